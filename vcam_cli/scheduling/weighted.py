"""Schedules for the best linear estimate from all samples before saturation.

The worth of a schedule (`linear`) is no chain: every capture changes what all others are good
for. The search begins with the best schedule of the last sample before saturation, with captures
clustered at both ends (what many reads against read noise want), and with the best of fewer
captures; one capture at a time then goes where it is worth most. How far the result may be from
the best is said by an upper bound (`weighted_bound`), as `gap`.

Without read and reset noise the last sample holds all there is to know, and `noisy` applies.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.scheduling import candidates, linear, noisy, objective
from vcam_cli.scheduling.candidates import UNCONSTRAINED
from vcam_cli.scheduling.objective import SLACK, Constraints, Schedule, Sensor, shortest
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.weighted_bound import upper_bounds

Floats = NDArray[np.float64]

SWEEPS = 10
SOON = 1e-5
ENOUGH = 1e-9
"""Relative gain of a sweep over all captures below which the search from a start ends, and that
from the best of all these."""
SCAN = 24
ZOOM = 7
ROUNDS = 4
"""Times a capture tries: SCAN over the whole range, then ZOOM around the best, ROUNDS in all."""
KINKS = 32
"""About as many kinks are tried too."""
PIECES = 128
"""Segments or levels that the search sees of a pdf with more; the result is judged by all."""


def expected_snr(pdf: Pdf, times: ArrayLike, sensor: Sensor) -> float:
    """Mean SNR of the best linear estimate, as a power ratio; times (N,) in any order [s].

    Every entry is a read of its own: at equal times two reads halve the read noise.
    """
    when = np.sort(np.atleast_1d(np.asarray(times, float)))
    if not (when[0] > 0 and np.isfinite(when[-1])):
        raise ValueError("capture times must be finite and above 0")
    if not sensor.floor:
        return objective.expected_snr(pdf, when, sensor)
    return float(linear.mean_snr(pdf, when[None], sensor)[0])


def upper_bound(
    pdf: Pdf, count: int, sensor: Sensor, constraints: Constraints = UNCONSTRAINED
) -> float:
    """Mean SNR that no schedule of `count` captures exceeds. Errors as `optimal`."""
    if count < 1:
        raise ValueError("at least one capture is needed")
    return float(upper_bounds(pdf, count, sensor, constraints)[-1])


def optimal(
    pdf: Pdf,
    counts: Sequence[int],
    sensor: Sensor,
    constraints: Constraints = UNCONSTRAINED,
) -> dict[int, Schedule]:
    """Good schedules of each number of captures for the weighted estimate.

    Never worth less than the best schedule of the last sample before saturation, judged by this
    estimate. `gap` is the relative distance from the upper bound. Under a least gap or whole
    frames a time is read once: repeated times at the end are captures that do not fit, and
    `expected_snr` is that of the distinct ones. Errors as `noisy.optimal`.
    """
    starts = noisy.optimal(pdf, counts, sensor, constraints)
    if not sensor.floor or not starts:
        return starts
    bounds = upper_bounds(pdf, max(counts), sensor, constraints)
    result: dict[int, Schedule] = {}
    fewer: Floats = np.empty(0)
    for count in sorted(starts):
        last = starts[count].times
        search = _Search(pdf, sensor, constraints, count, float(last[-1]))
        fewer = search.best([last, *search.ends(last), fewer])
        result[count] = _schedule(pdf, fewer, count, sensor, float(bounds[count - 1]))
    return {count: result[count] for count in starts}


def _schedule(pdf: Pdf, times: Floats, count: int, sensor: Sensor, bound: float) -> Schedule:
    value = expected_snr(pdf, times, sensor)
    padded = np.append(times, np.full(count - len(times), times[-1]))
    return Schedule(padded, sensor.limit(padded), value, max(bound / value - 1, 0.0))


class _Search:
    """Coordinate ascent: each capture in turn goes where the schedule is worth most."""

    def __init__(
        self, pdf: Pdf, sensor: Sensor, constraints: Constraints, count: int, late: float
    ) -> None:
        """late: the search goes at least up to this time [s]."""
        self.pdf, self.sensor, self.count = pdf, sensor, count
        self.rough = _fewer_pieces(pdf)
        self.frame = constraints.frame_time
        self.apart = max(candidates.least_gap(constraints), self.frame)
        self.first = shortest(pdf, sensor, constraints)
        self.kinks = self._kinks()
        self.longest = max(float(self.kinks[-1]), self.first, late)

    def _kinks(self) -> Floats:
        """Longest times of levels or edges [s], where the worth jumps or bends."""
        seen = self.rough.probability > 0
        ends = np.concatenate([self.rough.low[seen], self.rough.high[seen]]) + self.sensor.dark
        times = self.sensor.well / ends[ends > 0]
        if not self.rough.discrete and not ends.min():
            times = np.append(times, 1e3 * times.max())  # darker ones hardly count
        times = np.append(np.minimum(times, self.sensor.max_time), self.first)
        return np.asarray(self._whole(np.unique(times[times >= self.first])))

    def _whole(self, times: Floats) -> Floats:
        if not self.frame:
            return times
        return np.unique(np.floor(times / self.frame * (1 + SLACK))) * self.frame

    def ends(self, times: Floats) -> Iterator[Floats]:
        """Schedules with half of the captures as early and half as late as they may be."""
        late = {float(times[-1]), self.longest} if self.sensor.max_time < np.inf else {times[-1]}
        for last in late:
            half = self.count // 2
            early = self.first + self.apart * np.arange(self.count - half)
            both = np.append(early, last - self.apart * np.arange(half))
            if self._fits(np.sort(both)[None])[0]:
                yield np.sort(both)

    def best(self, starts: Sequence[Floats]) -> Floats:
        """The best of what the starts lead to and of the starts themselves."""
        begun = [self._distinct(start) for start in starts if len(start)]
        found = [self._climb(start, SOON) for start in begun]
        top = max(found, key=lambda times: float(self._worth(times[None])[0]))
        found.append(self._climb(top, ENOUGH))
        return max([*begun, *found], key=lambda times: expected_snr(self.pdf, times, self.sensor))

    def _distinct(self, times: Floats) -> Floats:
        """`times` with as many captures as fit: repeated ones are spread, or left out."""
        if not self.apart:
            return np.append(times, np.full(self.count - len(times), times[-1]))
        kept = np.unique(times)
        while len(kept) < self.count:
            spots = self._fitting(kept)
            if not len(spots):
                break
            kept = spots[int(np.argmax(self._worth(spots)))]
        return kept

    def _fitting(self, kept: Floats) -> Floats:
        """(B, n + 1) schedules with one more capture, next to one there is."""
        near = np.concatenate([kept + self.apart, kept - self.apart, self.kinks])
        return self._with(kept, near)

    def _with(self, others: Floats, times: Floats) -> Floats:
        """(B, n + 1): `others` with each of `times` that is allowed."""
        times = times[(times >= self.first) & (times <= self.longest)]
        if self.frame:
            times = np.unique(np.round(times / self.frame)) * self.frame
            times = times[(times >= self.first) & (times <= self.longest)]
        all_of = np.broadcast_to(others, (len(times), len(others)))
        schedules = np.sort(np.concatenate([all_of, times[:, None]], axis=1), axis=1)
        return schedules[self._fits(schedules)]

    def _fits(self, schedules: Floats) -> NDArray[np.bool_]:
        steps = np.diff(schedules, axis=1)
        inside = (schedules[:, 0] >= self.first) & (schedules[:, -1] <= self.longest)
        return inside & (steps >= self.apart * (1 - 1e-9)).all(axis=1)

    def _worth(self, schedules: Floats) -> Floats:
        return linear.mean_snr(self.rough, schedules, self.sensor, linear.ROUGH)

    def _climb(self, times: Floats, enough: float) -> Floats:
        value = float(self._worth(times[None])[0])
        for _ in range(SWEEPS):
            before = value
            for k in range(len(times) - 1, 0, -1):
                times, value = self._move(times, k, value)
            if value <= before * (1 + enough):
                break
        return times

    def _move(self, times: Floats, k: int, value: float) -> tuple[Floats, float]:
        """Capture k elsewhere, if that is worth more."""
        others, tries = np.delete(times, k), self._scan(times)
        for _ in range(ROUNDS):
            schedules = self._with(others, tries)
            if not len(schedules):
                break
            worth = self._worth(schedules)
            top = int(np.argmax(worth))
            if worth[top] > value:
                times, value = schedules[top], float(worth[top])
            moved = _added(schedules[top], others)
            around = int(np.searchsorted(tries, moved))
            low, high = tries[max(around - 1, 0)], tries[min(around + 1, len(tries) - 1)]
            tries = np.linspace(low, high, ZOOM)
        return times, value

    def _scan(self, times: Floats) -> Floats:
        """Times over the whole range, kinks, the captures' and those a gap from them."""
        spread = np.geomspace(self.first, self.longest, SCAN)
        step = max(1, len(self.kinks) // KINKS)
        beside = [times - self.apart, times, times + self.apart]
        found = np.unique(np.concatenate([spread, self.kinks[::step], *beside]))
        return np.asarray(found[(found >= self.first) & (found <= self.longest)])


def _added(schedule: Floats, others: Floats) -> float:
    """The capture that `schedule` has and `others` lack."""
    differs = np.append(np.flatnonzero(schedule[:-1] != others), len(others))
    return float(schedule[int(differs[0])])


def _fewer_pieces(pdf: Pdf) -> Pdf:
    """`pdf` with neighbors merged to at most PIECES of about equal probability."""
    seen = pdf.probability > 0
    low, high, probability = pdf.low[seen], pdf.high[seen], pdf.probability[seen]
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
