"""Tails of the read noise and bands of the rows: what is more than normal, independent noise."""

from __future__ import annotations

from typing import Any

from vcam_cli.verification.stack_statistics import Estimate

SIGNIFICANT = 5.0
"""Standard errors from which tails, or a correlation of rows, are more than chance."""
SHAPES = -0.24, 0.134
"""Shapes of Tukey's lambda distribution between which kurtosis tells it: infinite at -1/4, that of
a normal distribution at 0.135."""


def is_significant(found: Estimate) -> bool:
    """Return whether a number is above 0 by more than chance."""
    return found.value > SIGNIFICANT * found.error


def tail_shape(excess: float) -> float:
    """Return the shape of Tukey's lambda distribution of an excess kurtosis.

    Parameters
    ----------
    excess : float
        Excess kurtosis, 0 of a normal distribution.

    Returns
    -------
    float
        Shape, within `SHAPES`.
    """
    from scipy.optimize import brentq
    from scipy.stats import tukeylambda

    def short(shape: float) -> float:
        kurtosis: Any = tukeylambda.stats(shape, moments="k")  # type: ignore[call-overload]
        return float(kurtosis) - excess

    heaviest, lightest = SHAPES
    if short(heaviest) <= 0:
        return heaviest
    if short(lightest) >= 0:
        return lightest
    return float(brentq(short, heaviest, lightest))


def neighbor_correlation(lag_one: float, rows_apart: int) -> float:
    """Return the correlation of neighboring rows from that of rows farther apart, at most 0.999."""
    return min(max(lag_one, 0.0), 0.999) ** (1 / rows_apart)
