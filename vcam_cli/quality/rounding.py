"""What rounding to whole codes leaves of noise: bounds that hold at any mean.

The variance of a rounded normal number depends on where its mean lies between two codes, and the
mean of its codes is off by up to half a code. Both errors fade as exp(-2 (pi s)^2) with the
standard deviation s [DN], so that they count below 0.7 DN alone. Where the mean lies is not known,
and differs from pixel to pixel: only bounds over all means can be stated.

References
----------
.. [1] B. Widrow and I. Kollar, Quantization Noise, Cambridge University Press, 2008, chapters 4, 9.
.. [2] EMVA Standard 1288, Release 4.0 Linear, 2021, section 6 and eq 54.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.quality.photon_transfer import MIN_DARK_VARIANCE, ROUNDING

LIMIT = MIN_DARK_VARIANCE - ROUNDING
"""Largest variance of noise that is hidden by rounding [DN^2], eq 54 of [2]."""
DEVIATIONS = np.linspace(0.0, 2.0, 401)
"""Standard deviations of the table of bounds [DN]; above them rounding adds 1/12."""
MEANS = np.linspace(0.0, 0.5, 51)
"""Means between two codes; all others are like one of these [DN]."""
CODES = np.arange(-12, 13)


@cache
def _tables() -> tuple[Array, Array, Array]:
    """Return least and largest variance [DN^2], and largest error of the mean [DN]."""
    from scipy.special import ndtr

    spread = np.maximum(DEVIATIONS, 1e-6)[:, None, None]
    ends = (CODES + 0.5 - MEANS[:, None]) / spread
    # A mean halfway between two codes goes to either in half of the frames.
    below = ndtr(np.where(abs(CODES + 0.5 - MEANS[:, None]) < 1e-12, 0.0, ends))
    share = np.diff(below, axis=-1, prepend=0.0)
    mean = share @ CODES
    variance = share @ CODES**2 - mean**2
    error = abs(mean - MEANS).max(axis=1)
    error[0] = 0.5
    return variance.min(axis=1), variance.max(axis=1), np.maximum.accumulate(error[::-1])[::-1]


def deviations(variance: float, error: float = 0.0) -> tuple[float, float]:
    """Return the least and the largest standard deviation that a variance of codes may have.

    Parameters
    ----------
    variance : float
        Variance of rounded numbers [DN^2].
    error : float
        Its standard error [DN^2].

    Returns
    -------
    tuple of float
        Standard deviations before rounding [DN], whatever the mean; the largest at least that of
        `LIMIT` where the variance is below that of eq 54.
    """
    least, most, _ = _tables()
    if variance - 3 * error > least[-1]:
        exact = math.sqrt(variance - ROUNDING)
        return exact, exact
    low = float(np.interp(variance, np.maximum.accumulate(most), DEVIATIONS, left=0.0))
    # Up to half a code two codes share the noise, and their variance says nothing of it.
    low = low if variance > most[0] else 0.0
    high = float(np.interp(variance, least, DEVIATIONS))
    return low, max(high, math.sqrt(LIMIT)) if variance < MIN_DARK_VARIANCE else high


def mean_error(deviation: float) -> float:
    """Return how far the mean of codes is at most from that of the numbers [DN].

    Parameters
    ----------
    deviation : float
        Standard deviation before rounding [DN].
    """
    return float(np.interp(deviation, DEVIATIONS, _tables()[2], right=0.0))


def spread_error(deviation: float, spread: float) -> float:
    """Return how far the standard deviation of mean codes is at most from that of the means [DN].

    The mean of codes is a curve over the mean, of slope 1 within 2 exp(-2 (pi s)^2): small
    differences are stretched by at most that, and none is changed by more than `mean_error`.

    Parameters
    ----------
    deviation : float
        Standard deviation of the noise of each, before rounding [DN].
    spread : float
        Standard deviation of the mean codes [DN].
    """
    slope = 2 * math.exp(-2 * (math.pi * deviation) ** 2)
    relative = slope / (1 - slope) if slope < 1 else math.inf
    return min(mean_error(deviation), relative * spread if spread else math.inf)
