"""The cosine spectrum of charts in closed form: even rectangles, discs on them, sums of products.

They are never sampled in two dimensions. Few numbers along each axis make all coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.scene_spectrum import Index, Pair, SceneSpectrum, pairs
from vcam_cli.parallel import AT_ONCE, PRODUCT, product, slices_within
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene
from vcam_cli.scenes.cells import cell_edges
from vcam_cli.scenes.closed_form import LightDisc, Rectangles

FINER = 32
"""Cells along an axis over the terms that are used, on which functions of one variable are
averaged: what they fold is at most 8e-4 of an edge's own terms, and they cost nothing."""


def closed_spectrum(
    scene: ChartScene, mix: Array, axes: Sequence[Axis], dtype: type
) -> SceneSpectrum:
    """Return the first terms of the spectrum of a chart that is not painted.

    Frequencies that cells of a grid would fold are not in it.

    Parameters
    ----------
    scene : ChartScene
        The chart, on the cells that scale the coefficients.
    mix : Array
        Mixtures (R, K) of its components.
    axes : sequence of Axis
        Axes along y and x, whose terms are computed.
    dtype : type
        Floating-point type.

    Returns
    -------
    SceneSpectrum
        Coefficients, unnormalized.
    """
    if scene.chart.separates:
        return product_spectrum(scene, mix, axes, dtype)
    rectangles = scene.rectangles(mix)
    assert rectangles is not None
    discs = scene.discs(np.asarray(mix, float))
    if not discs:
        return rectangle_spectrum(rectangles, scene.shape, axes, dtype)
    even = rectangle_spectrum(rectangles, scene.shape, axes, np.float64)
    waves = tuple(disc_waves(disc, scene, axes) for disc in discs)
    return DiscSpectrum(even, waves, np.dtype(dtype))


def product_spectrum(
    scene: ChartScene, mix: Array, axes: Sequence[Axis], dtype: type
) -> ProductSpectrum:
    """Return the spectrum of a sum of products, each factor transformed by itself.

    Parameters are those of `closed_spectrum`.

    Parameters
    ----------
    scene : ChartScene
        The chart; its light is a sum of products.
    mix : Array
        Mixtures (R, K) of its parts.
    axes : sequence of Axis
        Axes along y and x.
    dtype : type
        Floating-point type of the result.

    Returns
    -------
    ProductSpectrum
        Its spectrum.
    """
    counts = [FINER * max(axis.terms, 64) for axis in axes]
    y, x = (
        cell_edges(count, size / count)
        for count, size in zip(counts, scene.extent[::-1], strict=True)
    )
    found = scene.chart.products(x + scene.center[0], y + scene.center[1], mix)
    along_y = _scaled_terms(found.down.T, axes[0]).T
    along_x = _scaled_terms(found.along, axes[1])
    return ProductSpectrum(along_y.astype(dtype), along_x.astype(dtype))


def _scaled_terms(values: Array, axis: Axis) -> Array:
    """Return the terms (..., terms) of means over fine cells as if over those of an axis.

    A mean over N cells multiplies the term k by sinc(k / 2N), and a DCT-II counts it 2N times.
    """
    k, fine = np.arange(axis.terms), values.shape[-1]
    scale = axis.samples / fine * np.sinc(k / (2 * axis.samples)) / np.sinc(k / (2 * fine))
    return np.asarray(scipy.fft.dct(values, type=2)[..., : axis.terms] * scale)


@dataclass(frozen=True, eq=False)
class DiscWaves:
    """The spectrum of a disc: a function of |f|, times one function of y and one of x.

    Its integral times two cosines is theirs at its center, times pi r^2 2 J1(z) / z with z = 2 pi r
    |f|.
    """

    height: Array
    """(R,) its light."""
    down: Array
    """(ny,) what multiplies the terms along y."""
    along: Array
    """(nx,) what multiplies the terms along x."""
    z_down: Array
    """(ny,) 2 pi r f along y, rising."""
    z_along: Array
    """(nx,) 2 pi r f along x, rising."""
    shape: Array
    """2 J1(z) / z at z = 0, `STEP`, 2 `STEP` ..."""

    def terms(self, y: Index, x: Index) -> Array:
        """Return terms of a disc of height 1.

        Parameters
        ----------
        y, x : index
            Indices of the terms along y and x.

        Returns
        -------
        Array
            Terms (len(y), len(x)).
        """
        place = np.hypot(self.z_down[y][:, None], self.z_along[x]) * (1 / STEP)
        index = place.astype(np.intp)
        place -= index
        found = self.shape.take(index + 1) - self.shape.take(index)
        found *= place
        found += self.shape.take(index)
        found *= self.along[x]
        found *= self.down[y][:, None]
        return found

    def power(self, y: Array, x: Array) -> Array:
        """Return the sums of squared terms over blocks between edges, at most.

        J1^2 is at most J1^2 + Y1^2, and half of it in the mean where a block holds a whole wave.

        Parameters
        ----------
        y, x : Array
            Edges of the blocks, rising indices of terms along y and x.

        Returns
        -------
        Array
            Bounds (len(y) - 1, len(x) - 1), of a disc of height 1.
        """
        from scipy.special import j1, y1

        low = np.hypot(self.z_down[y[:-1]][:, None], self.z_along[x[:-1]])
        high = np.hypot(self.z_down[y[1:] - 1][:, None], self.z_along[x[1:] - 1])
        z = np.maximum(low, 1.0)
        squares = np.minimum(4 * (j1(z) ** 2 + y1(z) ** 2) / z**2, 1.0)
        squares[high - low > np.pi] /= 2
        sums = (np.add.reduceat(np.square(w[: e[-1]]), e[:-1]) for w, e in
                ((self.down, y), (self.along, x)))  # fmt: skip
        product: Array = squares * np.outer(*sums)
        return product


