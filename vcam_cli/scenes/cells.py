"""Cells along one axis: their edges, and what of them lies within an interval."""

import numpy as np

from vcam_cli.arrays import Array

Spans = tuple[Array, Array]
"""Where intervals begin, and where they end."""


def cell_edges(count: int, pitch: float) -> Array:
    """Return the edges of cells centered on 0.

    Parameters
    ----------
    count : int
        Number of cells.
    pitch : float
        Their pitch [m].

    Returns
    -------
    Array
        Rising edges (count + 1,) [m].
    """
    return (np.arange(count + 1) - count / 2) * pitch


def clip_cells(edges: Array, half: float) -> tuple[slice, Array, Array]:
    """Return the cells that reach into [-half, half].

    Parameters
    ----------
    edges : Array
        Edges (n + 1,) of the cells, rising [m].
    half : float
        Half the width of the interval [m].

    Returns
    -------
    cells : slice
        The cells that reach into it.
    cover : Array
        Part of each that lies inside.
    inside : Array
        Their edges, cut to the interval [m].
    """
    sliver = 1e-9 * (edges[-1] - edges[0]) / (len(edges) - 1)  # a rounding error, not a cell
    first = int(np.searchsorted(edges[1:], sliver - half))
    last = int(np.searchsorted(edges[:-1], half - sliver))
    if last <= first:
        return slice(0, 0), np.empty(0), np.empty(0)
    inside = np.clip(edges[first : last + 1], -half, half)
    return slice(first, last), np.diff(inside) / np.diff(edges[first : last + 1]), inside


def edges_within(edges: Array, half: float) -> Array:
    """Return the edges inside [-half, half], and these two.

    Parameters
    ----------
    edges : Array
        Rising edges [m].
    half : float
        Half the width of the interval [m].

    Returns
    -------
    Array
        Rising edges from -half to half [m].
    """
    inside = edges[(edges > -half) & (edges < half)]
    return np.concatenate([[-half], np.unique(inside), [half]])


def overlap(edges: Array, low: float, high: float) -> Array:
    """Return the part of every cell that lies within an interval.

    Parameters
    ----------
    edges : Array
        Rising edges (n + 1,) of the cells [m].
    low, high : float
        Ends of the interval [m].

    Returns
    -------
    Array
        Parts (n,), from 0 to 1.
    """
    inside = np.minimum(edges[1:], high) - np.maximum(edges[:-1], low)
    shares: Array = np.maximum(inside, 0.0) / np.diff(edges)
    return shares


def cell_means(planes: Array, count: int) -> Array:
    """Return the means over square blocks of cells.

    Parameters
    ----------
    planes : Array
        Planes (..., rows, columns), whose sides are whole multiples of `count`.
    count : int
        Cells along either side of a block.

    Returns
    -------
    Array
        Means (..., rows / count, columns / count).
    """
    if count == 1:
        return planes
    rows = planes[..., ::count, :].copy()
    for k in range(1, count):
        rows += planes[..., k::count, :]
    sums = rows[..., ::count].copy()
    for k in range(1, count):
        sums += rows[..., k::count]
    sums /= count**2
    return sums


def means_of_parts(planes: Array, parts: tuple[Array, Array], cells: tuple[Array, Array]) -> Array:
    """Return the means over cells of planes on parts of them.

    Parameters
    ----------
    planes : Array
        Means (..., rows, columns) over the parts.
    parts : tuple of Array
        Edges of the parts along y and along x, rising, those of the cells among them [m].
    cells : tuple of Array
        Edges of the cells along y and along x [m].

    Returns
    -------
    Array
        Means (..., rows, columns) over the cells.
    """
    for axis, of_parts, of_cells in zip((-2, -1), parts, cells, strict=True):
        if len(of_parts) == len(of_cells):  # no cell is divided
            continue
        shape = (-1, 1) if axis == -2 else (-1,)
        first = np.searchsorted(of_parts, of_cells[:-1])
        weighed = planes * np.diff(of_parts).astype(planes.dtype).reshape(shape)
        sums = np.add.reduceat(weighed, first, axis=axis)
        planes = sums / np.diff(of_cells).astype(planes.dtype).reshape(shape)
    return planes


def window_extremes(pick: np.ufunc, plane: Array, size: tuple[int, int]) -> Array:
    """Return the extreme of each window of a size that lies in a plane.

    Two windows make one up to twice as wide: a few passes, in a fifth of the time of SciPy's
    filters, and without their tenth of a second to import.

    Parameters
    ----------
    pick : ufunc
        The maximum or the minimum of two.
    plane : Array
        Values (m, n).
    size : tuple of int
        Rows and columns (k, l) of the windows.

    Returns
    -------
    Array
        Extremes (m - k + 1, n - l + 1).
    """
    for axis, width in enumerate(size):
        known = 1
        while known < width:
            step, length = min(known, width - known), plane.shape[axis]
            before = (slice(None),) * axis
            plane = pick(
                plane[(*before, slice(length - step))], plane[(*before, slice(step, None))]
            )
            known += step
    return plane


def extremes_within(values: Array, y: Spans, x: Spans) -> tuple[Array, Array]:
    """Return the least and the largest of the values in rectangles of rows and columns.

    Parameters
    ----------
    values : Array
        Values (..., h, w).
    y, x : Spans
        First and last row (m,), and first and last column (n,), of each rectangle.

    Returns
    -------
    low, high : Array
        Values (..., m, n).
    """
    found = []
    for pick in (np.minimum, np.maximum):
        columns = _extremes_along(pick, values, *x)
        lines = _extremes_along(pick, columns.swapaxes(-1, -2), *y)
        found.append(lines.swapaxes(-1, -2))
    return found[0], found[1]


def _extremes_along(pick: np.ufunc, values: Array, first: Array, last: Array) -> Array:
    """Return the extremes (..., m) of values (..., n) from the first of some places to the last.

    Two runs of a power of 2 make each.
    """
    out = np.empty((*values.shape[:-1], len(first)), values.dtype)
    powers, length = np.frexp(last - first + 1)[1] - 1, 1
    for power in range(int(powers.max(initial=0)) + 1):
        some = np.flatnonzero(powers == power)
        at_ends = (values.take(at[some], axis=-1) for at in (first, last + 1 - length))
        out[..., some] = pick(*at_ends)
        values = pick(values[..., :-length], values[..., length:])
        length *= 2
    return out
