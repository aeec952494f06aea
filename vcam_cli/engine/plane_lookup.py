"""Transfer tables over fx and fy, read at blocks of frequencies: linear along both axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.parallel import at_once, pieces, product


@dataclass(frozen=True)
class Where:
    """Frequencies along y, in a table."""

    rows: slice
    """Of the table, those around them."""
    shares: NDArray
    """(n, rows) how much each of them counts."""
    within: NDArray
    """(n,) the highest frequency along x that is not beyond the tables [cycles/m]"""


class PlaneLookup:
    """Tables of one parity; 0 where |f| is beyond them, which their corners are not.

    Read along x for all `fx` at once, which are the same in all blocks; of few rows when they are
    asked for, since all of it takes as much memory as many rows of the picture.
    """

    def __init__(self, planes: NDArray, top: float, fx: NDArray, dtype: np.dtype, few: bool):
        """planes: (R, C, m, m) over fy and fx from 0 to `top` [cycles/m]; few: whether few rows
        are asked for."""
        self.fx, self.top, self.dtype = fx, top, dtype
        self.last = planes.shape[-1] - 1
        self.scale = self.last / top
        self.along = np.minimum(fx * self.scale, self.last)
        self.few = few
        self.planes = (
            planes if few else [[_along_x(t, self.along, dtype) for t in c] for c in planes]
        )

    def where(self, fy: NDArray) -> Where:
        """Where the tables are read for rows (n,) of frequencies along y [cycles/m]."""
        at = np.minimum(fy * self.scale, self.last)
        first, stop = int(at.min()), int(np.ceil(at.max())) + 1
        shares = np.maximum(1 - np.abs(at[:, None] - np.arange(first, stop)), 0)
        left = (self.top * (1 + 1e-9)) ** 2 - fy**2
        within = np.where(left < 0, -1.0, np.sqrt(np.maximum(left, 0)))
        return Where(slice(first, stop), shares, within)

    def read(self, r: int, c: int, where: Where, count: int) -> NDArray:
        """The table of a component and color in those rows: (n, count)."""
        table = self.planes[r][c][where.rows]
        table = table if self.few else table[:, :count]
        found = product(where.shares.astype(table.dtype), table)
        if self.few:
            found = _along_x(found, self.along[:count], self.dtype)
        inside = int(np.searchsorted(self.fx[:count], where.within.min(), side="right"))
        if inside < count:
            found[:, inside:] *= self.fx[inside:count] <= where.within[:, None]
        return found


def _along_x(table: NDArray, position: NDArray, dtype: np.dtype) -> NDArray:
    """A table read between its columns; few rows at a time, since it is large in 64 bits."""
    out = np.empty((len(table), len(position)), dtype)
    for rows in pieces(len(table), at_once(len(position))):
        out[rows] = between(table[rows], position, 1)
    return out


def between(table: NDArray, position: NDArray, axis: int) -> NDArray:
    """A table read between its entries along an axis; constant beyond its end."""
    position = np.minimum(position, table.shape[axis] - 1)
    index = np.minimum(position.astype(int), table.shape[axis] - 2)
    fraction = (position - index).astype(table.dtype).reshape((-1, 1) if axis == 0 else (1, -1))
    low, high = np.take(table, index, axis), np.take(table, index + 1, axis)
    high -= low
    high *= fraction
    high += low
    return high
