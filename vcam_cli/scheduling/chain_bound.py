"""An upper bound on the mean SNR of the weighted estimate, for captures at any times.

Given all reads but one, this one at t adds r(t)^2 / (read^2 + v(t)) to the precision of a pixel's
photocurrent. r is what the others leave of t, straight between two of them; v, the variance of the
charge there as the others know it, is a parabola between two of them, bent down, since a step of
the charge is never known worse than without them. A square over a concave function is convex ([1]_,
section 3.2.6): between its neighbors a read is best beside one of them. Reads at one time are one
read of less noise. So of k captures, the first at t_1 and the last at T, all others are best for a
pixel at one of the two:

    V_k(T) = max over m of P(m, k - m, T),

with P the precision from m reads at t_1 and k - m at T. It is concave in m ([2]_), grows with T
and k, and is convex in T, since beyond the last read v is straight, too: straight lines between
tabulated T lie above it.

With V_k for what a pixel sees of k captures, a schedule is worth no more than a chain of rewards,
one stage a capture, whose optimum `row_maxima` finds. What is lost is that one schedule cannot be
the best for all pixels.

References
----------
.. [1] S. Boyd and L. Vandenberghe, "Convex Optimization", Cambridge University Press, 2004.
.. [2] W. N. Anderson and R. J. Duffin, "Series and parallel addition of matrices", J. Math. Anal.
   Appl. 26, 1969, doi:10.1016/0022-247X(69)90200-5.
"""

from functools import partial

import numpy as np

from vcam_cli.scheduling.candidates import Candidates, candidate_times, level_candidates
from vcam_cli.scheduling.chains import Rewards, row_maxima
from vcam_cli.scheduling.objective import TINY
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf
from vcam_cli.scheduling.sensor import SLACK, UNCONSTRAINED, Constraints, Sensor
from vcam_cli.scheduling.weighted_snr import EXACT, Pixels, pixels_by_saturation

RATIO = 1.17
"""Ratio of the last times T at which V_k is worked out, in a table of `MOST` at most."""
MOST = 200
EVERY = 16
"""Captures up to which each number has a table of its own; beyond, the next of `STEP` serves."""
STEP = 2**0.25
"""Ratio of numbers of captures with a table."""
ROUNDED = 1 + 1e-12
"""Factor that makes sums no smaller than what they are rounded from."""


def upper_bounds(
    pdf: Pdf, most: int, sensor: Sensor, constraints: Constraints = UNCONSTRAINED
) -> Floats:
    """Return the mean SNR that no schedule of 1, 2, .. captures exceeds.

    A capture inside a cell of candidates is given the exposure of the cell's end and the
    saturation of its beginning, which is only more.

    Parameters
    ----------
    pdf, sensor, constraints
        As those of `full_noise.optimal_schedules`.
    most : int
        The largest number of captures, at least 1.

    Returns
    -------
    (most,) array
        Upper bounds, as power ratios.

    Raises
    ------
    ValueError
        If `most` is below 1, or no whole frame is as short as the first capture must be.
    """
    if most < 1:
        raise ValueError("at least one capture is needed")
    cells = _bound_cells(pdf, sensor, constraints)
    pixels = pixels_by_saturation(pdf, cells.times, sensor, EXACT)
    stages = _stages(cells, pixels, sensor, most)
    last = _last_predecessors(cells, constraints.read_interval)
    best = np.maximum.accumulate(_chain_values(stages, last)) * ROUNDED
    full_wells = cells.tail * (1 + sensor.noise_floor / sensor.well)  # the tail at a full well each
    return np.asarray(best + full_wells)


def best_precision(count: int, first: float, last: Floats, rate: Floats, sensor: Sensor) -> Floats:
    """Return the most that `count` captures can tell of a pixel's photocurrent.

    Parameters
    ----------
    count : int
        Number of captures, at least 1; of one, the time is `last`.
    first : float
        Time of the first capture [s].
    last : (T, 1) array
        Times of the last one, none before the first [s].
    rate : (M,) array
        Photocurrent and dark current of pixels [e/s].
    sensor : Sensor
        The pixel.

    Returns
    -------
    (T, M) array
        Precision of the photocurrent [s^2/e^2].
    """
    if count == 1:
        return np.asarray(last**2 / np.maximum(rate * last + sensor.noise_floor, TINY))
    low = np.ones(np.broadcast_shapes(last.shape, rate.shape))
    high = np.full_like(low, count - 1)
    worth = partial(_precision, count=count, first=first, last=last, rate=rate, sensor=sensor)
    while (low < high).any():  # the maximum of a concave function of the early reads
        early = np.floor((low + high) / 2)
        next_one = np.minimum(early + 1, high)
        rises = worth(next_one) > worth(early)
        low, high = np.where(rises, next_one, low), np.where(rises, high, early)
    return worth(low)


