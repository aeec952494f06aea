"""The mean SNR of the best linear estimate from all samples before saturation, and its bound.

With k samples of one integration before saturation the estimate's SNR is i^2 t' C^-1 t, with

    C_jl = (i + dark) min(t_j, t_l) + read^2 delta_jl + reset^2.

Differences of neighboring samples have a tridiagonal covariance, so that elimination takes one
step a capture and gives the value for every k on its way ([1]_).

The mean over the pdf is by Gauss's rule. As a function of s = i + dark the value's only poles are
real, negative and at least read^2 / (t_1 + .. + t_k) from 0: generalized eigenvalues of noise and
min(t_j, t_l). Segments whose ends are at most a factor 2 apart, counted from that distance, have
their poles three half-widths from their middle, where each node gains a factor 34.

The bound: after k captures, the last at T, the estimate's variance is the least of
s w' m w + w' N w over weights with w' t = 1, m = min(t_j, t_l), N = read^2 + reset^2 11'. Apart,
the two are at least s / T (the last sample, free of noise) and 1 / B_k,

    B_k = max t' N^-1 t over the times of captures 2..k in [t_1, T]:

a convex function, greatest where each is at one end. So

    SNR <= i^2 / (s / T + 1 / B_k(T)) = T i^2 / (i + c_k),   c_k = dark + T / B_k(T),

which grows with T and k: a chain of rewards again, one stage a capture, with a global optimum.

References
----------
.. [1] X. Liu and A. El Gamal, "Synthesis of high dynamic range motion blur free image from multiple
   captures", IEEE Trans. Circuits Syst. I 50(4), 2003, doi:10.1109/TCSI.2003.809815.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.scheduling import objective
from vcam_cli.scheduling.candidates import Candidates, candidate_times, level_candidates
from vcam_cli.scheduling.chains import Rewards, rewards_of_exposures, row_maxima
from vcam_cli.scheduling.objective import TINY, sorted_times
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf
from vcam_cli.scheduling.sensor import SLACK, UNCONSTRAINED, Constraints, Sensor

EXACT = 11
"""Gauss points for a relative error of 1e-16."""
ROUGH = 6
"""Gauss points for 1e-9, enough for a search."""
NEAR_ZERO = 1e-8
"""Part of a segment that begins at 0 which is not split any further: it holds 1e-16 of the sum."""
NARROW = 1.02
"""Ratio of a segment's ends up to which three points suffice: the gain is 200^2 each."""


def weighted_expected_snr(pdf: Pdf, times: ArrayLike, sensor: Sensor) -> float:
    """Return the mean SNR of the best linear estimate, as a power ratio.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    times : (N,) array_like
        Capture times in any order [s]. Every entry is a read of its own: at equal times two reads
        halve the read noise.
    sensor : Sensor
        The pixel.

    Raises
    ------
    ValueError
        If a time is not finite and above 0.
    """
    when = sorted_times(times)
    if not sensor.noise_floor:
        return objective.expected_snr(pdf, when, sensor)
    return float(mean_snr(pdf, when[None], sensor)[0])


def mean_snr(pdf: Pdf, schedules: Floats, sensor: Sensor, order: int = EXACT) -> Floats:
    """Return the mean SNR of several schedules for the best linear estimate.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    schedules : (B, N) array
        Capture times, each row rising [s]; captures that coincide are all read.
    sensor : Sensor
        The pixel, with read or reset noise.
    order : int
        Number of Gauss points on a segment.

    Returns
    -------
    (B,) array
        Mean SNR, as a power ratio.
    """
    row, low, high, probability, captures = _saturation_segments(pdf, schedules, sensor)
    if not pdf.discrete:
        shift = sensor.dark + sensor.read**2 / schedules.sum(axis=1)[row]
        part, low, high, share = split_octaves(low, high, shift)
        row, probability, captures = row[part], probability[part] * share, captures[part]
    total = np.zeros(len(schedules))
    for nodes, chosen in _gauss_orders(pdf, low, high, order):
        points, weights = gauss_rule(nodes)
        half = (high[chosen] - low[chosen]) / 2
        i = (low[chosen] + half)[:, None] + half[:, None] * points
        when, samples = schedules[row[chosen]], captures[chosen]
        value = i * i * _precision(i + sensor.dark, when, samples, sensor) @ (weights / 2)
        total += np.bincount(row[chosen], probability[chosen] * value, len(schedules))
    return total


def upper_bounds(
    pdf: Pdf, most: int, sensor: Sensor, constraints: Constraints = UNCONSTRAINED
) -> Floats:
    """Return the mean SNR that no schedule of 1, 2, .. captures exceeds.

    A capture inside a cell of candidates is given the exposure of the cell's end and the
    saturation of its beginning, which is only more.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    most : int
        The largest number of captures, at least 1.
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands.

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
    exposures = [
        (reach, sensor.dark + reach / _information(k, cells.times[0], reach, sensor))
        for k, reach in enumerate([cells.times, *[cells.end] * (most - 1)], start=1)
    ]
    stages = rewards_of_exposures(pdf, cells.times, exposures, sensor)
    last = _last_predecessors(cells, constraints.read_interval)
    best = np.maximum.accumulate(_chain_values(stages, last))
    full_wells = cells.tail * (1 + sensor.noise_floor / sensor.well)  # the tail at a full well each
    return np.asarray(best + full_wells)


@cache
def gauss_rule(nodes: int) -> tuple[Floats, Floats]:
    """Return points and weights of Gauss's rule on [-1, 1]."""
    points, weights = np.polynomial.legendre.leggauss(nodes)
    return points, weights


