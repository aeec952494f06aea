"""Capture times chosen while a picture is taken, from the captures so far.

A camera that does not know its scene looks at each capture before it sets the next one. After
capture k it knows the photocurrents of the pixels that are not yet saturated, up to noise; the past
is fixed, and what the N - k captures left are best for is the offline problem again: the best
schedule of N - k + 1 captures whose first is at t_k, over the pixels still open. A pixel that is
saturated has its last sample and gains nothing. Of that plan only the next time is taken; the
capture there tells more. With the pdf known this is the offline optimum step by step, so what is
lost is what estimates are wrong by.

When nothing is known, the first capture is short and each next one longer by a factor until the
brightest pixels are measured: see `Start`.

References
----------
T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University, 2003,
sections 4.7 and 5.2, where online scheduling is left open.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling import noisy
from vcam_cli.scheduling.levels import levels
from vcam_cli.scheduling.objective import Constraints, Schedule, Sensor
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]
Optimal = Callable[[Pdf, Sequence[int], Sensor, Constraints], Mapping[int, Schedule]]
"""What plans: the best schedules of so many captures."""

FREE = Constraints()
ANCHOR = 1e-12
"""Weight of the level that holds the first capture of a plan where the last one was."""
DARKEST = 1e-6
"""Over the brightest open pixel: darker estimates are one level. They differ by noise alone."""


@dataclass(frozen=True)
class Start:
    """How the first captures are set when nothing is known of the scene."""

    first: float  # the first capture [s]
    factor: float = 8.0  # from one capture to the next, at most
    percentile: float = 99.9  # of the pixels, by brightness: the one that has to be measured
    enough: float = 10.0  # its signal over its noise from which on it is measured

    def __post_init__(self) -> None:
        if not (self.first > 0 and self.factor > 1 and self.enough > 0):
            raise ValueError("first and enough must be above 0, and factor above 1")

    def next(self, charge: NDArray, time: float, sensor: Sensor) -> float | None:
        """The next capture that still searches [s]; None when the brightest are measured.

        charge: of every pixel in the capture at `time` [e], saturated ones at the full well. The
        longer exposure fills no pixel of that percentile: three sigma are kept from the well.
        """
        signal = max(float(np.percentile(charge, self.percentile)) - sensor.dark * time, 0.0)
        noise = float(np.sqrt(signal + sensor.dark * time + sensor.floor))
        if 0 < self.enough * noise <= signal or time >= sensor.max_time:
            return None
        most = signal + sensor.dark * time + 3 * max(noise, 1.0)
        longer = time * min(self.factor, max(sensor.well / most, 1.0))
        return float(min(longer, sensor.max_time)) if longer > time else None


def plan(
    estimates: NDArray,
    time: float,
    count: int,
    sensor: Sensor,
    constraints: Constraints = FREE,
    optimal: Optimal = noisy.optimal,
) -> Floats:
    """The best `count` captures after the one at `time`, rising [s]; fewer where more gain nothing.

    estimates: photocurrents [e/s] of the pixels not saturated at `time`, of any shape, negative
    ones taken for dark; the pixels count the same. () where no pixel or no time is left.
    """
    limit = float(sensor.limit(time))
    pdf = levels(np.minimum(estimates, limit), darkest=DARKEST)
    if count < 1 or pdf is None or limit <= 0 or time >= sensor.max_time:
        return np.empty(0)
    held = Pdf.levels([*pdf.low, limit], [*pdf.probability, ANCHOR])
    found = np.unique(optimal(held, [count + 1], sensor, constraints)[count + 1].times)
    return found[found > time * (1 + 1e-9)]


def next_time(
    estimates: NDArray,
    time: float,
    count: int,
    sensor: Sensor,
    constraints: Constraints = FREE,
    optimal: Optimal = noisy.optimal,
) -> float | None:
    """The next capture [s] where `count` are left, as `plan`; None where none gains anything."""
    found = plan(estimates, time, count, sensor, constraints, optimal)
    return float(found[0]) if found.size else None
