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
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.random.bit_generator import ISeedSequence

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache

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


class BlockStreams:
    """The streams of consecutive blocks as one: every block's rows are drawn from its own.

    Its methods are those of a generator; their numbers are those of the blocks one by one, of
    whose streams each goes on where it stopped. One generator takes their states by turns: that is
    ten times as fast as opening one for each, which is most of the time of short rows.

    Parameters
    ----------
    seed, effect, capture, block
        As those of `stream`, of the first block.
    rows : int
        Rows of all blocks; the last block may have fewer than the others.
    """

    def __init__(self, seed: int, effect: str, capture: int, block: int, rows: int) -> None:
        self._rows = blocks(rows)
        self._generator = stream(seed, effect, capture, block)
        self._first = block
        self._states: list[Any] = [None] * len(self._rows)
        self._start: Any = self._generator.bit_generator.state

    def standard_normal(self, size: tuple[int, int], dtype: type) -> Array:
        """Return standard normal numbers (rows, columns)."""
        draw = self._generator.standard_normal
        return self._fill(np.empty(size, dtype), lambda part: draw(out=part, dtype=dtype))

    def random(self, size: tuple[int, int]) -> Array:
        """Return numbers from 0 to 1 (rows, columns)."""
        return self._fill(np.empty(size), lambda part: self._generator.random(out=part))

    def standard_exponential(self, size: tuple[int, int]) -> Array:
        """Return standard exponential numbers (rows, columns)."""
        draw = self._generator.standard_exponential
        return self._fill(np.empty(size), lambda part: draw(out=part))

    def random_raw(self, rows: int, words: int) -> Array:
        """Return words of 64 random bits, a number of them a row (rows, words)."""
        draw = self._generator.bit_generator.random_raw

        def fill(part: Array) -> None:
            part[:] = draw(part.size).reshape(part.shape)

        return self._fill(np.empty((rows, words), np.uint64), fill)

    def _fill(self, out: Array, draw: Callable[[Array], object]) -> Array:
        """Return the array with every block's rows drawn."""
        bits = self._generator.bit_generator
        for number, rows in enumerate(self._rows):
            if self._states[number] is None:
                self._start["state"]["counter"][-1] = self._first + number
                bits.state = self._start
            else:
                bits.state = self._states[number]
            draw(out[rows])
            self._states[number] = bits.state
        return out


class KeptNormals:
    """A stream whose normal numbers are kept: those of a sensor are the same in all of its frames.

    To copy them takes a twentieth of drawing them, which is a sixth of a frame of 512 x 512 pixels
    of a data set.

    Parameters
    ----------
    seed, effect, capture, block, rows
        As those of `streams`.
    """

    def __init__(self, seed: int, effect: str, capture: int, block: int, rows: int) -> None:
        self._key = seed, effect, capture, block, rows
        self._next_row = 0

    def standard_normal(self, size: tuple[int, int], dtype: type) -> Array:
        """Return standard normal numbers (rows, columns)."""
        rows, columns = size
        whole = (self._key[-1], columns)
        drawn = _NORMALS.get(
            (self._key, columns, dtype),
            lambda: streams(*self._key).standard_normal(whole, dtype=dtype),
        )
        start = self._next_row
        self._next_row += rows
        assert self._next_row <= self._key[-1], "each number of a sensor is drawn once"
        return drawn[start : self._next_row].copy()

    def random(self, size: tuple[int, int]) -> Array:
        """Return numbers from 0 to 1 (rows, columns)."""
        return self._drawn.random(size)

    def standard_exponential(self, size: tuple[int, int]) -> Array:
        """Return standard exponential numbers (rows, columns)."""
        return self._drawn.standard_exponential(size)

    @cached_property
    def _drawn(self) -> np.random.Generator | BlockStreams:
        """The stream of what is not kept."""
        return streams(*self._key)


_NORMALS: ByteCache[Array] = ByteCache(1 << 22, strict=True)
"""Of up to four arrays of 512 x 512 pixels, in 32 bits."""
KEPT_PIXELS = 1 << 18
"""Pixels of an array, at most, whose normal numbers are kept: they take less memory than one."""
Stream = np.random.Generator | BlockStreams | KeptNormals
"""Where a draw takes its random numbers from."""


def streams(
    seed: int, effect: str, capture: int = 0, block: int = 0, rows: int = 0
) -> np.random.Generator | BlockStreams:
    """Return the stream of some rows from a block on: of several blocks, those of each.

    Parameters
    ----------
    seed, effect, capture, block
        As those of `stream`, of the first block.
    rows : int
        Number of rows.
    """
    if rows <= BLOCK_ROWS:
        return stream(seed, effect, capture, block)
    return BlockStreams(seed, effect, capture, block, rows)


def coarse_normals(generator: Stream, rows: int, columns: int, dtype: type) -> Array:
    """Return standard normal numbers of 16 random bits each, in a fifth of the time.

    Each is one of 65536 equally probable values, of at most 4.3 standard deviations. Their mean is
    0 and their variance 1. Rows that are drawn one after the other are those drawn together.

    Parameters
    ----------
    generator : Generator or BlockStreams
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
    assert not isinstance(generator, KeptNormals)  # these draw normal numbers of full precision
    if isinstance(generator, BlockStreams):
        raw = generator.random_raw(rows, words)
    else:
        raw = generator.bit_generator.random_raw(rows * words)
    raw = raw.astype("<u8", copy=False)
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


def runs_of_blocks(rows: int, count: int) -> list[slice]:
    """Return slices of at most `count` rows that cover `rows` rows, of whole blocks, at least one.

    Parameters
    ----------
    rows : int
        Rows of the array.
    count : int
        Rows that are processed together, about.
    """
    step = max(1, count // BLOCK_ROWS) * BLOCK_ROWS
    return [slice(r, min(r + step, rows)) for r in range(0, rows, step)]
