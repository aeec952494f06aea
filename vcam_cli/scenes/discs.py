"""Opaque discs laid over each other, averaged over the cells of a grid.

Where each cell is the plain color of one disc, which is nearly everywhere, it is found by filling
rows of cells back to front. Cells crossed by one visible edge take the exact area of the circle
within the cell. Cells crossed by more are divided in four, again and again; after `DEPTH`
divisions the discs in what is left are taken as independent, so the error is a fraction of
4^-DEPTH of a cell where edges meet, and rounding elsewhere.

Why labels: the picture is painted once as disc numbers, and colored afterwards, so that any number
of planes costs one painting.
"""

from dataclasses import dataclass

import numpy as np

from vcam_cli.scenes.base import Array

DEPTH = 5


@dataclass(frozen=True)
class Discs:
    """Centres x, y and radii, (n,) each, in one unit of length; a later disc hides an earlier."""

    x: Array
    y: Array
    radius: Array

    def __len__(self) -> int:
        return len(self.x)

    def take(self, index: Array) -> "Discs":
        return Discs(self.x[index], self.y[index], self.radius[index])

    def touching(self, left: float, right: float, top: float, bottom: float) -> Array:
        """Indices, in order, of the discs whose bounding box meets a rectangle."""
        return np.flatnonzero(
            (self.x + self.radius > left)
            & (self.x - self.radius < right)
            & (self.y + self.radius > top)
            & (self.y - self.radius < bottom)
        )


def averages(discs: Discs, color: Array, x_edges: Array, y_edges: Array) -> Array:
    """Cell averages of discs on a ground: (R, ny, nx), in the dtype of `color`.

    color: (R, n + 1), column 0 the ground's, column i + 1 that of disc i. Edges rise.
    """
    near = discs.touching(x_edges[0], x_edges[-1], y_edges[0], y_edges[-1])
    discs = discs.take(near)
    color = np.concatenate([color[:, :1], color[:, near + 1]], axis=1)
    spans = _spans(discs, x_edges, y_edges)
    nx, ny = len(x_edges) - 1, len(y_edges) - 1
    label = _fill(spans, nx, ny)
    cell, front = _crossed(spans, label, nx)
    out = np.stack([np.take(row, label) for row in color])
    if len(cell):
        starts = np.flatnonzero(np.diff(cell, prepend=-1))
        cells, of_pair = cell[starts], np.repeat(np.arange(len(starts)), _counts(starts, cell))
        row, column = np.divmod(cells, nx)
        boxes = np.stack([x_edges[column], x_edges[column + 1], y_edges[row], y_edges[row + 1]])
        parts = _Parts(boxes, label[cells], np.arange(len(cells)), of_pair, front)
        out[:, cells] = _resolve(discs, parts, color)
    return out.reshape(len(color), ny, nx)


def values(discs: Discs, color: Array, x: Array, y: Array) -> Array:
    """Point values at (y[i], x[j]), both rising: (R, len(y), len(x))."""
    near = discs.touching(x[0], x[-1], y[0], y[-1])
    discs = discs.take(near)
    color = np.concatenate([color[:, :1], color[:, near + 1]], axis=1)
    disc, row = _rows(
        y.searchsorted(discs.y - discs.radius), y.searchsorted(discs.y + discs.radius)
    )
    half = _half_chord(discs.radius[disc], y[row] - discs.y[disc])
    column = _Columns(x)
    start = column.holding(discs.x[disc] - half) + 1
    stop = np.minimum(column.holding(discs.x[disc] + half) + 1, len(x))
    some = np.flatnonzero(stop > start)
    row = row[some] * len(x)
    label = np.zeros(len(x) * len(y), np.int32)
    _write(label, row + start[some], row + stop[some], disc[some])
    return np.stack([np.take(plane, label) for plane in color]).reshape(-1, len(y), len(x))


@dataclass(frozen=True)
class _Spans:
    """For every disc and every row of cells it meets, in the order of discs: the cells touched
    [touch_start, touch_stop) and, among them, those wholly inside [full_start, full_stop)."""

    disc: Array
    row: Array
    touch_start: Array
    touch_stop: Array
    full_start: Array
    full_stop: Array


