"""The methods of a schedule study: each gives capture times for some numbers of captures.

Schedules are found on one pdf and judged on another where the study approximates it. Whatever a
method gives, the readout's demands come last: times are whole frames, none longer than allowed,
and a capture too close to the one before it repeats that one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.schedule_study import ScheduleStudy
from vcam_cli.scheduling import noisy, objective, optimal, rivals, sqp, weighted
from vcam_cli.scheduling.heuristic import heuristic
from vcam_cli.scheduling.objective import SHOT, SLACK, Constraints, Schedule, Sensor
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.weighted_bound import upper_bounds

Floats = NDArray[np.float64]
FREE = Constraints()
"""Captures at any time."""
Schedules = dict[int, Schedule]
"""By the number of captures."""


@dataclass(frozen=True)
class Found:
    """What a method found for a number of captures."""

    method: str
    schedule: Schedule
    """Judged on the study's own pdf."""
    bound: float
    """No schedule has a larger E[SNR]."""
    seconds: float

    @property
    def count(self) -> int:
        """Captures that were asked for."""
        return len(self.schedule.times)

    @property
    def used(self) -> int:
        """Captures that differ."""
        times = self.schedule.times
        return 1 + int(np.sum(np.diff(times) > times[1:] * SLACK))


class Task:
    """A pdf, the sensor that looks at it, and the schedules that have been found for it.

    plan: what schedules are found on; default the pdf itself. seed: of random starts.
    Raises ValueError where a frame is too long for the brightest photocurrent.
    """

    def __init__(
        self,
        pdf: Pdf,
        sensor: Sensor = SHOT,
        constraints: Constraints = FREE,
        plan: Pdf | None = None,
        seed: int = 0,
    ) -> None:
        self.pdf, self.plan = pdf, plan or pdf
        self.sensor, self.constraints, self.seed = sensor, constraints, seed
        self.first = objective.shortest(pdf, sensor, constraints)
        self._optimum: Schedules = {}

    @property
    def approximated(self) -> bool:
        """Whether schedules are found on another pdf than they are judged on."""
        return self.plan is not self.pdf

    @cached_property
    def exact(self) -> Task:
        """The task without the approximation."""
        if not self.approximated:
            return self
        return Task(self.pdf, self.sensor, self.constraints, seed=self.seed)

    @cached_property
    def single(self) -> float:
        """E[SNR] of the capture that does not saturate the brightest photocurrent."""
        return objective.expected_snr(self.pdf, [self.first], self.sensor)

    @cached_property
    def best(self) -> float:
        """E[SNR] with each photocurrent at its own longest unsaturated time."""
        return objective.best_snr(self.pdf, self.sensor)

    @property
    def plain(self) -> bool:
        """Whether shot noise decides alone, and nothing restricts the times."""
        return self.sensor.noiseless and math.isinf(self.sensor.max_time) and not self.restricted

    @property
    def restricted(self) -> bool:
        """Whether the readout demands something of capture times."""
        return bool(self.constraints.min_gap or self.constraints.frame_time)

    def optimum(self, counts: Sequence[int]) -> Schedules:
        """Optimal schedules of the plan, all numbers of captures found at once."""
        missing = sorted(set(counts) - self._optimum.keys())
        if missing and self.plain:
            found = optimal.optimal(self.plan, missing)
            self._optimum |= {n: self._in_seconds(one) for n, one in found.items()}
        elif missing:
            self._optimum |= noisy.optimal(self.plan, missing, self.sensor, self.constraints)
        return {n: self._optimum[n] for n in counts}

    def _in_seconds(self, one: Schedule) -> Schedule:
        """A schedule for a well of one electron, with this sensor's well."""
        well = self.sensor.well
        times, value = one.times * well, one.expected_snr * well
        return Schedule(times, one.photocurrents, value, one.gap)

    def judged(self, times: Floats, gap: float | None = None) -> Schedule:
        """The schedule of these times, worth what it is on the pdf itself."""
        value = objective.expected_snr(self.pdf, times, self.sensor)
        return Schedule(times, self.sensor.limit(times), value, gap)

    def admissible(self, times: Floats, count: int) -> Floats:
        """These times as the readout allows them, `count` of them; the first is this task's."""
        allowed = [self.first]
        frame, least = self.constraints.frame_time, self.constraints.min_gap * (1 - SLACK)
        for when in np.sort(np.minimum(times, self.sensor.max_time))[1:]:
            if frame:
                when = math.floor(when / frame * (1 + SLACK)) * frame
            later = when - allowed[-1]
            allowed.append(when if later > 0 and later >= least else allowed[-1])
        return np.array(allowed + allowed[-1:] * (count - len(allowed)))

    def gap(self, found: Schedule, planned: Schedule) -> float | None:
        """Certified relative distance of a schedule from the global optimum.

        Of an approximation it says more than that of the approximated pdf: how far the schedule
        is from the best for the pdf itself.
        """
        if not self.approximated:
            return planned.gap
        n = len(found.times)
        best = self.exact.optimum([n])[n]
        reach = best.expected_snr * (1 + (best.gap or 0.0))
        return max(0.0, reach / found.expected_snr - 1)


