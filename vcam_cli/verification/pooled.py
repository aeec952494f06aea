"""Quantities of one kind pooled over frames and colors: many small differences of the same sign.

A conversion gain that is 5 % off changes every temporal variance by 5 %, which may be within the
chance of each. Their sum is not: equal deviations of n frames add up to n, and by
chance to about n^1/2. The predicted stacks give its distribution: each has its own sum, of
its deviations from the others, including errors shared by frames of one sensor.
"""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.records import dataclass
from vcam_cli.verification.stack_prediction import Judged

SURE = 1.30
"""Student's t of 39 degrees of freedom that nine in ten are below: an error whose deviation is
beyond the bound by this is found in 90 % of tests."""
MAIN = (
    *("temporal variance of pixels", "width of 50% of the temporal noise"),
    *("spatial variance of pixels", "width of 50% of the pattern of pixels"),
)
"""Kinds that a wrong gain, noise or pattern shows in: half of the false alarms is theirs."""
CLIPPED = 0.05
"""Share of codes at the highest above which frames tell nothing of noise."""
NO_NOISE = 1e-3
"""Temporal variance below which frames have none [DN^2]."""
NO_CHANCE = 1e-6
"""Standard deviation of a quantity that is the same in all stacks: of frames that are clipped."""


@dataclass(frozen=True)
class Pooled:
    """A kind of quantity over several frames."""

    group: str
    """Which frames: all, all dark, all lit."""
    judged: Judged
    """Geometric means, and the deviation of the sum."""
    one_percent: float
    """By how much the deviation changes where all are off by 1 %; 0 where that means nothing."""

    @property
    def kind(self) -> str:
        """The kind in `MAIN`; "" of the others."""
        return next((kind for kind in MAIN if self.judged.name.startswith(kind)), "")

    def least_error(self, bound: float) -> float:
        """Return the relative error that is found in 90 % of tests; inf where none is."""
        return 0.01 * (bound + SURE) / self.one_percent if self.one_percent else math.inf


def pool(groups: dict[str, list[Judged]]) -> list[Pooled]:
    """Return every kind of quantity that a group of frames has more than once.

    Parameters
    ----------
    groups : dict
        Name of a group of frames -> what was judged of each frame and color.
    """
    found = []
    for group, listed in groups.items():
        kinds: dict[str, list[Judged]] = {}
        for each in listed:
            # Means of unlike light are no one kind, and each is sharp by itself.
            if each.spread > NO_CHANCE and not each.name.startswith("mean"):
                kinds.setdefault(each.name, []).append(each)
        found += [_pool(group, each) for each in kinds.values() if len(each) > 1]
    return found


def is_clipped(listed: list[Judged]) -> bool:
    """Return whether what was judged is of frames that the ADC or the pixels clip."""
    return any(
        (each.name.startswith("codes at the highest") and each.measured > CLIPPED)
        or (
            each.name.startswith("temporal variance of pixels")
            and min(each.measured, each.predicted) < NO_NOISE
        )
        for each in listed
    )


def _pool(group: str, listed: list[Judged]) -> Pooled:
    others = np.array([each.others for each in listed]).sum(axis=0)
    spread = max(float(np.sqrt(np.mean(others**2))), 1e-9)
    total = sum(each.deviation for each in listed)
    slopes = sum(1 / each.spread for each in listed if each.is_logarithm)
    measured, predicted = (
        _mean([getattr(each, name) for each in listed]) for name in ("measured", "predicted")
    )
    pooled = Judged("", listed[0].name, measured, predicted, total / spread)
    return Pooled(group, pooled, 0.01 * slopes / spread)


def _mean(values: list[float]) -> float:
    """Return the geometric mean, in which small numbers count like large ones, where it exists."""
    if min(values) > 0:
        return float(np.exp(np.mean(np.log(values))))
    return float(np.mean(values))