def _spans(discs: Discs, x_edges: Array, y_edges: Array) -> _Spans:
    nx, ny = len(x_edges) - 1, len(y_edges) - 1
    first = np.clip(y_edges.searchsorted(discs.y - discs.radius, side="right") - 1, 0, ny)
    last = np.clip(y_edges.searchsorted(discs.y + discs.radius, side="left"), 0, ny)
    disc, row = _rows(first, last)
    x, y, radius = discs.x[disc], discs.y[disc], discs.radius[disc]
    above, below = y_edges[row] - y, y_edges[row + 1] - y
    nearest = np.maximum(np.maximum(above, -below), 0.0)
    farthest = np.maximum(-above, below)
    column = _Columns(x_edges)
    wide, narrow = _half_chord(radius, nearest), _half_chord(radius, farthest)
    touch_start = np.maximum(column.holding(x - wide), 0)
    touch_stop = np.minimum(column.holding(x + wide) + 1, nx)
    full_start = np.clip(column.holding(x - narrow) + 1, touch_start, touch_stop)
    full_stop = np.clip(column.holding(x + narrow), full_start, touch_stop)
    none = farthest >= radius
    full_start = np.where(none, touch_stop, full_start)
    full_stop = np.where(none, touch_stop, full_stop)
    keep = touch_stop > touch_start
    parts = (disc, row, touch_start, touch_stop, full_start, full_stop)
    return _Spans(*parts) if keep.all() else _Spans(*(part[keep] for part in parts))


class _Columns:
    """Which cell holds a position: -1 left of all, nx right of all. Faster than a search where
    the inner edges are evenly spaced (the two outermost cells may be cut)."""

    def __init__(self, edges: Array) -> None:
        self.edges = edges
        inner = edges[1:-1]
        step = (inner[-1] - inner[0]) / (len(inner) - 1) if len(inner) > 1 else 0.0
        even = step > 0 and np.allclose(np.diff(inner), step, rtol=1e-6, atol=0.0)
        self.step = step if even else None

    def holding(self, position: Array) -> Array:
        if self.step is None:
            return self.edges.searchsorted(position, side="right") - 1
        inner = np.floor((position - self.edges[1]) / self.step)
        index = np.clip(inner, -1, len(self.edges) - 3).astype(np.int32) + 1
        index[position < self.edges[0]] = -1
        index[position >= self.edges[-1]] = len(self.edges) - 1
        return index


def _rows(first: Array, last: Array) -> tuple[Array, Array]:
    """Every (item, number) with first[item] <= number < last[item], in the order of items."""
    count = np.maximum(last - first, 0)
    item = np.repeat(np.arange(len(count), dtype=np.int32), count)
    return item, _ragged(first, count)


def _ragged(first: Array, count: Array) -> Array:
    """first[0], first[0]+1, ... (count[0] numbers), first[1], ... concatenated."""
    before = np.cumsum(count) - count
    return np.arange(int(count.sum())) + np.repeat(first - before, count)


def _half_chord(radius: Array, distance: Array) -> Array:
    """Half the length of the chord at a distance from the centre; 0 outside."""
    return np.sqrt(np.maximum((radius - distance) * (radius + distance), 0.0))


def _fill(spans: _Spans, nx: int, ny: int) -> Array:
    """Per cell the frontmost disc that covers it whole, plus 1; 0 where none does."""
    label = np.zeros(nx * ny, np.int32)
    some = np.flatnonzero(spans.full_stop > spans.full_start)
    row = spans.row[some] * nx
    _write(label, row + spans.full_start[some], row + spans.full_stop[some], spans.disc[some])
    return label


def _write(label: Array, start: Array, stop: Array, disc: Array) -> None:
    for begin, end, number in zip(start.tolist(), stop.tolist(), (disc + 1).tolist(), strict=True):
        label[begin:end] = number


def _crossed(spans: _Spans, label: Array, nx: int) -> tuple[Array, Array]:
    """Cells crossed by edges that may be seen, and whose edge (label): pairs, front first."""
    row = spans.row * nx
    start = np.concatenate([row + spans.touch_start, row + spans.full_stop])
    count = np.concatenate(
        [spans.full_start - spans.touch_start, spans.touch_stop - spans.full_stop]
    )
    cell = _ragged(start, count)
    front = np.repeat(np.concatenate([spans.disc, spans.disc]) + 1, count)
    seen = front > label[cell]
    key = np.sort((cell[seen] << 31) - front[seen].astype(np.int64))
    cell = -((-key) >> 31)
    return cell, (cell << 31) - key


def _counts(starts: Array, pairs: Array) -> Array:
    return np.diff(starts, append=len(pairs))


@dataclass(frozen=True)
class _Parts:
    """Rectangles still to be judged, equal shares of their cells at one depth.

    box (4, m): left, right, top, bottom; back (m,): what lies behind the edges; cell (m,): whose
    part it is; and the edges that cross them as pairs: of_part (p,) rising,
    front (p,) falling within a part.
    """

    box: Array
    back: Array
    cell: Array
    of_part: Array
    front: Array


