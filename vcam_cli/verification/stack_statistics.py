"""What a stack of frames says of noise and pattern: variances of pixels, columns and rows.

A frame's residual is what it differs from the mean of its stack, its own mean taken out, since
that is light that drifts. Means over its rows and columns hold the noise of these and a share of
the pixels'; the residual is the pixels' own. All divisors are degrees of freedom, so that
the variances do not depend on how many frames and pixels there are.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.quality import rounding
from vcam_cli.quality.photon_transfer import ROUNDING
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Estimate:
    """A number, its standard error, and bounds of what no average takes away: rounding."""

    value: float
    error: float
    below: float = 0.0
    """How far below the value the truth may be beside the error."""
    above: float = 0.0
    """How far above."""

    @property
    def reach(self) -> float:
        """The larger of both bounds."""
        return max(self.below, self.above)

    def __add__(self, other: Estimate) -> Estimate:
        """Return the sum of two numbers of independent errors; bounds add up."""
        return Estimate(
            self.value + other.value,
            math.hypot(self.error, other.error),
            self.below + other.below,
            self.above + other.above,
        )

    def __sub__(self, other: Estimate) -> Estimate:
        """Return the difference of two numbers of independent errors."""
        return self + other * -1.0

    def __mul__(self, factor: float) -> Estimate:
        """Return a multiple."""
        ends = self.below * abs(factor), self.above * abs(factor)
        return Estimate(
            self.value * factor, self.error * abs(factor), *(ends if factor >= 0 else ends[::-1])
        )

    def __truediv__(self, other: Estimate) -> Estimate:
        """Return the ratio of two numbers of independent errors."""
        ratio, size = self.value / other.value, abs(other.value)
        more = abs(ratio) * other.reach
        return Estimate(
            ratio,
            math.hypot(self.error, ratio * other.error) / size,
            (self.below + more) / size,
            (self.above + more) / size,
        )


def combine(estimates: list[Estimate], weights: list[float] | None = None) -> Estimate:
    """Return the mean of independent estimates of one number, by weight where there are any."""
    weights = weights or [1.0] * len(estimates)
    scaled = [each * weight for each, weight in zip(estimates, weights, strict=True)]
    return sum(scaled[1:], scaled[0]) * (1 / sum(weights))


def robust_deviation(values: Array) -> float:
    """Return the standard deviation of normal numbers by their median absolute deviation."""
    return 1.4826 * float(np.median(abs(values - np.median(values))))


@dataclass(frozen=True)
class StackStatistics:
    """A plane of one color of a stack: means, and variances with their errors [DN, DN^2]."""

    frames: int
    average: Array
    """Mean of the frames (rows, columns) [DN]."""
    mean: Estimate
    """Mean of the good pixels [DN]."""
    pixel: Estimate
    """Temporal variance of pixels by themselves [DN^2]."""
    row: Estimate
    """Temporal variance of rows [DN^2]."""
    column: Estimate
    """Temporal variance of columns [DN^2]."""
    row_correlation: Estimate
    """Correlation of neighboring rows of the plane."""
    excess: Estimate
    """Excess kurtosis of the pixels' noise."""
    hidden: tuple[float, float]
    """Least and largest standard deviation of the temporal noise before rounding [DN]."""

    @property
    def is_hidden(self) -> bool:
        """Whether rounding may hide all of the temporal noise (EMVA 1288 release 4.0, eq 54)."""
        return self.hidden[0] == 0.0

    @property
    def temporal(self) -> float:
        """Temporal variance of all kinds together [DN^2]."""
        return self.pixel.value + max(self.row.value, 0.0) + max(self.column.value, 0.0)


