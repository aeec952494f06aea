"""Light that contradicts the frames taken in it: photons that fall while the signal rises."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vcam_cli.errors import Collector
from vcam_cli.fitting.conditions import Condition, Conditions, photons_per_pixel
from vcam_cli.verification.frames import raise_if_any
from vcam_cli.verification.model import Measurement

APART = 0.02
"""Difference from which two signals differ, relative to the brightest."""
SURE = 5.0
"""Standard errors from which signals differ significantly."""
FULL = 0.9
"""Part of the brightest signal above which pixels may be full, and brighter light gives no more."""


def check_light(found: Conditions, measurement: Measurement) -> None:
    """Raise BadInput where the stated light and the signals cannot both be right."""
    problems = Collector()
    groups: dict[str, list[Condition]] = {}
    for condition in found.flat:
        groups.setdefault(str(condition.entry.light), []).append(condition)
    for group in groups.values():
        for number, message in _contradictions(group, found, measurement):
            remedy = "correct photons or irradiance, or leave them out of all flat frames"
            problems.add(("frames", number), message, remedy)
            break
    raise_if_any(problems, measurement)


def _contradictions(
    group: list[Condition], found: Conditions, measurement: Measurement
) -> Iterator[tuple[int, str]]:
    numbers = {id(entry): number for number, entry in enumerate(measurement.frames)}
    color = found.colors[0]
    lit = [(c, photons_per_pixel(c.entry, measurement), c.mean(color)) for c in group]
    known = [(c, amount, mean) for c, amount, mean in lit if amount is not None]
    black = found.dark[0].mean(color).value
    top = max((mean.value - black for _, _, mean in known), default=0.0)
    for first, few, low in known:
        for second, many, high in known:
            small, large = low.value - black, high.value - black
            beyond = small - large - SURE * float(np.hypot(low.error, high.error))
            if few <= many and beyond > APART * top and large < FULL * top:
                yield (
                    numbers[id(first.entry)],
                    f"{first.label} has {few:.6g} photons a pixel and a signal of {small:.6g} DN,"
                    f" {second.label} {many:.6g} photons and {large:.6g} DN",
                )
