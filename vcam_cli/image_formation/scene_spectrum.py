"""The cosine spectrum of a scene: DCT-II coefficients of its planes.

Planes of samples are transformed; charts in closed form are not sampled (`closed_spectrum.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations_with_replacement
from typing import Protocol

import numpy as np
import scipy.fft
from numpy.typing import DTypeLike

from vcam_cli.arrays import Array
from vcam_cli.devices.processor import Processor
from vcam_cli.parallel import each, pieces, rows_at_once, slices_within
from vcam_cli.records import dataclass
from vcam_cli.scenes.bands import bands_of_rows, paint_by_bands
from vcam_cli.scenes.base import ChartScene

Index = Array | slice
Pair = tuple[int, int]
COPIED = 1 << 23
"""Values of a plane that are copied to a device together."""


class SceneSpectrum(Protocol):
    """DCT-II coefficients of R planes along y and x, unnormalized."""

    @property
    def dtype(self) -> np.dtype:
        """Floating-point type of the coefficients."""

    def __len__(self) -> int: ...

    def rows(self, plane: int, index: Index, count: int | None = None) -> Array:
        """Return rows of a plane's coefficients.

        Parameters
        ----------
        plane : int
            Index of the plane.
        index : Index
            Rows (n,).
        count : int, optional
            Number of coefficients along x; by default all.

        Returns
        -------
        Array
            Coefficients (n, count).
        """

    def products(self, y: Array, x: Array, workers: int, of: Sequence[Pair] | None = None) -> Array:
        """Return sums of products of two planes' coefficients over blocks of terms.

        Parameters
        ----------
        y, x : Array
            Edges of the blocks along each axis, rising from 0.
        workers : int
            Number of threads; the result does not depend on it.
        of : sequence of Pair, optional
            Pairs of planes; by default all `pairs`.

        Returns
        -------
        Array
            Sums (pairs, blocks along y, blocks along x), in 64 bits.
        """


def pairs(planes: int) -> list[Pair]:
    """Return the pairs (r, s), r <= s, of planes.

    Parameters
    ----------
    planes : int
        Number of planes.

    Returns
    -------
    list of tuple of int
        The pairs.
    """
    return list(combinations_with_replacement(range(planes), 2))


@dataclass(frozen=True, eq=False)
class SampledSpectrum:
    """The spectrum of planes of samples."""

    coefficients: Array
    """(R, ny, nx)"""

    @property
    def dtype(self) -> np.dtype:
        """Floating-point type of the coefficients."""
        return self.coefficients.dtype

    def __len__(self) -> int:
        return len(self.coefficients)

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
        return self.coefficients[plane, index, :count]

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
        every = of or pairs(len(self))
        return np.array([self._pair_products(pair, y, x, workers) for pair in every])

    def _pair_products(self, pair: Pair, y: Array, x: Array, workers: int) -> Array:
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


@dataclass(frozen=True, eq=False)
class JoinedSpectrum:
    """Planes that lie in several spectra; no color sees planes of two of them."""

    parts: tuple[tuple[SceneSpectrum, int], ...]
    """By plane: the spectrum that it is in, and its number there."""

    @property
    def dtype(self) -> np.dtype:
        """Floating-point type of the coefficients."""
        return self.parts[0][0].dtype

    def __len__(self) -> int:
        return len(self.parts)

    def rows(self, plane: int, index: Index, count: int | None = None) -> Array:
        """Return rows of a plane's coefficients (n, count), as `SceneSpectrum.rows`."""
        spectrum, number = self.parts[plane]
        return spectrum.rows(number, index, count)

    def products(self, y: Array, x: Array, workers: int, of: Sequence[Pair] | None = None) -> Array:
        """Return sums of products of two planes, as `SceneSpectrum.products`."""
        every = of or pairs(len(self))
        out = np.empty((len(every), len(y) - 1, len(x) - 1))
        for spectrum in {id(part): part for part, _ in self.parts}.values():
            own = [n for n, (r, _) in enumerate(every) if self.parts[r][0] is spectrum]
            if own:
                both = [(self.parts[every[n][0]][1], self.parts[every[n][1]][1]) for n in own]
                out[own] = spectrum.products(y, x, workers, both)
        return out


