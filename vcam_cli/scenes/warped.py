"""A chart as a lens images it that displaces what it images.

Cells of the sensor see parts of the chart that are no rectangles. The chart is painted flat, as
means over overlapping squares; between them a cubic spline gives the mean over a square anywhere.
What a cell sees is taken as one square about its center, where it is nearly one, and else as two or
four that have its second moments together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import pieces, product
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import SPARSE, Chart, PaintedCells
from vcam_cli.scenes.cells import cell_means
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region

SLIVER = 1e-6
"""Part of a width that is a rounding error."""
MOST_PARTS = 4
"""Parts along each side of a cell, at most: of the far field's wide cells, waves that go into one
once, twice or three times still leave nothing."""
TILE = 320
"""Cells along each side that are painted at once, more than the rows of a band of two megapixels:
over them the lens's scale hardly changes."""
FINER = 2
"""Painted cells along the side of a square: a spline between squares so close errs by 6e-5 of a
wave with five pixels in a period, where they are as large as 0.8 pixels."""
BEYOND = 10
"""Painted cells around those that are seen: a spline's ends change it by 0.27 a cell."""
MOST_FINER = 8.0
"""Painted cells of a tile over its cells times `FINER` squared, at most: it is halved beyond."""
EVEN = 1e-6
"""Difference of cells, over the brighter, up to which they hold one light: rounding."""
BLOCK = 5
"""Cells along each side of blocks that are even or not."""
FEW = 160
"""Cells along each side up to which a tile is not halved in order that two squares do for its
halves: cells painted around it take a quarter as long as its own. With 80 `fisheye` takes 17 % more
processor time."""
LONGEST = 10.0
"""Second moment along what a cell sees over that across, at most, of two squares: up to there
their fourth moments miss no more than is allowed for (`warps._squares`)."""
POLE = math.sqrt(3) - 2
"""Factor by which the coefficients of a cubic spline fall."""
AT_ONCE = 1 << 14
"""Places that are interpolated at once: 2 MB."""
IN_CACHE = 64
"""Lines of a tile that are transposed at once: 0.2 MB."""
SEEN = 80
"""Places along a side of a tile of values: 160 took 50 MB before a ColorChecker, and twice as long;
320 took 165 MB before leaves."""
POINTS = 4.0
"""Points of a chart along the distance of the nearest requested ones: between them its
values are interpolated linearly."""
DEGREES = (16, 32, 64, 128)
"""Degrees of the series of a map that are tried."""
PRECISE = 1e-11
"""Coefficients over the largest that a series does without: 1e-7 pixels of 10,000."""
LOOKS, LOOKS_IN_TILE = 33, 5
"""Places along each side of a map, and of a tile, at which its scale is looked at."""
TINY = 1e-30
"""Less than any second moment that counts."""
IN_USE, OF_PLACE = 2, 80
"""Arrays of a tile's painted cells in use at once, and what tells of each place that looks there
where it looks, with two squares about it [bytes]."""
INTERPOLATED = 3_000_000
"""Temporary arrays of `AT_ONCE` places: weights, where they count, and the library's [bytes]."""
CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))
"""Signs of the ways to four squares."""
PAIRS = ((0, 0), (1, 1), (0, 1))
"""Axes of the elements of a symmetric matrix of two rows."""

Places = Callable[[Array, Array], tuple[Array, Array]]
"""From places x, y of one shape to where they look [m]; NaN for those that see nothing."""


class Moments(NamedTuple):
    """Second moments of areas along x, along y, and across."""

    xx: Array
    yy: Array
    xy: Array

    @property
    def ends(self) -> tuple[Array, Array]:
        """Least and largest in any direction."""
        middle = (self.xx + self.yy) / 2
        apart = np.hypot((self.xx - self.yy) / 2, self.xy)
        return middle - apart, middle + apart

    def excess_over(self, square: float) -> Moments:
        """Return their excess over those of a square."""
        return Moments(self.xx - square, self.yy - square, self.xy)

    @property
    def longer_axis(self) -> tuple[Array, Array]:
        """The direction of the largest moment, as long as its root; 0 where it is negative."""
        length = np.sqrt(np.maximum(self.ends[1], 0.0))
        angle = np.arctan2(2 * self.xy, self.xx - self.yy) / 2
        return length * np.cos(angle), length * np.sin(angle)

    @property
    def root(self) -> Moments:
        """Square root of the symmetric matrix that they are."""
        root = np.sqrt(np.maximum(self.xx * self.yy - self.xy**2, 0.0))
        scale = np.sqrt(np.maximum(self.xx + self.yy + 2 * root, TINY))
        return Moments((self.xx + root) / scale, (self.yy + root) / scale, self.xy / scale)


