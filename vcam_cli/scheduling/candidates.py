"""Candidate times for a schedule, and what is lost by allowing no others.

x = well / t is the rate, photocurrent and dark current together, that fills the well at t.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.objective import SLACK, Constraints, Sensor, shortest
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

SIZE = 8192
"""Candidates for a continuous pdf, on top of its edges."""
NEGLIGIBLE = 1e-9
"""Probability of the photocurrents near 0 that are left without a capture of their own."""
MOST = 1 << 16
"""Candidates for levels under a least gap, above which no more of those shifted by it are added."""
UNCONSTRAINED = Constraints()


@dataclass(frozen=True)
class Grid:
    """Times a capture may have, and how any other time is moved to one of them."""

    times: Floats  # (G,) rising, the first is t_1 [s]
    begin: Floats  # (G,) earliest and latest time of a capture that is moved to this candidate,
    end: Floats  # where moving it costs at most `error` [s]
    error: float = 0.0  # mean SNR lost a capture
    ratio: float = 1.0  # of neighboring times, at most; 1: moving a capture costs nothing
    tail: float = 0.0  # mean SNR of photocurrents that saturate in none of the candidates
    complete: bool = False  # a best schedule is among the candidates even under a least gap


def least_gap(constraints: Constraints) -> float:
    """The least time between captures that differ [s]: `min_gap`, in whole frames."""
    gap, frame = constraints.min_gap, constraints.frame_time
    return frame * float(np.ceil(gap / frame * (1 - SLACK))) if frame else gap


def followers(begin: Floats, end: Floats, gap: float) -> Indices:
    """First candidate that may lie `gap` after each; itself, a repetition, without a gap.

    begin, end : (G,) earliest and latest time that each stands for.
    """
    own = np.arange(len(begin))
    if not gap:
        return own
    return np.maximum(np.searchsorted(end * (1 + SLACK), begin + gap), own)


def grid(pdf: Pdf, sensor: Sensor, constraints: Constraints, count: int) -> Grid:
    """Candidates for up to `count` captures.

    Raises ValueError where no whole frame is as short as the first capture must be.
    """
    start = shortest(pdf, sensor, constraints)
    if pdf.discrete:
        return _shifted(levels(pdf, sensor, constraints), constraints, count)
    return _continuous(pdf, sensor, constraints, start, count)


def levels(pdf: Pdf, sensor: Sensor, constraints: Constraints) -> Grid:
    """The longest unsaturated time of every level, in whole frames.

    A capture at any other time is put off to the next of these: nothing more saturates, and
    nobody's exposure is shorter.
    """
    start = shortest(pdf, sensor, constraints)
    seen = pdf.low[(pdf.probability > 0) & (pdf.low > 0)]
    times = np.minimum(sensor.well / (seen + sensor.dark), sensor.max_time)
    if constraints.frame_time:
        times = _whole(times, constraints.frame_time) * constraints.frame_time
    times = np.unique(np.append(times[times > start * (1 + SLACK)], start))
    return Grid(times, np.append(times[0], times[:-1]), times)


def _shifted(base: Grid, constraints: Constraints, count: int) -> Grid:
    """Under a least gap also the times that lie 1, 2, .. gaps before another candidate.

    In a best schedule every capture is put off until it would saturate a level, or until it
    reaches the longest exposure, or stands the least gap before its successor: each is a whole
    number of gaps before a level's time.
    """
    gap = least_gap(constraints)
    if not gap:
        return Grid(base.times, base.begin, base.end, complete=True)
    times, start, complete = base.times, base.times[0], True
    for steps in range(1, count):
        shifted = base.times - steps * gap
        shifted = shifted[shifted >= (start + gap) * (1 - SLACK)]
        complete = len(times) + len(shifted) <= MOST
        if not complete:
            break
        times = np.append(times, shifted)
    times = _distinct(times, constraints)
    return Grid(times, times, times, complete=complete)


def _continuous(
    pdf: Pdf, sensor: Sensor, constraints: Constraints, start: float, count: int
) -> Grid:
    darkest, tail = _darkest(pdf, sensor)
    stop = max(min(sensor.well / darkest, sensor.max_time), start)
    low, high = sensor.well / stop, sensor.well / start
    rates = np.concatenate([_edges(pdf, sensor), _spread(pdf, sensor, low, high)])
    rates = rates[(rates > low) & (rates < high)]
    times = np.concatenate([[start, stop], sensor.well / rates])
    gap, frame = least_gap(constraints), constraints.frame_time
    if gap:
        steps = gap * np.arange(count)
        times = np.concatenate([times, start + steps, stop - steps])
    if frame:  # frames on both sides of each time: the cells between stay inside its cells
        down = _whole(times, frame)
        longest = float(_whole(np.array([stop]), frame)[0])
        times = np.unique(np.clip(np.append(down, down + 1), None, longest)) * frame
    times = times[(times >= start) & (times <= stop * (1 + SLACK))]
    times = _distinct(np.append(times, start), constraints)
    return _cells(pdf, sensor, frame, times, tail)


def _cells(pdf: Pdf, sensor: Sensor, frame: float, times: Floats, tail: float) -> Grid:
    """The grid with a bound of what captures inside its cells may gain.

    Let every capture of a best schedule move at random to one end of its cell, in x, so that it
    stays where it is on average. The worth sums w(a, b), a capture at x = a before one at b, and
    its mean is the interpolation of w between the ends: lower by at most h^2/8 (max -w_aa +
    max -w_bb). With f constant in the cell [lo, hi] of height h, g(i, x) the SNR, falling and
    convex in x,
        -w_bb = f g_i <= f well / lo,
        -w_aa <= f (-2 g_x - g_i) <= f well / lo, and where b lies above a in the same cell
                 less than f g_xx h <= 6 f well h hi / lo^3 more.
    Moved captures may change places. The sum w then counts a pixel less than its longest
    unsaturated exposure, as what is added for a later run of unsaturated captures is
    g(its last) - g(a longer, saturated one before) <= 0. So some schedule on the grid is worth
    at least the best one's less `error` a capture. Neighboring frames have nothing in between.
    """
    rates = sensor.well / times
    high, low = rates[:-1], rates[1:]
    near = np.diff(times) <= 1.5 * frame
    middle = (high + low) / 2 - sensor.dark
    segment = np.minimum(np.searchsorted(pdf.high, middle, side="right"), len(pdf.low) - 1)
    inside = (pdf.low[segment] <= middle) & ~near
    density = np.where(inside, pdf.density[segment], 0.0)
    height = high - low
    lost = height**2 / 8 * density * sensor.well / low * (2 + 6 * height * high / low**2)
    begin, end = times.copy(), times.copy()
    begin[1:] = np.where(near, times[1:], times[:-1])
    end[:-1] = np.where(near, times[:-1], times[1:])
    error = float(lost.max(initial=0.0))
    ratio = float(np.max(np.where(near, 1.0, times[1:] / times[:-1]), initial=1.0))
    return Grid(times, begin, end, error, ratio, tail, complete=bool(near.all()))


def _darkest(pdf: Pdf, sensor: Sensor) -> tuple[float, float]:
    """The least x of use, and the mean SNR of the photocurrents below it."""
    least = pdf.min + sensor.dark
    if least > 0 or np.isfinite(sensor.max_time):
        return max(least, sensor.well * np.finfo(float).tiny), 0.0
    first = int(np.flatnonzero(pdf.probability > 0)[0])
    share = min(NEGLIGIBLE / pdf.probability[first], 1.0)
    full = sensor.well**2 / (sensor.well + sensor.floor)
    return share * float(pdf.high[first]), share * float(pdf.probability[first]) * full


def _edges(pdf: Pdf, sensor: Sensor) -> Floats:
    """x of all edges of segments that occur."""
    occurs = pdf.probability > 0
    return np.unique(np.concatenate([pdf.low[occurs], pdf.high[occurs]])) + sensor.dark


def _spread(pdf: Pdf, sensor: Sensor, low: float, high: float) -> Floats:
    """x from `low` to `high`, half of them so that `error` is the same in all cells
    (h ~ sqrt(x / f)), half geometric, that no cell is wide against its x."""
    if low >= high:
        return np.empty(0)
    ratios = np.geomspace(low, high, SIZE // 2 + 1)
    bottom = np.clip(pdf.low + sensor.dark, low, high)
    top = np.clip(pdf.high + sensor.dark, low, high)
    length = np.sqrt(pdf.density) * (np.sqrt(top) - np.sqrt(bottom))
    knots = np.concatenate([[0.0], np.cumsum(length)])
    wanted = np.linspace(0, knots[-1], SIZE // 2 + 1)[1:-1]
    segment = np.clip(np.searchsorted(knots, wanted, side="right") - 1, 0, len(length) - 1)
    share = (wanted - knots[segment]) / np.where(length > 0, length, 1.0)[segment]
    roots = np.sqrt(bottom[segment]) * (1 - share) + np.sqrt(top[segment]) * share
    return np.concatenate([ratios, roots**2])


def _whole(times: Floats, frame: float) -> Floats:
    """Whole frames in each time."""
    return np.floor(times / frame * (1 + SLACK))


def _distinct(times: Floats, constraints: Constraints) -> Floats:
    """Sorted, without what differs by rounding."""
    if constraints.frame_time:
        return np.unique(np.round(times / constraints.frame_time)) * constraints.frame_time
    times = np.unique(times)
    return times[np.append(True, np.diff(times) > 1e-14 * times[1:])]
