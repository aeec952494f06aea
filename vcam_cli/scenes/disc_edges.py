"""Cells crossed by the edges of opaque discs: visible discs in each, and their average color.

A cell crossed by one visible edge takes the exact area of the circle within the cell. Cells
crossed by more are divided in four, again and again, and the discs in the rest are then taken
as independent. So there is an error in cells where edges meet, and rounding elsewhere; how often
cells are divided is chosen by it (`divisions`).
"""

import math
from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import pieces
from vcam_cli.records import dataclass

AT_ONCE = 1 << 11
"""Cells whose edges are looked at together."""
MOST = 5
"""Divisions of a cell that several edges cross, at most."""
UNDIVIDED, DIVIDED = 0.0042, 0.3
"""Error of the mean of a cell, rms over all cells of dead leaves of white, where none is divided,
and by what each division reduces it: measured against five on cells of 0.1 to 0.8 of the smallest
leaf's radius, where most edges meet in those of 0.4."""


def divisions(error: float) -> int:
    """Return how often crossed cells are divided.

    Parameters
    ----------
    error : float
        Rms error that their averages may have, relative to white.

    Returns
    -------
    int
        Number of divisions, at most `MOST`.
    """
    if error <= 0:
        return MOST
    return min(max(math.ceil(math.log(error / UNDIVIDED) / math.log(DIVIDED)), 0), MOST)


@dataclass(frozen=True)
class Discs:
    """Opaque discs in one unit of length; a later disc hides an earlier."""

    x: Array
    """Centers to the right (n,)."""
    y: Array
    """Centers down (n,)."""
    radius: Array
    """Radii (n,)."""

    def __len__(self) -> int:
        """Return the number of discs."""
        return len(self.x)

    def select(self, index: Array) -> "Discs":
        """Return some of the discs.

        Parameters
        ----------
        index : Array
            Their indices.

        Returns
        -------
        Discs
            These discs, in the order of `index`.
        """
        return Discs(self.x[index], self.y[index], self.radius[index])

    def find_near(self, left: float, right: float, top: float, bottom: float) -> Array:
        """Return the discs whose bounding box meets a rectangle.

        Parameters
        ----------
        left, right, top, bottom : float
            Ends of the rectangle, in the unit of the discs.

        Returns
        -------
        Array
            Indices, rising.
        """
        return np.flatnonzero(
            (self.x + self.radius > left)
            & (self.x - self.radius < right)
            & (self.y + self.radius > top)
            & (self.y - self.radius < bottom)
        )


@dataclass(frozen=True)
class CrossedCells:
    """Cells that edges of discs cross. The label of disc i is i + 1."""

    box: Array
    """Left, right, top and bottom of each cell (4, m)."""
    back: Array
    """Label of what lies behind the edges of each cell (m,)."""
    count: Array
    """Number of edges that cross each cell (m,), at least 1."""
    front: Array
    """Labels of the edges (sum of count,), cell by cell and falling within a cell."""


@dataclass(frozen=True)
class EdgeShares:
    """Visible discs in cells that edges cross: labels, and the part of the cell that each fills."""

    single: Array
    """Whether one edge alone crosses a cell (m,)."""
    front: Array
    """Label of what lies in front, of cells with a single edge (s,)."""
    back: Array
    """Label of what lies behind it (s,)."""
    inside: Array
    """Part of the cell that lies in front (s,)."""
    cell: Array
    """Cell, counted among those of several edges (t,)."""
    label: Array
    """Label that is seen in it (t,)."""
    weight: Array
    """Part of the cell that it fills (t,)."""

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return sum(getattr(self, field.name).nbytes for field in fields(self))

    def seen(self) -> Iterator[tuple[Array, Array, Array]]:
        """Yield cells, labels that are seen in them and the parts of them that these fill."""
        single, several = np.flatnonzero(self.single), np.flatnonzero(~self.single)
        yield single, self.front, self.inside
        yield single, self.back, 1 - self.inside
        yield several[self.cell], self.label, self.weight

    def colors(self, color: Array) -> Iterator[Array]:
        """Yield the average color of every cell, plane by plane.

        Parameters
        ----------
        color : Array
            Color (R, labels) of the ground and of every disc.

        Yields
        ------
        Array
            Averages (m,) of a plane, in the unit of `color`; overwritten with the next one.
        """
        plane = np.empty(len(self.single))
        # Numbers are kept in few bits; indexing converts them each time.
        single, several = np.flatnonzero(self.single), np.flatnonzero(~self.single)
        front, back, cell, label = (
            numbers.astype(np.intp) for numbers in (self.front, self.back, self.cell, self.label)
        )
        behind = 1 - self.inside
        for row in color:
            plane[single] = row.take(front) * self.inside + row.take(back) * behind
            plane[several] = np.bincount(cell, row.take(label) * self.weight, len(several))
            yield plane