@dataclass(frozen=True, eq=False)
class SmoothMap:
    """Where the places of a rectangle about the center look, as Chebyshev series.

    Beyond the rectangle it goes on straight.
    """

    series: Array
    """Coefficients (2, n, n) of x and y, rows for the series over y [m]."""
    half: tuple[float, float]
    """Half of the rectangle's width and height [m]."""

    def on_grid(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where the places of columns x (n,) and rows y (m,) [m] look: two of (m, n) [m]."""
        inside_x, inside_y = (np.clip(a, -h, h) for a, h in zip((x, y), self.half, strict=True))
        ((found_x, found_y),) = self._sums((self.series,), inside_x, inside_y)
        found_x += self._slopes[0] * (x - inside_x)
        found_y += self._slopes[1] * (y - inside_y)[:, None]
        return found_x, found_y

    def seen_moments(self, x: Array, y: Array, size: tuple[float, float] = (1.0, 1.0)) -> Moments:
        """Return the second moments of what cells about columns x (n,), rows y (m,) see.

        They are those of one that looks straight at the chart: 1, 1 and 0.
        """
        inside_x, inside_y = (np.clip(a, -h, h) for a, h in zip((x, y), self.half, strict=True))
        along_x, along_y = (
            [part * (length / own) for part, own in zip(sums, size, strict=True)]
            for sums, length in zip(
                self._sums(self._derivatives, inside_x, inside_y), size, strict=True
            )
        )
        return Moments(*(along_x[i] * along_x[j] + along_y[i] * along_y[j] for i, j in PAIRS))

    def _sums(self, every: Sequence[Array], x: Array, y: Array) -> list[tuple[Array, Array]]:
        """Return both sums (m, n) of each series (2, k, l) at places of the rectangle."""
        most = max(max(series.shape) for series in every)
        along_x, along_y = (
            np.polynomial.chebyshev.chebvander(at / half, most - 1)
            for at, half in zip((x, y), self.half, strict=True)
        )
        found = []
        for series in every:
            _, rows, columns = series.shape
            sum_x, sum_y = (
                product(product(along_y[:, :rows], each), along_x[:, :columns].T) for each in series
            )
            found.append((sum_x, sum_y))
        return found

    @cached_property
    def _derivatives(self) -> tuple[Array, Array]:
        """Series of the derivatives along x and y."""
        along_x, along_y = (
            np.polynomial.chebyshev.chebder(self.series, scl=1 / half, axis=axis)
            for half, axis in zip(self.half, (2, 1), strict=True)
        )
        return along_x, along_y

    @cached_property
    def _slopes(self) -> tuple[float, float]:
        """Mean scale along both axes."""
        ends = np.array([-1.0, 1.0])
        ((x, y),) = self._sums((self.series,), ends * self.half[0], ends * self.half[1])
        return (
            float((x[:, 1] - x[:, 0]).mean() / (2 * self.half[0])),
            float((y[1] - y[0]).mean() / (2 * self.half[1])),
        )

    @cached_property
    def _squared_scales(self) -> tuple[Array, Array]:
        """Squares of the lesser and the larger scale at some places."""
        x, y = (np.linspace(-1, 1, LOOKS) * half for half in self.half)
        return self.seen_moments(x, y).ends

    @cached_property
    def scales(self) -> tuple[float, float]:
        """Mean of the larger scale over the rectangle, and the largest: lengths seen over own."""
        larger = np.sqrt(self._squared_scales[1])
        return float(larger.mean()), float(larger.max())

    @property
    def stretch(self) -> float:
        """Larger scale over the lesser, in the mean over the rectangle."""
        least, most = self._squared_scales
        return float(np.sqrt(most / np.maximum(least, TINY)).mean())

    @cached_property
    def elongation(self) -> float:
        """Square of the larger scale over that of the lesser, less 1, where they differ most."""
        least, most = self._squared_scales
        return float((most / np.maximum(least, 1e-12)).max()) - 1


def smooth_map(places: Places, half: tuple[float, float]) -> SmoothMap | None:
    """Return a map of a rectangle about the center as a series; None where places see nothing.

    Parameters
    ----------
    places : callable
        The map.
    half : tuple of float
        Half of the rectangle's width and height [m].
    """
    for degree in DEGREES:
        nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        x, y = np.meshgrid(nodes * half[0], nodes * half[1])
        seen = np.array(places(x, y))
        if not np.isfinite(seen).all():
            return None
        terms = np.polynomial.chebyshev.chebvander(nodes, degree) * (2 / (degree + 1))
        terms[:, 0] /= 2
        series = terms.T @ seen @ terms
        size = np.abs(series).max(axis=0)
        counts = np.argwhere(size > PRECISE * size.max())
        needed = int(counts.max()) + 1
        if needed < degree:
            break
    return SmoothMap(np.ascontiguousarray(series[:, :needed, :needed]), half)


@dataclass(frozen=True, eq=False)
class WarpedChart(Chart):
    """A chart seen through a map."""

    chart: Chart
    sees: SmoothMap
    """Where places of the sensor look."""
    widest: float = math.inf
    """Largest width of cells represented by squares; wider ones are painted in parts [m]."""
    sharp: float = math.inf
    """The same of boxes that nothing blurs [m]."""
    alike: float = math.inf
    """Largest difference of the second moments of what a cell sees from those of one square, back
    on the sensor [m2]."""

    edge_seconds = property(lambda self: self.chart.edge_seconds)
    undivided = property(lambda self: min(self.chart.undivided / self.sees.scales[1], self.widest))

    @property
    def brightest(self) -> float:
        """Brightest light of the chart, in the frame or not."""
        return self.chart.brightest

    @property
    def darkest(self) -> float:
        """Bound below its light."""
        return self.chart.darkest

    def highest_frequency(self, half_width: float) -> float:
        """Return that of the chart, by the largest scale of the map."""
        largest = self.sees.scales[1]
        return self.chart.highest_frequency(half_width * largest) * largest

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the chart's edges, as dense as where they are densest.

        The length of edges over the area grows with the scale at which they are seen.
        """
        sides = [
            np.linspace(c - size / 2, c + size / 2, LOOKS)
            for c, size in zip(region.center, region.size, strict=True)
        ]
        seen = self.sees.on_grid(*sides)
        (left, top), (right, bottom) = ([pick(at) for at in seen] for pick in (np.min, np.max))
        whole = Region(((left + right) / 2, (top + bottom) / 2), (right - left, bottom - top))
        found = [self.chart.edge_energy(part, level, ceiling) for part in (whole, region)]
        densest = max(found, key=lambda energy: energy.aligned + energy.oblique)
        return replace(densest.scaled(self.sees.scales[0]), alike=0.0)  # lines become curves

    def painting_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of temporary arrays of a thread: those of a tile."""
        tile, parts = self._tile_cells(cells), self._parts(cells.pitch)
        painted = tile.values * tile.count
        places = math.prod(min(TILE, parts * n) for n in cells.shape)
        interpolated = painted + 2 * tile.values * places + INTERPOLATED
        work = max(IN_USE * painted, interpolated)
        held = (OF_PLACE + tile.values) * places
        return max(held + work, painted + self.chart.painting_bytes(tile))

    def kept_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of what the chart keeps of all tiles, and of the library of splines."""
        return SPARSE + self.chart.kept_bytes(self._tile_cells(cells))

    def _tile_cells(self, cells: PaintedCells) -> PaintedCells:
        """Return the cells of the chart that are painted for a tile."""
        parts = self._parts(cells.pitch)
        sides = (min(TILE, parts * n) * FINER + 2 * BEYOND + FINER for n in cells.shape)
        # Narrow squares along what cells see, where that is longer than wide.
        long = min(self.sees.stretch, MOST_FINER)
        rows, columns = sides
        scale = self.sees.scales[0]
        return PaintedCells(
            shape=(rows, math.ceil(columns * long)),
            pitch=cells.pitch * scale / parts / FINER,
            extent=(cells.extent[0] * scale, cells.extent[1] * scale),
            values=cells.values,
        )

    def _parts(self, pitch: float) -> int:
        """Return the parts along each side of a cell of a size [m]."""
        return max(1, min(math.ceil(pitch / self.widest - SLIVER), MOST_PARTS))

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells between edges, of one size, into an array."""
        x, y = ((edges[1:] + edges[:-1]) / 2 for edges in (x_edges, y_edges))
        width, height = ((e[-1] - e[0]) / (len(e) - 1) for e in (x_edges, y_edges))
        size = width, height
        self._paint(x, y, size, self._parts(max(size)), mix, out)

    def box_averages(self, x: Array, y: Array, size: tuple[float, float], mix: Array) -> Array:
        """Return the averages over boxes about places, which may overlap: (R, len(y), len(x))."""
        out = np.empty((len(mix), len(y), len(x)), mix.dtype)
        count = max(1, math.ceil(max(size) / min(self.sharp, self.widest) - SLIVER))
        self._paint(x, y, size, count, mix, out)
        return out

    def _paint(
        self,
        x: Array,
        y: Array,
        size: tuple[float, float],
        count: int,
        mix: Array,
        out: Array,
    ) -> None:
        """Write the averages over cells of one size about columns and rows of places.

        Those of `count` parts along each side of a cell are averaged.
        """
        parts = (np.arange(count) + 0.5) / count - 0.5
        x, y = (np.add.outer(at, w * parts) for at, w in zip((x, y), size, strict=True))
        for rows in pieces(len(y), max(1, TILE // count)):
            for columns in pieces(len(x), max(1, TILE // count)):
                tile = x[columns].ravel(), y[rows].ravel()
                found = self._tile(tile, (size[0] / count, size[1] / count), mix)
                out[:, rows, columns] = cell_means(found, count)

    def _tile(self, places: tuple[Array, Array], size: tuple[float, float], mix: Array) -> Array:
        """Return the averages (R, m, n) over cells about columns and rows of places."""
        axis = int(len(places[1]) > len(places[0]))
        few = self._few_moments(places, size)
        if len(places[axis]) > FEW and self._is_better_halved(*few, size):
            return self._halved_tile(places, axis, size, mix)
        centers = self.sees.on_grid(*places)
        side, ways = self._squares(places, size, few)
        grids = [
            _Grid.around([c + way[axis] for way in ways], side * size[axis] / FINER)
            for axis, c in enumerate(centers)
        ]
        painted = math.prod(grid.count for grid in grids)
        if painted > MOST_FINER * FINER**2 * (centers[0].size + TILE) and len(places[axis]) > 1:
            return self._halved_tile(places, axis, size, mix)
        x, y = (grid.edges for grid in grids)
        planes = self.chart.crop_to_cells(x, y).averages(x, y, mix)
        column, row = (grid.index(at) for grid, at in zip(grids, centers, strict=True))
        farthest = max(
            float(np.abs(way[axis]).max()) / grid.pitch
            for way in ways
            for axis, grid in enumerate(grids)
        )
        out, varies = _even_light(planes, row, column, farthest)
        if not varies.any():
            return out
        lines = _spline_down(planes)
        del planes  # two arrays as large as the tile are in use at once, not three
        spline = _spline_across(lines)
        del lines
        found: Array = np.zeros((len(out), int(varies.sum())), out.dtype)
        for way in ways:
            across, down = (w / grid.pitch for w, grid in zip(way, grids, strict=True))
            found += _interpolated(spline, (row + down)[varies], (column + across)[varies])
        found /= len(ways)
        out[:, varies] = found
        return out

    def _halved_tile(
        self, places: tuple[Array, Array], axis: int, size: tuple[float, float], mix: Array
    ) -> Array:
        """Return the averages of a tile from those of its halves along an axis, x or y."""
        halves = np.array_split(places[axis], 2)
        tiles = [(places[0], half) if axis else (half, places[1]) for half in halves]
        found = [self._tile(tile, size, mix) for tile in tiles]
        return np.concatenate(found, axis=2 - axis)

    def _few_moments(
        self, places: tuple[Array, Array], size: tuple[float, float]
    ) -> tuple[Array, Array]:
        """Return the least and the largest second moments at some places of a tile.

        They are those of `SmoothMap.seen_moments`.
        """
        x, y = (np.linspace(at[0], at[-1], LOOKS_IN_TILE) for at in places)
        return self.sees.seen_moments(x, y, size).ends

    def _are_alike(self, least: Array, size: tuple[float, float]) -> bool:
        """Return whether one square has nearly all of some second moments."""
        return float(np.ptp(least)) / 2 * max(size) ** 2 / 12 <= self.alike

    def _is_better_halved(self, least: Array, most: Array, size: tuple[float, float]) -> bool:
        """Return whether two squares would do for some halves of a tile, though not for all."""
        return not self._are_alike(least, size) and bool((most <= LONGEST * least).any())

    def _squares(
        self, places: tuple[Array, Array], size: tuple[float, float], few: tuple[Array, Array]
    ) -> tuple[float, Sequence[tuple[Array, Array]]]:
        """Return the side of squares over that of the cells, and where they lie about the centers.

        There is one square where it has nearly the second moments of what the cells see, and two
        where those along the shorter axis of what they see are nearly all alike. `few` are the
        moments at some places.
        """
        ends = np.array(few)
        if self._are_alike(ends, size):
            return math.sqrt((ends.min() + ends.max()) / 2), [(np.zeros(1), np.zeros(1))]
        moments = self.sees.seen_moments(*places, size)
        width, height = (length / math.sqrt(12) for length in size)
        least, most = moments.ends
        low, square = float(least.min()), float(least.min() + least.max()) / 2
        if self._are_alike(least, size) and float(most.max()) <= LONGEST * square:
            along_x, along_y = moments.excess_over(square).longer_axis
            way = width * along_x, height * along_y
            return math.sqrt(square), [way, (-way[0], -way[1])]
        root = moments.excess_over(low).root
        return math.sqrt(low), [
            (width * (a * root.xx + b * root.xy), height * (a * root.xy + b * root.yy))
            for a, b in CORNERS
        ]

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values (R, len(y), len(x)) at points, straight between closely spaced ones."""
        out = np.zeros((len(mix), len(y), len(x)), mix.dtype)
        for rows in pieces(len(y), SEEN):
            for columns in pieces(len(x), SEEN):
                at = self.sees.on_grid(x[columns], y[rows])
                out[:, rows, columns] = self._values(at, mix)
        return out

    def _values(self, at: tuple[Array, Array], mix: Array) -> Array:
        from scipy.ndimage import map_coordinates

        axes = []
        for axis, place in enumerate(at):
            along = np.abs(np.diff(place, axis=1 - axis)) if place.shape[1 - axis] > 1 else place
            step = max(float(along.min()), np.ptp(place) / (POINTS * SEEN), 1e-12) / POINTS
            count = math.ceil(np.ptp(place) / step) + 2
            axes.append(place.min() - step + step * np.arange(count + 1))
        x, y = axes
        planes = self.chart.values(x, y, mix)
        index = [(at[1] - y[0]) / (y[1] - y[0]), (at[0] - x[0]) / (x[1] - x[0])]
        return np.array([map_coordinates(p, index, order=1, mode="nearest") for p in planes])


@dataclass(frozen=True)
class _Grid:
    """Painted cells along an axis, and the squares on them."""

    first: float
    """Edge of the first cell [m]."""
    pitch: float
    """Width of a cell [m]."""
    count: int
    """Cells of squares about the places that are seen, without those around them."""

    @classmethod
    def around(cls, places: Sequence[Array], pitch: float) -> _Grid:
        """Return the cells for squares about places [m]."""
        low, high = min(float(p.min()) for p in places), max(float(p.max()) for p in places)
        return cls(low - (BEYOND + FINER / 2) * pitch, pitch, math.ceil((high - low) / pitch) + 1)

    @property
    def edges(self) -> Array:
        """Edges of the cells, rising [m]."""
        return self.first + self.pitch * np.arange(self.count + 2 * BEYOND + FINER)

    def index(self, place: Array) -> Array:
        """Return where among the squares those about places lie."""
        return (place - self.first) / self.pitch - FINER / 2


def _even_light(planes: Array, row: Array, column: Array, farthest: float) -> tuple[Array, Array]:
    """Return the light (R, m, n) at places among squares as if it were even, and where it is not.

    It is even where cells hold one light as far around a place as its spline sees, and squares
    `farthest` from it. Nothing is interpolated there, which saves a fifth of the time before a
    ColorChecker.

    Parameters
    ----------
    planes : Array
        Painted cells (R, ny, nx).
    row, column : Array
        Places (m, n) among the squares.
    farthest : float
        Largest distance of a square from its place [cells].
    """
    from scipy import ndimage

    blocks_around = 2 * math.ceil((BEYOND + FINER + farthest) / BLOCK) + 1
    size = 1, blocks_around, blocks_around
    low = _of_blocks(planes, np.minimum)
    least = ndimage.minimum_filter(low, size)
    most = ndimage.maximum_filter(_of_blocks(planes, np.maximum), size)
    varies: Array = np.any(most - least > EVEN * np.maximum(most, -least), axis=0)
    block = (row / BLOCK).astype(np.intp), (column / BLOCK).astype(np.intp)
    return low[:, *block], varies[block]


def _of_blocks(planes: Array, pick: np.ufunc) -> Array:
    """Return the largest or the least values (R, my, mx) of square blocks of `BLOCK` cells.

    `pick` is the maximum or the minimum of two. NumPy's `reduceat` takes four times as long.
    """
    for _ in range(2):
        found = planes[:, ::BLOCK].copy()
        for k in range(1, BLOCK):
            more = planes[:, k::BLOCK]
            inside = found[:, : more.shape[1]]
            pick(inside, more, out=inside)
        planes = found.swapaxes(1, 2)
    return planes


def _spline_down(planes: Array) -> Array:
    """Return the coefficients (ny, R, nx), along y, of the splines through means over cells.

    The means are over `FINER` cells down, of `planes` (R, ny + FINER - 1, nx), one at every cell.
    """
    ny = planes.shape[1] - FINER + 1
    down = planes[:, :ny].swapaxes(0, 1).copy()
    for k in range(1, FINER):
        down += planes[:, k : k + ny].swapaxes(0, 1)
    down *= 6 / FINER
    _sharpen(down)
    return down


def _spline_across(down: Array) -> Array:
    """Return the coefficients (nx, ny, R) of the cubic spline through the means over squares.

    `down` (ny, R, nx + FINER - 1) are those along y.
    """
    ny, count, nx = down.shape[0], down.shape[1], down.shape[2] - FINER + 1
    out: Array = np.empty((nx, ny, count), down.dtype)
    lines, turned = down.reshape(ny * count, -1), out.reshape(nx, -1)
    for some in pieces(len(lines), IN_CACHE):
        means = lines[some, :nx].copy()
        for k in range(1, FINER):
            means += lines[some, k : k + nx]
        means *= 6 / FINER
        turned[:, some] = means.T
    _sharpen(out)
    return out


def _sharpen(values: Array) -> None:
    """Turn values (n, ...) times 6 into the coefficients of the splines through them.

    Splines are mirrored at their ends. It takes half the time of SciPy's filter, which follows one
    line after the other.
    """
    pole, step = values.dtype.type(POLE), np.empty_like(values[0])
    lines = list(values)
    lines[0][...] = np.tensordot(pole ** np.arange(BEYOND), values[:BEYOND], 1)
    for last, line in pairwise(lines):
        np.multiply(last, pole, out=step)
        np.add(line, step, out=line)
    lines[-1][...] = (lines[-1] + pole * lines[-2]) * (pole / (pole**2 - 1))
    for last, line in pairwise(reversed(lines)):
        np.subtract(last, line, out=step)
        np.multiply(step, pole, out=line)


def _interpolated(spline: Array, row: Array, column: Array) -> Array:
    """Return a spline (nx, ny, R) at places (k,): (R, k).

    A sparse product shares the weights among the planes: 2.8 times as fast as SciPy's
    interpolation of four, 1.15 times of one.
    """
    from scipy import sparse

    _, ny, count = spline.shape
    flat, found = spline.reshape(-1, count), np.empty((count, len(row)), spline.dtype)
    around = np.add.outer(ny * np.arange(4), np.arange(4)).ravel().astype(np.int32)
    for some in pieces(len(row), AT_ONCE):
        (i, down), (j, across) = (_cubic_weights(at[some], spline.dtype) for at in (row, column))
        terms = (ny * j + i)[:, None] + around
        weights = across[:, :, None] * down[:, None]
        ends = np.arange(len(terms) + 1, dtype=np.int32) * 16
        matrix = sparse.csr_array(
            (weights.ravel(), terms.ravel(), ends), shape=(len(terms), len(flat))
        )
        found[:, some] = (matrix @ flat).T
    return found


def _cubic_weights(place: Array, dtype: np.dtype) -> tuple[Array, Array]:
    """Return the first of four coefficients (k,) about places, and what each counts (k, 4)."""
    first = np.floor(place).astype(np.int32)
    t = (place - first).astype(dtype)
    weights: Array = np.empty((len(t), 4), dtype)
    weights[:, 0] = (1 - t) ** 3 / 6
    weights[:, 1] = 2 / 3 - t * t * (1 - t / 2)
    weights[:, 3] = t**3 / 6
    weights[:, 2] = 1 - weights[:, 0] - weights[:, 1] - weights[:, 3]
    return first - 1, weights