@dataclass(frozen=True, eq=False)
class DeviceSpectrum(SampledSpectrum):
    """The spectrum of planes of samples, on a device."""

    device: Processor

    def _pair_products(self, pair: Pair, y: Array, x: Array, workers: int) -> Array:
        first, second = (self.coefficients[plane, : y[-1], : x[-1]] for plane in pair)
        members = [
            self.device.put(np.repeat(np.eye(len(edges) - 1), np.diff(edges), axis=0), self.dtype)
            for edges in (y, x)
        ]
        sums = members[0].T @ ((first * second) @ members[1])
        return self.device.get(sums).astype(np.float64)


def _block_groups(edges: Array, longest: int) -> list[slice]:
    """Return neighboring blocks of terms, together at most `longest` or one block alone."""
    out, start = [], 0
    for stop in range(1, len(edges)):
        if stop + 1 == len(edges) or edges[stop + 1] - edges[start] > longest:
            out.append(slice(start, stop))
            start = stop
    return out


def transform_planes(planes: Array, workers: int) -> SampledSpectrum:
    """Return the DCT-II of planes along both axes; it overwrites them.

    Columns are copied before they are transformed: those of a plane whose rows are 2^n numbers
    apart share few lines of the cache.

    Parameters
    ----------
    planes : Array
        Samples (R, ny, nx).
    workers : int
        Number of threads; the result does not depend on it.

    Returns
    -------
    SampledSpectrum
        Coefficients, unnormalized.
    """
    for plane in planes:

        def along_rows(s: slice, plane: Array = plane) -> None:
            plane[s] = scipy.fft.dct(plane[s], type=2, axis=1, overwrite_x=True)

        rows, columns = plane.shape
        each(along_rows, pieces(rows, rows_at_once(columns)), workers)
        _transform_columns(plane, rows, workers)
    return SampledSpectrum(planes)


def transform_on(device: Processor, planes: Array, terms: tuple[int, int]) -> DeviceSpectrum:
    """Return the first terms of the DCT-II of planes, computed on a device.

    Parameters
    ----------
    device : Processor
        The device.
    planes : Array
        Samples (R, ny, nx), on the device.
    terms : tuple of int
        Number of terms along y and x.

    Returns
    -------
    DeviceSpectrum
        Coefficients, unnormalized.
    """
    alone = device.put(np.ones((1, 1)), planes.dtype)
    shape = planes.shape[1], planes.shape[2]
    found = device.spectrum(planes[..., None], alone, shape, (0, 0))
    return DeviceSpectrum(found[:, 0, : terms[0], : terms[1]], device)


def painted_on(
    device: Processor, scene: ChartScene, mix: Array, workers: int
) -> tuple[Array, Array]:
    """Return the planes of a chart on a device, painted by the processor band by band.

    Parameters
    ----------
    device : Processor
        The device.
    scene : ChartScene
        The chart on its cells.
    mix : Array
        Mixtures (R, K) of the scene's components.
    workers : int
        Number of threads.

    Returns
    -------
    planes : Array
        Averages over the cells (R, ny, nx), on the device.
    brightest : Array
        Largest absolute value of every plane (R,).
    """
    paint, brightest = scene.painter(mix), list[Array]()

    def fill(rows: slice, out: Array) -> None:
        def fill_rows(part: slice) -> None:
            paint(slice(rows.start + part.start, rows.start + part.stop), out[:, part])

        paint_by_bands(fill_rows, out.shape[1], out.shape[2], workers)
        brightest.append(np.maximum(out.max(axis=(1, 2)), -out.min(axis=(1, 2))))

    planes = _in_bands(device, (len(mix), *scene.shape), scene.dtype, fill)
    return planes, np.max(brightest, axis=0)


