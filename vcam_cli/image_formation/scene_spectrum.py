"""The cosine spectrum of a scene: DCT-II coefficients of its planes.

Planes of samples are transformed. A chart of even rectangles is never sampled: its coefficients
are known in closed form, and few numbers along each axis make all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise
from typing import Protocol

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.parallel import each, pieces, product, rows_at_once, slices_within
from vcam_cli.scenes.base import Rectangles

Index = NDArray | slice


class SceneSpectrum(Protocol):
    """DCT-II coefficients of R planes along y and x, unnormalized."""

    @property
    def dtype(self) -> np.dtype: ...

    def __len__(self) -> int: ...

    def rows(self, plane: int, index: Index, count: int | None = None) -> NDArray:
        """Rows of a plane's first `count` coefficients along x, or all: (n, up to count)."""

    def products(self, y: NDArray, x: NDArray, workers: int) -> NDArray:
        """Sums of the product of two planes' coefficients over blocks of terms, for all `pairs`.

        y, x: edges of the blocks along each axis, rising from 0. Returns (pairs, blocks along y,
        blocks along x) in 64 bits.
        """


def pairs(planes: int) -> list[tuple[int, int]]:
    """The pairs (r, s), r <= s, of so many planes."""
    return list(combinations_with_replacement(range(planes), 2))


@dataclass(frozen=True, eq=False)
class SampledSpectrum:
    """The spectrum of planes of samples."""

    coefficients: NDArray
    """(R, ny, nx)"""

    @property
    def dtype(self) -> np.dtype:
        return self.coefficients.dtype

    def __len__(self) -> int:
        return len(self.coefficients)

    def rows(self, plane: int, index: Index, count: int | None = None) -> NDArray:
        return self.coefficients[plane, index, :count]

    def products(self, y: NDArray, x: NDArray, workers: int) -> NDArray:
        every = pairs(len(self))
        return np.array([self._pair_products(pair, y, x, workers) for pair in every])

    def _pair_products(
        self, pair: tuple[int, int], y: NDArray, x: NDArray, workers: int
    ) -> NDArray:
        first, second = (self.coefficients[plane, :, : x[-1]] for plane in pair)
        out = np.empty((len(y) - 1, len(x) - 1))

        def add(blocks: slice) -> None:
            edges = y[blocks.start : blocks.stop + 1]
            sums = np.zeros((len(edges) - 1, len(x) - 1))
            for rows in slices_within(slice(edges[0], edges[-1]), longest):
                both = np.add.reduceat(first[rows] * second[rows], x[:-1], axis=1)
                sums += np.add.reduceat(both, edges[:-1] - edges[0], axis=0)
            out[blocks] = sums

        longest = rows_at_once(x[-1])
        each(add, _block_groups(y, longest), workers)
        return out


def _block_groups(edges: NDArray, longest: int) -> list[slice]:
    """Neighboring blocks of terms, together at most `longest` terms or one block alone."""
    out, start = [], 0
    for stop in range(1, len(edges)):
        if stop + 1 == len(edges) or edges[stop + 1] - edges[start] > longest:
            out.append(slice(start, stop))
            start = stop
    return out


def transform_planes(planes: NDArray, workers: int) -> SampledSpectrum:
    """The DCT-II of planes (R, ny, nx) along both axes; overwrites its argument.

    Columns are copied before they are transformed: those of a plane whose rows are 2^n numbers
    apart share few lines of the cache.
    """
    for plane in planes:

        def along_rows(s: slice, plane: NDArray = plane) -> None:
            plane[s] = scipy.fft.dct(plane[s], type=2, axis=1, overwrite_x=True)

        def along_columns(s: slice, plane: NDArray = plane) -> None:
            columns = np.ascontiguousarray(plane[:, s])
            plane[:, s] = scipy.fft.dct(columns, type=2, axis=0, overwrite_x=True)

        rows, columns = plane.shape
        each(along_rows, pieces(rows, rows_at_once(columns)), workers)
        each(along_columns, pieces(columns, rows_at_once(rows)), workers)
    return SampledSpectrum(planes)


@dataclass(frozen=True, eq=False)
class RectangleSpectrum:
    """The spectrum of even rectangles, as far as it is asked for."""

    along_y: NDArray
    """(ny, d) coefficients along y of the d rows of rectangles."""
    along_x: NDArray
    """(R, d, nx) coefficients along x of the light in these rows."""

    @property
    def dtype(self) -> np.dtype:
        return self.along_x.dtype

    def __len__(self) -> int:
        return len(self.along_x)

    def rows(self, plane: int, index: Index, count: int | None = None) -> NDArray:
        return product(self.along_y[index], self.along_x[plane, :, :count])

    def products(self, y: NDArray, x: NDArray, workers: int) -> NDArray:
        planes, runs, columns = self.along_x.shape
        below = self.along_y.astype(np.float64)
        in_rows = np.array([below[s].T @ below[s] for s in _blocks(y)]).reshape(-1, runs**2)
        out = []
        for plane in range(planes):
            others = self.along_x[plane:].reshape(-1, columns).astype(np.float64)
            in_columns = np.array([others[:runs, s] @ others[:, s].T for s in _blocks(x)])
            for other in np.split(in_columns, planes - plane, axis=2):
                out.append(product(in_rows, other.reshape(-1, runs**2).T))
        return np.array(out)


def _blocks(edges: NDArray) -> list[slice]:
    return [slice(*ends) for ends in pairwise(edges)]


def rectangle_spectrum(
    rectangles: Rectangles, cells: tuple[int, int], axes: Sequence[Axis], dtype: type
) -> RectangleSpectrum:
    """The first terms of the spectrum of a chart of even rectangles, in closed form.

    cells: of the grid (ny, nx) that scales the coefficients; axes: along y and x, whose terms are
    computed. Frequencies that cells of a grid would fold are not in it.
    """
    along_y = terms_of_runs(rectangles.y, cells[0], axes[0].terms)
    along_x = terms_of_runs(rectangles.x, cells[1], axes[1].terms)
    return RectangleSpectrum(
        along_y.astype(dtype), np.asarray(rectangles.values @ along_x.T).astype(dtype)
    )


def terms_of_runs(edges: NDArray, cells: int, terms: int) -> NDArray:
    """The first terms of the DCT-II of light that is 1 from edge to edge: (terms, runs).

    edges: (runs + 1,) from border to border [m]. With the edges as parts b of the way between the
    borders, the cosine series of a run has the terms (sin(pi k b') - sin(pi k b)) / pi k; means
    over N cells multiply them by sinc(k / 2N), and a DCT-II counts them 2N times.
    """
    parts = (edges - edges[0]) / (edges[-1] - edges[0])
    k = np.arange(1, terms)
    sines = np.sin(np.pi * (np.outer(k, parts) % 2))
    out = np.empty((terms, len(parts) - 1))
    out[0] = 2 * cells * np.diff(parts)
    scale = 2 * cells * np.sinc(k / (2 * cells)) / (np.pi * k)
    out[1:] = np.diff(sines, axis=1) * scale[:, None]
    return out
