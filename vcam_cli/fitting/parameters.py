"""Rows of parameters.csv: a number, its interval, how it was found."""

from __future__ import annotations

import math

from vcam_cli.fitting.noise_shape import is_significant
from vcam_cli.records import dataclass
from vcam_cli.verification.stack_statistics import Estimate

SIGMAS = 1.6448536269514722
"""Standard errors to either side that hold 90 % of a normal distribution."""
COLUMNS = ("parameter", "value", "low", "high", "unit", "method")


@dataclass(frozen=True)
class Parameter:
    """An estimated parameter with its 90 % interval."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    method: str

    @property
    def cells(self) -> tuple[str | float, ...]:
        """The row of parameters.csv."""
        return self.name, self.value, self.low, self.high, self.unit, self.method


def parameter(name: str, found: Estimate, unit: str, method: str) -> Parameter:
    """Return a parameter whose error is normal."""
    reach = SIGMAS * found.error
    ends = found.value - reach - found.below, found.value + reach + found.above
    return Parameter(name, found.value, *ends, unit, method)


def deviation(name: str, variance: Estimate, scale: Estimate, unit: str, method: str) -> Parameter:
    """Return a standard deviation, sqrt(variance) / scale; 0 where the variance is not above 0.

    The interval's ends are those of the variance: of its logarithm, which of a chi-squared number
    is the more nearly normal, where it is well above 0; of itself near 0, where its root and
    logarithm are far from normal.
    """
    reach = SIGMAS * variance.error
    ends = variance.value - reach, variance.value + reach
    if is_significant(variance):
        factor = math.exp(reach / variance.value)
        ends = variance.value / factor, variance.value * factor
    ends = ends[0] - variance.below, ends[1] + variance.above
    relative = (SIGMAS * scale.error + scale.reach) / scale.value
    value, low, high = (math.sqrt(max(v, 0.0)) / scale.value for v in (variance.value, *ends))
    low = value - math.hypot(value - low, value * relative)
    high = value + math.hypot(high - value, value * relative)
    return Parameter(name, value, max(low, 0.0), high, unit, method)
