"""The fixed pattern of a stack: variances of pixels, columns, rows, and of what changes slowly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.fitting.noise_shape import is_significant
from vcam_cli.quality import nonuniformity
from vcam_cli.verification.stack_statistics import Estimate, StackStatistics

CYCLES = 2
"""Highest spatial frequency of what changes slowly [cycles over the array]."""


@dataclass(frozen=True)
class Pattern:
    """Spatial variances of a stack with their errors [DN^2]."""

    total: Estimate
    pixel: Estimate
    column: Estimate
    row: Estimate
    slow: Estimate
    """What changes slowly over the array; where it is more than chance the others are without."""


def pattern(stack: StackStatistics, good: NDArray) -> Pattern:
    """Return the spatial variances, freed of the temporal noise that is left in the mean.

    What is taken out has an error of its own, which is independent of that of the mean: of n
    frames it is 1 / (n - 1) of the variance of what is left, and so of weight in short stacks.

    Parameters
    ----------
    stack : StackStatistics
        The stack.
    good : NDArray
        Which pixels count; the others take the mean of all.

    Returns
    -------
    Pattern
        Variances by eqs 36 and 42 of EMVA 1288 release 4.0 (`quality.nonuniformity`).
    """
    rows, columns = good.shape
    filled = np.where(good, stack.average, stack.mean.value)
    slow, surface = slow_part(filled)
    if is_significant(slow):
        filled = filled - surface
    found = nonuniformity.spatial_variance(
        nonuniformity.Stack(stack.frames, filled, stack.pixel.value)
    )
    n, share = stack.frames, float(good.mean())
    pixel_seen = (found.pixel + stack.pixel.value / n) / share
    column = found.column - max(stack.column.value, 0.0) / n
    row = found.row - max(stack.row.value, 0.0) / n
    pixel = found.pixel / share
    errors = {
        "pixel": _chi(pixel_seen, (rows - 1) * (columns - 1)),
        "column": _chi(found.column + pixel_seen / rows, columns - 1),
        "row": _chi(found.row + pixel_seen / columns, rows - 1),
    }
    left = {"pixel": stack.pixel, "column": stack.column, "row": stack.row}
    whole = {name: math.hypot(error, left[name].error / n) for name, error in errors.items()}
    every = pixel + row + column + (slow.value if is_significant(slow) else 0.0)
    return Pattern(
        total=Estimate(every, math.hypot(*whole.values())),
        pixel=Estimate(pixel, whole["pixel"]),
        column=Estimate(column, whole["column"]),
        row=Estimate(row, whole["row"]),
        slow=slow,
    )


def slow_part(average: NDArray) -> tuple[Estimate, NDArray]:
    """Return the variance of what changes slowly over the array, and its surface.

    It is what the cosines of `effects/noise/fpn_shading.py` hold, up to `CYCLES` cycles over the
    array, less what white noise of pixels, columns and rows has in so few terms.

    Parameters
    ----------
    average : NDArray
        Mean frame (rows, columns) [DN].

    Returns
    -------
    variance : Estimate
        Variance [DN^2].
    surface : NDArray
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
    noise[0] = float(column.var()) / columns
    noise[:, 0] = float(row.var()) / rows
    noise *= terms != 0
    value = float((terms**2 - noise).sum())
    error = math.sqrt(float((2 * noise**2 + 4 * noise * terms**2).sum()))
    return Estimate(value, error), surface


def _cosines(length: int, count: int) -> NDArray:
    """Return cosines of unit mean square over so many pixels (length, count)."""
    waves = np.cos(np.pi / length * np.outer(np.arange(length) + 0.5, np.arange(count)))
    waves[:, 1:] *= math.sqrt(2)
    return waves


def _chi(variance: float, freedom: int) -> float:
    """Return the standard error of a variance of normal numbers."""
    return abs(variance) * math.sqrt(2 / max(freedom, 1))
