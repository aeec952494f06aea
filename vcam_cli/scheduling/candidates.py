"""Candidate times for a schedule, and what is lost by allowing no others.

x = well / t is the rate, photocurrent and dark current together, that fills the well at t.
"""

import numpy as np

from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import SLACK, Constraints, Sensor, first_capture_time

SIZE = 8192
"""Candidates for a continuous pdf, beside its edges."""
NEGLIGIBLE = 1e-9
"""Probability of the photocurrents near 0 that are left without a capture of their own."""
MOST = 1 << 16
"""Candidates for levels under a least gap, above which no more of those shifted by it are added."""


@dataclass(frozen=True)
class Candidates:
    """Times a capture may have, and how any other time is moved to one of them.

    Parameters
    ----------
    times : (G,) array
        Candidate times, rising, the first is t_1 [s].
    begin, end : (G,) arrays
        Earliest and latest time of a capture that is moved to each candidate, where moving it costs
        at most `error` [s].
    error : float
        Mean SNR lost for each capture that is moved, at most.
    ratio : float
        Largest ratio of neighboring times; 1 where moving a capture costs nothing.
    tail : float
        Mean SNR of photocurrents that saturate in none of the candidates, at most.
    complete : bool
        Whether a best schedule is among the candidates even under a least gap.
    """

    times: Floats
    begin: Floats
    end: Floats
    error: float = 0.0
    ratio: float = 1.0
    tail: float = 0.0
    complete: bool = False


def candidate_times(pdf: Pdf, sensor: Sensor, constraints: Constraints, count: int) -> Candidates:
    """Choose candidates for up to `count` captures.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents [e/s].
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands of the times.
    count : int
        Most captures that a schedule may have.

    Returns
    -------
    Candidates
        Times [s], with the mean SNR lost by allowing no others.

    Raises
    ------
    ValueError
        If no whole frame is as short as the first capture must be.
    """
    start = first_capture_time(pdf, sensor, constraints)
    if pdf.discrete:
        return _shifted_candidates(level_candidates(pdf, sensor, constraints), constraints, count)
    return _continuous_candidates(pdf, sensor, constraints, start, count)


def level_candidates(pdf: Pdf, sensor: Sensor, constraints: Constraints) -> Candidates:
    """Return the longest unsaturated time of every level, in whole frames.

    A capture at any other time is delayed to the next of these: nothing more saturates, and no
    pixel's exposure is shorter.

    Parameters
    ----------
    pdf : Pdf
        Levels of photocurrent [e/s].
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands of the times.

    Returns
    -------
    Candidates
        Times [s]; moving a capture to one of them loses nothing.

    Raises
    ------
    ValueError
        If no whole frame is as short as the first capture must be.
    """
    start = first_capture_time(pdf, sensor, constraints)
    lit = pdf.low[(pdf.probability > 0) & (pdf.low > 0)]
    times = np.minimum(sensor.well / (lit + sensor.dark), sensor.max_time)
    if constraints.frame_time:
        times = constraints.whole_frames(times) * constraints.frame_time
    times = np.unique(np.append(times[times > start * (1 + SLACK)], start))
    return Candidates(times, np.append(times[0], times[:-1]), times)


def _shifted_candidates(base: Candidates, constraints: Constraints, count: int) -> Candidates:
    """Add the times that lie 1, 2, .. least gaps before another candidate, where there is a gap.

    In a best schedule every capture is delayed until it would saturate a level, or until it
    reaches the longest exposure, or stands the least gap before its successor: each is a whole
    number of gaps before a level's time.
    """
    gap = constraints.least_gap
    if not gap:
        return Candidates(base.times, base.begin, base.end, complete=True)
    times, start, complete = base.times, base.times[0], True
    for steps in range(1, count):
        shifted = base.times - steps * gap
        shifted = shifted[shifted >= (start + gap) * (1 - SLACK)]
        complete = len(times) + len(shifted) <= MOST
        if not complete:
            break
        times = np.append(times, shifted)
    times = _distinct_times(times, constraints)
    return Candidates(times, times, times, complete=complete)


