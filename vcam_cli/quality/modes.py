"""Modes of a distribution: how many maxima its density has, and how surely it has one.

A mean describes a distribution that has one mode. How many a density has depends on how finely
one looks: it is smoothed by a Gaussian, whose width is Silverman's rule of thumb, and its maxima
are counted. The critical width is the least above which there is a single one [1]; a
distribution is the more surely unimodal the less of its spread that is.

References
----------
.. [1] B. W. Silverman, "Using kernel density estimates to investigate multimodality", Journal of
   the Royal Statistical Society B 43, 97-99, 1981, doi:10.1111/j.2517-6161.1981.tb01155.x.
.. [2] B. W. Silverman, "Density Estimation for Statistics and Data Analysis", Chapman & Hall,
   1986, section 3.4.2.
"""

from __future__ import annotations

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

MIN_PROMINENCE = 0.01
"""Part of the highest maximum that another must rise above the dip beside it to count."""
MIN_BANDWIDTH_BINS = 2.0
"""Standard deviation of the narrowest Gaussian [bins]."""
BISECTIONS = 24
"""Halvings of the search for the critical width."""
SILVERMAN_FACTOR = 0.9
"""Factor of the rule of thumb [2].

The bandwidth is this times count^-1/5 times the smaller of standard deviation and quartile
range / 1.34.
"""


@dataclass(frozen=True)
class Modes:
    """Maxima of a density, and how surely there is a single one."""

    locations: tuple[float, ...]
    """Places of the maxima, in the values' unit."""
    bandwidth: float
    """Standard deviation of the Gaussian by which the density was smoothed."""
    critical_bandwidth: float
    """Least bandwidth that leaves a single maximum; not less than two bins."""
    spread: float
    """Standard deviation of the values."""


def density_modes(counts: Array, width: float, independent: float) -> Modes:
    """Return the maxima of the density of values that are not negative [1], [2].

    Parameters
    ----------
    counts : ndarray
        Number of values (n,) in bins of equal width, from 0.
    width : float
        Width of a bin, in the values' unit.
    independent : float
        Number of values that are independent of each other, which decides how finely the density
        is known.

    Returns
    -------
    Modes
        The maxima, and the bandwidths.

    Raises
    ------
    ValueError
        There are no values.
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
    least = MIN_BANDWIDTH_BINS * width
    bandwidth = max(SILVERMAN_FACTOR * scale * independent**-0.2, least)
    smoother = _Smoother(counts, width)
    locations = tuple(float(center[i]) for i in _maxima(smoother(bandwidth)))
    return Modes(
        locations, bandwidth, _critical_bandwidth(smoother, least, len(counts) * width), spread
    )


def density(counts: Array, width: float, bandwidth: float) -> Array:
    """Return the smoothed density of counted values; what would fall below 0 is folded back.

    Parameters
    ----------
    counts : ndarray
        Number of values (n,) in bins of equal width, from 0.
    width : float
        Width of a bin, in the values' unit.
    bandwidth : float
        Standard deviation of the Gaussian, in the values' unit.

    Returns
    -------
    ndarray
        Density (n,) [1 / unit of the values].
    """
    return _Smoother(counts, width)(bandwidth)


class _Smoother:
    """Smooths a density by any Gaussian.

    In cosines, whose ends are mirrors, the Gaussian is a factor on each.
    """

    def __init__(self, counts: Array, width: float) -> None:
        self._count, self._width = len(counts), width
        length = scipy.fft.next_fast_len(2 * len(counts), real=True)
        padded = np.zeros(length)
        padded[: len(counts)] = counts / (np.sum(counts) * width)
        self._cosines = scipy.fft.dct(padded)
        self._angle = np.pi * np.arange(length) / length

    def __call__(self, bandwidth: float) -> Array:
        factor = np.exp(-((self._angle * bandwidth / self._width) ** 2) / 2)
        return np.asarray(scipy.fft.idct(self._cosines * factor)[: self._count])


def _maxima(values: Array) -> Array:
    """Return the indices of the maxima of enough prominence, from left to right."""
    from scipy.signal import find_peaks

    peaks: Array = find_peaks(np.pad(values, 1), prominence=MIN_PROMINENCE * values.max())[0] - 1
    return peaks


def _critical_bandwidth(smoother: _Smoother, least: float, most: float) -> float:
    """Return the least bandwidth with one maximum: fewer never come of more smoothing [1]."""
    if len(_maxima(smoother(least))) == 1:
        return least
    low, high = least, most
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        one = len(_maxima(smoother(middle))) == 1
        low, high = (low, middle) if one else (middle, high)
    return high