def stack_statistics(frames: Array, good: Array) -> StackStatistics:
    """Return the statistics of a stack of two frames or more.

    Parameters
    ----------
    frames : Array
        Codes (n, rows, columns) [DN].
    good : Array
        Which pixels count (rows, columns).

    Returns
    -------
    StackStatistics
        Means and variances; those of normal noise have the error of a chi-squared number.
    """
    n, rows, columns = frames.shape
    average = frames.mean(axis=0)
    second = fourth = by_row = by_column = lagged = 0.0
    share = float(good.mean())
    for frame in frames:
        residual = np.where(good, frame - average, 0.0)
        residual -= np.where(good, residual.sum() / good.sum(), 0.0)
        row_means, column_means = residual.mean(1) / share, residual.mean(0) / share
        by_row += float((row_means**2).sum())
        lagged += float((row_means[1:] * row_means[:-1]).sum())
        by_column += float((column_means**2).sum())
        residual -= np.where(good, row_means[:, None] + column_means, 0.0)
        square = residual**2
        second += float(square.sum())
        fourth += float((square**2).sum())
    freedom = (n - 1) * ((rows - 1) * (columns - 1) - float((~good).sum()))
    pixel = second / freedom
    count = n * float(good.sum())
    # of the residuals of n frames; fourth cumulants shrink by this factor, variances by (n-1)/n
    shrink = ((1 - 1 / n) ** 4 + (n - 1) / n**4) / (1 - 1 / n) ** 2
    excess = ((fourth / count) / (second / count) ** 2 - 3) / shrink if second else 0.0
    spread = math.sqrt(max(2 + excess, 0.1) / freedom)
    row = by_row / ((n - 1) * (rows - 1))
    column = by_column / ((n - 1) * (columns - 1))
    own_row = row - pixel / columns
    correlation = lagged / ((n - 1) * (rows - 1)) / own_row if own_row > 0 else 0.0
    correlation_error = (row / own_row if own_row > 0 else 1.0) / math.sqrt((n - 1) * rows)
    error = math.hypot(pixel * spread, row * math.sqrt(2 / ((n - 1) * (rows - 1))))
    temporal = pixel + max(row, 0.0) + max(column, 0.0)
    low, high = rounding.deviations(temporal, error)
    spatial = float(average[good].var())
    # Pixels whose means are spread over the codes round up and down alike.
    off = rounding.mean_error(rounding.deviations(temporal + spatial, error)[0])
    unknown = (math.inf, math.inf) if low == 0 else (0.0, 0.0)
    mean_error = math.sqrt(max(pixel, 1 / 12) / (n * rows * columns) + _share(row, rows, n)
                           + _share(column, columns, n))  # fmt: skip
    return StackStatistics(
        n,
        average,
        Estimate(float(average[good].mean()), mean_error, off, off),
        Estimate(pixel, pixel * spread, *_bounds(temporal - ROUNDING, low, high)),
        _line(own_row, row * math.sqrt(2 / ((n - 1) * (rows - 1))), low, high),
        _line(column - pixel / rows, column * math.sqrt(2 / ((n - 1) * (columns - 1))), low, high),
        Estimate(correlation, correlation_error, *unknown),
        Estimate(excess, math.sqrt(24 / freedom) / shrink, *unknown),
        (low, high),
    )


def _bounds(variance: float, low: float, high: float) -> tuple[float, float]:
    """Return how far below and above a variance the squares of two deviations are [DN^2]."""
    return max(variance - low**2, 0.0), max(high**2 - variance, 0.0)


def _line(variance: float, error: float, low: float, high: float) -> Estimate:
    """Return the variance of lines with the bounds that rounding sets.

    low, high: standard deviations of all temporal noise [DN].
    """
    found = with_rounding(Estimate(variance, error), low)
    return replace(found, above=min(found.above, max(high**2 - variance, 0.0)))


def with_rounding(found: Estimate, deviation: float) -> Estimate:
    """Return a variance of mean codes with the bounds that rounding sets.

    deviation: least standard deviation of the noise that is averaged [DN].
    """
    spread = math.sqrt(max(found.value, 0.0))
    off = rounding.spread_error(deviation, max(spread, math.sqrt(found.error)))
    bounds = _bounds(found.value, max(spread - off, 0.0), spread + off) if off else (0.0, 0.0)
    return replace(found, below=bounds[0], above=bounds[1])


def _share(line_variance: float, lines: int, frames: int) -> float:
    return max(line_variance, 0.0) / (lines * frames)