def _continuous_candidates(
    pdf: Pdf, sensor: Sensor, constraints: Constraints, start: float, count: int
) -> Candidates:
    darkest, tail = _darkest_rate(pdf, sensor)
    stop = max(min(sensor.well / darkest, sensor.max_time), start)
    low, high = sensor.well / stop, sensor.well / start
    rates = np.concatenate([_edge_rates(pdf, sensor), _spread_rates(pdf, sensor, low, high)])
    rates = rates[(rates > low) & (rates < high)]
    times = np.concatenate([[start, stop], sensor.well / rates])
    gap, frame = constraints.least_gap, constraints.frame_time
    if gap:
        steps = gap * np.arange(count)
        times = np.concatenate([times, start + steps, stop - steps])
    if frame:  # frames on both sides of each time: the cells between stay inside its cells
        down = constraints.whole_frames(times)
        longest = float(constraints.whole_frames(stop))
        times = np.unique(np.clip(np.append(down, down + 1), None, longest)) * frame
    times = times[(times >= start) & (times <= stop * (1 + SLACK))]
    times = _distinct_times(np.append(times, start), constraints)
    return _add_error_bound(pdf, sensor, frame, times, tail)


def _add_error_bound(
    pdf: Pdf, sensor: Sensor, frame: float, times: Floats, tail: float
) -> Candidates:
    """Return the candidates with a bound of what captures inside their cells may gain.

    Let every capture of a best schedule move at random to one end of its cell, in x, so that it
    stays where it is on average. The schedule is worth the sum of w(a, b), a capture at x = a
    before one at b, and its mean is the interpolation of w between the ends: lower by at most
    h^2/8 (max -w_aa + max -w_bb). With f constant in the cell [lo, hi] of height h, g(i, x) the
    SNR, falling and convex in x,

        -w_bb = f g_i <= f well / lo,
        -w_aa <= f (-2 g_x - g_i) <= f well / lo, and where b lies above a in the same cell
                 less than f g_xx h <= 6 f well h hi / lo^3 more.

    Moved captures may change places. The sum w then counts a pixel less than its longest
    unsaturated exposure, as what is added for a later run of unsaturated captures is
    g(its last) - g(a longer, saturated one before) <= 0. So some schedule on the candidates is
    worth at least the best one's less `error` a capture. Neighboring frames have nothing between.
    """
    rates = sensor.well / times
    high, low = rates[:-1], rates[1:]
    adjacent = np.diff(times) <= 1.5 * frame
    middle = (high + low) / 2 - sensor.dark
    segment = np.minimum(np.searchsorted(pdf.high, middle, side="right"), len(pdf.low) - 1)
    inside = (pdf.low[segment] <= middle) & ~adjacent
    density = np.where(inside, pdf.density[segment], 0.0)
    height = high - low
    lost = height**2 / 8 * density * sensor.well / low * (2 + 6 * height * high / low**2)
    begin, end = times.copy(), times.copy()
    begin[1:] = np.where(adjacent, times[1:], times[:-1])
    end[:-1] = np.where(adjacent, times[:-1], times[1:])
    error = float(lost.max(initial=0.0))
    ratio = float(np.max(np.where(adjacent, 1.0, times[1:] / times[:-1]), initial=1.0))
    return Candidates(times, begin, end, error, ratio, tail, complete=bool(adjacent.all()))


def _darkest_rate(pdf: Pdf, sensor: Sensor) -> tuple[float, float]:
    """Return the least x of use, and the mean SNR of the photocurrents below it."""
    least = pdf.min + sensor.dark
    if least > 0 or np.isfinite(sensor.max_time):
        return max(least, sensor.well * np.finfo(float).tiny), 0.0
    first = int(np.flatnonzero(pdf.probability > 0)[0])
    share = min(NEGLIGIBLE / pdf.probability[first], 1.0)
    full = sensor.well**2 / (sensor.well + sensor.noise_floor)
    return share * float(pdf.high[first]), share * float(pdf.probability[first]) * full


def _edge_rates(pdf: Pdf, sensor: Sensor) -> Floats:
    """Return x of all edges of segments that occur."""
    occurs = pdf.probability > 0
    return np.unique(np.concatenate([pdf.low[occurs], pdf.high[occurs]])) + sensor.dark


def _spread_rates(pdf: Pdf, sensor: Sensor, low: float, high: float) -> Floats:
    """Spread x from `low` to `high`.

    Half of them are placed so that `error` is the same in all cells (h ~ sqrt(x / f)), half are
    geometric, so that no cell is wide against its x.
    """
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


def _distinct_times(times: Floats, constraints: Constraints) -> Floats:
    """Sort times and drop what differs by rounding."""
    if constraints.frame_time:
        return np.unique(np.round(times / constraints.frame_time)) * constraints.frame_time
    times = np.unique(times)
    distinct: Floats = times[np.append(True, np.diff(times) > 1e-14 * times[1:])]
    return distinct