def edge_shares(discs: Discs, cells: CrossedCells, divided: int = MOST) -> EdgeShares:
    """Return the visible discs in crossed cells.

    Parameters
    ----------
    discs : Discs
        The discs; a later one lies in front.
    cells : CrossedCells
        The cells (m,) that edges cross.
    divided : int
        How often a cell of several edges is divided.

    Returns
    -------
    EdgeShares
        Labels and parts; of any colors.
    """
    several = cells.count > 1
    single = ~several
    pair = np.repeat(several, cells.count)
    front, back = cells.front[~pair], cells.back[single]
    inside = np.empty(len(front))
    number = np.flatnonzero(single)
    for some in pieces(len(front), AT_ONCE):
        inside[some] = cover(discs, front[some] - 1, cells.box[:, number[some]])
    labels, cells_type = (np.min_scalar_type(count + 1) for count in (len(discs), len(single)))
    number, fronts = np.flatnonzero(several), cells.front[pair]
    count = cells.count[number]
    ends = np.concatenate([[0], np.cumsum(count)])
    found = [(np.zeros(0, cells_type), np.zeros(0, labels), np.zeros(0))]
    for some in pieces(len(number), AT_ONCE):
        parts = _Parts(
            cells.box[:, number[some]],
            cells.back[number[some]],
            np.arange(some.start, some.stop),
            np.repeat(np.arange(some.stop - some.start), count[some]),
            fronts[ends[some.start] : ends[some.stop]],
        )
        cell, label, weight = _resolve(discs, parts, divided)
        found.append((cell.astype(cells_type), label.astype(labels), weight))
    cell, label, weight = (np.concatenate(each) for each in zip(*found, strict=True))
    return EdgeShares(
        single, front.astype(labels), back.astype(labels), inside, cell, label, weight
    )


def several_shares(count: int, cell: Array, label: Array, weight: Array) -> EdgeShares | None:
    """Return the visible discs in cells with several edges each.

    Parameters
    ----------
    count : int
        Number of cells.
    cell, label, weight : Array
        Cells (n,), labels that are seen in them, which may stand there several times, and parts of
        them that these fill, in any unit.

    Returns
    -------
    EdgeShares or None
        Labels and parts; None of no cells.
    """
    if not count:
        return None
    labels = int(label.max()) + 1
    key = cell.astype(np.int64) * labels + label
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    weight, key = np.add.reduceat(weight[order], starts), key[order[starts]]
    cell, seen = np.divmod(key, labels)
    weight /= np.bincount(cell, weight, count)[cell]
    none = np.empty(0, label.dtype)
    cell, seen = cell.astype(np.min_scalar_type(count)), seen.astype(label.dtype)
    return EdgeShares(np.zeros(count, bool), none, none, np.empty(0), cell, seen, weight)


@dataclass(frozen=True)
class _Parts:
    """Rectangles still to be divided, equal shares of their cells at one depth."""

    box: Array
    """Left, right, top and bottom of each rectangle (4, m)."""
    back: Array
    """Label of what lies behind the edges of each rectangle (m,)."""
    cell: Array
    """Cell that each rectangle is a part of (m,)."""
    of_part: Array
    """Rectangle of each edge that crosses one (p,), rising."""
    front: Array
    """Label of each such edge (p,), falling within a rectangle."""


def _resolve(discs: Discs, parts: _Parts, divided: int) -> tuple[Array, Array, Array]:
    """Return cell, label and weight of all that is seen in cells, one part each at first."""
    found: list[tuple[Array, Array, Array]] = []  # cell, label, how much of the cell
    share = 1.0
    for _ in range(divided):
        share /= 4
        parts = _divide(discs, parts)
        crossings = np.bincount(parts.of_part, minlength=len(parts.back))
        plain = crossings == 0
        found.append((parts.cell[plain], parts.back[plain], np.full(int(plain.sum()), share)))
        single = crossings[parts.of_part] == 1
        part, front = parts.of_part[single], parts.front[single]
        inside = share * cover(discs, front - 1, parts.box[:, part])
        found.append((parts.cell[part], front, inside))
        found.append((parts.cell[part], parts.back[part], share - inside))
        parts = _select_parts(parts, crossings > 1)
    seen, behind = _layer_shares(discs, parts)
    found.append((parts.cell[parts.of_part], parts.front, share * seen))
    found.append((parts.cell, parts.back, share * behind))
    cell, label, weight = (np.concatenate(each) for each in zip(*found, strict=True))
    return cell, label, weight


def _select_parts(parts: _Parts, wanted: Array) -> _Parts:
    """Return some of the parts, with the edges that cross them."""
    number = np.cumsum(wanted) - 1
    pair = wanted[parts.of_part]
    return _Parts(
        parts.box[:, wanted],
        parts.back[wanted],
        parts.cell[wanted],
        number[parts.of_part[pair]],
        parts.front[pair],
    )