STEP = 0.01
"""Step of the table of 2 J1(z) / z: straight lines between its entries err by 1e-5 of its waves."""


@dataclass(frozen=True, eq=False)
class DiscSpectrum:
    """The spectrum of even rectangles and of discs on them, at the frequencies used."""

    even: ProductSpectrum
    discs: tuple[DiscWaves, ...]
    dtype: np.dtype

    def __len__(self) -> int:
        return len(self.even)

    def rows(self, plane: int, index: Index, count: int | None = None) -> Array:
        """Return rows of a plane's coefficients.

        Parameters
        ----------
        plane : int
            Number of the plane.
        index : index
            Indices (n,) of the rows.
        count : int or None
            Terms along x; None for all.

        Returns
        -------
        Array
            Coefficients (n, count).
        """
        light = self.even.rows(plane, index, count)
        for disc in self.discs:
            light += disc.height[plane] * disc.terms(index, slice(count))
        return light.astype(self.dtype)

    def products(self, y: Array, x: Array, workers: int, of: Sequence[Pair] | None = None) -> Array:
        """Return a bound on sums of products over blocks of terms: as if all were in phase.

        Parameters
        ----------
        y, x : Array
            Edges of the blocks, rising indices of terms along y and x.
        workers : int
            Number of threads.
        of : sequence of Pair, optional
            Pairs of planes; by default all `pairs`.

        Returns
        -------
        Array
            Bounds (pairs, len(y) - 1, len(x) - 1), in the order of the pairs.
        """
        squares = self.even.products(y, x, workers, [(r, r) for r in range(len(self))])
        of_discs = [disc.power(y, x) for disc in self.discs]
        own = []
        for r, square in enumerate(squares):
            amplitude = np.sqrt(np.maximum(square, 0))
            for disc, power in zip(self.discs, of_discs, strict=True):
                amplitude = amplitude + abs(disc.height[r]) * np.sqrt(power)
            own.append(amplitude)
        return np.array([own[r] * own[s] for r, s in of or pairs(len(self))])


def disc_waves(disc: LightDisc, scene: ChartScene, axes: Sequence[Axis]) -> DiscWaves:
    """Return the spectrum of a disc on a scene's area.

    Parameters
    ----------
    disc : LightDisc
        The disc [m].
    scene : ChartScene
        The scene.
    axes : sequence of Axis
        Axes along y and x.

    Returns
    -------
    DiscWaves
        The spectrum.
    """
    from scipy.special import j1

    width, height = scene.extent
    places = disc.y - scene.center[1] + height / 2, disc.x - scene.center[0] + width / 2
    waves, phases = [], []
    for axis, place in zip(axes, places, strict=True):
        f = axis.frequencies
        scale = 2 / axis.sample_pitch * np.sinc(f * axis.sample_pitch)
        waves.append(scale * np.cos(2 * np.pi * f * place))
        phases.append(2 * np.pi * disc.radius * f)
    z = STEP * np.arange(math.ceil(math.hypot(phases[0][-1], phases[1][-1]) / STEP) + 2)
    shape = np.divide(2 * j1(z), z, out=np.ones_like(z), where=z > 0)
    area = np.pi * disc.radius**2
    return DiscWaves(disc.height, area * waves[0], waves[1], phases[0], phases[1], shape)


