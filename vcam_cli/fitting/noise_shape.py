"""Tails of the read noise and bands of the rows: what is more than normal, independent noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.quality.photon_transfer import ROUNDING
from vcam_cli.verification.stack_statistics import Estimate

SIGNIFICANT = 5.0
"""Standard errors from which tails, or a correlation of rows, are significant."""
SHAPES = -0.45, 0.3
"""Shapes of Tukey's lambda distribution that are sought: -1/2 has no variance; 0.135 is nearly
normal."""


GROUPS = 20
"""Groups of rows left out in turn, for the confidence interval of a shape."""
REACH = 40.0
"""Largest difference with a bin of its own, over the robust standard deviation."""
FINENESS = 12
"""Grid points of densities in a standard deviation of the noise: they widen it by 1e-3 of it."""


def is_significant(found: Estimate) -> bool:
    """Return whether a number is significantly above 0."""
    return found.value > SIGNIFICANT * found.error + found.below


def difference_counts(frames: Array, good: Array) -> Array:
    """Return how often pixels differ by a number of codes between two frames (groups, codes).

    Two and two frames are compared, so that no pair shares a frame. The last code counts all that
    differ by it or more.

    Parameters
    ----------
    frames : Array
        Codes (n, rows, columns) [DN].
    good : Array
        Which pixels count (rows, columns).
    """
    pairs = len(frames) // 2
    apart = abs(frames[1 : 2 * pairs : 2].astype(np.int64) - frames[0 : 2 * pairs : 2])
    most = math.ceil(REACH * max(1.4826 * float(np.median(apart[:, good])), 1.0))
    apart = np.minimum(apart, most)
    listed = np.array_split(np.arange(good.shape[0]), min(GROUPS, good.shape[0]))
    return np.array(
        [np.bincount(apart[:, rows][:, good[rows]].ravel(), minlength=most + 1) for rows in listed]
    )


def tail_shape(counts: Array, normal: float, electrons: float, gain: float) -> Estimate:
    """Return the shape of Tukey's lambda distribution of the readout, by maximum likelihood.

    Kurtosis would not do: of shapes below -1/8 that of a sample has no finite error, and falls
    short. The likelihood is that of differences of two frames: of two numbers of the readout, of
    two of the dark current's electrons, of lines, and of rounding, whose difference has a triangle
    for its density where the pixels' means lie anywhere between two codes.

    Parameters
    ----------
    counts : Array
        Of `difference_counts`.
    normal : float
        Variance of rows and columns [DN^2].
    electrons : float
        Mean dark current in the exposure [e].
    gain : float
        System gain [DN/e].

    Returns
    -------
    Estimate
        The shape; its error is that of leaving out each group of rows in turn (jackknife).
    """
    from scipy.fft import next_fast_len
    from scipy.optimize import minimize

    whole, codes = counts.sum(axis=0), counts.shape[1]
    seen = float(whole @ np.arange(codes) ** 2.0 / whole.sum() / 2)
    rest = seen - normal - gain**2 * electrons - ROUNDING
    begin = np.array([-0.05, 0.5 * math.log(max(rest, 0.1 * seen))])
    points = math.ceil(FINENESS / math.exp(begin[1]))
    half = math.ceil(1.25 * codes * points)
    size = next_fast_len(4 * half + 2, real=True)
    turn = 2 * math.pi * np.fft.rfftfreq(size, 1 / points)
    beside = np.exp(-(turn**2) * normal - 2 * electrons * (1 - np.cos(gain * turn)))
    beside *= np.sinc(turn / (2 * math.pi)) ** 2

    def likeliest(numbers: Array, start: Array) -> Array:
        def cost(place: Any) -> Any:
            mass = _readout(place, half, points)
            expected = _differences(mass, beside, size, codes, points)
            return -float(numbers @ np.log(np.maximum(expected, 1e-300)))

        simplex = start + np.array([[0.0, 0.0], [0.02, 0.0], [0.0, 0.02]])
        options: Any = {"xatol": 1e-4, "fatol": 1e-3, "initial_simplex": simplex}
        return np.asarray(minimize(cost, start, method="Nelder-Mead", options=options).x)

    best = likeliest(whole, begin)
    others = np.array([likeliest(whole - group, best)[0] for group in counts])
    count = len(counts)
    error = math.sqrt((count - 1) / count * float(((others - others.mean()) ** 2).sum()))
    return Estimate(float(np.clip(best[0], *SHAPES)), error)


def _readout(place: Array, half: int, points: int) -> Array:
    """Return the probability of the readout's noise in every cell of a grid (2 half + 1,).

    place: shape, and logarithm of the standard deviation [DN]; points: cells in a code.
    """
    from scipy.special import beta, expit

    shape, deviation = float(np.clip(place[0], *SHAPES)), math.exp(place[1])
    shape = shape if abs(shape) > 1e-6 else 1e-6
    spread = math.sqrt(2 * (1 / (1 + 2 * shape) - beta(shape + 1, shape + 1))) / abs(shape)
    # Logits reach far into both tails, where probabilities are lost in rounding beside 1.
    logits = np.linspace(-45.0, 45.0, 4001)
    low, high = shape * np.log(expit(logits)), shape * np.log(expit(-logits))
    values = (np.expm1(low) - np.expm1(high)) / shape * (deviation / spread)
    edges = (np.arange(-half, half + 2) - 0.5) / points
    return np.diff(expit(np.interp(edges, values, logits, left=-np.inf, right=np.inf)))


def _differences(mass: Array, beside: Array, size: int, codes: int, points: int) -> Array:
    """Return the probability that two frames differ by a number of codes, of either sign (codes,).

    beside: transform of the difference of all else (size // 2 + 1,).
    """
    from scipy.fft import irfft, rfft

    power = abs(rfft(mass, size)) ** 2 * beside
    density = irfft(power, size)[: codes * points : points] * points
    density[1:] *= 2
    density[-1] = max(1 - float(density[:-1].sum()), 1e-12)
    return np.asarray(density)


def neighbor_correlation(lag_one: float, rows_apart: int) -> float:
    """Return the correlation of neighboring rows from that of rows farther apart, at most 0.999."""
    return float(min(max(lag_one, 0.0), 0.999) ** (1 / rows_apart))
