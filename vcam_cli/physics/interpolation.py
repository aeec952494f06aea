"""Interpolation by polynomials through few neighboring values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array

Floats = NDArray[np.float64]


def lagrange(nodes: Floats, at: float | Floats) -> Floats:
    """Return the weights of values at nodes in the polynomial through them.

    Parameters
    ----------
    nodes : Floats
        Nodes (n,), all different, in any unit.
    at : float or Floats
        Places of any shape, in the same unit.

    Returns
    -------
    Floats
        Weights (*shape, n), whose sum is 1.
    """
    others = np.subtract.outer(at, nodes)[..., None]  # (..., j, 1) beside nodes (i)
    apart = np.subtract.outer(nodes, nodes).T
    own = np.eye(len(nodes), dtype=bool)
    weights: Floats = np.where(own, 1.0, others / np.where(own, 1.0, apart)).prod(axis=-2)
    return weights


def between_entries(table: Array, position: Floats, points: int, axis: int) -> Array:
    """Return a table between its entries, by polynomials through the nearest of them.

    Parameters
    ----------
    table : Array
        Values at 0, 1, 2 ... along an axis, at least as many as `points`.
    position : Floats
        Places (p,) along it, from 0 to the last entry.
    points : int
        Entries that a polynomial goes through, even.
    axis : int
        The axis.

    Returns
    -------
    Array
        The table, that axis of length p.
    """
    first = np.clip(position.astype(int) - points // 2 + 1, 0, table.shape[axis] - points)
    weights = lagrange(np.arange(points, dtype=float), position - first).T
    shape = [1] * table.ndim
    shape[axis] = -1
    return np.asarray(
        sum(
            weight.reshape(shape) * np.take(table, first + number, axis)
            for number, weight in enumerate(weights)
        )
    )
