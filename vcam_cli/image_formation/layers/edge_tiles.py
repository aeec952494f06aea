"""Layers around the edges of those before them, on cells of their own: tiles of one size.

What layers hide of each other differs from ray to ray only beside edges. So of a frame those tiles
that have some are looked at, each with as much around it as blurs into it. Tiles that see the same
layers are worked on together, as many as fit the cache.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.image_formation.layers.occlusion import BlurredLayer, covariance
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.parallel import pieces, results
from vcam_cli.scenes.cells import GOLDEN, cell_means
from vcam_cli.scenes.layered import LayeredScene

SIDE = 48
"""Side of a tile, at least [pixels]."""
SIDE_IN_RADII = 4
"""The same, in radii of the widest blur: what lies around a tile is then no more than twice it."""
IN_A_STRIP = 16
"""Tiles that are painted at once, at most."""
TOGETHER = 1 << 18
"""Values of one layer that are worked on at once."""
POINTS, JUDGED = 16, 12
"""Points along each side of a tile at which its detail is judged, and tiles in which it is."""
Tile = tuple[slice, slice]
"""Rows and columns of pixels."""


def tiles_with(edges: NDArray, radius: float, whole: int) -> tuple[list[Tile], tuple[int, int]]:
    """Return the tiles of a frame that have an edge, and the rows and columns of each.

    Parameters
    ----------
    edges : NDArray
        Pixels (rows, columns) that have one.
    radius : float
        Radius of the widest blur [pixels].
    whole : int
        Number of which rows and columns are a multiple.

    Returns
    -------
    tiles : list of Tile
        Those that have an edge; the last ones may end before their size, with the frame.
    size : tuple of int
        Rows and columns [pixels].
    """
    least = max(math.ceil(SIDE_IN_RADII * radius), SIDE)
    size = [math.ceil(count / max(count // least, 1) / whole) * whole for count in edges.shape]
    rows, columns = (pieces(count, step) for count, step in zip(edges.shape, size, strict=True))
    tiles = [tile for tile in product(rows, columns) if edges[tile].any()]
    return tiles, (size[0], size[1])


def adjacent(tiles: Sequence[Tile]) -> list[list[Tile]]:
    """Return strips of some tiles, each of which begins where the one to its left ends."""
    strips: list[list[Tile]] = []
    for tile in tiles:
        last = strips[-1][-1] if strips else None
        follows = last and last[0] == tile[0] and last[1].stop == tile[1].start
        if follows and len(strips[-1]) < IN_A_STRIP:
            strips[-1].append(tile)
        else:
            strips.append([tile])
    return strips


@dataclass(frozen=True)
class Cells:
    """The cells of a tile, which begin at its first pixel's border, and those around it.

    They are as long along x and y as the pixels, times a number or divided by one.
    """

    geometry: Geometry
    per_pixel: float
    """Cells along either side of a pixel: a whole number, or the inverse of one."""
    before: tuple[int, int]
    """Rows and columns of cells before the first pixel."""
    shape: tuple[int, int]
    """Rows and columns of cells."""
    pixels: tuple[int, int]
    """Rows and columns of the tile's pixels."""

    @classmethod
    def around(
        cls, geometry: Geometry, pixels: tuple[int, int], per_pixel: int, radius: float, whole: int
    ) -> Cells:
        """Return cells as far around tiles of so many pixels as a radius [m].

        `whole` of them along either side can be taken together.
        """
        before, shape = [], []
        for count, pitch in zip(pixels, (geometry.pitch_y, geometry.pitch_x), strict=True):
            around = math.ceil(radius / pitch * per_pixel / whole) + 1
            cells = math.ceil(count * per_pixel / whole) + 2 * around
            before.append(around * whole)
            shape.append(scipy.fft.next_fast_len(cells, real=True) * whole)
        return cls(geometry, per_pixel, (before[0], before[1]), (shape[0], shape[1]), pixels)

    @property
    def sides(self) -> tuple[float, float]:
        """Of a cell along x and y [m]."""
        return self.geometry.pitch_x / self.per_pixel, self.geometry.pitch_y / self.per_pixel

    def edges(self, tile: Tile, further: int = 0) -> tuple[NDArray, NDArray]:
        """Return the edges of columns and of rows of cells around a tile [m].

        They go on for some further columns to its right.
        """
        g, (side_x, side_y) = self.geometry, self.sides
        x, y = pixel_centers(g, detector=True)
        left, top = x[tile[1].start] - g.pitch_x / 2, y[tile[0].start] - g.pitch_y / 2
        return (
            left + (np.arange(self.shape[1] + further + 1) - self.before[1]) * side_x,
            top + (np.arange(self.shape[0] + 1) - self.before[0]) * side_y,
        )

    def together(self, count: int) -> Cells:
        """Return cells that are each so many of these along either side."""
        before, shape = (
            (rows // count, columns // count) for rows, columns in (self.before, self.shape)
        )
        return replace(self, per_pixel=self.per_pixel / count, before=before, shape=shape)

    def at_pixels(self, planes: NDArray) -> NDArray:
        """Return the means over the collecting areas of a tile's pixels (..., rows, columns)."""
        g, weights = self.geometry, []
        for axis, width in enumerate(
            (g.collecting_height / g.pitch_y, g.collecting_width / g.pitch_x)
        ):
            at = self.before[axis] + (np.arange(self.pixels[axis]) + 0.5) * self.per_pixel
            one = np.eye(self.shape[axis], dtype=planes.dtype)
            weights.append(box_means(one, at, width * self.per_pixel))
        return np.asarray(weights[0] @ planes @ weights[1].T)


@dataclass(frozen=True)
class TileBatch:
    """Tiles that see the same layers."""

    tiles: list[Tile]
    numbers: list[int]
    """Of the layers in the scene, the nearest first."""
    radii: list[float]
    """Of their blurs [m]."""
    planes: list[NDArray]
    """Light of every color and opacity (tiles, C + 1, rows, columns) of each layer's cells."""

    @property
    def values(self) -> int:
        """Values of all layers."""
        return sum(planes.size for planes in self.planes)

    def together(self, count: int) -> TileBatch:
        """Return the means over so many cells along either side."""
        return replace(self, planes=[cell_means(planes, count) for planes in self.planes])

    def lacking(self, cells: Cells, rings: int, period: float) -> list[NDArray]:
        """Return the covariance (C, rows, columns) at the pixels of every tile.

        It is that by so many rings of points, with the period of the lens's cut-off [m].
        """
        side_x, side_y = cells.sides
        layers = [
            BlurredLayer(planes, (radius / side_x, radius / side_y))
            for radius, planes in zip(self.radii, self.planes, strict=True)
        ]
        light = cells.at_pixels(covariance(layers, rings, (period / side_x, period / side_y)))
        return [
            own[:, : rows.stop - rows.start, : columns.stop - columns.start]
            for own, (rows, columns) in zip(light, self.tiles, strict=True)
        ]


class Painting:
    """Tiles with the layers that are seen in each, of those that see more than one.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    scene : LayeredScene
        The scene.
    tiles : sequence of Tile
        The tiles.
    cells : Cells
        Their cells.
    """

    def __init__(
        self, path: OpticalPath, scene: LayeredScene, tiles: Sequence[Tile], cells: Cells
    ) -> None:
        self.cells = cells
        self._scene, self._mixes = scene, []
        for part in scene.parts:
            level = path.transfer.level[part.components].T
            mix = np.zeros((len(level) + 1, level.shape[1] + 1), path.settings.dtype)
            mix[:-1, :-1], mix[-1, -1] = level, 1
            self._mixes.append(mix)
        seen = results(self._visible_layers, adjacent(tiles), path.workers)
        every = [own for strip in seen for own in strip]
        found = [(place, own) for place, own in enumerate(every) if len(own) > 1]
        found.sort(key=lambda each: list(each[1]))
        self.places = [place for place, _ in found]
        """Numbers of the given tiles, in the order of the batches."""
        at_once = max(TOGETHER // (len(self._mixes[0]) * math.prod(cells.shape)), 1)
        self.batches: list[TileBatch] = []
        """The tiles, those that see the same layers together."""
        for same, members in groupby(found, lambda each: list(each[1])):
            radii = [path.layers[number].radius for number in same]
            alike = list(members)
            for some in (alike[few] for few in pieces(len(alike), at_once)):
                planes = [np.stack([layer[number] for _, layer in some]) for number in same]
                own = [tiles[place] for place, _ in some]
                self.batches.append(TileBatch(own, same, radii, planes))

    @property
    def values(self) -> int:
        """Values of all layers on all tiles."""
        return sum(batch.values for batch in self.batches)

    def _visible_layers(self, strip: list[Tile]) -> list[dict[int, NDArray]]:
        """Return the layers that are seen of each tile of a strip, by their number."""
        cells, first = self.cells, strip[0]
        starts = [round((tile[1].start - first[1].start) * cells.per_pixel) for tile in strip]
        edges = cells.edges(first, starts[-1])
        layers: list[dict[int, NDArray]] = [{} for _ in strip]
        open_tiles = list(zip(starts, layers, strict=True))
        for number, (part, mix) in enumerate(zip(self._scene.parts, self._mixes, strict=True)):
            planes = part.chart.averages(*edges, mix)
            hidden = []
            for start, seen in open_tiles:
                own = planes[..., start : start + cells.shape[1]]
                if own[-1].any():
                    seen[number] = own.copy()  # lets go of the strip
                hidden.append(own[-1].min() >= 1)
            open_tiles = [tile for tile, gone in zip(open_tiles, hidden, strict=True) if not gone]
            if not open_tiles:
                break
        return layers

    def unresolved(self, count: int) -> float:
        """Return what detail of two layers that lies within cells could hide of each other, rms.

        It is the product of mean deviations from the means over two cells of so many of these along
        either side, as if all of it lay behind each other: [e/s] in the color where it is most.
        """
        every = [(batch, k) for batch in self.batches for k in range(len(batch.tiles))]
        chosen = every[:: max(len(every) // JUDGED, 1)]
        squares = [np.square(self._hidden_detail(batch, k, count)) for batch, k in chosen]
        return math.sqrt(float(np.mean(squares, axis=0).max())) if squares else 0.0

    def _hidden_detail(self, batch: TileBatch, k: int, count: int) -> NDArray:
        """Return the same of a tile (C,) [e/s]."""
        edges, indices = self.cells.edges(batch.tiles[k]), []
        for n in self.cells.shape[::-1]:
            indices.append(np.unique(np.linspace(0, n - 1, POINTS).astype(int)))
        x, y = (
            cells[index] + (cells[1] - cells[0]) * (np.arange(len(index)) * step % 1)
            for cells, index, step in zip(edges, indices, (GOLDEN, GOLDEN**2), strict=True)
        )
        columns, rows = (index // (2 * count) for index in indices)
        deviations, means = [], []
        for number, planes in zip(batch.numbers, batch.planes, strict=True):
            blocks = cell_means(planes[k], 2 * count)[:, rows[:, None], columns]
            points = self._scene.parts[number].chart.values(x, y, self._mixes[number])
            deviations.append(np.abs(points - blocks).mean(axis=(1, 2)))
            means.append(planes[k, :-1].mean(axis=(1, 2)))
        total = np.zeros(len(means[0]))
        for front in range(len(means) - 1):
            for back in range(front + 1, len(means)):
                behind = np.max(means[back + 1 :], axis=0) if back + 1 < len(means) else 0.0
                seen = deviations[back][:-1] + deviations[back][-1] * behind
                total += deviations[front][-1] * seen
        return total


def box_means(plane: NDArray, at: NDArray, width: float) -> NDArray:
    """Return the means of even rows over boxes of a width around places, counted in rows."""
    sums = np.concatenate([np.zeros_like(plane[:1]), np.cumsum(plane, axis=0)])
    low, high = (_interpolated(sums, at + side * width / 2) for side in (-1, 1))
    return (high - low) / plane.dtype.type(width)


def _interpolated(plane: NDArray, at: NDArray) -> NDArray:
    """Return a plane straight between its rows, at places counted in rows."""
    index = np.clip(at.astype(int), 0, len(plane) - 2)
    part = (at - index).astype(plane.dtype)[:, None]
    return np.asarray(plane[index] * (1 - part) + plane[index + 1] * part)
