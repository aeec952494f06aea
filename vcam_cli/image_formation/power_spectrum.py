"""What a scene's spectrum holds, and what filters leave of it: mean squares by Parseval's theorem.

Coefficients are summed as products of planes over blocks of neighboring frequencies: exactly, in
one pass over the whole spectrum. A transfer function is then judged at the blocks' centers, a few
thousand in place of millions of terms. Mean squares are those of the continuous signal, before it
is sampled by the pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import SeparableTransfer
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.scene_spectrum import SceneSpectrum, pairs
from vcam_cli.image_formation.transfer_tables import PARITIES, Tables, reader
from vcam_cli.parallel import product

ALONE = 16
"""Lowest terms along an axis that are blocks of their own."""
WIDTH = 1 / 20
"""Width of a block relative to its frequency."""
LOWEST, MOST_LOWEST = 24, 512
"""Terms along each axis from which the brightest mean is found: so many over the array's length,
but no more than the second number."""


@dataclass(frozen=True)
class Blocks:
    """Blocks of neighboring terms along one axis."""

    edges: NDArray
    """(b + 1,) first coefficients of blocks of the samples' spectrum, from 0, and the end."""
    weights: NDArray
    """(n, b) from squares of those coefficients to mean squares of the terms in every block."""
    low: NDArray
    """(n,) lowest frequency of every block of terms [cycles/m]."""
    high: NDArray
    """(n,) highest frequency of every block of terms [cycles/m]."""

    @property
    def center(self) -> NDArray:
        """Frequencies (n,) in the middle of the blocks [cycles/m]."""
        return (self.low + self.high) / 2


