"""Shot noise: Poisson statistics of collected electrons, from one normal number a pixel.

The number of electrons collected at a mean m is a Poisson variable [1], eq 2.26: its variance
equals the number of electrons collected.

Why not `Generator.poisson`: it takes a variable number of draws a pixel, so a difference in the
last bit of one mean moves every later pixel of the stream. Here each pixel takes exactly one
normal number, whatever its mean.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.2.3.
.. [2] E. A. Cornish, R. A. Fisher, "Moments and cumulants in the specification of
   distributions", Revue de l'Institut International de Statistique 5, 307-320, 1938,
   doi:10.2307/1400905.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array

CORNISH_FISHER_MEAN = 8.0
"""Mean from which the expansion is used [electrons]; below, the distribution is inverted."""
FEW = 0.25
"""Share of the numbers above which those that are not inverted yet go on by themselves."""
LEAST_TAIL = 1e-15
"""Probability of larger numbers below which they do not occur."""


def poisson_from_normal(mean: NDArray[np.floating], z: NDArray[np.floating]) -> Array:
    """Return a Poisson variable made from one standard normal variable a pixel.

    Below `CORNISH_FISHER_MEAN` the Poisson distribution function is inverted at Phi(z): exact.
    From there on the quantile's Cornish-Fisher expansion [2] is rounded down, with the continuity
    correction 1/2 of a lattice variable:

        floor(m + z sqrt(m) + 1/3 + z^2/6 - (z/36 + z^3/72)/sqrt(m))

    Its total-variation distance from the Poisson law is 8e-4 at m = 8 and 5e-5 at m = 50.

    Parameters
    ----------
    mean : ndarray
        Mean m of the variable [electrons], of any shape; below 0 it counts as 0. It must be finite.
    z : ndarray
        Standard normal numbers [dimensionless], of the same shape.

    Returns
    -------
    ndarray
        Whole numbers, 0 or more [electrons], in the shape and float type of `mean`.
    """
    low = mean < CORNISH_FISHER_MEAN
    if low.any() and mean.min() == mean.max():  # as in dark frames
        return _invert_even(mean, z)
    root = np.sqrt(np.maximum(mean, CORNISH_FISHER_MEAN))
    z2 = z * z
    out = (z2 * (-1 / 72) - 1 / 36) * z
    out /= root
    out += z2 * (1 / 6)
    root *= z
    out += root
    out += mean
    out += 1 / 3
    np.floor(out, out=out)
    np.maximum(out, 0, out=out)  # the expansion turns negative 5 standard deviations below 8
    if low.any():
        out[low] = _invert(mean[low], z[low])
    return out


def _invert(mean: Array, z: Array) -> Array:
    """Return the smallest k with P(X <= k | mean) >= Phi(z), summing the distribution upwards."""
    from scipy.special import ndtr

    m = np.maximum(mean.astype(np.float64), 0.0)
    # The upper tail in its own right, since 1 - Phi(z) rounds to 0 from z = 8 on.
    upper = ndtr(-z.astype(np.float64))
    tail = -np.expm1(-m)  # P(X > k)
    count = np.zeros_like(mean)
    place: Array = np.flatnonzero(tail > upper)
    m, tail, upper = m[place], tail[place], np.maximum(upper[place], LEAST_TAIL)
    term, above = np.exp(-m), np.full(m.shape, True)
    k = 0
    while left := np.count_nonzero(above):
        if left < FEW * above.size:  # picking them takes as long as some steps of all
            place, m, term = place[above], m[above], term[above]
            tail, upper, above = tail[above], upper[above], above[above]
        k += 1
        count[place] += above
        term *= m / k
        tail -= term
        above = tail > upper
    return count


def _invert_even(mean: Array, z: Array) -> Array:
    """Return the same where all means are one: how many of the distribution's steps lie below z.

    Each is compared with all numbers, of their own float type: that takes a fifth of the time of
    searching for each.
    """
    from scipy.special import ndtri

    m, k = max(float(mean.flat[0]), 0.0), 0
    term, tail, tails = np.exp(-m), -np.expm1(-m), []
    while tail > LEAST_TAIL:
        tails.append(tail)
        k += 1
        term *= m / k
        tail -= term
    steps = -ndtri(tails)
    rounded = steps.astype(z.dtype)
    below = np.nextafter(rounded, z.dtype.type(-np.inf))
    count = np.zeros(z.shape, np.uint8)
    for step in np.where(rounded > steps, below, rounded):
        count += z > step
    return count.astype(mean.dtype)


def gaussian_shot_noise(mean: NDArray[np.floating], z: NDArray[np.floating]) -> Array:
    """Return electrons with the normal approximation of shot noise, m + z sqrt(m), not rounded [1].

    Parameters
    ----------
    mean : ndarray
        Mean m [electrons], of any shape; below 0 its variance counts as 0.
    z : ndarray
        Standard normal numbers [dimensionless], of the same shape.

    Returns
    -------
    ndarray
        Electrons with their noise [electrons], in the shape of `mean`.
    """
    drawn: Array = mean + z * np.sqrt(np.maximum(mean, 0))
    return drawn
