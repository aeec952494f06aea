"""Random telegraph noise from a stack of dark frames: pixels with traps, by maximum likelihood.

Where the noise of a pixel is normal with variance s^2, the sum of squares of its n values about
their mean is s^2 times a chi-squared number of n - 1 degrees of freedom. Where a trap of step A was
filled in k of the n frames it is a noncentral one, of noncentrality A^2 k (n - k) / (n s^2). k is
binomial, A is distributed exponentially, as `effects/noise/telegraph_noise.py` has them. So the
histogram of the pixels' variances tells s^2, the share of pixels with traps and their mean step;
and whether few or most values of a pixel are high, the third moment's sign, tells how often a trap
is filled.

Noise with heavy tails makes variances large, too, but not of the same pixels again and again: traps
are only looked for where the variances of a pixel in two halves of the stack go together.

References
----------
.. [1] Wang, Rao, Mierop and Theuwissen, Random telegraph signal in CMOS image sensor pixels, IEDM
   2006, doi:10.1109/IEDM.2006.346973.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.verification.stack_statistics import Estimate

LEAST_FRAMES = 6
"""Frames of a stack that tells traps: three in each half."""
RARE = 0.01
"""Share of the pixels whose variance in half of the stack counts as large."""
SURE = 5.0
"""Standard deviations from which the count of pixels with two large variances is significant."""
CLEAR = 12.0
"""Variance over that of the median pixel from which the third moment's sign tells the state."""
EDGES = np.concatenate([[0.0], np.linspace(0.2, 3, 29), np.geomspace(3.3, 1000, 30), [np.inf]])
"""Edges of the histogram, over the median pixel's variance."""
Cost = Callable[..., Any]
"""From logarithms of core variance, fraction and step, and the logit of the occupancy."""
UNKNOWN = 1e3
"""Standard error of a logit that is not known."""
LITTLE_KNOWN = 0.3
"""Standard error of an occupancy that is not known, 12^-1/2; relative, what that leaves of
fraction and step."""
NODES, ROUGH = 110, 40
"""Steps over which the exponential distribution is summed, at last and before."""


@dataclass(frozen=True)
class Traps:
    """Telegraph noise of a sensor."""

    fraction: Estimate
    amplitude: Estimate
    """Mean of the steps [DN]."""
    occupancy: Estimate
    core: Estimate
    """Variance of pixels without traps [DN^2]."""

    @property
    def variance(self) -> float:
        """What traps add to the variance of pixels in the mean [DN^2]."""
        p = self.occupancy.value
        return self.fraction.value * 2 * self.amplitude.value**2 * p * (1 - p)


@dataclass(frozen=True)
class PixelMoments:
    """Moments of the temporal noise of every pixel (pixels,)."""

    frames: int
    variance: Array
    """Of all frames [DN^2]."""
    halves: tuple[Array, Array]
    """Of each half of the stack [DN^2]."""
    third: Array
    """Sum of cubes [DN^3]."""
    lines: float
    """What the means of rows and columns that are taken out add to each variance [DN^2]."""


def pixel_moments(frames: Array, good: Array) -> PixelMoments:
    """Return the moments of the good pixels, noise of frames, rows and columns taken out.

    A mean over a row contains a share of the pixel itself, which the difference would lose: it is
    scaled up, as if each mean were that of the row's other pixels. A trap's step keeps its size so,
    and the noise of these means is that of all pixels, which is known.

    Parameters
    ----------
    frames : Array
        Codes (n, rows, columns) [DN].
    good : Array
        Which pixels count (rows, columns).
    """
    residual = np.where(good, frames - frames.mean(axis=0), 0.0)
    residual -= residual.mean(axis=(1, 2), keepdims=True)
    residual -= residual.mean(axis=2, keepdims=True) + residual.mean(axis=1, keepdims=True)
    own = math.prod(1 - 1 / length for length in good.shape)
    each = residual[:, good] / own
    each -= each.mean(axis=0)
    half = len(frames) // 2
    halves = _variance(each[:half]), _variance(each[half:])
    variance = _variance(each)
    lines = float(variance.mean()) * (1 - own)
    return PixelMoments(len(frames), variance, halves, (each**3).sum(axis=0), lines)


