"""Exposures one after the other: how long each, and how many, for the largest mean SNR.

Each exposure of a bracket has charge of its own, and so shot noise, read and reset noise of its
own. Those that do not saturate are merged by inverse variance, where the precisions i^2 / variance
add up. The mean SNR of a bracket, as a power ratio, is a sum over its exposures:

    SNR = sum_k h(t_k),   h(t) = E[ (i t)^2 / ((i + dark) t + read^2 + reset^2) ],   sum_k t_k <= T

with 0 in place of the ratio where t saturates i. h is eq 4.1 of [1]_ for a single capture. With
shot noise alone h(t) = t E[i; i t <= 1]. Non-destructive captures share one charge instead: of them
the last before saturation counts, and none of the others adds to it.

How it is solved. All exposures have the same h, and only their sum couples them. At an optimum no
pair gains by moving time from one to the other. Starts for that exchange are brackets of at most
two different times, which maximize sum h(t_k) - price sum t_k at the price where they just fit;
by the theorem of Shapley and Folkman those are optimal but for one exposure [2]_. Beside them stand
equal exposures. No gap is certified.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
.. [2] J. P. Aubin and I. Ekeland, "Estimates of the duality gap in nonconvex optimization",
   Mathematics of Operations Research 1(3), 1976.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import combinations_with_replacement

import numpy as np

from vcam_cli.scheduling.objective import Schedule, expected_snr, mean_snr_rate
from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import (
    SHOT_NOISE,
    SLACK,
    UNCONSTRAINED,
    Constraints,
    Sensor,
    first_capture_time,
)

GRID = 400
"""Times between the shortest worth a look and the longest, evenly in their logarithm."""
BREAKS = 400
"""Times at which a level or the end of a segment saturates, at most."""
REFINED = 25
"""Times between two neighbors of the grid at which a maximum is refined, each time."""
REFINEMENTS = 4
"""How often: in all 12^4 times finer than the grid."""
GAIN = 1e-7
"""Relative gain of a round of exchanges below which they end."""
ROUNDS = 10
"""Rounds, at most."""


def bracket_snr(pdf: Pdf, times: Floats, sensor: Sensor = SHOT_NOISE) -> float:
    """Return the mean SNR of exposures that are merged by inverse variance.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    times : (N,) array
        Exposure times in any order [s].
    sensor : Sensor
        The pixel.

    Returns
    -------
    float
        Mean SNR, as a power ratio.
    """
    found, counts = np.unique(np.asarray(times, float), return_counts=True)
    one = [expected_snr(pdf, [time], sensor) for time in found]
    return float(np.dot(counts, one))


def bracket_bound(pdf: Pdf, total: float, sensor: Sensor = SHOT_NOISE) -> float:
    """Return the mean SNR of one exposure of the total time in a well that is never full.

    No bracket within that time exceeds it, whatever its number of exposures: t^2 / (a t + b) grows
    faster than t, so that time is worth most in one piece.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents [e/s].
    total : float
        Time of all exposures together [s].
    sensor : Sensor
        The pixel.

    Returns
    -------
    float
        Mean SNR, as a power ratio.
    """
    lit = pdf.high > 0
    low, high = pdf.low[lit], pdf.high[lit]
    noise = np.full(len(low), sensor.dark + sensor.noise_floor / total)
    return float(np.sum(pdf.probability[lit] * total * mean_snr_rate(low, high, noise)))


def optimal_bracket(
    pdf: Pdf,
    count: int,
    total: float,
    sensor: Sensor = SHOT_NOISE,
    constraints: Constraints = UNCONSTRAINED,
) -> Schedule:
    """Return the exposures whose merge has the largest mean SNR within a total time.

    One of them is that of `first_capture_time`, as in schedules of captures: it does not saturate
    the brightest photocurrent, so that every pixel is measured.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    count : int
        Number of exposures, at least 1.
    total : float
        Time from the start of the first to the end of the last [s].
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands: time between exposures, and whole frames.

    Returns
    -------
    Schedule
        Exposure times, rising.

    Raises
    ------
    ValueError
        If the exposures do not fit.
    """
    first = first_capture_time(pdf, sensor, constraints)
    room = total - first - (count - 1) * constraints.least_gap
    times = np.array([first])
    if count > 1:
        least = constraints.frame_time
        if room < (count - 1) * least * (1 - SLACK) or room <= 0:
            message = f"{count} exposures one after the other do not fit {total:.4g} s"
            raise ValueError(f"{message}; write a smaller count, or leave out the method bracket")
        values = _Values(pdf, sensor, constraints.frame_time, room)
        others = max(
            (_exchanged(start, values, room) for start in _starts(values, count - 1, room, first)),
            key=values.of_bracket,
        )
        times = np.sort(np.append(times, others))
    return Schedule(times, sensor.saturation_limit(times), bracket_snr(pdf, times, sensor))


@dataclass
class _Values:
    """h of times, on a grid and beside it."""

    pdf: Pdf
    sensor: Sensor
    frame: float
    longest: float
    times: Floats = field(init=False)
    values: Floats = field(init=False)
    _known: dict[float, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        first = first_capture_time(self.pdf, self.sensor) / 4
        ends = np.unique(np.concatenate([self.pdf.low, self.pdf.high])) + self.sensor.dark
        breaks = self.sensor.well / ends[ends > 0]
        breaks = breaks[breaks <= self.longest]
        if len(breaks) > BREAKS:
            breaks = breaks[np.linspace(0, len(breaks) - 1, BREAKS).astype(int)]
        grid = np.geomspace(min(first, self.longest), self.longest, GRID)
        times = np.unique(np.concatenate([grid, breaks]))
        if self.frame:
            times = np.unique(np.maximum(np.floor(times / self.frame * (1 + SLACK)), 1))
            times = times[times * self.frame <= self.longest * (1 + SLACK)] * self.frame
        self.times = times
        self.values = np.array([self.at(time) for time in times])

    def at(self, time: float) -> float:
        """Return h of a time."""
        if time not in self._known:
            self._known[time] = expected_snr(self.pdf, [time], self.sensor)
        return self._known[time]

    def of_bracket(self, times: Floats) -> float:
        """Return the mean SNR of a bracket."""
        return float(sum(self.at(float(time)) for time in times))

    def between(self, low: float, high: float) -> Floats:
        """Return times from low to high, whole frames where required."""
        times = np.linspace(low, high, REFINED)
        if self.frame:
            times = np.unique(np.round(times / self.frame)) * self.frame
            times = times[times > 0]
        return times


def _starts(values: _Values, count: int, room: float, first: float) -> Iterator[Floats]:
    """Yield brackets that fit: equal exposures, and those of two times at the price of time."""
    fitting = values.times[values.times <= room / count * (1 + SLACK)]
    if not len(fitting):  # less time than a quarter of the first each
        yield np.full(count, room / count)
        return
    yield np.full(count, fitting[-1])
    yield np.full(count, fitting[int(np.argmax(values.values[: len(fitting)]))])
    short, long = _at_the_price(values, count, room)
    for times in {(short, long), (first, long), (first, short)}:
        low, high = min(times), max(times)
        for many in range(count + 1):
            if many * high + (count - many) * low <= room * (1 + SLACK):
                found = np.full(count, low)
                found[count - many :] = high
                yield found


def _at_the_price(values: _Values, count: int, room: float) -> tuple[float, float]:
    """Return the shortest and the longest best exposure at the price where `count` just fit."""
    low, high = 0.0, float(np.max(values.values / values.times))
    times, each = values.times, room / count

    def best(price: float) -> int:
        return int(np.argmax(values.values - price * times))

    if times[best(0.0)] <= each:
        return (float(times[best(0.0)]),) * 2
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if times[best(middle)] > each else (low, middle)
    return float(times[best(high)]), float(times[best(low)])


def _exchanged(start: Floats, values: _Values, room: float) -> Floats:
    """Return a bracket after exchanges of time between its exposures, and with unused time."""
    times = np.array(start)
    for _ in range(ROUNDS):
        before = values.of_bracket(times)
        kinds = [int(np.flatnonzero(times == time)[0]) for time in np.unique(times)]
        twice = [int(np.flatnonzero(times == time)[-1]) for time in np.unique(times)]
        for one, other in combinations_with_replacement(range(len(kinds)), 2):
            a, b = kinds[one], twice[other]
            spare = room - times.sum()
            if a != b:
                times[a], times[b] = _best_pair(
                    times[a], times[b], times[a] + times[b] + spare, values
                )
            else:
                times[a] = _best_alone(times[a], times[a] + spare, values)
        if values.of_bracket(times) <= before * (1 + GAIN):
            break
    return times


def _best_alone(time: float, most: float, values: _Values) -> float:
    """Return the best time up to `most`, at least as good as the given one."""
    found = values.times[values.times <= most * (1 + SLACK)]
    best = float(found[int(np.argmax(values.values[: len(found)]))]) if len(found) else time
    best = _refined(best, most, values, values.at)
    return best if values.at(best) > values.at(time) else time


def _best_pair(one: float, other: float, total: float, values: _Values) -> tuple[float, float]:
    """Return the best two times of a sum of at most `total`, no worse than the given ones."""

    def rest(time: float) -> float:
        left = total - time
        if values.frame:
            left = np.floor(left / values.frame * (1 + SLACK)) * values.frame
        return float(left)

    def worth(time: float) -> float:
        left = rest(time)
        return values.at(time) + values.at(left) if left > 0 else -np.inf

    grid = values.times[values.times < total]
    # The other may saturate later than on the grid: the remaining time is a candidate, too.
    mirrored = np.array([rest(t) for t in grid])
    found = np.unique(np.concatenate([grid, mirrored[mirrored > 0], [one, other]]))
    best = float(found[int(np.argmax([worth(float(t)) for t in found]))])
    best = _refined(best, total, values, worth)
    if worth(best) <= values.at(one) + values.at(other):
        return one, other
    left = rest(best)
    # Time that does not help is not used.
    alone = _best_alone(left, left, values)
    return best, alone if values.at(alone) >= values.at(left) else left


def _refined(time: float, most: float, values: _Values, worth: Callable[[float], float]) -> float:
    """Return the best time near one of the grid, up to `most`."""
    at = int(np.searchsorted(values.times, time))
    low = min(float(values.times[max(at - 1, 0)]), most)
    high = min(values.times[min(at + 1, len(values.times) - 1)], most)
    for _ in range(REFINEMENTS):
        found = np.append(values.between(low, high), time)
        time = float(found[int(np.argmax([worth(float(t)) for t in found]))])
        step = (high - low) / (REFINED - 1)
        low, high = max(time - step, found.min()), min(time + step, most)
    return time
