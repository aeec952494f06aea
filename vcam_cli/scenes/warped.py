"""A chart as a lens images it that displaces what it images.

Cells of the sensor see parts of the chart that are no rectangles. The chart is painted flat, as
means over overlapping squares; between them a cubic spline gives the mean over a square anywhere.
What a cell sees is taken as one square about its center, where it is nearly one, and else as four
that have its second moments together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import pieces, product
from vcam_cli.scenes.base import Chart
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
        found_x, found_y = self._sums(self.series, inside_x, inside_y)
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
                (self._sums(series, inside_x, inside_y) for series in self._derivatives),
                size,
                strict=True,
            )
        )
        return Moments(*(along_x[i] * along_x[j] + along_y[i] * along_y[j] for i, j in PAIRS))

    def _sums(self, series: Array, x: Array, y: Array) -> tuple[Array, Array]:
        """Return both sums (m, n) of series (2, k, l) at places of the rectangle."""
        along_x, along_y = (
            np.polynomial.chebyshev.chebvander(at / half, count - 1)
            for at, half, count in zip((x, y), self.half, series.shape[:0:-1], strict=True)
        )
        found_x, found_y = (product(product(along_y, each), along_x.T) for each in series)
        return found_x, found_y

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
        x, y = self._sums(self.series, ends * self.half[0], ends * self.half[1])
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

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells between edges, of one size, into an array."""
        x, y = ((edges[1:] + edges[:-1]) / 2 for edges in (x_edges, y_edges))
        width, height = ((e[-1] - e[0]) / (len(e) - 1) for e in (x_edges, y_edges))
        size = width, height
        count = max(1, min(math.ceil(max(size) / self.widest - SLIVER), MOST_PARTS))
        self._paint(x, y, size, count, mix, out)

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
        from scipy import ndimage

        centers = self.sees.on_grid(*places)
        side, ways = self._squares(places, size)
        grids = [
            _Grid.around([c + way[axis] for way in ways], side * size[axis] / FINER)
            for axis, c in enumerate(centers)
        ]
        painted = math.prod(grid.count for grid in grids)
        axis = int(len(places[1]) > len(places[0]))
        if painted > MOST_FINER * FINER**2 * (centers[0].size + TILE) and len(places[axis]) > 1:
            halves = (self._tile(half, size, mix) for half in _halves(places, axis))
            return np.concatenate(list(halves), axis=2 - axis)
        x, y = (grid.edges for grid in grids)
        planes = self.chart.crop_to_cells(x, y).averages(x, y, mix)
        splines = [
            ndimage.spline_filter(_square_means(plane), output=plane.dtype, mode="mirror")
            for plane in planes
        ]
        out = np.zeros((len(mix), *centers[0].shape), mix.dtype)
        for way in ways:
            column, row = (g.index(c + w) for g, c, w in zip(grids, centers, way, strict=True))
            for found, spline in zip(out, splines, strict=True):
                found += ndimage.map_coordinates(
                    spline, (row, column), output=spline.dtype, mode="mirror", prefilter=False
                )
        out /= len(ways)
        return out

    def _squares(
        self, places: tuple[Array, Array], size: tuple[float, float]
    ) -> tuple[float, Sequence[tuple[Array, Array]]]:
        """Return the side of squares over that of the cells, and where they lie about the centers.

        There is one square where it has nearly the second moments of what the cells see.
        """
        x, y = places
        few_x, few_y = (np.linspace(at[0], at[-1], LOOKS_IN_TILE) for at in places)
        least, most = self.sees.seen_moments(few_x, few_y, size).ends
        low, high = float(least.min()), float(most.max())
        if (high - low) / 2 * max(size) ** 2 / 12 <= self.alike:
            return math.sqrt((low + high) / 2), [(np.zeros(1), np.zeros(1))]
        moments = self.sees.seen_moments(x, y, size)
        low = float(moments.ends[0].min())
        root = moments.excess_over(low).root
        width, height = (length / math.sqrt(12) for length in size)
        return math.sqrt(low), [
            (width * (a * root.xx + b * root.xy), height * (a * root.xy + b * root.yy))
            for a, b in CORNERS
        ]

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values (R, len(y), len(x)) at points, straight between closely spaced ones."""
        out = np.zeros((len(mix), len(y), len(x)), mix.dtype)
        for rows in pieces(len(y), TILE):
            for columns in pieces(len(x), TILE):
                at = self.sees.on_grid(x[columns], y[rows])
                out[:, rows, columns] = self._values(at, mix)
        return out

    def _values(self, at: tuple[Array, Array], mix: Array) -> Array:
        from scipy.ndimage import map_coordinates

        axes = []
        for axis, place in enumerate(at):
            along = np.abs(np.diff(place, axis=1 - axis)) if place.shape[1 - axis] > 1 else place
            step = max(float(along.min()), np.ptp(place) / (POINTS * TILE), 1e-12) / POINTS
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


def _halves(places: tuple[Array, Array], axis: int) -> list[tuple[Array, Array]]:
    """Return both halves of columns and rows, across an axis."""
    x, y = places
    halves = np.array_split(places[axis], 2)
    return [(x, half) if axis else (half, y) for half in halves]


def _square_means(plane: Array) -> Array:
    """Return the means over squares of `FINER` cells along each side, one at every cell."""
    rows, columns = (count - FINER + 1 for count in plane.shape)
    tall = np.sum([plane[k : k + rows] for k in range(FINER)], axis=0)
    return np.asarray(np.sum([tall[:, k : k + columns] for k in range(FINER)], axis=0) / FINER**2)
