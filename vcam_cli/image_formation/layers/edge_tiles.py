"""Layers around the edges of those before them, on cells of their own: tiles of one size.

What layers hide of each other differs from ray to ray only beside edges. So of a frame those tiles
that have some are looked at, each with as much around it as blurs into it. Tiles that see the same
layers are worked on together, as many as fit the cache.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.image_formation.layers.occlusion import BlurredLayer, covariance
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.parallel import results
from vcam_cli.scenes.layered import LayeredScene

SIDE = 48
"""Side of a tile, at least [pixels]."""
AROUND = 4
"""The same, in radii of the widest blur: so much does a tile see around it."""
TOGETHER = 1 << 18
"""Values of one layer that are worked on at once."""
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
    least = max(math.ceil(AROUND * radius), SIDE)
    size = [math.ceil(count / max(count // least, 1) / whole) * whole for count in edges.shape]
    rows, columns = (
        [slice(start, min(start + step, count)) for start in range(0, count, step)]
        for count, step in zip(edges.shape, size, strict=True)
    )
    tiles = [tile for tile in product(rows, columns) if edges[tile].any()]
    return tiles, (size[0], size[1])


@dataclass(frozen=True)
class Cells:
    """The cells of a tile, which begin at its first pixel's border, and those around it."""

    geometry: Geometry
    side: float
    """Of a cell [m]."""
    before: int
    """Cells before the first pixel, in either direction."""
    shape: tuple[int, int]
    """Rows and columns of cells."""
    pixels: tuple[int, int]
    """Rows and columns of the tile's pixels."""

    @classmethod
    def around(
        cls, geometry: Geometry, pixels: tuple[int, int], side: float, radius: float, whole: int = 1
    ) -> Cells:
        """Return the cells of a side, as far around tiles of so many pixels as a radius [m].

        `whole` of them and more can be taken together.
        """
        before = math.ceil(radius / side / whole) + 1
        shape = [
            scipy.fft.next_fast_len(math.ceil(n * pitch / side / whole) + 2 * before, real=True)
            for n, pitch in zip(pixels, (geometry.pitch_y, geometry.pitch_x), strict=True)
        ]
        cells = shape[0] * whole, shape[1] * whole
        return cls(geometry, side, before * whole, cells, pixels)

    def edges(self, tile: Tile) -> tuple[NDArray, NDArray]:
        """Return the edges of columns and of rows of cells around a tile [m]."""
        g, (rows, columns) = self.geometry, self.shape
        x, y = pixel_centers(g, detector=True)
        left, top = x[tile[1].start] - g.pitch_x / 2, y[tile[0].start] - g.pitch_y / 2
        return (
            left + (np.arange(columns + 1) - self.before) * self.side,
            top + (np.arange(rows + 1) - self.before) * self.side,
        )

    def together(self, count: int) -> Cells:
        """Return cells that are each so many of these along either side."""
        rows, columns = self.shape
        return replace(
            self,
            side=self.side * count,
            before=self.before // count,
            shape=(rows // count, columns // count),
        )

    def at_pixels(self, planes: NDArray) -> NDArray:
        """Return the means over the collecting areas of a tile's pixels (..., rows, columns)."""
        g, weights = self.geometry, []
        for count, pitch, width, cells in (
            (self.pixels[0], g.pitch_y, g.collecting_height, self.shape[0]),
            (self.pixels[1], g.pitch_x, g.collecting_width, self.shape[1]),
        ):
            at = self.before + (np.arange(count) + 0.5) * pitch / self.side
            one = np.eye(cells, dtype=planes.dtype)
            weights.append(box_means(one, at, width / self.side))
        return np.asarray(weights[0] @ planes @ weights[1].T)


@dataclass(frozen=True)
class TileBatch:
    """Tiles that see the same layers."""

    tiles: list[Tile]
    radii: list[float]
    """Of the layers' blurs [m], the nearest first."""
    planes: list[NDArray]
    """Light of every color and opacity (tiles, C + 1, rows, columns) of each layer's cells."""

    @property
    def values(self) -> int:
        """Values of all layers."""
        return sum(planes.size for planes in self.planes)

    def together(self, count: int) -> TileBatch:
        """Return the means over so many cells along either side."""
        if count == 1:
            return self
        planes = []
        for fine in self.planes:
            *other, rows, columns = fine.shape
            apart = fine.reshape(*other, rows // count, count, columns // count, count)
            planes.append(apart.mean(axis=(-3, -1), dtype=fine.dtype))
        return replace(self, planes=planes)

    def lacking(self, cells: Cells, rings: int, period: float) -> list[NDArray]:
        """Return the covariance (C, rows, columns) at the pixels of every tile.

        It is that by so many rings of points, with the period of the lens's cut-off [m].
        """
        layers = [
            BlurredLayer(planes, radius / cells.side)
            for radius, planes in zip(self.radii, self.planes, strict=True)
        ]
        light = cells.at_pixels(covariance(layers, rings, period / cells.side))
        return [
            own[:, : rows.stop - rows.start, : columns.stop - columns.start]
            for own, (rows, columns) in zip(light, self.tiles, strict=True)
        ]


def painted(
    path: OpticalPath, scene: LayeredScene, tiles: Sequence[Tile], cells: Cells
) -> list[TileBatch]:
    """Return tiles with the layers that are seen in each.

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

    Returns
    -------
    list of TileBatch
        The tiles, those that see the same layers together.
    """
    mixes = []
    for part in scene.parts:
        level = path.transfer.level[part.components].T
        mix = np.zeros((len(level) + 1, level.shape[1] + 1), path.settings.dtype)
        mix[:-1, :-1], mix[-1, -1] = level, 1
        mixes.append(mix)

    def seen(tile: Tile) -> list[tuple[int, NDArray]]:
        edges, layers = cells.edges(tile), []
        for number, (part, mix) in enumerate(zip(scene.parts, mixes, strict=True)):
            planes = part.chart.averages(*edges, mix)
            if planes[-1].any():
                layers.append((number, planes))
            if planes[-1].min() >= 1:
                break
        return layers

    def numbers(number: int) -> list[int]:
        return [layer for layer, _ in found[number]]

    found = results(seen, tiles, path.workers)
    batches = []
    for same, members in groupby(sorted(range(len(tiles)), key=numbers), numbers):
        radii = [path.layers[layer].radius for layer in same]
        size = len(mixes[0]) * math.prod(cells.shape)
        for some in _parts(list(members), max(TOGETHER // size, 1)):
            planes = [np.stack([found[k][n][1] for k in some]) for n in range(len(same))]
            batches.append(TileBatch([tiles[k] for k in some], radii, planes))
    return batches


def _parts(items: list[int], count: int) -> Iterator[list[int]]:
    for start in range(0, len(items), count):
        yield items[start : start + count]


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