def blocks(axis: Axis) -> Blocks:
    """Return the blocks of the terms of an axis.

    The spectrum of uniform squares of light goes on beyond that of the samples: coefficients repeat
    backwards and forwards, and so do their blocks.

    Parameters
    ----------
    axis : Axis
        Samples and terms along the axis.

    Returns
    -------
    Blocks
        Blocks whose width grows with the frequency.
    """
    count = min(axis.samples, axis.terms)
    starts = _starts(count)
    first, last = starts, np.append(starts[1:], count) - 1
    low, high, source = [], [], []
    for number in range(-(-axis.terms // count)):
        ends = (first, last) if number % 2 == 0 else (count - last[::-1], count - first[::-1])
        low.append(ends[0] + number * count)
        high.append(ends[1] + number * count)
        source.append(np.arange(len(starts))[:: 1 if number % 2 == 0 else -1])
    inside = np.concatenate(low) < axis.terms
    start, stop = np.concatenate(low)[inside], np.concatenate(high)[inside]
    stop = np.minimum(stop, axis.terms - 1)
    box = np.sinc((start + stop) / (4 * axis.samples))
    weight = np.square((box if axis.squares else 1 / box) / (2 * axis.samples))
    weight *= np.where(start > 0, 2, 1)
    target = np.searchsorted(_starts(axis.terms), start, side="right") - 1
    merged = np.flatnonzero(np.diff(target, prepend=-1))
    weights = np.zeros((len(merged), len(starts)))
    row = np.cumsum(np.diff(target, prepend=-1) > 0) - 1
    np.add.at(weights, (row, np.concatenate(source)[inside]), weight)
    step = 1 / (2 * axis.length)
    edges = np.append(starts, count)
    return Blocks(edges, weights, start[merged] * step, np.maximum.reduceat(stop, merged) * step)


def _starts(terms: int) -> NDArray:
    """Return the first terms of blocks whose width grows with the frequency."""
    starts = [*range(min(ALONE, terms))]
    at = len(starts)
    while at < terms:
        starts.append(at)
        at += max(1, int(at * WIDTH))
    return np.array(starts)


@dataclass(frozen=True, eq=False)
class PowerSpectrum:
    """Mean squares of a scene's planes by frequency, separable transfer functions aside."""

    x: Blocks
    y: Blocks
    products: NDArray
    """(pairs, blocks along y, blocks along x) of planes (r, s), r <= s, twice where they differ."""
    planes: int
    separable: tuple[SeparableTransfer, ...]

    def filtered_power(self, tables: Tables) -> NDArray:
        """Return the mean squares of every color's signal.

        Parameters
        ----------
        tables : Tables
            Transfer functions of the lens.

        Returns
        -------
        NDArray
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        return self.pixel_power(self.lens_power(tables))

    def lens_power(self, tables: Tables) -> NDArray:
        """Return the mean squares before the separable transfer functions.

        Parameters
        ----------
        tables : Tables
            Transfer functions of the lens.

        Returns
        -------
        NDArray
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        power = np.zeros((tables.colors, len(self.y.low), len(self.x.low)))
        for parity in tables.parities:
            values = reader(tables, parity, self.x.center).values(self.y.center)
            for (r, s), squares in zip(pairs(self.planes), self.products, strict=True):
                power += values[r] * values[s] * squares
        return np.maximum(power, 0)

    def pixel_power(self, power: NDArray) -> NDArray:
        """Return mean squares behind the separable transfer functions.

        Parameters
        ----------
        power : NDArray
            Mean squares before them, from `lens_power`.

        Returns
        -------
        NDArray
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        return power * self._separable_squares(self.separable)

    def upper_bound(self, tables: Tables) -> NDArray:
        """Return mean squares that no lens exceeds whose radial part is given.

        Planes whose light cancels through one lens need not through another: it is as if none did.

        Parameters
        ----------
        tables : Tables
            Tables over |f| that the lens passes at most.

        Returns
        -------
        NDArray
            Mean squares (C, blocks along y, blocks along x) [(e/s)^2].
        """
        values = np.abs(reader(tables, 0, self.x.center).values(self.y.center))
        own = [p for (r, s), p in zip(pairs(self.planes), self.products, strict=True) if r == s]
        amplitudes = values * np.sqrt(np.maximum(own, 0))[:, None]
        return self.pixel_power(np.square(amplitudes.sum(axis=0)))

    def omission_power(self, power: NDArray, effect: SeparableTransfer) -> NDArray:
        """Return mean squares of what leaving out a separable transfer function adds.

        Parameters
        ----------
        power : NDArray
            Mean squares from `lens_power`.
        effect : SeparableTransfer
            The transfer function that is left out.

        Returns
        -------
        NDArray
            Mean squares (C,) [(e/s)^2].
        """
        others = self._separable_squares([e for e in self.separable if e is not effect])
        own = np.outer(effect.along_y(self.y.center), effect.along_x(self.x.center))
        return np.asarray((power * (others * np.square(1 - own))).sum(axis=(1, 2)))

    def _separable_squares(self, effects: Sequence[SeparableTransfer]) -> NDArray:
        """Return the largest squares of separable transfer functions in the blocks."""
        along_x, along_y = np.ones(len(self.x.low)), np.ones(len(self.y.low))
        for effect in effects:
            along_x *= _largest(effect.along_x, self.x)
            along_y *= _largest(effect.along_y, self.y)
        return np.outer(along_y, along_x)

    def needed_frequency(self, power: NDArray, budget: float, pitch: tuple[float, float]) -> float:
        """Return the frequency beyond which little enough is left.

        That of a term is the larger of those along both axes, each in its own Nyquist frequency.

        Parameters
        ----------
        power : NDArray
            Mean squares (C, ...) from `filtered_power` or `upper_bound` [(e/s)^2].
        budget : float
            Rms that may be left [e/s].
        pitch : tuple of float
            Pixel pitch along y and x [m].

        Returns
        -------
        float
            Frequency [pixel Nyquist].
        """
        shell = self._shell(pitch).ravel()
        order = np.argsort(shell, kind="stable")
        sums = np.cumsum(power.reshape(len(power), -1)[:, order[::-1]], axis=1)[:, ::-1]
        needed = np.flatnonzero(sums.max(axis=0) > budget**2)
        return float(shell[order[needed[-1]]]) if len(needed) else 0.0

    def tail_rms(self, power: NDArray, frequency: float, pitch: tuple[float, float]) -> float:
        """Return the rms of all that lies beyond a frequency, in the color of most.

        Parameters
        ----------
        power : NDArray
            Mean squares (C, ...) from `filtered_power` or `upper_bound` [(e/s)^2].
        frequency : float
            Frequency [pixel Nyquist].
        pitch : tuple of float
            Pixel pitch along y and x [m].

        Returns
        -------
        float
            Rms [e/s].
        """
        beyond = self._shell(pitch) > frequency * (1 + 1e-9)
        return float(np.sqrt(power[:, beyond].sum(axis=1).max()))

    def _shell(self, pitch: tuple[float, float]) -> NDArray:
        """Return the frequency of every block, (blocks along y, blocks along x) [pixel Nyquist]."""
        along_y, along_x = 2 * pitch[0] * self.y.high, 2 * pitch[1] * self.x.high
        return np.maximum(along_y[:, None], along_x)


def _largest(transfer, blocks: Blocks) -> NDArray:
    """Return the largest square of a transfer function along one axis in every block."""
    ends = [transfer(f) for f in (blocks.low, blocks.center, blocks.high)]
    return np.asarray(np.square(ends).max(axis=0))


def power_spectrum(
    spectrum: SceneSpectrum,
    x: Axis,
    y: Axis,
    separable: Sequence[SeparableTransfer],
    workers: int,
) -> PowerSpectrum:
    """Return the power spectrum of planes up to the highest terms of the axes.

    Parameters
    ----------
    spectrum : SceneSpectrum
        Spectrum of the planes.
    x, y : Axis
        Terms along x and y.
    separable : sequence of SeparableTransfer
        Transfer functions along the axes.
    workers : int
        Number of threads; the result does not depend on it.

    Returns
    -------
    PowerSpectrum
        Mean squares by block of terms.
    """
    along_x, along_y = blocks(x), blocks(y)
    products = []
    sums = spectrum.products(along_y.edges, along_x.edges, workers)
    for (r, s), of_pair in zip(pairs(len(spectrum)), sums, strict=True):
        twice = 1 if r == s else 2
        squares = product(along_y.weights, product(of_pair, along_x.weights.T))
        products.append(twice * squares)
    return PowerSpectrum(along_x, along_y, np.array(products), len(spectrum), tuple(separable))


def brightest_mean(
    spectrum: SceneSpectrum,
    x: Axis,
    y: Axis,
    tables: Tables,
    separable: Sequence[SeparableTransfer],
) -> float:
    """Return a bound from below on the brightest place of the array.

    It is found from the lowest frequencies. Fejer's kernel weakens the terms of a cosine series in
    proportion to their number: the series is then a mean of the light with weights of which none is
    negative, so no such mean is brighter than the brightest place. Of a chart, light from beyond
    the array has a small part in the means near its edges.

    Parameters
    ----------
    spectrum : SceneSpectrum
        Spectrum of the planes.
    x, y : Axis
        Terms along x and y.
    tables : Tables
        Transfer functions of the lens.
    separable : sequence of SeparableTransfer
        Transfer functions along the axes.

    Returns
    -------
    float
        Signal [e/s].

    References
    ----------
    L. Fejer, Math. Ann. 58, 51-69, 1904.
    """
    rows, columns = _lowest(y), _lowest(x)
    index, columns_index = (
        y.coefficient_index(np.arange(rows)),
        x.coefficient_index(np.arange(columns)),
    )
    along_x, along_y = (
        _means(x, columns, separable, "along_x"),
        _means(y, rows, separable, "along_y"),
    )
    signal = 0.0
    for parity in tables.parities:
        odd_x, odd_y = PARITIES[parity]
        values = reader(tables, parity, x.frequencies[:columns]).values(y.frequencies[:rows])
        total = np.zeros(values.shape[1:])
        for plane in range(len(spectrum)):
            found = spectrum.rows(plane, index[0], columns)[:, columns_index[0]].astype(np.float64)
            total += values[plane] * found * np.outer(index[1], columns_index[1])
        signal = signal + along_y(odd_y) @ total @ along_x(odd_x).T
    return max(0.0, float(np.max(signal)))


def _lowest(axis: Axis) -> int:
    """Return the number of terms whose means reach over a small part of the array.

    They reach over some pixels, so that there are pixels as bright as the mean.
    """
    over_array = LOWEST * axis.length / (axis.pixels * axis.pixel_pitch)
    over_pixels = max(1.0, axis.length / (2 * axis.pixel_pitch))
    return min(int(over_array), int(over_pixels), axis.terms, MOST_LOWEST)


def _means(axis: Axis, terms: int, separable: Sequence[SeparableTransfer], direction: str):
    """Return the waves of the first terms at places on the array, weakened as Fejer has it."""
    k = np.arange(terms)
    factor = axis.weights[:terms] * (1 - k / terms) * np.where(k > 0, 2, 1)
    for effect in separable:
        factor = factor * getattr(effect, direction)(axis.frequencies[:terms])
    places = axis.first + np.linspace(0, axis.pixels - 1, 2 * LOWEST) * axis.pixel_pitch
    angle = np.pi * np.outer(places / axis.length, k)
    return lambda odd: (np.sin if odd else np.cos)(angle) * factor
