"""Random numbers with a fixed number of words a pixel: the same for any batch, block and thread.

A word of 32 bits belongs to a seed, a stream (an effect), a sample and a pixel: it is the output of
Philox 4x32 with ten rounds [1], whose key is the seed, and whose counter is (pixel // 4, sample,
hash of the stream); four pixels share one output. A normal number is the inverse of the
distribution function at the middle of the word's part of 0 to 1: of at most 6.3 standard
deviations, right to 7e-7 of itself. A Poisson number is made of one word as `physics.noise` makes
it of a normal number: exact below a mean of 8, the Cornish-Fisher expansion from there on.

This module computes them with NumPy. `kernels.cu` has the same formulas for a graphics processor;
tests hold both to each other.

References
----------
.. [1] J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, "Parallel random numbers: as easy as 1,
   2, 3", SC11, 2011, doi:10.1145/2063384.2063405.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np

from vcam_cli.arrays import Array

WORDS = 4
"""Words of one output of the generator."""
_M0, _M1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_W0, _W1 = np.uint32(0x9E3779B9), np.uint32(0xBB67AE85)
ROUNDS = 10
CENTER, TAIL = 2.5, 3.5
"""Centers of the two polynomials, in w and in sqrt(w)."""
TURN = 5.0
"""w = -ln(4 p (1 - p)) from which the tail's polynomial holds: p < 0.00168."""
CENTRAL = (
    2.1233136653900146,
    0.34880268573760986,
    -0.00590812973678112,
    -0.001773041789419949,
    0.00030911510111764073,
    -6.207880232977914e-06,
    -4.981194706488168e-06,
    4.851791004512052e-07,
    3.9583209598959e-08,
)
OUTER = (
    4.717088222503662,
    1.4246275424957275,
    0.004660701844841242,
    -0.0028612962923943996,
    0.0014297561720013618,
    -0.001076356042176485,
    0.0007895552553236485,
    -0.00024882846628315747,
)
"""Coefficients of z / (1 - 2 p), z the normal number of the tail probability p: weighted least
squares over w in 0 to 5 and over sqrt(w) up to 4.72, which 32 bits reach."""
EXPANDED_MEAN = 8.0
"""Mean from which the expansion is used, as `physics.noise.CORNISH_FISHER_MEAN` [electrons]."""


@lru_cache(maxsize=256)
def stream_words(name: str) -> tuple[int, int]:
    """Return the two words of a counter that belong to a stream.

    Parameters
    ----------
    name : str
        Name of the stream.

    Returns
    -------
    tuple of int
        Words of 32 bits.
    """
    digest = hashlib.blake2b(f"vcam {name}".encode(), digest_size=8).digest()
    return int.from_bytes(digest[:4], "little"), int.from_bytes(digest[4:], "little")


def seed_key(seed: int) -> int:
    """Return the key of a seed: the seed itself, of one beyond 64 bits its hash.

    Parameters
    ----------
    seed : int
        Seed, not negative.

    Returns
    -------
    int
        Key of 64 bits.
    """
    if seed < 1 << 64:
        return seed
    digest = hashlib.blake2b(f"vcam {seed}".encode(), digest_size=8).digest()
    return int.from_bytes(digest, "little")