def _optimal(task: Task, counts: Sequence[int]) -> Schedules:
    found = {}
    for n, planned in task.optimum(counts).items():
        times = task.admissible(planned.times, n) if task.approximated else planned.times
        judged = task.judged(times)
        found[n] = task.judged(times, task.gap(judged, planned))
    return found


def _weighted(task: Task, counts: Sequence[int]) -> Schedules:
    found = weighted.optimal(task.plan, counts, task.sensor, task.constraints)
    if not task.approximated:
        return found
    bounds = _bounds(task, "weighted", counts)
    judged = {}
    for n, planned in found.items():
        # Where nothing restricts times, equal ones are reads of their own; else they do not fit.
        reads = np.unique(planned.times) if task.restricted else planned.times
        value = weighted.expected_snr(task.pdf, reads, task.sensor)
        gap = max(bounds[n] / value - 1, 0.0)
        judged[n] = Schedule(planned.times, planned.photocurrents, value, gap)
    return judged


def _heuristic(task: Task, counts: Sequence[int]) -> Schedules:
    return _of_photocurrents(task, {n: heuristic(task.plan, n) for n in counts})


def _sqp(task: Task, counts: Sequence[int]) -> Schedules:
    found = {n: sqp.sqp(task.plan, n, seed=task.seed) for n in counts}
    return _of_photocurrents(task, {n: one.photocurrents for n, one in found.items()})


def _of_photocurrents(task: Task, found: Mapping[int, Floats]) -> Schedules:
    """Of photocurrents that are to fill the well just then."""
    wells = {n: task.sensor.well / (i + task.sensor.dark) for n, i in found.items()}
    return {n: task.judged(task.admissible(times, n)) for n, times in wells.items()}


Rule = Callable[[float, float, int], Floats]
"""The first time, the last, and the number of captures -> times (N,)."""


def _rule(rule: Rule) -> Callable[[Task, Sequence[int]], Schedules]:
    def method(task: Task, counts: Sequence[int]) -> Schedules:
        found = {}
        for n in counts:
            last = task.sensor.max_time
            if math.isinf(last):
                last = float(task.optimum([n])[n].times[-1])
            times = rule(task.first, max(last, task.first), n)
            found[n] = task.judged(task.admissible(times, n))
        return found

    return method


METHODS: dict[str, Callable[[Task, Sequence[int]], Schedules]] = {
    "optimal": _optimal,
    "heuristic": _heuristic,
    "uniform": _rule(rivals.uniform),
    "exponential": _rule(rivals.exponential),
    "geometric": _rule(rivals.geometric),
    "sqp": _sqp,
    "weighted": _weighted,
}


def find(task: Task, method: str, counts: Sequence[int]) -> list[Found]:
    """What a method finds for each number of captures, in their order.

    Seconds are of all of them together, shared out alike: some methods find all at once.
    """
    if method not in ("optimal", "heuristic", "weighted"):
        task.optimum(counts)  # whose longest time the rules share, is not of their seconds
    start = time.perf_counter()
    found = METHODS[method](task, counts)
    seconds = (time.perf_counter() - start) / len(counts)
    bounds = _bounds(task, method, counts)
    return [Found(method, found[n], bounds[n], seconds) for n in counts]


def _bounds(task: Task, method: str, counts: Sequence[int]) -> dict[int, float]:
    """What no schedule of so many captures exceeds: one for all but the weighted estimate."""
    if method != "weighted":
        return dict.fromkeys(counts, task.best)
    found = upper_bounds(task.pdf, max(counts), task.sensor, task.constraints)
    return {n: float(found[n - 1]) for n in counts}


def sensor_of(study: ScheduleStudy) -> Sensor:
    """The sensor of a study; shot noise alone and a well of one electron where it has none."""
    given = study.sensor
    if given is None:
        return SHOT
    return Sensor(
        well=given.well_capacity,
        dark=given.dark_current,
        read=given.read_noise,
        reset=given.reset_noise,
        max_time=given.max_time or math.inf,
    )


def constraints_of(study: ScheduleStudy) -> Constraints:
    """What the study demands of capture times."""
    return Constraints(study.constraints.min_gap, study.constraints.frame_time)
