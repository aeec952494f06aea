"""What a stack of frames is judged by: mean, variances, spectra of rows and columns, tails.

Each is taken of measured frames and of predicted ones by the same code, so that what it leaves out
is left out of both. Beside its value each has a form that is nearly normal: the logarithm of a
variance, the root of a count.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.verification.stack_statistics import robust_deviation, stack_statistics

BANDS = 0.0, 0.125, 0.25, 0.5
"""Ends of the bands of spectra [cycles/pixel]."""
WIDTHS = 0.5, 0.9
"""Shares of the values whose range is taken."""
TAILS = 3.0, 4.5
"""Standard deviations beyond which values are counted."""
OUTLIER = 6.0
"""Robust standard deviations from the median, from which a pixel's mean is an outlier."""
BLOCK = 8
"""Pixels along the blocks whose means tell slow differences over the array."""
LEAST_VARIANCE = 1e-6
"""Lower limit of variances before their logarithm [DN^2]."""


@dataclass(frozen=True)
class Quantity:
    """A number of a stack of frames of one color."""

    name: str
    """With its unit."""
    value: float
    normal: float
    """The value in a form whose distribution is nearly normal."""
    is_count: bool = False
    """Whether that is the root of a count."""
    is_logarithm: bool = False
    """Whether that is the logarithm."""


def quantities(frames: Array, highest: int) -> list[Quantity]:
    """Return what a stack of frames of one place of the color filter array is judged by.

    Parameters
    ----------
    frames : Array
        Codes (n, rows, columns); of one frame there is no temporal noise [DN].
    highest : int
        Highest code of the ADC [DN].

    Returns
    -------
    list of Quantity
        Mean; shares of codes at either end, and of pixels that are outliers; of the other pixels
        variances and spectra, those of temporal noise and those of the fixed pattern.
    """
    average = frames.mean(axis=0)
    median = float(np.median(average))
    spread = max(robust_deviation(average), 0.5)
    good = abs(average - median) <= OUTLIER * spread
    mean = float(average[good].mean())
    shares = {
        "codes of 0": frames == 0,
        "codes at the highest": frames == highest,
        "outliers of the pattern": ~good,
    }
    found = [Quantity("mean [DN]", mean, mean)]
    found += [_share(name, where) for name, where in shares.items()]
    filled = np.where(good, frames, mean)
    if len(frames) > 1:
        found += _temporal(filled, good)
    return found + list(_spatial(filled.mean(axis=0), good, len(frames)))


def _variance(name: str, value: float) -> Quantity:
    form = math.log(max(value, LEAST_VARIANCE))
    return Quantity(f"{name} [DN2]", value, form, is_logarithm=True)


def _share(name: str, where: Array) -> Quantity:
    """Return a share; the root of a count of Poisson has a variance of 1/4 (Anscombe 1948)."""
    count = int(where.sum())
    return Quantity(f"{name} [1]", count / where.size, math.sqrt(count + 3 / 8), True)


def _temporal(frames: Array, good: Array) -> Iterator[Quantity]:
    """Yield variance, spectra and tails of what is new in every frame."""
    told = stack_statistics(frames, good)
    yield _variance("temporal variance of pixels", told.pixel.value)
    residual = frames - frames.mean(axis=0)
    residual -= residual.mean(axis=(1, 2), keepdims=True)
    rows, columns = residual.mean(axis=2), residual.mean(axis=1)
    yield from _spectrum("temporal variance of rows", rows)
    yield from _spectrum("temporal variance of columns", columns)
    residual -= rows[:, :, None] + columns[:, None, :]
    yield from _widths("temporal noise", residual[:, good], 1 / len(frames))
    deviation = max(float(np.sqrt(np.mean(residual[:, good] ** 2))), LEAST_VARIANCE)
    for limit in TAILS:
        yield _share(f"temporal noise beyond {limit:g} sigma", abs(residual) > limit * deviation)
    # The kurtosis of heavy tails has tails itself, which its reciprocal ends at 0.
    form = -3 / max(told.excess.value + 3, 0.1)
    yield Quantity("excess kurtosis of temporal noise [1]", told.excess.value, form)


def _spatial(average: Array, good: Array, frames: int) -> Iterator[Quantity]:
    """Yield variance and spectra of the mean of `frames` frames: pattern, and residual noise.

    That of pixels is without slow differences, which are those of blocks.
    """
    each = average - average.mean()
    rows, columns = each.mean(axis=1), each.mean(axis=0)
    yield from _spectrum("spatial variance of rows", rows[None])
    yield from _spectrum("spatial variance of columns", columns[None])
    each -= rows[:, None] + columns
    down, across = each.shape[0] // BLOCK, each.shape[1] // BLOCK
    if min(down, across) > 1:
        cut = each[: down * BLOCK, : across * BLOCK].reshape(down, BLOCK, across, BLOCK)
        blocks = cut.mean(axis=(1, 3), keepdims=True)
        yield _variance(f"spatial variance of blocks of {BLOCK} x {BLOCK}", float(blocks.var()))
        each = cut - blocks
    yield _variance("spatial variance of pixels", float(each.var()))
    yield from _widths("pattern of pixels", each[_good_cells(good, each.shape)], 1 / frames)


def _good_cells(good: Array, shape: tuple[int, ...]) -> Array:
    """Return which pixels count, in the shape of blocks where there are any."""
    if len(shape) == 2:
        return good
    return good[: shape[0] * shape[1], : shape[2] * shape[3]].reshape(shape)


def _widths(name: str, values: Array, step: float) -> Iterator[Quantity]:
    """Yield how far apart quantiles are, which few large values do not change.

    step: of the values, which are spread over it, so that quantiles are no multiples of it.
    """
    smooth = values.ravel() + np.random.default_rng(0).uniform(-step / 2, step / 2, values.size)
    quantiles = np.quantile(smooth, [(1 - share) / 2 for share in (*WIDTHS, *(-w for w in WIDTHS))])
    for number, share in enumerate(WIDTHS):
        width = float(quantiles[len(WIDTHS) + number] - quantiles[number])
        form = math.log(max(width, LEAST_VARIANCE))
        label = f"width of {share:.0%} of the {name} [DN]"
        yield Quantity(label, width, form, is_logarithm=True)


def _spectrum(name: str, profiles: Array) -> Iterator[Quantity]:
    """Yield the variance of profiles (n, length) that falls into each band of frequencies."""
    length = profiles.shape[1]
    power = (abs(np.fft.rfft(profiles, axis=1)) ** 2).mean(axis=0) / length**2
    power[1 : (length + 1) // 2] *= 2  # of negative frequencies, too
    frequency = np.fft.rfftfreq(length)
    for low, high in pairwise(BANDS):
        inside = (frequency > low) & (frequency <= high)
        if inside.any():
            yield _variance(f"{name}, {low:g} to {high:g} c/px", float(power[inside].sum()))


def mean_of_planes(planes: list[list[Quantity]]) -> list[Quantity]:
    """Return the mean of each quantity over the planes of a color."""
    return [
        Quantity(
            each[0].name,
            float(np.mean([q.value for q in each])),
            float(np.mean([q.normal for q in each])),
            each[0].is_count,
            each[0].is_logarithm,
        )
        for each in zip(*planes, strict=True)
    ]