def words(keys: Array, name: str, sample: int, count: int) -> Array:
    """Return one random word for every pixel of every frame.

    Parameters
    ----------
    keys : Array
        Keys (B,) of the frames' seeds, uint64.
    name : str
        Name of the stream.
    sample : int
        Index of the sample of an exposure.
    count : int
        Number of pixels of a frame.

    Returns
    -------
    Array
        Words (B, count), uint32.
    """
    groups = -(-count // WORDS)
    shape = len(keys), groups
    low, high = stream_words(name)
    counter = [
        np.broadcast_to(np.arange(groups, dtype=np.uint32), shape),
        np.full(shape, sample, np.uint32),
        np.full(shape, low, np.uint32),
        np.full(shape, high, np.uint32),
    ]
    halves = keys.astype(np.uint32)[:, None], (keys >> np.uint64(32)).astype(np.uint32)[:, None]
    found = philox(counter, [np.broadcast_to(half, shape) for half in halves])
    return np.stack(found, axis=-1).reshape(len(keys), -1)[:, :count]


def philox(counter: list[Array], key: list[Array]) -> list[Array]:
    """Return the output of Philox 4x32 with ten rounds.

    Parameters
    ----------
    counter : list of Array
        Four words of the counters, uint32.
    key : list of Array
        Two words of the keys, in their shape.

    Returns
    -------
    list of Array
        Four words in the same shape.
    """
    half, (first, second) = np.uint64(32), key
    with np.errstate(over="ignore"):
        for _ in range(ROUNDS):
            a = _M0 * counter[0].astype(np.uint64)
            b = _M1 * counter[2].astype(np.uint64)
            counter = [
                (b >> half).astype(np.uint32) ^ counter[1] ^ first,
                b.astype(np.uint32),
                (a >> half).astype(np.uint32) ^ counter[3] ^ second,
                a.astype(np.uint32),
            ]
            first, second = first + _W0, second + _W1
    return counter


def normals(word: Array) -> Array:
    """Return the standard normal numbers of words.

    Parameters
    ----------
    word : Array
        Words of any shape, uint32.

    Returns
    -------
    Array
        Normal numbers in their shape, float32.
    """
    one = np.float32
    place = word & np.uint32(0x7FFFFFFF)
    p = (place.astype(one) + one(0.5)) * one(2.0**-32)
    x = ((np.uint32(0x7FFFFFFF) - place).astype(one) + one(0.5)) * one(2.0**-31)
    w = -np.log(one(4) * p * (one(1) - p))
    outside = np.sqrt(np.maximum(w, one(TURN))) - one(TAIL)
    z = np.where(w < one(TURN), _horner(CENTRAL, w - one(CENTER)), _horner(OUTER, outside)) * x
    signed: Array = np.where(word >> np.uint32(31), z, -z)
    return signed


def _horner(coefficients: tuple[float, ...], at: Array) -> Array:
    found = np.full(at.shape, coefficients[-1], np.float32)
    for coefficient in coefficients[-2::-1]:
        found = found * at + np.float32(coefficient)
    return found


def uniforms(word: Array) -> Array:
    """Return numbers between 0 and 1 of words, the upper tails of their normal numbers.

    Parameters
    ----------
    word : Array
        Words of any shape, uint32.

    Returns
    -------
    Array
        Numbers in their shape, float64, from 2^-33 to 1 - 2^-33.
    """
    place = (word & np.uint32(0x7FFFFFFF)).astype(np.float64)
    p = (place + 0.5) * 2.0**-32
    upper: Array = np.where(word >> np.uint32(31), p, 1 - p)
    return upper


def poisson(mean: Array, word: Array) -> Array:
    """Return Poisson numbers of words.

    Parameters
    ----------
    mean : Array
        Means of any shape [electrons]; below 0 they count as 0.
    word : Array
        Words in the shape of the means, uint32.

    Returns
    -------
    Array
        Whole numbers in the shape and float type of the means [electrons].
    """
    kind = mean.dtype.type
    z = normals(word).astype(kind)
    root = np.sqrt(np.maximum(mean, kind(EXPANDED_MEAN)))
    square = z * z
    out: Array = (square * kind(-1 / 72) - kind(1 / 36)) * z / root + square * kind(1 / 6)
    out = np.maximum(np.floor(out + root * z + mean + kind(1 / 3)), kind(0))
    low = mean < EXPANDED_MEAN
    if low.any():
        out[low] = _inverted(mean[low].astype(np.float64), uniforms(word[low]))
    return out


def _inverted(mean: Array, upper: Array) -> Array:
    """Return the smallest k with P(X > k | mean) <= upper, summing the distribution upwards."""
    mean = np.maximum(mean, 0.0)
    term = np.exp(-mean)
    tail, count, k = -np.expm1(-mean), np.zeros_like(mean), 0
    above = tail > upper
    while above.any():
        k += 1
        count += above
        term = term * (mean / k)
        tail = tail - term
        above &= tail > upper
    return count