@dataclass(frozen=True, eq=False)
class ProductSpectrum:
    """A spectrum as a sum of products of functions of both axes, at the frequencies used."""

    along_y: Array
    """(ny, d) coefficients along y of d functions."""
    along_x: Array
    """(R, d, nx) coefficients along x of what multiplies each."""

    @property
    def dtype(self) -> np.dtype:
        """Floating-point type of the coefficients."""
        return self.along_x.dtype

    def __len__(self) -> int:
        return len(self.along_x)

    def rows(self, plane: int, index: Index, count: int | None = None) -> Array:
        """Return rows of a plane's coefficients.

        Parameters
        ----------
        plane : int
            Number of the plane.
        index : index
            Indices (n,) of the rows.
        count : int or None
            Terms along x; None for all.

        Returns
        -------
        Array
            Coefficients (n, count).
        """
        return product(self.along_y[index], self.along_x[plane, :, :count])

    def products(self, y: Array, x: Array, workers: int, of: Sequence[Pair] | None = None) -> Array:
        """Return sums of products of two planes' coefficients over blocks of terms.

        Parameters
        ----------
        y, x : Array
            Edges of the blocks, rising indices of terms along y and x.
        workers : int
            Number of threads.
        of : sequence of Pair, optional
            Pairs of planes; by default all `pairs`.

        Returns
        -------
        Array
            Sums (pairs, len(y) - 1, len(x) - 1), in the order of the pairs.
        """
        planes, runs, columns = self.along_x.shape
        in_columns = _sums_of_products(self.along_x.reshape(-1, columns), x)
        in_columns = in_columns.reshape(-1, planes, runs, planes, runs)
        # Along y the sums are the same for two functions in either order: a third of the time.
        one, other = np.triu_indices(runs)
        in_rows = _sums_of_products(self.along_y.T, y)[:, one, other]
        in_rows[:, one == other] /= 2
        out = []
        for r, s in of or pairs(planes):
            both = in_columns[:, r, :, s]
            out.append(product(in_rows, (both[:, one, other] + both[:, other, one]).T))
        return np.array(out)


def _sums_of_products(values: Array, edges: Array) -> Array:
    """Return the sums of products of all rows (n, terms) over blocks: (len(edges) - 1, n, n)."""
    if values.size * len(values) <= PRODUCT:
        own = np.ascontiguousarray(values[:, edges[0] : edges[-1]], np.float64)
        sums = np.add.reduceat(own[:, None] * own, edges[:-1] - edges[0], axis=2)
        return np.ascontiguousarray(np.moveaxis(sums, 2, 0))
    longest = max(16, PRODUCT // len(values) ** 2)  # of long rows a BLAS takes 20 times as long
    out = np.zeros((len(edges) - 1, len(values), len(values)))
    for total, block in zip(out, pairwise(edges), strict=True):
        for some in slices_within(slice(*block), longest):
            part = np.ascontiguousarray(values[:, some], np.float64)
            total += product(part, part.T)
    return out


def rectangle_spectrum(
    rectangles: Rectangles, cells: tuple[int, int], axes: Sequence[Axis], dtype: type
) -> ProductSpectrum:
    """Return the first terms of the spectrum of a chart of even rectangles, in closed form.

    Frequencies that cells of a grid would fold are not in it.

    Parameters
    ----------
    rectangles : Rectangles
        The chart.
    cells : tuple of int
        Cells (ny, nx) of the grid that scales the coefficients.
    axes : sequence of Axis
        Axes along y and x, whose terms are computed.
    dtype : type
        Floating-point type.

    Returns
    -------
    ProductSpectrum
        Coefficients, unnormalized.
    """
    along_y = terms_of_runs(rectangles.y, cells[0], axes[0].terms)
    along_x = terms_of_runs(rectangles.x, cells[1], axes[1].terms)
    values = rectangles.values.reshape(-1, along_x.shape[1])  # one product: NumPy's of each is slow
    in_rows = product(values, along_x.T, dtype).reshape(*rectangles.values.shape[:2], -1)
    return ProductSpectrum(along_y.astype(dtype), in_rows)


def terms_of_runs(edges: Array, cells: int, terms: int) -> Array:
    """Return the first terms of the DCT-II of light that is 1 from edge to edge.

    With the edges as parts b of the way between the borders, the cosine series of a run has the
    terms (sin(pi k b') - sin(pi k b)) / pi k; means over N cells multiply them by sinc(k / 2N), and
    a DCT-II counts them 2N times.

    Parameters
    ----------
    edges : Array
        Edges (runs + 1,) from border to border [m].
    cells : int
        Number of cells N.
    terms : int
        Number of terms.

    Returns
    -------
    Array
        Coefficients (terms, runs).
    """
    parts = (edges - edges[0]) / (edges[-1] - edges[0])
    out = np.empty((terms, len(parts) - 1))
    out[0] = 2 * cells * np.diff(parts)
    for some in slices_within(slice(1, terms), max(1, AT_ONCE // len(parts))):
        k = np.arange(some.start, some.stop)
        turns = np.outer(k, parts)
        turns -= 2 * np.floor(turns / 2)  # exact, and 5 times as fast as % 2
        sines = np.sin(np.pi * turns)
        scale = 2 * cells * np.sinc(k / (2 * cells)) / (np.pi * k)
        np.multiply(np.diff(sines, axis=1), scale[:, None], out=out[some])
    return out
