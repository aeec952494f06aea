"""A picture as a chart: its averages over cells of any size, at any place."""

import math
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import pieces, product, rows_at_once
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import SPARSE, Chart, Frame, PaintedCells
from vcam_cli.scenes.cells import clip_cells
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region, counted_height

Inside = tuple[slice, Array, Array]
"""Cells along an axis, the part of each that is inside a frame, and their edges in it [m]."""


@dataclass(frozen=True, eq=False)
class PictureChart(Chart):
    """Samples of a picture as even squares of light in a frame around the origin."""

    picture: Array
    """Values (h, w, K)."""
    frame: Frame
    mirrored: bool
    """Whether the picture goes on beyond its frame as its mirror image; else all is 0 there."""

    @cached_property
    def brightest(self) -> float:
        """Brightest light, relative to the perfect white."""
        return float(self.picture.max())

    @cached_property
    def is_even(self) -> bool:
        """Whether all samples are the same."""
        return bool((self.picture == self.picture[0, 0]).all())

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the exact averages over the cells."""
        height, width, channels = self.picture.shape
        down, rows = self._shares(y_edges * (height / self.frame.height) + height / 2, height)
        across, columns = self._shares(x_edges * (width / self.frame.width) + width / 2, width)
        seen = self.picture[rows, columns]
        lines = product((down @ seen.reshape(len(seen), -1)).reshape(-1, channels), mix.T)
        lines = lines.reshape(len(out[0]), -1, len(mix))
        for plane, one in zip(out, np.moveaxis(lines, 2, 0), strict=True):
            plane[:] = (across @ one.T).T

    def painting_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of temporary arrays: rows of samples, mixed, and cells of a plane."""
        _, width, channels = self.picture.shape
        width = min(width, math.ceil(cells.extent[0] * width / self.frame.width) + 2)
        of_sample = self.picture.itemsize * channels + cells.values
        return int(cells.shape[0] * width * of_sample + self.picture.itemsize * cells.count)

    def kept_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of the library that shares samples among cells."""
        return SPARSE

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the samples at points."""
        height, width, _ = self.picture.shape
        rows, lit_rows = self._index(y * (height / self.frame.height) + height / 2, height)
        columns, lit_columns = self._index(x * (width / self.frame.width) + width / 2, width)
        found = self.picture[np.ix_(rows, columns)] * np.outer(lit_rows, lit_columns)[..., None]
        return np.asarray(np.moveaxis(found @ np.asarray(mix).T, -1, 0), mix.dtype)

    def edges(self) -> tuple[Array, Array] | None:
        """Return the border of a picture that is a single sample, if it has one."""
        if self.picture.shape[:2] != (1, 1):
            return None
        half = self.frame.width / 2, self.frame.height / 2
        x, y = (np.empty(0) if self.mirrored else np.array([-end, end]) for end in half)
        return x, y

    def sample_borders(self, x_edges: Array, y_edges: Array) -> tuple[Array, Array]:
        """Return the borders of the samples within cells."""

        def along(edges: Array, size: float, count: int) -> Array:
            pitch = size / count
            first, last = edges[0] / pitch + count / 2, edges[-1] / pitch + count / 2
            if not self.mirrored:
                first, last = max(first, 0.0), min(last, count)
            return (np.arange(math.ceil(first), math.floor(last) + 1) - count / 2) * pitch

        height, width, _ = self.picture.shape
        return along(x_edges, self.frame.width, width), along(y_edges, self.frame.height, height)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the steps from sample to sample, and of the picture's border."""
        key = np.asarray(level, self.picture.dtype).tobytes(), ceiling
        if key not in self._energies:
            self._energies[key] = self._edges_times_length(level, ceiling)
        area = self.frame.width * self.frame.height if self.mirrored else region.area
        return EdgeEnergy(aligned=self._energies[key] / area)

    @cached_property
    def _energies(self) -> dict[tuple[bytes, float], float]:
        """Energy times area by level and ceiling: every region has the same of it."""
        return {}

    def _edges_times_length(self, level: Array, ceiling: float) -> float:
        height, width, _ = self.picture.shape
        down, across = self.frame.height / height, self.frame.width / width
        level = np.asarray(level, self.picture.dtype).reshape(self.picture.shape[2], -1)
        around = 0 if self.mirrored else 1
        end = np.zeros((around, width, level.shape[1]), level.dtype)
        above, total = end, 0.0
        for rows in pieces(height, rows_at_once(level.size * width)):  # in half the time of all
            light = self.picture[rows] @ level
            last = end if rows.stop == height else end[:0]
            lines = np.concatenate([above, light, last])
            wide = np.pad(light, ((0, 0), (around, around), (0, 0)))
            for steps, length in (
                (counted_height(wide[:, 1:], wide[:, :-1], ceiling), down),
                (counted_height(lines[1:], lines[:-1], ceiling), across),
            ):
                total += length * float(steps.sum(dtype=float))
            above = light[-1:]
        return total

    def channel(self, number: int) -> "PictureChart":
        """Return one of its channels alone.

        Parameters
        ----------
        number : int
            Number of the channel.

        Returns
        -------
        PictureChart
            A picture of one channel.
        """
        return replace(self, picture=self.picture[..., number, None])

    @property
    def squared(self) -> "PictureChart":
        """Return the same chart of squared values."""
        return replace(self, picture=np.square(self.picture))

    def inside(self, x_edges: Array, y_edges: Array) -> tuple[Inside, Inside]:
        """Return the cells that the picture reaches, and what of each is inside its frame.

        Parameters
        ----------
        x_edges, y_edges : Array
            Rising edges of the cells [m].

        Returns
        -------
        columns, rows : Inside
            Those cells, the part of each that is inside, and their edges, cut to the frame [m].
        """
        if self.mirrored:
            x, y = ((slice(0, len(e) - 1), np.ones(len(e) - 1), e) for e in (x_edges, y_edges))
        else:
            x = clip_cells(x_edges, self.frame.width / 2)
            y = clip_cells(y_edges, self.frame.height / 2)
        return x, y

    def _shares(self, edges: Array, count: int) -> tuple[Any, slice]:
        """Return what of each cell is each sample's, a sparse matrix, and the samples that occur.

        Edges are counted in samples.
        """
        from scipy.sparse import csr_array

        cells = len(edges) - 1
        # Where nothing is beyond the picture, a cell that is wider has no more samples than it.
        ends = np.clip(edges, 0, count) if not self.mirrored else edges
        first, last = np.floor(ends[:-1]).astype(int), np.ceil(ends[1:]).astype(int)
        most = max(int((last - first).max()), 1)
        sample = first[:, None] + np.arange(most)
        inside = np.minimum(sample + 1, edges[1:, None]) - np.maximum(sample, edges[:-1, None])
        share = np.maximum(inside, 0) / np.diff(edges)[:, None]
        index, lit = self._fold(sample, count)
        share = np.where(lit, share, 0).astype(self.picture.dtype)
        low, high = int(index.min()), int(index.max()) + 1
        starts = np.arange(cells + 1) * most
        matrix = csr_array((share.ravel(), index.ravel() - low, starts), (cells, high - low))
        return matrix, slice(low, high)

    def _index(self, place: Array, count: int) -> tuple[Array, Array]:
        """Return the sample at places, counted in samples, and 1 where there is one, else 0."""
        return self._fold(np.floor(place).astype(int), count)

    def _fold(self, index: Array, count: int) -> tuple[Array, Array]:
        """Return the sample that stands at an index, and whether there is one."""
        if not self.mirrored:
            return np.clip(index, 0, count - 1), (index >= 0) & (index < count)
        index = index % (2 * count)
        return np.minimum(index, 2 * count - 1 - index), np.ones(index.shape, bool)


@dataclass(frozen=True, eq=False)
class CubeChart(PictureChart):
    """A cube of spectra as such a chart."""

    units: Array
    """Value of band k at which component k is 1 (bands,)."""

    @cached_property
    def brightest(self) -> float:
        """Brightest light of a band over that of white there."""
        return float((self.picture.reshape(-1, len(self.units)).max(axis=0) / self.units).max())

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the exact averages over the cells of the few mixtures."""
        height, width, _ = self.picture.shape
        down, rows = self._shares(y_edges * (height / self.frame.height) + height / 2, height)
        across, columns = self._shares(x_edges * (width / self.frame.width) + width / 2, width)
        seen = self.picture[rows, columns] @ np.asarray(mix / self.units, self.picture.dtype).T
        lines = (down @ seen.reshape(len(seen), -1)).reshape(len(out[0]), -1, len(mix))
        for plane, one in zip(out, np.moveaxis(lines, 2, 0), strict=True):
            plane[:] = (across @ one.T).T

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the samples at points."""
        return super().values(x, y, np.asarray(mix / self.units, mix.dtype))

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the steps from sample to sample, and of the cube's border."""
        return super().edge_energy(region, np.asarray(level / self.units), ceiling)