def _variance(values: Array) -> Array:
    """Return the variance of each column (pixels,), 0 of a single frame."""
    return np.asarray(values.var(axis=0, ddof=min(1, len(values) - 1)))


def find_traps(moments: list[PixelMoments]) -> Traps | None:
    """Return the telegraph noise of pixels; None where it is not significant.

    Parameters
    ----------
    moments : list of PixelMoments
        Of the planes of a stack; of fewer than `LEAST_FRAMES` frames there is no answer.

    Returns
    -------
    Traps or None
        Share, mean step, occupancy, each with its standard error by the curvature of the
        likelihood.
    """
    frames = moments[0].frames
    if frames < LEAST_FRAMES or not _go_together(moments):
        return None
    variance = np.concatenate([m.variance for m in moments])
    third = np.concatenate([m.third for m in moments])
    unit = float(np.median(variance))
    counts = _histogram(variance / unit, third)

    def cost(place: Array, nodes: int = NODES) -> float:
        expected = _probabilities(place, frames, nodes)
        return -float((counts * np.log(np.maximum(expected, 1e-300))).sum())

    found = _most_likely(cost)
    if found is None:
        return None
    place, errors = found
    values = _values(place, frames)
    scales = unit, 1.0, math.sqrt(unit), 1.0
    core, fraction, amplitude, occupancy = (
        Estimate(value * scale, error * slope * scale)
        for value, error, slope, scale in zip(
            values, errors, _slopes(place, frames), scales, strict=True
        )
    )
    rarer = min(occupancy.value, 1 - occupancy.value)
    if rarer * frames < 1.05:  # at the end of its range: fraction and step rest on it
        occupancy = replace(occupancy, error=LITTLE_KNOWN)
        fraction, amplitude = (
            replace(each, error=math.hypot(each.error, LITTLE_KNOWN * each.value))
            for each in (fraction, amplitude)
        )
    lines = Estimate(float(np.mean([m.lines for m in moments])), 0.0)
    return Traps(fraction, amplitude, occupancy, core - lines)


def _most_likely(cost: Cost) -> tuple[Array, Array] | None:
    """Return where the cost is least, and the standard errors there; None where it is nowhere.

    Rare and frequent steps may each be a minimum by itself.
    """
    from scipy.optimize import minimize

    found = []
    for occupancy in (-1.0, 0.0, 1.0):
        begin = np.array([0.0, math.log(0.02), math.log(5.0), occupancy])
        rough = minimize(
            cost, begin, (ROUGH,), method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3}
        )
        found.append(rough)
    best = min(found, key=lambda each: each.fun)
    place = minimize(cost, best.x, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-4}).x
    errors = _errors(cost, place)
    return (place, errors) if np.isfinite(errors).all() else None


def _go_together(moments: list[PixelMoments]) -> bool:
    """Return whether significantly many pixels have large variances in both halves."""
    first, second = (np.concatenate([m.halves[h] for m in moments]) for h in (0, 1))
    large = [each > np.quantile(each, 1 - RARE) for each in (first, second)]
    chance = float(large[0].mean() * large[1].mean()) * len(first)
    return float((large[0] & large[1]).sum()) > chance + SURE * math.sqrt(max(chance, 1.0))


def _histogram(variance: Array, third: Array) -> Array:
    """Return counts (2, bins): below and above 0 is the third moment where it tells the state."""
    number = np.clip(np.searchsorted(EDGES, variance, "right") - 1, 0, len(EDGES) - 2)
    sign = ((third > 0) & (EDGES[number] >= CLEAR)).astype(int)
    counts = np.zeros((2, len(EDGES) - 1))
    np.add.at(counts, (sign, number), 1)
    return counts


