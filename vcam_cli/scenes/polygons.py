"""Polygons averaged over the cells of a grid, exactly, and at points.

Every side adds to the cells right of it the area between them and itself, signed by its direction;
the sums from left to right are the covers: Green's theorem, with the sums of font rasterizers [1].
A side is cut where it crosses the edges of rows, then of columns, so the work is the number of
cells that sides cross, whatever the area.

References
----------
.. [1] R. Levien, "font-rs", 2016; and FreeType's rasterizer.
"""

from collections.abc import Iterable

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.runs import expand_ranges


@dataclass(frozen=True)
class Sides:
    """Sides from (x0, y0) to (x1, y1) of closed polygons; x to the right, y down.

    Polygons run counterclockwise as seen, their holes clockwise, and do not overlap.
    """

    x0: Array
    """Starts to the right (n,)."""
    y0: Array
    """Starts down (n,)."""
    x1: Array
    """Ends to the right (n,)."""
    y1: Array
    """Ends down (n,)."""

    def scale_and_move(self, scale: float, x: float, y: float) -> "Sides":
        """Return the sides `scale` times as large, then moved by x and y.

        Parameters
        ----------
        scale : float
            Factor on all coordinates.
        x, y : float
            What is added to them afterwards.

        Returns
        -------
        Sides
            The sides.
        """
        return Sides(
            self.x0 * scale + x, self.y0 * scale + y, self.x1 * scale + x, self.y1 * scale + y
        )


def sides(outlines: Iterable[Array]) -> Sides:
    """Return the sides of closed polygons.

    Parameters
    ----------
    outlines : iterable of Array
        Corners (n, 2) of each, in order.

    Returns
    -------
    Sides
        All sides.
    """
    starts = [np.asarray(outline, float) for outline in outlines]
    stops = [np.roll(start, -1, axis=0) for start in starts]
    return Sides(*np.concatenate(starts).T, *np.concatenate(stops).T)


def join_sides(parts: Iterable[Sides]) -> Sides:
    """Return all the sides of several polygons.

    Parameters
    ----------
    parts : iterable of Sides
        Sides of each polygon.

    Returns
    -------
    Sides
        All sides.
    """
    rows = [np.stack([p.x0, p.y0, p.x1, p.y1]) for p in parts]
    return Sides(*np.concatenate(rows, axis=1))


def cover(polygons: Sides, x_edges: Array, y_edges: Array) -> Array:
    """Return the part of every cell that polygons cover.

    Parameters
    ----------
    polygons : Sides
        Sides of the polygons [m].
    x_edges, y_edges : Array
        Rising edges of the cells [m].

    Returns
    -------
    Array
        Parts (len(y_edges) - 1, len(x_edges) - 1), from 0 to 1.
    """
    row, xa, xb, ya, yb = _cut_at_rows(_sides_that_count(polygons, x_edges, y_edges), y_edges)
    rise = (yb - ya) / np.diff(y_edges)[row]
    low, high = np.minimum(xa, xb), np.maximum(xa, xb)
    # one column more on either side, for what lies beyond the grid
    step = x_edges[-1] - x_edges[0]
    left = min(x_edges[0], float(low.min(initial=x_edges[0]))) - step
    right = max(x_edges[-1], float(high.max(initial=x_edges[-1]))) + step
    columns = np.concatenate([[left], x_edges, [right]])
    first = columns.searchsorted(low, side="right") - 1
    piece, column = expand_ranges(first, np.maximum(columns.searchsorted(high), first + 1))
    start = np.maximum(low[piece], columns[column])
    stop = np.minimum(high[piece], columns[column + 1])
    length = (high - low)[piece]
    upright = length <= 0
    part = np.where(upright, 1.0, (stop - start) / np.where(upright, 1.0, length))
    beside = (columns[column + 1] - (start + stop) / 2) / np.diff(columns)[column]
    full = rise[piece] * part
    shape = (len(y_edges) - 1, len(columns))
    cell = row[piece] * shape[1] + column
    total = np.bincount(cell, full * beside, minlength=shape[0] * shape[1])
    total += np.bincount(cell + 1, full * (1 - beside), minlength=len(total))
    return np.cumsum(total.reshape(shape), axis=1)[:, 1:-2]


def contains_points(polygons: Sides, x: Array, y: Array) -> Array:
    """Return where points lie in a polygon.

    Parameters
    ----------
    polygons : Sides
        Sides of the polygons [m].
    x, y : Array
        Rising places along the rows and columns [m].

    Returns
    -------
    Array
        1 or 0, (len(y), len(x)).
    """
    polygons = _sides_that_count(polygons, x, y)
    low, high = np.minimum(polygons.y0, polygons.y1), np.maximum(polygons.y0, polygons.y1)
    side, row = expand_ranges(y.searchsorted(low), y.searchsorted(high))
    x0, y0, x1, y1 = (each[side] for each in _fields(polygons))
    crossing = x0 + (x1 - x0) * ((y[row] - y0) / (y1 - y0))
    cell = row * (len(x) + 1) + x.searchsorted(crossing)
    turns = np.bincount(cell, np.sign(y1 - y0), minlength=len(y) * (len(x) + 1))
    return np.cumsum(turns.reshape(len(y), len(x) + 1), axis=1)[:, :-1]


def _sides_that_count(polygons: Sides, x: Array, y: Array) -> Sides:
    """Return the sides that count between the first and the last place along x and y.

    Those that lie left of them do.
    """
    x0, y0, x1, y1 = _fields(polygons)
    here = np.maximum(y0, y1) > y[0]
    here &= np.minimum(y0, y1) <= y[-1]
    here &= np.minimum(x0, x1) <= x[-1]
    return Sides(*(each[here] for each in _fields(polygons)))


def _fields(polygons: Sides) -> tuple[Array, Array, Array, Array]:
    return polygons.x0, polygons.y0, polygons.x1, polygons.y1


def _cut_at_rows(polygons: Sides, y_edges: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return the sides cut at the edges of rows: row, then x at both ends and y at both ends."""
    x0, y0, x1, y1 = _fields(polygons)
    low, high = np.minimum(y0, y1), np.maximum(y0, y1)
    last = len(y_edges) - 1
    first = np.clip(y_edges.searchsorted(low, side="right") - 1, 0, last)
    stop = np.clip(y_edges.searchsorted(high), 0, last)
    side, row = expand_ranges(first, np.where(high > low, stop, 0))
    x0, y0, x1, y1 = x0[side], y0[side], x1[side], y1[side]
    top, bottom = y_edges[row], y_edges[row + 1]
    ya, yb = np.clip(y0, top, bottom), np.clip(y1, top, bottom)
    slope = (x1 - x0) / (y1 - y0)
    bounds = np.minimum(x0, x1), np.maximum(x0, x1)
    xa, xb = (np.clip(x0 + (y - y0) * slope, *bounds) for y in (ya, yb))
    return row, xa, xb, ya, yb