def _resolve(discs: Discs, parts: _Parts, color: Array) -> Array:
    """Average colors (R, cells) of the cells the parts belong to."""
    count = int(parts.cell[-1]) + 1
    out = np.zeros((len(color), count))

    def add(cell: Array, label: Array, weight: Array | float) -> None:
        for plane, row in zip(out, color, strict=True):
            plane += np.bincount(cell, row[label] * weight, minlength=count)

    for depth in range(DEPTH + 1):
        share = 0.25**depth
        crossings = np.bincount(parts.of_part, minlength=len(parts.back))
        plain = crossings == 0
        add(parts.cell[plain], parts.back[plain], share)
        single = crossings[parts.of_part] == 1
        part, front = parts.of_part[single], parts.front[single]
        inside = share * _cover(discs, front - 1, parts.box[:, part])
        add(parts.cell[part], front, inside)
        add(parts.cell[part], parts.back[part], share - inside)
        several = crossings > 1
        if not several.any():
            break
        parts = _keep(parts, several)
        if depth == DEPTH:
            seen, behind = _layered(discs, parts)
            add(parts.cell[parts.of_part], parts.front, share * seen)
            add(parts.cell, parts.back, share * behind)
        else:
            parts = _divide(discs, parts)
    return out


def _keep(parts: _Parts, wanted: Array) -> _Parts:
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
    """Each part in four; edges that hide behind a disc that covers the quarter are dropped."""
    left, right, top, bottom = parts.box
    x, y = (left + right) / 2, (top + bottom) / 2
    quarters = [(left, x, top, y), (x, right, top, y), (left, x, y, bottom), (x, right, y, bottom)]
    box = np.concatenate([np.stack(quarter) for quarter in quarters], axis=1)
    back, cell = np.tile(parts.back, 4), np.tile(parts.cell, 4)
    number = len(parts.back)
    of_part = np.concatenate([parts.of_part + k * number for k in range(4)])
    front = np.tile(parts.front, 4)
    nearest, farthest = _distances(discs, front - 1, box[:, of_part])
    radius = discs.radius[front - 1]
    covers = farthest <= radius
    np.maximum.at(back, of_part[covers], front[covers])
    seen = (nearest < radius) & ~covers & (front > back[of_part])
    return _Parts(box, back, cell, of_part[seen], front[seen])


def _distances(discs: Discs, index: Array, box: Array) -> tuple[Array, Array]:
    """Nearest and farthest distance of the rectangles from the discs' centres."""
    left, right, top, bottom = box
    x, y = discs.x[index], discs.y[index]
    near_x = np.maximum(np.maximum(left - x, x - right), 0.0)
    near_y = np.maximum(np.maximum(top - y, y - bottom), 0.0)
    far_x, far_y = np.maximum(x - left, right - x), np.maximum(y - top, bottom - y)
    return np.hypot(near_x, near_y), np.hypot(far_x, far_y)


def _layered(discs: Discs, parts: _Parts) -> tuple[Array, Array]:
    """What is seen of each edge's disc, and of what lies behind all, as parts of 1.

    From the front, a disc is seen in its own share of what those before it leave free: exact
    where the edges are independent. Pairs (p,) and parts (m,).
    """
    cover = np.minimum(_cover(discs, parts.front - 1, parts.box[:, parts.of_part]), 1 - 1e-12)
    shade = np.log1p(-cover)
    before = np.cumsum(shade) - shade
    first = np.flatnonzero(np.diff(parts.of_part, prepend=-1))
    before -= np.repeat(before[first], _counts(first, parts.of_part))
    behind = np.exp(np.bincount(parts.of_part, shade, minlength=len(parts.back)))
    return cover * np.exp(before), behind


def _cover(discs: Discs, index: Array, box: Array) -> Array:
    """The part of each rectangle, 0..1, that lies in its disc: exact."""
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
    """t cut to -1..1, and twice the area under the unit circle's quarter up to |t|."""
    t = np.clip(t, -1.0, 1.0)
    return t, np.abs(t) * np.sqrt(1.0 - t * t) + np.arcsin(np.abs(t))


def _corner(side: tuple[Array, Array], end: tuple[Array, Array]) -> Array:
    """Signed area of the unit disc within [0, x] x [0, y]."""
    (x, area_x), (y, area_y) = side, end
    outside = (area_x + area_y - np.pi / 2) / 2
    return np.where(x * x + y * y <= 1.0, x * y, np.sign(x) * np.sign(y) * outside)
