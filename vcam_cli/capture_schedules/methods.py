"""The methods of a schedule study: each gives capture times for some numbers of captures.

Schedules are found on one pdf and judged on another where the study approximates it. Whatever a
method gives, the readout's demands come last: times are whole frames, none longer than allowed,
and a capture too close to the one before it repeats that one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from vcam_cli.capture_schedules.model import ScheduleStudy
from vcam_cli.records import dataclass
from vcam_cli.scheduling import full_noise, objective, shot_noise, weighted_schedules
from vcam_cli.scheduling.brackets import bracket_bound, bracket_snr, optimal_bracket
from vcam_cli.scheduling.comparison_schedules import (
    exponential_times,
    geometric_times,
    heuristic_photocurrents,
    uniform_times,
)
from vcam_cli.scheduling.flow_bound import least_bounds
from vcam_cli.scheduling.local_search import assigned_schedule, sqp_schedule
from vcam_cli.scheduling.objective import Schedule
from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import (
    SHOT_NOISE,
    SLACK,
    UNCONSTRAINED,
    Constraints,
    Sensor,
    first_capture_time,
)
from vcam_cli.scheduling.weighted_snr import weighted_expected_snr

BRACKET = "bracket"
"""Exposures one after the other, each with charge of its own, within the captures' longest time."""
Schedules = dict[int, Schedule]
"""Schedules by the number of captures."""
Method = Callable[["Task", Sequence[int]], Schedules]


@dataclass(frozen=True)
class MethodResult:
    """What a method found for a number of captures.

    Parameters
    ----------
    method : str
        Name of the method.
    schedule : Schedule
        Its schedule, judged on the study's own pdf.
    bound : float
        Mean SNR that no schedule exceeds, as a power ratio.
    seconds : float
        Time it took.
    """

    method: str
    schedule: Schedule
    bound: float
    seconds: float

    @property
    def count(self) -> int:
        """Requested number of captures."""
        return len(self.schedule.times)

    @property
    def distinct_captures(self) -> int:
        """Number of captures that differ."""
        times = self.schedule.times
        if self.method == BRACKET:  # equal exposures are taken one after the other
            return len(times)
        return 1 + int(np.sum(np.diff(times) > times[1:] * SLACK))