def _values(place: Array, frames: int) -> tuple[float, float, float, float]:
    """Return core variance, fraction, mean step and occupancy, in units of the median pixel.

    A trap that is filled, or empty, in less than one of this number of frames is not seen again
    and again: a few rare steps in all pixels would look like it.
    """
    core, fraction, amplitude, occupancy = map(float, place)
    share = 1 / (1 + math.exp(-occupancy))
    return (
        math.exp(core),
        min(math.exp(fraction), 1.0),
        math.exp(amplitude),
        min(max(share, 1 / frames), 1 - 1 / frames),
    )


def _slopes(place: Array, frames: int) -> tuple[float, float, float, float]:
    """Return how fast the values change with the place."""
    core, fraction, amplitude, occupancy = _values(place, frames)
    return core, fraction, amplitude, occupancy * (1 - occupancy)


def _probabilities(place: Array, frames: int, nodes: int = NODES) -> Array:
    """Return the probability of every bin of the histogram (2, bins)."""
    from scipy.special import chdtr, chndtr
    from scipy.stats import binom

    core, fraction, amplitude, occupancy = _values(place, frames)
    freedom = frames - 1
    scaled = EDGES[1:-1] * freedom / core
    plain = np.diff(np.concatenate([[0.0], chdtr(freedom, scaled), [1.0]]))
    filled = np.arange(frames + 1)
    share = binom.pmf(filled, frames, occupancy)
    # Few noncentralities suffice: between them the distribution is smooth.
    centers = np.concatenate([[0.0], np.geomspace(0.05, 4e4, nodes)])
    table = chndtr(scaled, freedom, centers[:, None])
    table = np.diff(np.concatenate([np.zeros((len(centers), 1)), table,
                                    np.ones((len(centers), 1))], axis=1))  # fmt: skip
    out = np.zeros((2, len(plain)))
    clear = EDGES[:-1] >= CLEAR
    for k in filled:
        # The share of steps A up to each noncentrality A^2 k (n - k) / (n core).
        lever = k * (frames - k) / (frames * core)
        own = table[0]
        if lever:
            steps = np.sqrt(centers / lever)
            mass = -np.diff(np.concatenate([np.exp(-steps / amplitude), [0.0]]))
            middle = (table[:-1] + table[1:]) / 2
            own = mass[:-1] @ middle + mass[-1] * table[-1]
        upper = 0.5 if 2 * k == frames else float(2 * k < frames)  # few high: third moment above 0
        out[1] += share[k] * own * upper * clear
        out[0] += share[k] * own * np.where(clear, 1 - upper, 1.0)
    plain_part = np.stack([plain * np.where(clear, 0.5, 1.0), plain * 0.5 * clear])
    return (1 - fraction) * plain_part + fraction * out


def _errors(cost: Cost, place: Array) -> Array:
    """Return standard errors from the curvature of the negative logarithm of the likelihood.

    Where it has none along the occupancy, which then ends its range, that is not known, and the
    others are; infinite where it is no minimum along these.
    """
    size, step = len(place), 0.02
    hessian = np.empty((size, size))
    moved = np.eye(size) * step
    for i in range(size):
        for j in range(i + 1):
            corners = [cost(place + a * moved[i] + b * moved[j]) for a, b in
                       ((1, 1), (1, -1), (-1, 1), (-1, -1))]  # fmt: skip
            value = (corners[0] - corners[1] - corners[2] + corners[3]) / (4 * step**2)
            hessian[i, j] = hessian[j, i] = value
    for known in (size, size - 1):
        part = hessian[:known, :known]
        if np.linalg.eigvalsh(part).min() > 0:
            errors = np.sqrt(np.diag(np.linalg.inv(part)))
            return np.append(errors, np.full(size - known, UNKNOWN))
    return np.full(size, np.inf)