def _divide(discs: Discs, parts: _Parts) -> _Parts:
    """Divide each part in four; edges hidden behind a disc that covers the quarter are dropped."""
    left, right, top, bottom = parts.box
    x, y = (left + right) / 2, (top + bottom) / 2
    quarters = [(left, x, top, y), (x, right, top, y), (left, x, y, bottom), (x, right, y, bottom)]
    box = np.concatenate([np.stack(quarter) for quarter in quarters], axis=1)
    back, cell = np.tile(parts.back, 4), np.tile(parts.cell, 4)
    number = len(parts.back)
    of_part = np.concatenate([parts.of_part + k * number for k in range(4)])
    front = np.tile(parts.front, 4)
    nearest, farthest = _distances(discs, parts)
    covers = farthest <= 0.0
    np.maximum.at(back, of_part[covers], front[covers])
    seen = (nearest < 0.0) & ~covers & (front > back[of_part])
    return _Parts(box, back, cell, of_part[seen], front[seen])


def _distances(discs: Discs, parts: _Parts) -> tuple[Array, Array]:
    """Return the nearest and farthest squared distances of the parts' quarters from edges' centers.

    They are less the squared radius, and stand quarter by quarter.
    """
    index = parts.front - 1
    left, right, top, bottom = parts.box[:, parts.of_part]
    middle_x, middle_y = (left + right) / 2, (top + bottom) / 2
    x, y, limit = discs.x[index], discs.y[index], discs.radius[index] ** 2
    across = _squared_distances(left - x, middle_x - x), _squared_distances(middle_x - x, right - x)
    down = _squared_distances(top - y, middle_y - y), _squared_distances(middle_y - y, bottom - y)
    near, far = (
        np.concatenate([v[end] + (h[end] - limit) for v in down for h in across]) for end in (0, 1)
    )
    return near, far


def _squared_distances(low: Array, high: Array) -> tuple[Array, Array]:
    """Return the squares of the least and the largest distance of an interval from 0."""
    return np.maximum(np.maximum(low, -high), 0.0) ** 2, np.maximum(-low, high) ** 2


def _layer_shares(discs: Discs, parts: _Parts) -> tuple[Array, Array]:
    """Return the visible shares of each edge's disc, and of the background, as parts of 1.

    From the front, a disc is seen in its own share of what those before it leave free: exact
    where the edges are independent. Pairs (p,) and parts (m,).
    """
    share = np.minimum(cover(discs, parts.front - 1, parts.box[:, parts.of_part]), 1 - 1e-12)
    shade = np.log1p(-share)
    before = np.cumsum(shade) - shade
    first = np.flatnonzero(np.diff(parts.of_part, prepend=-1))
    before -= np.repeat(before[first], np.diff(first, append=len(before)))
    behind = np.exp(np.bincount(parts.of_part, shade, minlength=len(parts.back)))
    return share * np.exp(before), behind


def cover(discs: Discs, index: Array, box: Array) -> Array:
    """Return the exact part of rectangles that lies in discs.

    Parameters
    ----------
    discs : Discs
        The discs.
    index : Array
        Index (m,) of the disc of each rectangle.
    box : Array
        Left, right, top and bottom (4, m) of the rectangles, in the unit of the discs.

    Returns
    -------
    Array
        Parts (m,), from 0 to 1.
    """
    left, right, top, bottom = box
    radius, x, y = discs.radius[index], discs.x[index], discs.y[index]
    sides = [_side((left - x) / radius), _side((right - x) / radius)]
    ends = [_side((top - y) / radius), _side((bottom - y) / radius)]
    area = (
        _corner(sides[1], ends[1])
        - _corner(sides[0], ends[1])
        - _corner(sides[1], ends[0])
        + _corner(sides[0], ends[0])
    )
    return np.asarray(np.clip(area * radius**2 / ((right - left) * (bottom - top)), 0.0, 1.0))


def _side(t: Array) -> tuple[Array, Array]:
    """Return `t` cut to -1..1, and twice the area under the unit circle's quarter up to |t|."""
    t = np.clip(t, -1.0, 1.0)
    return t, np.abs(t) * np.sqrt(1.0 - t * t) + np.arcsin(np.abs(t))


def _corner(side: tuple[Array, Array], end: tuple[Array, Array]) -> Array:
    """Return the signed area of the unit disc within [0, x] x [0, y]."""
    (x, area_x), (y, area_y) = side, end
    outside = (area_x + area_y - np.pi / 2) / 2
    return np.where(x * x + y * y <= 1.0, x * y, np.sign(x) * np.sign(y) * outside)