class Task:
    """A pdf, the sensor that it falls on, and the optimal schedules found for it so far.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene; schedules are judged on them.
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands.
    plan : Pdf, optional
        The pdf that schedules are found on; by default `pdf` itself.
    seed, starts : int
        Seed and number of random starts.
    bounded : Sensor, optional
        The pixel that the stated bound is of; by default `sensor` itself. A longest exposure that
        all schedules share restricts them, and leaves eq 4.2's imax / E(I) as it is.

    Raises
    ------
    ValueError
        If a frame is too long for the brightest photocurrent.
    """

    def __init__(
        self,
        pdf: Pdf,
        sensor: Sensor = SHOT_NOISE,
        constraints: Constraints = UNCONSTRAINED,
        plan: Pdf | None = None,
        seed: int = 0,
        starts: int = 1,
        bounded: Sensor | None = None,
    ) -> None:
        self.pdf, self.plan = pdf, plan or pdf
        self.sensor, self.constraints = sensor, constraints
        self._bounded = bounded or sensor
        self.seed, self.starts = seed, starts
        self.first = first_capture_time(pdf, sensor, constraints)
        self._optimum: Schedules = {}

    @property
    def is_approximate(self) -> bool:
        """Whether schedules are found on another pdf than they are judged on."""
        return self.plan is not self.pdf

    @cached_property
    def exact_task(self) -> Task:
        """The task without the approximation."""
        if not self.is_approximate:
            return self
        return Task(self.pdf, self.sensor, self.constraints, seed=self.seed)

    @cached_property
    def single(self) -> float:
        """Mean SNR of the capture that does not saturate the brightest photocurrent."""
        return objective.expected_snr(self.pdf, [self.first], self.sensor)

    @cached_property
    def bound(self) -> float:
        """Mean SNR with each photocurrent at its own longest unsaturated time."""
        return objective.expected_snr_bound(self.pdf, self._bounded)

    @property
    def largest_gain(self) -> float:
        """The stated bound as a gain: imax / E(I) of shot noise alone."""
        return self.bound / self.single

    @property
    def reachable_gain(self) -> float:
        """Gain that no number of captures exceeds within the longest exposure."""
        return objective.expected_snr_bound(self.pdf, self.sensor) / self.single

    def gain(self, schedule: Schedule) -> float:
        """Return the mean SNR of a schedule over that of a single capture."""
        return schedule.expected_snr / self.single

    @property
    def shot_noise_only(self) -> bool:
        """Whether shot noise alone decides, and nothing restricts the times."""
        return self.sensor.noiseless and math.isinf(self.sensor.max_time) and not self.is_restricted

    @property
    def is_restricted(self) -> bool:
        """Whether the readout demands something of capture times."""
        return bool(self.constraints.min_gap or self.constraints.frame_time)

    @property
    def most_captures(self) -> float:
        """Number of captures, as far apart as they must be, that fit the longest exposure."""
        room, apart = self.sensor.max_time - self.first, self.constraints.read_interval
        if not apart or math.isinf(room):
            return math.inf
        return 1 + math.floor(room / apart * (1 + SLACK))

    def optimum(self, counts: Sequence[int]) -> Schedules:
        """Return the optimal schedules of the plan, all numbers of captures found at once."""
        missing = sorted(set(counts) - self._optimum.keys())
        if missing and self.shot_noise_only:
            found = shot_noise.optimal_schedules(self.plan, missing)
            self._optimum |= {n: self._scale_to_well(one) for n, one in found.items()}
        elif missing:
            found = full_noise.optimal_schedules(self.plan, missing, self.sensor, self.constraints)
            self._optimum |= found
        return {n: self._optimum[n] for n in counts}

    def _scale_to_well(self, one: Schedule) -> Schedule:
        """Convert a schedule for a well of one electron to this sensor's well."""
        well = self.sensor.well
        times, value = one.times * well, one.expected_snr * well
        return Schedule(times, one.photocurrents, value, one.gap)

    def judge(self, times: Floats, gap: float | None = None) -> Schedule:
        """Return the schedule of rising times [s] with its expected SNR on the pdf itself."""
        value = objective.expected_snr(self.pdf, times, self.sensor)
        return Schedule(times, self.sensor.saturation_limit(times), value, gap)

    def admissible_times(self, times: Floats, count: int) -> Floats:
        """Return `count` times as the readout allows them [s]; the first is this task's."""
        allowed = [self.first]
        frame, least = self.constraints.frame_time, self.constraints.min_gap * (1 - SLACK)
        for when in np.sort(np.minimum(times, self.sensor.max_time))[1:]:
            if frame:
                when = self.constraints.whole_frames(when) * frame
            later = when - allowed[-1]
            allowed.append(when if later > 0 and later >= least else allowed[-1])
        return np.array(allowed + allowed[-1:] * (count - len(allowed)))

    def certified_gap(self, judged: Schedule, planned: Schedule) -> float | None:
        """Return the certified relative distance of a schedule from the global optimum.

        Of an approximation it says more than that of the approximated pdf: how far the schedule
        is from the best for the pdf itself.
        """
        if not self.is_approximate:
            return planned.gap
        n = len(judged.times)
        best = self.exact_task.optimum([n])[n]
        reach = best.expected_snr * (1 + (best.gap or 0.0))
        return max(0.0, reach / judged.expected_snr - 1)


def _optimal(task: Task, counts: Sequence[int]) -> Schedules:
    schedules = {}
    for n, planned in task.optimum(counts).items():
        times = task.admissible_times(planned.times, n) if task.is_approximate else planned.times
        gap = task.certified_gap(task.judge(times), planned)
        schedules[n] = task.judge(times, gap)
    return schedules


def _weighted_schedules(task: Task, counts: Sequence[int]) -> Schedules:
    found = weighted_schedules.optimal_schedules(task.plan, counts, task.sensor, task.constraints)
    if not task.is_approximate:
        return found
    bounds = _upper_bounds(task, "weighted", counts)
    judged = {}
    for n, planned in found.items():
        # Where nothing restricts times, equal ones are reads of their own; else they do not fit.
        reads = np.unique(planned.times) if task.is_restricted else planned.times
        value = weighted_expected_snr(task.pdf, reads, task.sensor)
        gap = max(bounds[n] / value - 1, 0.0)
        judged[n] = Schedule(planned.times, planned.photocurrents, value, gap)
    return judged


def _brackets(task: Task, counts: Sequence[int]) -> Schedules:
    found = {}
    for n in counts:
        total = _last_time(task, n)
        planned = optimal_bracket(task.plan, n, total, task.sensor, task.constraints)
        value = bracket_snr(task.pdf, planned.times, task.sensor)
        found[n] = Schedule(planned.times, planned.photocurrents, value)
    return found