def _precision(
    early: Floats, count: int, first: float, last: Floats, rate: Floats, sensor: Sensor
) -> Floats:
    """Return the precision from `early` reads at the first time and the others at the last.

    Elimination in the covariance of the two means, the second less the first.
    """
    read = sensor.read**2 / early
    pivot = np.maximum(rate * first + sensor.reset**2 + read, TINY)
    share = read / pivot
    step = last - first
    rest = rate * step + read * (1 - share) + sensor.read**2 / (count - early)
    return np.asarray(first**2 / pivot + (step + share * first) ** 2 / np.maximum(rest, TINY))


def _stages(cells: Candidates, pixels: Pixels, sensor: Sensor, most: int) -> list[Rewards]:
    """Return the rewards of the first, second, .. capture."""
    first, end = float(cells.times[0]), float(cells.end[-1])
    reached = max(end / first, RATIO)
    last = np.geomspace(first, reached * first, min(MOST, 2 + int(np.log(reached) / np.log(RATIO))))
    stages: list[Rewards] = []
    for k in range(1, most + 1):
        if k > 2 and _tabulated(k) == _tabulated(k - 1):
            stages.append(stages[-1])
            continue
        reach = cells.times if k == 1 else cells.end
        precision = best_precision(_tabulated(k), first, last[:, None], pixels.rate, sensor)
        stages.append(_rewards(precision * pixels.weight, pixels.last, reach, last))
    return stages


def _tabulated(count: int) -> int:
    """Return the number of captures whose table serves for `count`: at least as many."""
    if count <= EVERY:
        return count
    steps = np.ceil(np.log(count / EVERY) / np.log(STEP) * (1 - SLACK))
    return max(count, int(np.ceil(EVERY * STEP**steps)))


def _rewards(earned: Floats, saturation: Indices, reach: Floats, last: Floats) -> Rewards:
    """Return the rewards of captures with exposures `reach`, straight between tabulated ones.

    earned : (T, M), what each pixel is worth with its last capture at each tabulated time.
    """
    size = len(reach)
    by_cell = np.zeros((size, len(last)))
    np.add.at(by_cell, saturation, earned.T)
    above = np.cumsum(by_cell[::-1], axis=0)[::-1]  # of pixels that are not saturated there
    sums = np.stack([above[:, :-1], above[:, 1:]], axis=2)
    block = np.clip(np.searchsorted(last, reach, side="right") - 1, 0, len(last) - 2)
    share = (reach - last[block]) / (last[block + 1] - last[block])
    weights = np.stack([1 - share, share], axis=1)
    own = np.einsum("gp,gp->g", weights, sums[np.arange(size), block])
    return Rewards(np.asarray(own), block, weights, sums)


def _bound_cells(pdf: Pdf, sensor: Sensor, constraints: Constraints) -> Candidates:
    if pdf.discrete:
        return level_candidates(pdf, sensor, constraints)
    frames = Constraints(0.0, constraints.frame_time)
    cells = candidate_times(pdf, sensor, frames, 1)
    return Candidates(cells.times, cells.times, cells.end, tail=cells.tail)


def _last_predecessors(cells: Candidates, gap: float) -> Indices:
    """Return the last candidate that each may follow; -1 where it may follow none."""
    own = np.arange(len(cells.times))
    if not gap:
        return own
    latest = np.searchsorted(cells.begin, cells.end * (1 + SLACK) - gap, side="right") - 1
    return np.minimum(latest, own)


def _chain_values(stages: list[Rewards], last: Indices) -> Floats:
    """Return (N,) the best value of chains of exactly 1..N captures; -inf where they do not fit.

    ahead[l]: value of all captures before the one at l. Rows l >= `start` can be reached.
    """
    size = len(last)
    values = np.full(len(stages), -np.inf)
    values[0] = stages[0].own[0]
    ahead, start = np.zeros(1), 0
    for k in range(1, len(stages)):
        begin = int(np.searchsorted(last, start, side="left"))
        if begin == size:
            break
        ahead = _advance(stages[k - 1], ahead, start, last, begin)
        start = begin
        values[k] = float(np.max(ahead + stages[k].own[start:]))
    return values


def _advance(before: Rewards, ahead: Floats, start: int, last: Indices, begin: int) -> Floats:
    """Return `ahead` of rows `begin` on, from that of columns `start` on, of the capture before."""

    def value(rows: Indices, columns: Indices) -> Floats:
        earned = before.own[columns] - before.loss(columns, rows + begin)
        return ahead[columns - start] + earned

    lower = np.full(len(last) - begin, start)
    upper = np.minimum(last[begin:], start + len(ahead) - 1)
    return row_maxima(value, lower, upper)[0]
