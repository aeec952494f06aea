"""The fixed pattern of a stack: variances of pixels, columns, rows, and of what changes slowly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.fitting.noise_shape import is_significant
from vcam_cli.quality import nonuniformity, rounding
from vcam_cli.records import dataclass
from vcam_cli.verification.stack_statistics import (
    Estimate,
    StackStatistics,
    robust_deviation,
    with_rounding,
)

CYCLES = 2
"""Highest spatial frequency of what changes slowly [cycles over the array]."""
ALIEN = 7.0
"""Robust standard deviations of the columns' means from which a column is unlike the others. Of few
columns these are themselves known to some 15 %: of 48 normal ones none is so far off."""
LEAST_COLUMNS = 32
"""Least number of columns for a robust deviation; among fewer no outlier is reported."""
ROUNDS = 30
"""Steps of the fit of least absolute deviations; after a third of them aliens have no weight."""


@dataclass(frozen=True)
class Pattern:
    """Spatial variances of a stack with their errors [DN^2]."""

    total: Estimate
    pixel: Estimate
    column: Estimate
    row: Estimate
    slow: Estimate
    """Slow variation over the array; where it is significant the others exclude it."""
    alien: tuple[int, ...] = ()
    """Numbers of columns of the plane unlike the others, which all but `total` leave out."""
    largest: float = 0.0
    """How far the mean of one of these is off, at most [DN]."""


def pattern(stack: StackStatistics, good: Array) -> Pattern:
    """Return the spatial variances, freed of the temporal noise that is left in the mean.

    What is taken out has an error of its own, which is independent of that of the mean: of n
    frames it is 1 / (n - 1) of the residual's variance, and so matters in short stacks.

    Parameters
    ----------
    stack : StackStatistics
        The stack.
    good : Array
        Which pixels count; the others take the mean of all.

    Returns
    -------
    Pattern
        Variances by eqs 36 and 42 of EMVA 1288 release 4.0 (`quality.nonuniformity`).
    """
    rows, columns = good.shape
    filled = np.where(good, stack.average, stack.mean.value)
    off = _aliens(filled.mean(axis=0))
    slow, surface = slow_part(filled - off)
    if is_significant(slow):
        filled = filled - surface
    alike = np.flatnonzero(off == 0)
    kept = len(alike)
    found = nonuniformity.spatial_variance(
        nonuniformity.Stack(stack.frames, filled[:, alike], stack.pixel.value)
    )
    n, share = stack.frames, float(good[:, alike].mean())
    seen = found.pixel + stack.pixel.value / n
    pixel, pixel_seen = found.pixel / share, seen / share
    taken = 1 + (2 * CYCLES if is_significant(slow) else 0)  # cosines of columns alone, and a mean
    freedom = {"column": max(kept - taken, 1), "row": max(rows - taken, 1)}
    column = _of_lines(found.column, seen / rows, kept, freedom["column"])
    row = _of_lines(found.row, seen / kept, rows, freedom["row"])
    column -= max(stack.column.value, 0.0) / n
    row -= max(stack.row.value, 0.0) / n
    # Pixels that are noisier than others leave more of it: the square of their variances has the
    # excess kurtosis of all noise in it, three times its relative variance.
    noisier = stack.pixel.value / n * math.sqrt(max(stack.excess.value, 0.0) / 3)
    errors = {
        "pixel": _chi(math.hypot(pixel_seen, noisier), (rows - 1) * (kept - 1)),
        "column": _chi(found.column + pixel_seen / rows, freedom["column"]),
        "row": _chi(found.row + pixel_seen / kept, freedom["row"]),
    }
    left = {"pixel": stack.pixel, "column": stack.column, "row": stack.row}
    whole = {name: math.hypot(error, left[name].error / n) for name, error in errors.items()}
    values = {"pixel": pixel, "column": column, "row": row}
    parts = {
        name: with_rounding(Estimate(value, whole[name]), stack.hidden[0])
        for name, value in values.items()
    }
    every = pixel + row + column + (slow.value if is_significant(slow) else 0.0)
    every += float((off**2).sum()) / columns
    total = with_rounding(Estimate(every, math.hypot(*whole.values())), stack.hidden[0])
    # Noise and pattern together are a rounded number, too, and each is a part of them.
    low, high = rounding.deviations(stack.temporal + every, total.error)
    least = max(low**2 - stack.hidden[1] ** 2, 0.0)
    rest = column + row + parts["column"].above + parts["row"].above
    return Pattern(
        total=_with_bounds_within(total, least, high**2),
        pixel=_with_bounds_within(parts["pixel"], least - rest, high**2),
        column=_with_bounds_within(parts["column"], 0.0, high**2),
        row=_with_bounds_within(parts["row"], 0.0, high**2),
        slow=with_rounding(slow, stack.hidden[0]),
        alien=tuple(int(column) for column in np.flatnonzero(off)),
        largest=float(off[np.argmax(abs(off))]),
    )


def _with_bounds_within(found: Estimate, low: float, high: float) -> Estimate:
    """Return a variance whose bounds reach no farther than to both ends [DN^2]."""
    below, above = max(found.value - max(low, 0.0), 0.0), max(high - found.value, 0.0)
    return replace(found, below=min(found.below, below), above=min(found.above, above))


def _of_lines(found: float, pixels: float, count: int, freedom: int) -> float:
    """Return the variance of lines from that of eq 42, which divides by their number.

    pixels: share of the pixels in the variance of a line's mean [DN^2].
    """
    return (found + pixels) * count / freedom - pixels


def _aliens(means: Array) -> Array:
    """Return by how much columns are off that are unlike all others (columns,), else 0 [DN].

    Off the cosines through all columns' means, by least absolute deviations: a few bright columns
    at an edge hardly move these, and would be fitted by least squares.
    """
    columns = len(means)
    if columns < LEAST_COLUMNS:
        return np.zeros(columns)
    waves = _cosines(columns, 2 * CYCLES + 1)
    apart = means - np.median(means)
    limit = math.inf
    for step in range(ROUNDS):
        weights = 1 / np.sqrt(np.maximum(abs(apart), 0.1 * robust_deviation(apart) or 1.0))
        weights[abs(apart) > limit] = 0
        terms, *_ = np.linalg.lstsq(waves * weights[:, None], means * weights, rcond=None)
        apart = means - waves @ terms
        if 3 * step >= ROUNDS:
            # A fit of least absolute deviations goes through as many points as it has terms.
            free = np.sort(abs(apart))[len(terms) :]
            limit = ALIEN * 1.4826 * float(np.median(free)) or math.inf
    return np.where(abs(apart) > limit, apart, 0.0)


def slow_part(average: Array) -> tuple[Estimate, Array]:
    """Return the variance of what changes slowly over the array, and its surface.

    It is what the cosines of `effects/noise/fpn_shading.py` hold, up to `CYCLES` cycles over the
    array, less what white noise of pixels, columns and rows has in so few terms.

    Parameters
    ----------
    average : Array
        Mean frame (rows, columns) [DN].

    Returns
    -------
    variance : Estimate
        Variance [DN^2].
    surface : Array
        The sum of the cosines (rows, columns) [DN].
    """
    rows, columns = average.shape
    low = [min(2 * CYCLES + 1, length) for length in (rows, columns)]
    down, across = (_cosines(length, count) for length, count in zip((rows, columns), low,
                                                                     strict=True))  # fmt: skip
    each = average - average.mean()
    terms = down.T @ each @ across / each.size
    terms *= np.hypot(*np.indices(terms.shape)) <= 2 * CYCLES
    terms[0, 0] = 0
    surface = down @ terms @ across.T
    rest = each - surface
    column, row = rest.mean(axis=0), rest.mean(axis=1)
    own = float((rest - column - row[:, None]).var()) / each.size
    noise = np.full(terms.shape, own)
    noise[0] = float((column**2).sum()) / max(columns - low[1], 1) / columns
    noise[:, 0] = float((row**2).sum()) / max(rows - low[0], 1) / rows
    noise *= terms != 0
    value = float((terms**2 - noise).sum())
    error = math.sqrt(float((2 * noise**2 + 4 * noise * terms**2).sum()))
    return Estimate(value, error), surface


def _cosines(length: int, count: int) -> Array:
    """Return cosines of unit mean square over `length` pixels (length, count)."""
    waves = np.cos(np.pi / length * np.outer(np.arange(length) + 0.5, np.arange(count)))
    waves[:, 1:] *= math.sqrt(2)
    return waves


def _chi(variance: float, freedom: int) -> float:
    """Return the standard error of a variance of normal numbers."""
    return abs(variance) * math.sqrt(2 / max(freedom, 1))
