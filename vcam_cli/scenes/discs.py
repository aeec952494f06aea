"""Opaque discs laid over each other, averaged over the cells of a grid.

Where each cell is the plain color of one disc, which is nearly everywhere, it is found from the
runs of cells that each disc covers. Cells crossed by visible edges are left to `disc_edges`.

Why labels: the picture is painted once as disc numbers, and colored afterwards, so that any number
of planes costs one painting.
"""

import hashlib
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Protocol, TypeVar, cast

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.records import dataclass
from vcam_cli.scenes import disc_edges
from vcam_cli.scenes.disc_edges import CrossedCells, Discs
from vcam_cli.scenes.runs import concatenate_ranges, expand_ranges, topmost_numbers

Cells = tuple[slice, slice]
"""Rows and columns of cells."""


KEPT = 1 << 27
"""Bytes of coverage that are kept: cameras that differ in the lens alone see the same discs. Those
of eight layers before 1000 x 1000 pixels and of the rays between them take 83 MB."""


class Painted(Protocol):
    """What is kept."""

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""


_COVERAGE: ByteCache[Painted] = ByteCache(KEPT)


@dataclass(frozen=True)
class Coverage:
    """Which disc is seen where on a grid of cells: their picture but for its colors."""

    near: Array
    """Indices of the discs that labels count, from 1: 0 is the ground, the last is nothing."""
    label: Array
    """Label (ny, nx) that fills each cell."""
    row: Array
    """Rows of the cells that edges cross (m,)."""
    column: Array
    """Their columns (m,)."""
    shares: disc_edges.EdgeShares | None
    """Visible discs in those; None where there are none."""

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        own = self.near.nbytes + self.label.nbytes + self.row.nbytes + self.column.nbytes
        return own + (0 if self.shares is None else self.shares.nbytes)

    def paint(self, color: Array, out: Array) -> None:
        """Write the cell averages into `out` (R, ny, nx).

        Parameters
        ----------
        color : Array
            Colors (R, n + 1), see `paint`.
        out : Array
            Averages.
        """
        nothing = np.zeros((len(color), 1), color.dtype)
        color = np.concatenate([color[:, :1], color[:, self.near + 1], nothing], axis=1)
        index = self.label.astype(np.intp)
        for plane, line in zip(out, color, strict=True):
            np.take(line, index, out=plane, mode="clip")
        del index
        if self.shares is not None:
            at = self.row.astype(np.intp), self.column.astype(np.intp)
            for plane, light in zip(out, self.shares.colors(color), strict=True):
                plane[at] = light

    def together(self, count: int) -> "Coverage":
        """Return which disc is seen where on larger cells: the means of these.

        Parameters
        ----------
        count : int
            Cells of these along either side of a larger one; the grid is a multiple of it.

        Returns
        -------
        Coverage
            Discs on the larger cells.
        """
        if count == 1:
            return self
        rows, columns = (size // count for size in self.label.shape)
        first = self.label[::count, ::count]
        same = self.label == np.repeat(np.repeat(first, count, axis=0), count, axis=1)
        row, column = self.row.astype(np.intp), self.column.astype(np.intp)
        same[row, column] = False
        even = same.reshape(rows, count, columns, count).all(axis=(1, 3))
        number = np.cumsum(~even).reshape(rows, columns) - 1
        plain = ~np.repeat(np.repeat(even, count, axis=0), count, axis=1)
        plain[row, column] = False
        plain_row, plain_column = np.nonzero(plain)
        cell = [number[plain_row // count, plain_column // count]]
        label, weight = [self.label[plain_row, plain_column]], [np.ones(len(plain_row))]
        if self.shares is not None:
            crossed = number[row // count, column // count]
            for part, seen, share in self.shares.seen():
                cell.append(crossed[part])
                label.append(seen)
                weight.append(share)
        shares = disc_edges.several_shares(
            int((~even).sum()), np.concatenate(cell), np.concatenate(label), np.concatenate(weight)
        )
        row, column = (at.astype(self.row.dtype) for at in np.nonzero(~even))
        return Coverage(self.near, first, row, column, shares)


def paint(
    discs: Discs,
    color: Array,
    x_edges: Array,
    y_edges: Array,
    out: Array,
    hidden: Cells | None = None,
    divided: int = disc_edges.MOST,
    keep: bool = False,
) -> None:
    """Write the cell averages of discs on a ground into `out` (R, ny, nx).

    Parameters
    ----------
    discs : Discs
        Centers and radii, in the unit of the edges; a later disc hides an earlier.
    color : ndarray
        Colors (R, n + 1): column 0 is the ground's, column i + 1 that of disc i.
    x_edges, y_edges : ndarray
        Edges of the cells, rising.
    out : ndarray
        Averages (R, ny, nx).
    hidden : Cells, optional
        Hidden cells; they become 0.
    divided : int, optional
        How often cells are divided in which edges meet, see `disc_edges.divisions`.
    keep : bool, optional
        Whether the coverage is kept, at most `KEPT` bytes of it, for the same discs in other
        colors on the same cells.
    """
    make = partial(coverage, discs, x_edges, y_edges, hidden, divided)
    if keep:
        arrays = (discs.x, discs.y, discs.radius, x_edges, y_edges)
        make = partial(painted_once, arrays, (str(hidden), divided), make)
    make().paint(color, out)


P = TypeVar("P", bound=Painted)


def painted_once(arrays: Sequence[Array], more: Hashable, make: Callable[[], P]) -> P:
    """Return what was painted, of the same kind as before for the same arrays.

    Parameters
    ----------
    arrays : sequence of Array
        Numbers that it depends on.
    more : hashable
        What else it depends on, its kind among it.
    make : callable
        What paints it.

    Returns
    -------
    Painted
        What `make` returns, or has returned.
    """
    digest = hashlib.blake2b(digest_size=16)
    for part in arrays:
        digest.update(b"%d " % len(part) + np.ascontiguousarray(part, float).tobytes())
    return cast(P, _COVERAGE.get((digest.digest(), more), make))


def asked_bytes() -> int:
    """Return the memory of all coverage that was requested so far [bytes].

    What an image takes of it is the difference, up to `KEPT`, whatever was kept before.
    """
    return _COVERAGE.asked


def forget() -> None:
    """Keep no coverage of what was painted."""
    _COVERAGE.clear()


def coverage(
    discs: Discs, x_edges: Array, y_edges: Array, hidden: Cells | None, divided: int
) -> Coverage:
    """Return which disc is seen where; parameters as those of `paint`."""
    near = discs.find_near(x_edges[0], x_edges[-1], y_edges[0], y_edges[-1])
    discs = discs.select(near)
    spans = _spans(discs, x_edges, y_edges)
    label = _labels(spans, len(discs), (len(y_edges) - 1, len(x_edges) - 1), hidden)
    cell, front = _crossed_cells(spans, label)
    starts = np.flatnonzero(np.diff(cell, prepend=-1))
    row, column = np.divmod(cell[starts], label.shape[1])
    if not len(cell):
        return Coverage(near, label.astype(np.min_scalar_type(len(discs) + 1)), row, column, None)
    count = np.diff(starts, append=len(cell))
    del spans, cell  # memory for what follows
    box = np.stack([x_edges[column], x_edges[column + 1], y_edges[row], y_edges[row + 1]])
    crossed = CrossedCells(box, label[row, column], count, front)
    shares = disc_edges.edge_shares(discs, crossed, divided)
    labels = np.min_scalar_type(len(discs) + 1)
    row, column = (at.astype(np.min_scalar_type(max(label.shape))) for at in (row, column))
    return Coverage(near, label.astype(labels), row, column, shares)


def averages(discs: Discs, color: Array, x_edges: Array, y_edges: Array) -> Array:
    """Return what `paint` writes, in the dtype of `color`.

    Parameters
    ----------
    discs : Discs
        The discs; a later one lies in front.
    color : Array
        Color (R, n + 1) of the ground and of every disc.
    x_edges, y_edges : Array
        Rising edges of the cells, in the unit of the discs.

    Returns
    -------
    Array
        Averages (R, len(y_edges) - 1, len(x_edges) - 1).
    """
    out = np.empty((len(color), len(y_edges) - 1, len(x_edges) - 1), color.dtype)
    paint(discs, color, x_edges, y_edges, out)
    return out


def values(discs: Discs, color: Array, x: Array, y: Array) -> Array:
    """Return the colors at points.

    Parameters
    ----------
    discs : Discs
        The discs; a later one lies in front.
    color : Array
        Color (R, n + 1) of the ground and of every disc.
    x, y : Array
        Rising places along the rows and columns, in the unit of the discs.

    Returns
    -------
    Array
        Values (R, len(y), len(x)).
    """
    near = discs.find_near(x[0], x[-1], y[0], y[-1])
    discs = discs.select(near)
    color = np.concatenate([color[:, :1], color[:, near + 1]], axis=1)
    disc, row = expand_ranges(
        y.searchsorted(discs.y - discs.radius), y.searchsorted(discs.y + discs.radius)
    )
    half = _half_chord(discs.radius[disc], y[row] - discs.y[disc])
    column = _Columns(x)
    start = column.index_of(discs.x[disc] - half) + 1
    stop = np.minimum(column.index_of(discs.x[disc] + half) + 1, len(x))
    some = np.flatnonzero(stop > start)
    row = row[some] * len(x)
    label = topmost_numbers(
        row + start[some], row + stop[some], disc[some] + 1, len(x) * len(y), len(x)
    )
    index = label.astype(np.intp)
    return np.stack([np.take(plane, index) for plane in color]).reshape(-1, len(y), len(x))


def separate_cover(discs: Discs, x_edges: Array, y_edges: Array) -> Array:
    """Return the exact part of every cell that discs cover.

    Parameters
    ----------
    discs : Discs
        Discs that do not overlap.
    x_edges, y_edges : Array
        Rising edges of the cells, in the unit of the discs.

    Returns
    -------
    Array
        Parts (len(y_edges) - 1, len(x_edges) - 1), from 0 to 1.
    """
    shape = len(y_edges) - 1, len(x_edges) - 1
    spans = _spans(discs, x_edges, y_edges)
    # whole cells: 1 at the first of a run, -1 behind its last, summed from the left
    line = spans.row * (shape[1] + 1)
    ends = np.bincount(line + spans.full_start, minlength=shape[0] * (shape[1] + 1))
    ends -= np.bincount(line + spans.full_stop, minlength=len(ends))
    cover = np.cumsum(ends.reshape(shape[0], -1), axis=1)[:, :-1].astype(float)
    for start, stop in (
        (spans.touch_start, spans.full_start),
        (spans.full_stop, spans.touch_stop),
    ):
        span, column = expand_ranges(start, stop)
        row, disc = spans.row[span], spans.disc[span]
        box = np.stack([x_edges[column], x_edges[column + 1], y_edges[row], y_edges[row + 1]])
        part = disc_edges.cover(discs, disc, box)
        cover += np.bincount(row * shape[1] + column, part, minlength=cover.size).reshape(shape)
    return cover


def visible_discs(
    discs: Discs, x_edges: Array, y_edges: Array, hidden: Cells | None = None
) -> Array:
    """Return the discs that may be seen on a grid: hardly more than are seen.

    Left out are those that touch no cell but such as are covered whole by a disc before them.

    Parameters
    ----------
    discs : Discs
        The discs; a later one lies in front.
    x_edges, y_edges : Array
        Rising edges of the cells, in the unit of the discs.
    hidden : Cells or None
        Cells in which nothing is seen.

    Returns
    -------
    Array
        Indices, rising.
    """
    spans = _spans(discs, x_edges, y_edges)
    label = _labels(spans, len(discs), (len(y_edges) - 1, len(x_edges) - 1), hidden)
    count = spans.touch_stop - spans.touch_start
    front = np.repeat(spans.disc, count)
    seen = np.zeros(len(discs), bool)
    cell = concatenate_ranges(spans.row * label.shape[1] + spans.touch_start, count)
    seen[front[front >= label.ravel()[cell] - 1]] = True
    return np.flatnonzero(seen)


@dataclass(frozen=True)
class _Spans:
    """Cells that every disc meets in every row, in the order of discs."""

    disc: Array
    """Index of the disc."""
    row: Array
    """Row of cells."""
    touch_start: Array
    """First cell that the disc touches."""
    touch_stop: Array
    """End of the cells that the disc touches."""
    full_start: Array
    """First cell that lies wholly inside the disc."""
    full_stop: Array
    """End of the cells that lie wholly inside the disc."""


def _spans(discs: Discs, x_edges: Array, y_edges: Array) -> _Spans:
    nx, ny = len(x_edges) - 1, len(y_edges) - 1
    first = np.clip(y_edges.searchsorted(discs.y - discs.radius, side="right") - 1, 0, ny)
    last = np.clip(y_edges.searchsorted(discs.y + discs.radius, side="left"), 0, ny)
    disc, row = expand_ranges(first, last)
    x, y, radius = discs.x[disc], discs.y[disc], discs.radius[disc]
    above, below = y_edges[row] - y, y_edges[row + 1] - y
    nearest = np.maximum(np.maximum(above, -below), 0.0)
    farthest = np.maximum(-above, below)
    column = _Columns(x_edges)
    wide, narrow = _half_chord(radius, nearest), _half_chord(radius, farthest)
    touch_start = np.maximum(column.index_of(x - wide), 0)
    touch_stop = np.minimum(column.index_of(x + wide) + 1, nx)
    full_start = np.clip(column.index_of(x - narrow) + 1, touch_start, touch_stop)
    full_stop = np.clip(column.index_of(x + narrow), full_start, touch_stop)
    none = farthest >= radius
    full_start = np.where(none, touch_stop, full_start)
    full_stop = np.where(none, touch_stop, full_stop)
    keep = touch_stop > touch_start
    parts = (disc, row, touch_start, touch_stop, full_start, full_stop)
    return _Spans(*parts) if keep.all() else _Spans(*(part[keep] for part in parts))


class _Columns:
    """Finds the cell that holds a position: -1 left of all, nx right of all.

    This is faster than a search where the inner edges are evenly spaced (the two outermost cells
    may be cut).
    """

    def __init__(self, edges: Array) -> None:
        self.edges = edges
        inner = edges[1:-1]
        step = (inner[-1] - inner[0]) / (len(inner) - 1) if len(inner) > 1 else 0.0
        even = step > 0 and np.allclose(np.diff(inner), step, rtol=1e-6, atol=0.0)
        self.step = step if even else None

    def index_of(self, position: Array) -> Array:
        if self.step is None:
            return self.edges.searchsorted(position, side="right") - 1
        inner = np.floor((position - self.edges[1]) / self.step)
        index: Array = np.clip(inner, -1, len(self.edges) - 3).astype(np.int32) + 1
        index[position < self.edges[0]] = -1
        index[position >= self.edges[-1]] = len(self.edges) - 1
        return index


def _half_chord(radius: Array, distance: Array) -> Array:
    """Return half the length of the chord at a distance from the center; 0 outside."""
    half_chord: Array = np.sqrt(np.maximum((radius - distance) * (radius + distance), 0.0))
    return half_chord


def _labels(spans: _Spans, discs: int, shape: tuple[int, int], hidden: Cells | None) -> Array:
    """Return per cell the frontmost disc that covers it whole, plus 1; 0 where none does."""
    some = np.flatnonzero(spans.full_stop > spans.full_start)
    row = spans.row[some] * shape[1]
    start, stop = row + spans.full_start[some], row + spans.full_stop[some]
    label = topmost_numbers(start, stop, spans.disc[some] + 1, shape[0] * shape[1], shape[1])
    label = label.reshape(shape)
    if hidden is not None:
        label[hidden] = discs + 1
    return label


def _crossed_cells(spans: _Spans, label: Array) -> tuple[Array, Array]:
    """Return pairs of a cell and the label of a visible edge that crosses it, front first."""
    row, keys = spans.row * label.shape[1], []
    for start, stop in (
        (spans.touch_start, spans.full_start),
        (spans.full_stop, spans.touch_stop),
    ):
        cell = concatenate_ranges(row + start, stop - start)
        front = np.repeat(spans.disc + 1, stop - start)
        seen = np.flatnonzero(front > label.ravel()[cell])
        keys.append((cell[seen] << 31) - front[seen].astype(np.int64))
    key = np.sort(np.concatenate(keys))
    cell = -((-key) >> 31)
    return cell, (cell << 31) - key
