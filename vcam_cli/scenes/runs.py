"""Runs of cells laid over each other: which of them is seen in each cell.

Every run is taken as two that are a power of two long and may overlap. Each is marked at its
first cell; then, from the longest to the shortest, marks are handed down to runs of half the
length. So a picture takes a few passes over its cells, and no loop over its runs.
"""

import numpy as np

from vcam_cli.arrays import Array

CELLS_AT_ONCE = 1 << 17
"""Cells of a pass, which are to stay in the processor's cache."""
LEVELS = 32
"""Powers of two that the length of a run may have."""


def topmost_numbers(start: Array, stop: Array, number: Array, size: int, line: int) -> Array:
    """Return for every cell the largest number of the runs that hold it, 0 where none does.

    Parameters
    ----------
    start, stop : Array
        First cell of each run (n,), and that behind its last. No run is empty or leaves its line,
        the cells [k line, (k + 1) line).
    number : Array
        Positive number of each run (n,).
    size : int
        Number of cells.
    line : int
        Cells of a line.

    Returns
    -------
    Array
        Numbers (size,), int32.
    """
    label = np.zeros(size, np.int32)
    piece = line * max(1, CELLS_AT_ONCE // line)
    level = np.frexp((stop - start).astype(np.float32))[1] - 1  # 2^level <= length
    group = (start // piece * LEVELS + level).astype(np.uint16)
    order = np.argsort(group, kind="stable")
    start, stop, number = start[order], stop[order], number[order]
    bounds = np.searchsorted(group[order], np.arange(LEVELS * -(-size // piece) + 1))
    for index, first in enumerate(range(0, size, piece)):
        here = bounds[LEVELS * index : LEVELS * (index + 1) + 1]
        _propagate_marks(label[first : first + piece], start - first, stop - first, number, here)
    return label


def _propagate_marks(label: Array, start: Array, stop: Array, number: Array, bounds: Array) -> None:
    """Write the numbers of one piece; its runs of level k are [bounds[k], bounds[k + 1])."""
    levels = np.flatnonzero(np.diff(bounds))
    above, here = np.zeros_like(label), np.empty_like(label)
    for level in range(int(levels.max(initial=-1)), -1, -1):
        length = 1 << level
        here[:length] = above[:length]
        np.maximum(above[length:], above[:-length], out=here[length:])
        some = slice(bounds[level], bounds[level + 1])
        np.maximum.at(here, start[some], number[some])
        np.maximum.at(here, stop[some] - length, number[some])
        above, here = here, above
    label[:] = above


def expand_ranges(first: Array, last: Array) -> tuple[Array, Array]:
    """Return every (item, number) with first[item] <= number < last[item], item by item.

    Parameters
    ----------
    first, last : Array
        Ends (n,) of each item's range; it is empty where last <= first.

    Returns
    -------
    item, number : Array
        The pairs, one each (M,).
    """
    count = np.maximum(last - first, 0)
    item = np.repeat(np.arange(len(count), dtype=np.int32), count)
    return item, concatenate_ranges(first, count)


def concatenate_ranges(first: Array, count: Array) -> Array:
    """Return first[0], first[0]+1, ... (count[0] numbers), first[1], ... concatenated.

    Parameters
    ----------
    first : Array
        First number of each range (n,).
    count : Array
        How many numbers it has (n,).

    Returns
    -------
    Array
        The numbers (sum of `count`,).
    """
    before = np.cumsum(count) - count
    indices: Array = np.arange(int(count.sum())) + np.repeat(first - before, count)
    return indices