def _gauss_orders(
    pdf: Pdf, low: Floats, high: Floats, order: int
) -> list[tuple[int, NDArray[np.bool_]]]:
    """Return numbers of Gauss points and the segments that they are for."""
    if pdf.discrete:
        return [(1, np.ones(len(low), bool))]
    narrow = high <= NARROW * low
    return [(nodes, chosen) for nodes, chosen in ((3, narrow), (order, ~narrow)) if chosen.any()]


def _precision(rate: Floats, times: Floats, captures: Indices, sensor: Sensor) -> Floats:
    """Return t' C^-1 t, (n, q), of rates i + dark (n, q) from the first `captures` (n,) of times.

    times : (n, N). Elimination in the covariance of differences: variances rate dt + 2 read^2, of
    the first rate t + read^2 + reset^2, covariance of neighbors -read^2.
    """
    order = np.argsort(-captures, kind="stable")  # those with one more capture come first
    rate, times, captures = rate[order], times[order], captures[order]
    read = sensor.read**2
    time = np.broadcast_to(times[:, :1], rate.shape)
    pivot = np.maximum(rate * time + sensor.noise_floor, TINY)
    total = time * time / pivot
    for k in range(1, times.shape[1]):
        more = int(np.searchsorted(-captures, -k, side="left"))
        if not more:
            break
        step = (times[:more, k] - times[:more, k - 1])[:, None]
        share = read / pivot[:more]
        time = step + share * time[:more]
        # without read noise a repeated capture adds nothing: 0 / TINY
        pivot = np.maximum(rate[:more] * step + read * (2 - share), TINY)
        total[:more] += time * time / pivot
    result = np.empty_like(total)
    result[order] = total
    return result


def _saturation_segments(
    pdf: Pdf, schedules: Floats, sensor: Sensor
) -> tuple[Indices, Floats, Floats, Floats, Indices]:
    """Split the pdf between the photocurrents that each schedule's captures saturate.

    Returns the schedule that each segment belongs to, its ends, its probability and its number of
    captures, for segments where neither of the last is 0.
    """
    limits = sensor.saturation_limit(schedules / (1 + SLACK))
    if pdf.discrete:
        lit = pdf.low[pdf.low > 0]
        shape = (len(schedules), len(lit))
        low = high = np.broadcast_to(lit, shape)
        probability = np.broadcast_to(pdf.probability[pdf.low > 0], shape)
        filled = (lit + sensor.dark)[None, :, None] * schedules[:, None, :]
        captures = (filled <= sensor.well * (1 + SLACK)).sum(axis=2)
    else:
        edges = np.unique(np.concatenate([pdf.low, pdf.high]))
        ends = [np.broadcast_to(edges, (len(schedules), len(edges))), limits]
        points = np.sort(np.clip(np.concatenate(ends, axis=1), edges[0], edges[-1]), axis=1)
        low, high = points[:, :-1], points[:, 1:]
        middle = low + (high - low) / 2
        segment = np.minimum(np.searchsorted(pdf.high, middle, side="right"), len(pdf.low) - 1)
        density = np.where(pdf.low[segment] <= middle, pdf.density[segment], 0.0)
        probability = density * (high - low)
        captures = (limits[:, None, :] >= high[:, :, None]).sum(axis=2)
    row, column = np.nonzero((probability > 0) & (captures > 0))
    return (
        row, low[row, column], high[row, column], probability[row, column], captures[row, column]
    )  # fmt: skip


def split_octaves(
    low: Floats, high: Floats, shift: Floats
) -> tuple[Indices, Floats, Floats, Floats]:
    """Split segments until their ends, moved by `shift`, are at most a factor 2 apart.

    Returns the segment each part comes from, its ends, its share of that one's width.
    """
    start = np.maximum(shift, NEAR_ZERO * high - low)
    ratio = (high + start) / (low + start)
    parts = np.maximum(np.ceil(np.log2(ratio) * (1 - 1e-9)), 1).astype(np.intp)
    source = np.repeat(np.arange(len(low)), parts)
    step = np.arange(len(source)) - np.repeat(np.cumsum(parts) - parts, parts)
    begin, factor = (low + start)[source], (ratio ** (1 / parts))[source]
    first, last = step == 0, step == parts[source] - 1
    bottom = np.where(first, low[source], begin * factor**step - start[source])
    top = np.where(last, high[source], begin * factor ** (step + 1) - start[source])
    return source, bottom, top, (top - bottom) / (high - low)[source]


def _bound_cells(pdf: Pdf, sensor: Sensor, constraints: Constraints) -> Candidates:
    if pdf.discrete:
        return level_candidates(pdf, sensor, constraints)
    frames = Constraints(0.0, constraints.frame_time)
    cells = candidate_times(pdf, sensor, frames, 1)
    return Candidates(cells.times, cells.times, cells.end, tail=cells.tail)


def _information(k: int, first: float, last: Floats, sensor: Sensor) -> Floats:
    """Return B_k(T) of the formula above for T = `last` (G,) and t_1 = `first`; may be infinite."""
    read, reset = sensor.read**2, sensor.reset**2
    if k == 1:
        return last**2 / sensor.noise_floor if sensor.noise_floor else np.full(last.shape, np.inf)
    if not read:
        same = first**2 / reset if reset else np.inf
        return np.where(last > first, np.inf, same)  # the difference of two is free of reset
    early = np.arange(1, k)[:, None]
    square = early * first**2 + (k - early) * last**2
    total = early * first + (k - early) * last
    values = (square - total**2 * (reset / (read + k * reset))) / read
    return np.asarray(values.max(axis=0))


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
