"""A chart as a lens images it that displaces what it images.

Cells of the sensor see parts of the chart that are no rectangles. Each is taken as two boxes, side
by side along a diagonal, that have its center and its second moments. The chart is painted on finer
cells, whose sums from the corner on give the mean over any box by four of their values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

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
TILE = 128
"""Cells along each side that are painted at once: over them the lens's scale hardly changes."""
FINER = 2.0
"""Finer cells along the side of the smallest box: an edge between them moves no center, and blurs
by a quarter of what the box does, in second moments."""
MOST_FINER = 8.0
"""Finer cells in a tile over its cells times `FINER` squared, at most: it is halved beyond."""
POINTS = 4.0
"""Points of a chart along the distance of the nearest requested ones: between them its
values are interpolated linearly."""
DEGREES = (16, 32, 64, 128)
"""Degrees of the series of a map that are tried."""
PRECISE = 1e-11
"""Coefficients over the largest that a series does without: 1e-7 pixels of 10,000."""
MOST_APART = 0.3
"""Part of the second moments along x and y that the distance of two boxes makes, at most."""
ROUND = 1e-3
"""Distance of two boxes below which they are one [finer cells]."""
LOOKS = 33
"""Places along each side of the map at which its scale is looked at."""

Places = Callable[[Array, Array], tuple[Array, Array]]
"""From places x, y of one shape to where they look [m]; NaN for those that see nothing."""


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
        along_x, beyond_x = self._terms(x, self.half[0])
        along_y, beyond_y = self._terms(y, self.half[1])
        found_x, found_y = (product(product(along_y, s), along_x.T) for s in self.series)
        found_x += self._slopes[0] * beyond_x
        found_y += self._slopes[1] * beyond_y[:, None]
        return found_x, found_y

    def _terms(self, at: Array, half: float) -> tuple[Array, Array]:
        inside = np.clip(at, -half, half)
        terms = np.polynomial.chebyshev.chebvander(inside / half, self.series.shape[1] - 1)
        return terms, at - inside

    @cached_property
    def _slopes(self) -> tuple[float, float]:
        """Mean scale along both axes."""
        ends = np.array([-1.0, 1.0])
        x, y = self.on_grid_inside(ends * self.half[0], ends * self.half[1])
        return (
            float((x[:, 1] - x[:, 0]).mean() / (2 * self.half[0])),
            float((y[1] - y[0]).mean() / (2 * self.half[1])),
        )

    def on_grid_inside(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the same of places that lie in the rectangle."""
        along_x, along_y = self._terms(x, self.half[0])[0], self._terms(y, self.half[1])[0]
        found_x, found_y = (product(product(along_y, s), along_x.T) for s in self.series)
        return found_x, found_y

    @cached_property
    def _jacobian(self) -> tuple[Array, Array]:
        """Derivatives of the places seen (2, m, n) along x and along y, at some places."""
        x, y = (np.linspace(-1, 1, LOOKS) * half for half in self.half)
        seen = np.array(self.on_grid_inside(x, y))
        return np.gradient(seen, x, axis=2), np.gradient(seen, y, axis=1)

    @cached_property
    def scales(self) -> tuple[float, float]:
        """Mean of the larger scale over the rectangle, and the largest: lengths seen over own."""
        jacobian = np.moveaxis(np.array(self._jacobian), (0, 1), (-1, -2))
        larger = np.linalg.svd(jacobian, compute_uv=False)[..., 0]
        return float(larger.mean()), float(larger.max())

    @cached_property
    def skew(self) -> float:
        """Largest second moment across x and y of what a square sees, over its mean one."""
        along_x, along_y = self._jacobian
        moments = [along_x[i] * along_x[j] + along_y[i] * along_y[j] for i, j in ((0, 0), (1, 1))]
        across = along_x[0] * along_x[1] + along_y[0] * along_y[1]
        return float(np.abs(2 * across / (moments[0] + moments[1])).max())


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
    """Largest width of cells represented by boxes; wider ones are painted in parts [m]."""

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
        return densest.scaled(self.sees.scales[0])

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells between edges into an array."""
        width = max(float(np.diff(edges[:2])[0]) for edges in (x_edges, y_edges))
        parts = min(math.ceil(width / self.widest - SLIVER), MOST_PARTS)
        if parts > 1:
            self._paint_in_parts(x_edges, y_edges, mix, out, parts)
        else:
            self._paint_tiles(x_edges, y_edges, mix, out)

    def _paint_tiles(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        for rows in pieces(len(y_edges) - 1, TILE):
            for columns in pieces(len(x_edges) - 1, TILE):
                self._paint_tile(
                    x_edges[columns.start : columns.stop + 1],
                    y_edges[rows.start : rows.stop + 1],
                    mix,
                    out[:, rows, columns],
                )

    def _paint_in_parts(
        self, x_edges: Array, y_edges: Array, mix: Array, out: Array, parts: int
    ) -> None:
        """Write the means over `parts` parts along each side of every cell."""
        x, y = (
            np.interp(np.arange(parts * (len(e) - 1) + 1) / parts, np.arange(len(e)), e)
            for e in (x_edges, y_edges)
        )
        for rows in pieces(len(y_edges) - 1, TILE):
            y_parts = y[parts * rows.start : parts * rows.stop + 1]
            planes = np.empty((len(mix), len(y_parts) - 1, len(x) - 1), mix.dtype)
            self._paint_tiles(x, y_parts, mix, planes)
            out[:, rows] = cell_means(planes, parts)

    def _paint_tile(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        boxes = _Boxes.of_cells(self.sees.on_grid(x_edges, y_edges))
        pitch = [least / FINER for least in boxes.least]
        first, last = boxes.ends
        counts = [math.ceil((b - a) / p) + 2 for a, b, p in zip(first, last, pitch, strict=True)]
        cells = (len(x_edges) - 1, len(y_edges) - 1)
        if math.prod(counts) > MOST_FINER * FINER**2 * (math.prod(cells) + TILE):
            axis = int(cells[1] > cells[0])
            if cells[axis] > 1:
                self._paint_halves((x_edges, y_edges), mix, out, axis)
                return
        x, y = (a - p + p * np.arange(n + 1) for a, p, n in zip(first, pitch, counts, strict=True))
        planes = self.chart.crop_to_cells(x, y).averages(x, y, mix)
        out[:] = _box_means(planes, (x, y), boxes)

    def _paint_halves(self, edges: tuple[Array, Array], mix: Array, out: Array, axis: int) -> None:
        """Paint a tile in two parts, across one axis."""
        cells = len(edges[axis]) - 1
        for part in (slice(0, cells // 2), slice(cells // 2, cells)):
            x, y = edges
            own = edges[axis][part.start : part.stop + 1]
            if axis == 0:
                self._paint_tile(own, y, mix, out[:, :, part])
            else:
                self._paint_tile(x, own, mix, out[:, part])

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
class _Boxes:
    """What cells see of a chart: boxes of one size, in pairs about a center."""

    x: Array
    """Centers of the pairs (m, n) [m]."""
    y: Array
    width: Array
    """Square roots of twelve times the second moments, widths of a single box (m, n) [m]."""
    height: Array
    across: Array
    """Second moment across x and y [m2]."""

    @classmethod
    def of_cells(cls, corners: tuple[Array, Array]) -> _Boxes:
        """Return the boxes of cells whose corners (m + 1, n + 1) look at places x, y [m]."""
        centers, along_x, along_y = [], [], []
        for seen in corners:
            left = seen[1:] + seen[:-1]
            top = seen[:, 1:] + seen[:, :-1]
            along_x.append((left[:, 1:] - left[:, :-1]) / 2)
            along_y.append((top[1:] - top[:-1]) / 2)
            centers.append((left[:, 1:] + left[:, :-1]) / 4)
        (x, y), (width, height) = centers, (np.hypot(along_x[n], along_y[n]) for n in (0, 1))
        across = (along_x[0] * along_x[1] + along_y[0] * along_y[1]) / 12
        return cls(x, y, width, height, across)

    @property
    def least(self) -> tuple[float, float]:
        """Least width and height [m]."""
        return float(self.width.min()), float(self.height.min())

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Left and upper, right and lower end of all of them [m]."""
        half_x, half_y = self.width, self.height  # of pairs, more than enough
        first = float((self.x - half_x).min()), float((self.y - half_y).min())
        return first, (float((self.x + half_x).max()), float((self.y + half_y).max()))

    @property
    def halves(self) -> tuple[Array, Array, Array, Array]:
        """Displacements of a pair from its center along x and y, its width and height [m].

        The pair has the second moments of what its cell sees.
        """
        ratio = self.width / self.height
        size = np.abs(self.across)
        most = [MOST_APART * length**2 / 12 for length in (self.width, self.height)]
        size = np.minimum(size, np.minimum(most[0] / ratio, most[1] * ratio))
        dx = np.sqrt(size * ratio)
        dy = np.copysign(np.sqrt(size / ratio), self.across)
        width, height = (
            np.sqrt(np.square(length) - 12 * np.square(apart))
            for length, apart in ((self.width, dx), (self.height, dy))
        )
        return dx, dy, width, height


def _box_means(planes: Array, edges: Sequence[Array], box: _Boxes) -> Array:
    """Return the means (R, m, n) over boxes of planes (R, rows, columns) on cells between edges."""
    from scipy.sparse import csr_array

    x, y = edges
    pitch = float(x[1] - x[0]), float(y[1] - y[0])
    dx, dy, width, height = box.halves
    weights, index = [], []
    for sign in (-1, 1) if np.abs(dx).max() > ROUND * pitch[0] else (0,):
        columns, across = _ends(box.x + sign * dx - x[0], width, pitch[0], len(x))
        rows, down = _ends(box.y + sign * dy - y[0], height, pitch[1], len(y))
        index.append((rows[:, :, None] * len(x) + columns[:, None, :]).reshape(len(rows), -1))
        weights.append((down[:, :, None] * across[:, None, :]).reshape(len(rows), -1))
    taps = np.concatenate(weights, axis=1) / len(weights)
    starts = np.arange(len(taps) + 1, dtype=np.int32) * taps.shape[1]
    at = np.concatenate(index, axis=1).reshape(-1)
    means = csr_array((taps.reshape(-1), at, starts), (len(taps), len(x) * len(y)))
    sums = np.zeros((len(y), len(x), len(planes)))
    for number, plane in enumerate(planes):
        sums[1:, 1:, number] = plane.cumsum(axis=0, dtype=float).cumsum(axis=1)
    found = means @ sums.reshape(-1, len(planes))
    return np.moveaxis(found.reshape(*box.x.shape, -1), -1, 0)


def _ends(place: Array, size: Array, pitch: float, count: int) -> tuple[Array, Array]:
    """Return the sums that make means along an axis, their indices and weights (cells, 4).

    Sums are straight between their places: the mean is what they grow by from one end of the box
    to the other, over its width, counted in cells.
    """
    center, width = place.ravel() / pitch, size.ravel() / pitch
    index = np.empty((len(center), 4), np.int32)
    weights = np.empty((len(center), 4))
    for side, sign in ((0, -1), (1, 1)):
        end = center + sign / 2 * width
        low = np.clip(end.astype(np.int32), 0, count - 2)
        part = end - low
        index[:, 2 * side], index[:, 2 * side + 1] = low, low + 1
        weights[:, 2 * side], weights[:, 2 * side + 1] = (1 - part) * sign, part * sign
    return index, weights / width[:, None]
