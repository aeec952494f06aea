"""Random streams that no other part of the camera can move.

Every draw of the simulator comes from a counter-based generator (Philox 4x64, Salmon et al.,
"Parallel random numbers: as easy as 1, 2, 3", SC11, doi:10.1145/2063384.2063405) whose key says
what is drawn: which seed, which effect, which capture. The counter says where: the block of
64 rows of the array. So one effect switched off changes no other effect's numbers, and blocks
may be computed in any order by any number of workers.

Why blocks and not rows: opening a stream costs 4 us and the seed of a draw 1 us, as much as 1000
normals.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.random.bit_generator import ISeedSequence

from vcam_cli.arrays import Array

BLOCK_ROWS = 64
"""Rows of the array that share one stream, and that flow together through the engine."""


def stream(seed: int, effect: str, capture: int = 0, block: int = 0) -> np.random.Generator:
    """Return the random generator of one effect in one block of rows.

    Equal arguments give equal numbers, on every machine that runs the same NumPy.

    Parameters
    ----------
    seed : int
        The sensor seed (what stays with the sensor) or the frame seed (what is new in each frame),
        not negative.
    effect : str
        Name of the effect.
    capture : int
        Index of the sample within one integration.
    block : int
        Index of the block of `BLOCK_ROWS` rows.
    """
    digest = hashlib.blake2b(f"vcam {seed} {effect} {capture}".encode(), digest_size=16).digest()
    key: Any = _Key(digest)  # NumPy documents it and does not type it
    return np.random.Generator(np.random.Philox(key, counter=[0, 0, 0, block]))


class _Key(ISeedSequence):
    """A key of Philox.

    Where it is handed in as `key`, NumPy asks the system for a seed that it does not use, which
    takes twice as long as the rest.
    """

    def __init__(self, digest: bytes) -> None:
        self._words = np.frombuffer(digest, "<u8").astype(np.uint64)

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> Array:
        """Return the key."""
        return self._words


def coarse_normals(generator: np.random.Generator, rows: int, columns: int, dtype: type) -> Array:
    """Return standard normal numbers of 16 random bits each, in a fifth of the time.

    Each is one of 65536 equally probable values, of at most 4.3 standard deviations. Their mean is
    0 and their variance 1. Rows that are drawn one after the other are those drawn together.

    Parameters
    ----------
    generator : np.random.Generator
        Stream of random bits.
    rows, columns : int
        How many there are.
    dtype : type
        Floating-point type.

    Returns
    -------
    Array
        Normal numbers (rows, columns).
    """
    words = -(-columns // 4)
    raw = generator.bit_generator.random_raw(rows * words).astype("<u8", copy=False)
    bits = raw.view("<u2").reshape(rows, 4 * words)[:, :columns]
    return _normal_quantiles(dtype).take(bits)


@lru_cache(maxsize=2)
def _normal_quantiles(dtype: type) -> Array:
    """Return the standard normal numbers in the middle of 65536 equal parts, with variance 1."""
    from scipy.special import ndtri

    count = 1 << 16
    middle = ndtri((np.arange(count) + 0.5) / count)
    quantiles: Array = (middle / np.sqrt(np.mean(np.square(middle)))).astype(dtype)
    quantiles.setflags(write=False)
    return quantiles


def blocks(rows: int) -> list[slice]:
    """Return consecutive slices of at most `BLOCK_ROWS` rows that cover `rows` rows."""
    return [slice(r, min(r + BLOCK_ROWS, rows)) for r in range(0, rows, BLOCK_ROWS)]