def _last_time(task: Task, count: int) -> float:
    """Return the longest time that the methods share: the longest exposure, or the optimum's."""
    last = task.sensor.max_time
    if math.isinf(last):
        last = float(task.optimum([count])[count].times[-1])
    return max(last, task.first)


def _heuristic_schedules(task: Task, counts: Sequence[int]) -> Schedules:
    return _schedules_of_photocurrents(
        task, {n: heuristic_photocurrents(task.plan, n) for n in counts}
    )


def _sqp(task: Task, counts: Sequence[int]) -> Schedules:
    seeds = range(task.seed, task.seed + task.starts)

    def best(count: int) -> Floats:
        found = (sqp_schedule(task.plan, count, seed=seed) for seed in seeds)
        return max(found, key=lambda one: one.expected_snr).photocurrents

    return _schedules_of_photocurrents(task, {n: best(n) for n in counts})


def _sqp_assigned(task: Task, counts: Sequence[int]) -> Schedules:
    found = {n: assigned_schedule(task.plan, n, task.starts, task.seed) for n in counts}
    return _schedules_of_photocurrents(task, {n: one.photocurrents for n, one in found.items()})


def _schedules_of_photocurrents(task: Task, photocurrents: Mapping[int, Floats]) -> Schedules:
    """Return the schedules of photocurrents that just fill the well in each capture."""
    times = {n: task.sensor.well / (i + task.sensor.dark) for n, i in photocurrents.items()}
    return {n: task.judge(task.admissible_times(when, n)) for n, when in times.items()}


def _method_of_rule(rule: Callable[[float, float, int], Floats]) -> Method:
    """Make a method of a rule: the first time, the last, and the number of captures to times."""

    def method(task: Task, counts: Sequence[int]) -> Schedules:
        schedules = {}
        for n in counts:
            times = rule(task.first, _last_time(task, n), n)
            schedules[n] = task.judge(task.admissible_times(times, n))
        return schedules

    return method


METHODS: dict[str, Method] = {
    "optimal": _optimal,
    "heuristic": _heuristic_schedules,
    "uniform": _method_of_rule(uniform_times),
    "exponential": _method_of_rule(exponential_times),
    "geometric": _method_of_rule(geometric_times),
    "sqp": _sqp,
    "sqp-assigned": _sqp_assigned,
    "weighted": _weighted_schedules,
    BRACKET: _brackets,
}


def find_schedules(task: Task, method: str, counts: Sequence[int]) -> list[MethodResult]:
    """Find the schedules of a method for each number of captures, in their order.

    Seconds are of all of them together, shared out alike: some methods find all at once.

    Parameters
    ----------
    task : Task
        The pdf, the sensor and the readout's demands.
    method : str
        A name in `METHODS`.
    counts : sequence of int
        Numbers of captures, each at least 1.
    """
    if method not in ("optimal", "heuristic", "weighted"):
        task.optimum(counts)  # whose longest time the rules share, is not of their seconds
    start = time.perf_counter()
    schedules = METHODS[method](task, counts)
    seconds = (time.perf_counter() - start) / len(counts)
    bounds = _upper_bounds(task, method, counts)
    return [MethodResult(method, schedules[n], bounds[n], seconds) for n in counts]


def _upper_bounds(task: Task, method: str, counts: Sequence[int]) -> dict[int, float]:
    """Return the bounds of the mean SNR: one for all but the weighted estimate and brackets."""
    if method == BRACKET:
        return {n: bracket_bound(task.pdf, _last_time(task, n), task.sensor) for n in counts}
    if method != "weighted":
        return dict.fromkeys(counts, task.bound)
    found = least_bounds(task.pdf, tuple(counts), task.sensor, task.constraints)
    return dict(zip(counts, found, strict=True))


def study_sensor(study: ScheduleStudy) -> Sensor:
    """Return the sensor of a study; without one, shot noise alone and a well of one electron."""
    given = study.sensor
    if given is None:
        return SHOT_NOISE
    return Sensor(
        well=given.well_capacity,
        dark=given.dark_current,
        read=given.read_noise,
        reset=given.reset_noise,
        max_time=given.max_time or math.inf,
    )


def study_constraints(study: ScheduleStudy) -> Constraints:
    """Return what the study demands of capture times."""
    return Constraints(study.constraints.min_gap, study.constraints.frame_time)
