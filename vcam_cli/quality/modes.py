"""How values are distributed, and whether around a single one.

A mean stands for a distribution that has one mode. How many a density has depends on how finely
one looks: it is smoothed by a Gaussian, whose width is Silverman's rule of thumb, and its maxima
are counted. The critical width is the least from which on there is a single one [1]; a
distribution is the more surely unimodal the less of its spread that is.

References
----------
[1] B. W. Silverman, "Using kernel density estimates to investigate multimodality", J. R. Statist.
    Soc. B 43, 97-99, 1981.
[2] B. W. Silverman, "Density Estimation for Statistics and Data Analysis", Chapman & Hall, 1986,
    section 3.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

LEAST = 0.01
"""Of the highest maximum: what another must rise above the dip beside it to count."""
FINEST = 2.0
"""Bins: the narrowest Gaussian."""
STEPS = 24
"""Halvings of the search for the critical width."""
RULE = 0.9
"""Of the smaller of standard deviation and quartile range / 1.34, times count^-1/5, [2]."""


@dataclass(frozen=True)
class Modes:
    """Of a density."""

    places: tuple[float, ...]
    """Of its maxima, in the values' unit."""
    bandwidth: float
    """Standard deviation of the Gaussian by which it was smoothed."""
    critical_bandwidth: float
    """The least that leaves a single maximum; not less than two bins."""
    spread: float
    """Standard deviation of the values."""


def modes(counts: NDArray, width: float, independent: float) -> Modes:
    """The maxima of the density of values that are not negative.

    counts: (n,) values in bins of a width, from 0; independent: number of values that are
    independent of each other, which decides how finely the density is known. Raises ValueError
    where there are no values.
    """
    counts = np.asarray(counts, np.float64)
    total = counts.sum()
    if not total > 0 or not independent > 0:
        raise ValueError("no values have no distribution")
    center = (np.arange(len(counts)) + 0.5) * width
    mean = (counts @ center) / total
    spread = float(np.sqrt(counts @ (center - mean) ** 2 / total))
    below = np.cumsum(counts) / total
    quartiles = center[np.searchsorted(below, 0.75)] - center[np.searchsorted(below, 0.25)]
    scale = min(spread, quartiles / 1.34) or spread
    least = FINEST * width
    bandwidth = max(RULE * scale * independent**-0.2, least)
    smoother = _Smoother(counts, width)
    places = tuple(float(center[i]) for i in _maxima(smoother(bandwidth)))
    return Modes(places, bandwidth, _critical(smoother, least, len(counts) * width), spread)


def density(counts: NDArray, width: float, bandwidth: float) -> NDArray:
    """Density (n,) of counted values (n,), smoothed; what would fall below 0 is folded back."""
    return _Smoother(counts, width)(bandwidth)


class _Smoother:
    """A density by any Gaussian: in cosines, whose ends are mirrors, it is a factor on each."""

    def __init__(self, counts: NDArray, width: float) -> None:
        self._count, self._width = len(counts), width
        length = scipy.fft.next_fast_len(2 * len(counts), real=True)
        padded = np.zeros(length)
        padded[: len(counts)] = counts / (np.sum(counts) * width)
        self._cosines = scipy.fft.dct(padded)
        self._angle = np.pi * np.arange(length) / length

    def __call__(self, bandwidth: float) -> NDArray:
        factor = np.exp(-((self._angle * bandwidth / self._width) ** 2) / 2)
        return np.asarray(scipy.fft.idct(self._cosines * factor)[: self._count])


def _maxima(values: NDArray, least: float = LEAST) -> list[int]:
    """Indices of the maxima that stand out by a part of the highest, from left to right."""
    threshold = least * values.max()
    found: list[int] = []
    highest, lowest = 0, 0.0
    rising = True
    for i, value in enumerate(values):
        if rising:
            if value > values[highest]:
                highest = i
            elif value < values[highest] - threshold:
                found.append(highest)
                rising, lowest = False, value
        elif value < lowest:
            lowest = value
        elif value > lowest + threshold:
            rising, highest = True, i
    if rising and values[highest] > 0 and (not found or values[highest] > lowest + threshold):
        found.append(highest)
    return found


def _critical(smoother: _Smoother, least: float, most: float) -> float:
    """The least bandwidth with one maximum: fewer never come of more smoothing, [1]."""
    if len(_maxima(smoother(least))) == 1:
        return least
    low, high = least, most
    for _ in range(STEPS):
        middle = (low + high) / 2
        one = len(_maxima(smoother(middle))) == 1
        low, high = (low, middle) if one else (middle, high)
    return high
