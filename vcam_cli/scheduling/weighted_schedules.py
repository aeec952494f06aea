"""Schedules for the best linear estimate from all samples before saturation.

The mean SNR of a schedule (`weighted_snr`) is no sum over a chain: every capture changes what all
others are good for. The search begins with the best schedule of the last sample before saturation,
with captures clustered at both ends (what many reads against read noise want), and with the best of
fewer captures; one capture at a time then moves to where the schedule is worth most. How far the
result may be from the best is certified by an upper bound, as `gap`: that of `upper_bounds`, or
for captures at whole frames the closer one of `flow_bound`.

Without read and reset noise the last sample is a sufficient statistic, and `full_noise` applies.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling import full_noise
from vcam_cli.scheduling.flow_bound import least_bounds
from vcam_cli.scheduling.objective import Schedule
from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import (
    SLACK,
    UNCONSTRAINED,
    Constraints,
    Sensor,
    first_capture_time,
)
from vcam_cli.scheduling.weighted_snr import ROUGH, mean_snr, weighted_expected_snr

SWEEPS = 10
COARSE_GAIN = 1e-5
"""Relative gain of a sweep over all captures below which the search from a start ends."""
FINE_GAIN = 1e-9
"""The same, for the search from the best of all these."""
SCAN = 24
ZOOM = 7
ROUNDS = 4
"""Times that are tried for a capture: SCAN over the whole range, then ZOOM around the best, in
ROUNDS rounds in all."""
PIECES = 128
"""Segments or levels of the pdf that is searched; the result is judged by the whole pdf."""


def optimal_schedules(
    pdf: Pdf,
    counts: Sequence[int],
    sensor: Sensor,
    constraints: Constraints = UNCONSTRAINED,
) -> dict[int, Schedule]:
    """Find good schedules of each number of captures for the weighted estimate.

    They are never worth less than the best schedule of the last sample before saturation, judged by
    this estimate.

    Parameters
    ----------
    pdf, counts, sensor, constraints
        As those of `full_noise.optimal_schedules`.

    Returns
    -------
    dict
        Schedules by number of captures, in the order of `counts`; `gap` is the relative distance
        from the upper bound. Under a least gap or whole frames a time is read once: repeated times
        at the end are captures that do not fit, and `expected_snr` is that of the distinct ones.

    Raises
    ------
    ValueError
        If a count is below 1, or no whole frame is as short as the first capture must be.
    """
    starts = full_noise.optimal_schedules(pdf, counts, sensor, constraints)
    if not sensor.noise_floor or not starts:
        return starts
    bounds = dict(zip(counts, least_bounds(pdf, tuple(counts), sensor, constraints), strict=True))
    schedules: dict[int, Schedule] = {}
    fewer: Floats = np.empty(0)
    for count in sorted(starts):
        last_sample = starts[count].times
        search = _CoordinateAscent(pdf, sensor, constraints, count, float(last_sample[-1]))
        fewer = search.best_times([last_sample, *search.clustered_times(last_sample), fewer])
        schedules[count] = _padded_schedule(pdf, fewer, count, sensor, bounds[count])
    return {count: schedules[count] for count in starts}


def _padded_schedule(pdf: Pdf, times: Floats, count: int, sensor: Sensor, bound: float) -> Schedule:
    """Return the schedule of `times`, the last repeated up to `count`, with its certified gap."""
    value = weighted_expected_snr(pdf, times, sensor)
    padded = np.append(times, np.full(count - len(times), times[-1]))
    return Schedule(padded, sensor.saturation_limit(padded), value, max(bound / value - 1, 0.0))


class _CoordinateAscent:
    """The search for good times: each capture in turn moves to where the schedule is worth most."""

    def __init__(
        self, pdf: Pdf, sensor: Sensor, constraints: Constraints, count: int, latest: float
    ) -> None:
        """Prepare the search; times up to `latest` [s] at least are tried."""
        self.pdf, self.sensor, self.count = pdf, sensor, count
        self.rough = _merged_pieces(pdf)
        self.constraints = constraints
        self.frame = constraints.frame_time
        self.interval = constraints.read_interval
        self.first = first_capture_time(pdf, sensor, constraints)
        self.kinks = self._kink_times()
        self.longest = max(float(self.kinks[-1]), self.first, latest)

    def best_times(self, starts: Sequence[Floats]) -> Floats:
        """Return the best of what the starts lead to and of the starts themselves."""
        begun = [self._spread_repeats(start) for start in starts if len(start)]
        climbed = [self._climb(start, COARSE_GAIN) for start in begun]
        top = max(climbed, key=lambda times: float(self._rough_snr(times[None])[0]))
        climbed.append(self._climb(top, FINE_GAIN))
        every = [*begun, *climbed]
        return max(every, key=lambda times: weighted_expected_snr(self.pdf, times, self.sensor))

    def clustered_times(self, times: Floats) -> Iterator[Floats]:
        """Yield schedules with half of the captures as early and half as late as they may be."""
        late = {float(times[-1]), self.longest} if self.sensor.max_time < np.inf else {times[-1]}
        for last in late:
            half = self.count // 2
            early = self.first + self.interval * np.arange(self.count - half)
            both = np.append(early, last - self.interval * np.arange(half))
            if self._admissible(np.sort(both)[None])[0]:
                yield np.sort(both)

    def _kink_times(self) -> Floats:
        """Return the longest times of levels or edges [s], where the mean SNR jumps or bends."""
        occurs = self.rough.probability > 0
        ends = np.concatenate([self.rough.low[occurs], self.rough.high[occurs]]) + self.sensor.dark
        times = self.sensor.well / ends[ends > 0]
        if not self.rough.discrete and not ends.min():
            times = np.append(times, 1e3 * times.max())  # darker ones hardly count
        times = np.append(np.minimum(times, self.sensor.max_time), self.first)
        times = np.unique(times[times >= self.first])
        if not self.frame:
            return times
        return np.unique(self.constraints.whole_frames(times)) * self.frame

    def _spread_repeats(self, times: Floats) -> Floats:
        """Return `times` with as many captures as fit: repeated ones are spread, or left out."""
        if not self.interval:
            return np.append(times, np.full(self.count - len(times), times[-1]))
        kept = np.unique(times)
        while len(kept) < self.count:
            beside = np.concatenate([kept + self.interval, kept - self.interval, self.kinks])
            schedules = self._add_capture(kept, beside)
            if not len(schedules):
                break
            kept = schedules[int(np.argmax(self._rough_snr(schedules)))]
        return kept

    def _add_capture(self, others: Floats, times: Floats) -> Floats:
        """Return (B, n + 1) schedules: `others` with each of `times` that is admissible."""
        times = times[(times >= self.first) & (times <= self.longest)]
        if self.frame:
            times = np.unique(np.round(times / self.frame)) * self.frame
            times = times[(times >= self.first) & (times <= self.longest)]
        repeated = np.broadcast_to(others, (len(times), len(others)))
        schedules = np.sort(np.concatenate([repeated, times[:, None]], axis=1), axis=1)
        return schedules[self._admissible(schedules)]

    def _admissible(self, schedules: Floats) -> NDArray[np.bool_]:
        steps = np.diff(schedules, axis=1)
        inside = (schedules[:, 0] >= self.first) & (schedules[:, -1] <= self.longest)
        return inside & (steps >= self.interval * (1 - 1e-9)).all(axis=1)

    def _rough_snr(self, schedules: Floats) -> Floats:
        return mean_snr(self.rough, schedules, self.sensor, ROUGH)

    def _climb(self, times: Floats, least_gain: float) -> Floats:
        """Move all captures in turn until a sweep gains less than `least_gain`, relative."""
        value = float(self._rough_snr(times[None])[0])
        for _ in range(SWEEPS):
            before = value
            for k in range(len(times) - 1, 0, -1):
                times, value = self._move_capture(times, k, value)
            if value <= before * (1 + least_gain):
                break
        return times

    def _move_capture(self, times: Floats, k: int, value: float) -> tuple[Floats, float]:
        """Move capture k to where the schedule is worth more, if there is such a time."""
        others, tries = np.delete(times, k), self._scan_times(times)
        for _ in range(ROUNDS):
            schedules = self._add_capture(others, tries)
            if not len(schedules):
                break
            snr = self._rough_snr(schedules)
            top = int(np.argmax(snr))
            if snr[top] > value:
                times, value = schedules[top], float(snr[top])
            moved = _added_capture(schedules[top], others)
            around = int(np.searchsorted(tries, moved))
            low, high = tries[max(around - 1, 0)], tries[min(around + 1, len(tries) - 1)]
            tries = np.linspace(low, high, ZOOM)
        return times, value

    def _scan_times(self, times: Floats) -> Floats:
        """Return times over the whole range, kinks, the captures' and those a gap from them."""
        spread = np.geomspace(self.first, self.longest, SCAN)
        beside = [times - self.interval, times, times + self.interval]
        tries = np.unique(np.concatenate([spread, self.kinks, *beside]))
        return np.asarray(tries[(tries >= self.first) & (tries <= self.longest)])


def _added_capture(schedule: Floats, others: Floats) -> float:
    """Return the capture that `schedule` has and `others` lack."""
    differs = np.append(np.flatnonzero(schedule[:-1] != others), len(others))
    return float(schedule[int(differs[0])])


def _merged_pieces(pdf: Pdf) -> Pdf:
    """Merge neighboring segments or levels to at most PIECES of about equal probability."""
    occurs = pdf.probability > 0
    low, high, probability = pdf.low[occurs], pdf.high[occurs], pdf.probability[occurs]
    if len(low) <= PIECES:
        return Pdf(low, high, probability)
    part = np.floor(np.cumsum(probability) * (PIECES - 1) * (1 - SLACK)).astype(int)
    starts = np.flatnonzero(np.diff(part, prepend=-1))
    total = np.add.reduceat(probability, starts)
    if not pdf.discrete:
        return Pdf(low[starts], high[np.append(starts[1:] - 1, len(high) - 1)], total)
    level = np.add.reduceat(probability * low, starts) / total
    level[-1] = low[-1]  # the brightest decides the first capture
    return Pdf(level, level, total)