def copied_to(
    device: Processor, spectrum: SceneSpectrum, terms: tuple[int, int], workers: int
) -> DeviceSpectrum:
    """Return the first terms of a spectrum in closed form, copied to a device.

    Parameters
    ----------
    device : Processor
        The device.
    spectrum : SceneSpectrum
        Spectrum of R planes, computed by the processor.
    terms : tuple of int
        Number of terms along y and x.
    workers : int
        Number of threads.
    """

    def fill(rows: slice, out: Array) -> None:
        def fill_rows(part: slice) -> None:
            for plane, own in enumerate(out):
                index = slice(rows.start + part.start, rows.start + part.stop)
                own[part] = spectrum.rows(plane, index, terms[1])

        each(fill_rows, pieces(out.shape[1], rows_at_once(terms[1])), workers)

    return DeviceSpectrum(_in_bands(device, (len(spectrum), *terms), spectrum.dtype, fill), device)


def _in_bands(
    device: Processor,
    shape: tuple[int, int, int],
    dtype: DTypeLike,
    fill: Callable[[slice, Array], None],
) -> Array:
    """Return planes (R, ny, nx) on a device of rows that the processor computes: `fill`."""
    planes, rows, columns = shape
    out = device.zeros(shape, dtype)
    for band in pieces(rows, max(1, COPIED // columns)):
        part: Array = np.empty((planes, band.stop - band.start, columns), dtype)
        fill(band, part)
        out[:, band] = device.put(part)
    return out


def _transform_columns(plane: Array, terms: int, workers: int) -> None:
    """Put the first terms of the DCT-II of its columns in the first rows of a plane."""

    def along_columns(s: slice) -> None:
        columns = np.ascontiguousarray(plane[:, s])
        plane[:terms, s] = scipy.fft.dct(columns, type=2, axis=0, overwrite_x=True)[:terms]

    rows, columns = plane.shape
    each(along_columns, pieces(columns, rows_at_once(rows)), workers)


def transform_painted(
    scene: ChartScene, mix: Array, terms: tuple[int, int], dtype: type, workers: int
) -> tuple[SampledSpectrum, Array]:
    """Return the first terms of the DCT-II of a chart's planes, and how bright they are.

    Rows are painted and transformed band by band, and of each only the terms are kept: all cells of
    a plane are never held at once. They are painted in no more bits than they are transformed in.

    Parameters
    ----------
    scene : ChartScene
        The chart on its cells.
    mix : Array
        Mixtures (R, K) of the scene's components.
    terms : tuple of int
        Number of terms along y and x.
    dtype : type
        Floating-point type of the coefficients.
    workers : int
        Number of threads; the result does not depend on it.

    Returns
    -------
    spectrum : SampledSpectrum
        Coefficients, unnormalized.
    brightest : Array
        Largest absolute value of every plane (R,).
    """
    if np.dtype(dtype).itemsize < np.dtype(scene.dtype).itemsize:
        scene = replace(scene, dtype=dtype)
    rows, columns = scene.shape
    bands = bands_of_rows(rows, columns)
    half: Array = np.empty((len(mix), rows, terms[1]), dtype)
    brightest = np.zeros((len(bands), len(mix)))
    paint = scene.painter(mix)
    # Memory that is new to the process costs more than what is done in it.
    spare: list[Array] = []

    def along_rows(number: int) -> None:
        band = bands[number]
        shape = len(mix), bands[0].stop, columns
        whole = spare.pop() if spare else np.empty(shape, scene.dtype)
        light = whole[:, : band.stop - band.start]
        paint(band, light)
        brightest[number] = np.maximum(light.max(axis=(1, 2)), -light.min(axis=(1, 2)))
        for plane, own in zip(light.astype(dtype, copy=False), half[:, band], strict=True):
            for some in pieces(len(plane), rows_at_once(columns)):
                found = scipy.fft.dct(plane[some], axis=1, overwrite_x=True)
                own[some] = found[:, : terms[1]]
        spare.append(whole)

    each(along_rows, range(len(bands)), workers)
    for plane in half:
        _transform_columns(plane, terms[0], workers)
    return SampledSpectrum(half[:, : terms[0]]), brightest.max(axis=0)
