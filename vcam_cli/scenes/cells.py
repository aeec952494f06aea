"""Cells along one axis: their edges, and what of them lies within an interval."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def cell_edges(count: int, pitch: float) -> Array:
    """Return the count + 1 edges of cells centered on 0 [m]."""
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
    """Return the edges inside [-half, half], and these two."""
    inside = edges[(edges > -half) & (edges < half)]
    return np.concatenate([[-half], np.unique(inside), [half]])


def overlap(edges: Array, low: float, high: float) -> Array:
    """Return the part of every cell between `edges` that lies within [low, high]: (n,)."""
    inside = np.minimum(edges[1:], high) - np.maximum(edges[:-1], low)
    return np.maximum(inside, 0.0) / np.diff(edges)
