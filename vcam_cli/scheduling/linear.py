"""Mean signal-to-noise ratio of the best linear estimate from all samples before saturation.

With k samples of one integration before saturation the estimate's SNR is i^2 t' C^-1 t, with

    C_jl = (i + dark) min(t_j, t_l) + read^2 delta_jl + reset^2.

Differences of neighboring samples have a tridiagonal covariance, so that elimination takes one
step a capture and gives the value for every k on its way (X. Liu and A. El Gamal, "Synthesis of
high dynamic range motion blur free image from multiple captures", IEEE Trans. Circuits Syst. I
50(4), 2003, doi:10.1109/TCSI.2003.809815).

The mean over the pdf is by Gauss's rule. As a function of s = i + dark the value's only poles are
real, negative and at least read^2 / (t_1 + .. + t_k) from 0: generalized eigenvalues of noise and
min(t_j, t_l). Pieces whose ends are at most a factor 2 apart, counted from that distance, have
their poles three half-widths from their middle, where each node gains a factor 34.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.objective import SLACK, Sensor
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

EXACT = 11
"""Gauss points for 1e-16, and for 1e-9 while searching."""
ROUGH = 6
NEAR_ZERO = 1e-8
"""Part of a piece that begins at 0 which is not split any further: it holds 1e-16 of the sum."""
NARROW = 1.02
"""Ratio of a piece's ends up to which three points do: the gain is 200^2 each."""
TINY = float(np.finfo(np.float64).tiny)


def mean_snr(pdf: Pdf, schedules: Floats, sensor: Sensor, order: int = EXACT) -> Floats:
    """(B,) mean SNR of (B, N) schedules, each rising [s]; captures that coincide are all read."""
    row, low, high, probability, captures = _cells(pdf, schedules, sensor)
    if not pdf.discrete:
        shift = sensor.dark + sensor.read**2 / schedules.sum(axis=1)[row]
        cell, low, high, share = _split(low, high, shift)
        row, probability, captures = row[cell], probability[cell] * share, captures[cell]
        shift = shift[cell]
    total = np.zeros(len(schedules))
    for nodes, chosen in _rules(pdf, low, high, order):
        points, weights = _gauss(nodes)
        half = (high[chosen] - low[chosen]) / 2
        i = (low[chosen] + half)[:, None] + half[:, None] * points
        when, seen = schedules[row[chosen]], captures[chosen]
        value = i * i * _precision(i + sensor.dark, when, seen, sensor) @ (weights / 2)
        total += np.bincount(row[chosen], probability[chosen] * value, len(schedules))
    return total


@cache
def _gauss(nodes: int) -> tuple[Floats, Floats]:
    points, weights = np.polynomial.legendre.leggauss(nodes)
    return points, weights


def _rules(pdf: Pdf, low: Floats, high: Floats, order: int) -> list[tuple[int, NDArray[np.bool_]]]:
    """Numbers of Gauss points and the pieces that they are for."""
    if pdf.discrete:
        return [(1, np.ones(len(low), bool))]
    narrow = high <= NARROW * low
    return [(nodes, chosen) for nodes, chosen in ((3, narrow), (order, ~narrow)) if chosen.any()]


def _precision(rate: Floats, times: Floats, captures: Indices, sensor: Sensor) -> Floats:
    """t' C^-1 t, (n, q), of rates i + dark (n, q) from the first `captures` (n,) of times (n, N).

    Elimination in the covariance of differences: variances rate dt + 2 read^2, of the first
    rate t + read^2 + reset^2, covariance of neighbors -read^2.
    """
    order = np.argsort(-captures, kind="stable")  # those with one more capture come first
    rate, times, captures = rate[order], times[order], captures[order]
    read = sensor.read**2
    time = np.broadcast_to(times[:, :1], rate.shape)
    pivot = np.maximum(rate * time + sensor.floor, TINY)
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


def _cells(
    pdf: Pdf, schedules: Floats, sensor: Sensor
) -> tuple[Indices, Floats, Floats, Floats, Indices]:
    """Pieces of the pdf between the photocurrents that each schedule's captures saturate.

    Returns the schedule each belongs to, its ends, its probability and its number of captures,
    for pieces where neither of the last is 0.
    """
    limits = sensor.limit(schedules / (1 + SLACK))
    if pdf.discrete:
        seen = pdf.low[pdf.low > 0]
        shape = (len(schedules), len(seen))
        low = high = np.broadcast_to(seen, shape)
        probability = np.broadcast_to(pdf.probability[pdf.low > 0], shape)
        filled = (seen + sensor.dark)[None, :, None] * schedules[:, None, :]
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


def _split(low: Floats, high: Floats, shift: Floats) -> tuple[Indices, Floats, Floats, Floats]:
    """Pieces whose ends, moved by `shift`, are at most a factor 2 apart: the one each comes
    from, its ends, its share of that one's width."""
    start = np.maximum(shift, NEAR_ZERO * high - low)
    ratio = (high + start) / (low + start)
    parts = np.maximum(np.ceil(np.log2(ratio) * (1 - 1e-9)), 1).astype(np.intp)
    cell = np.repeat(np.arange(len(low)), parts)
    step = np.arange(len(cell)) - np.repeat(np.cumsum(parts) - parts, parts)
    begin, factor = (low + start)[cell], (ratio ** (1 / parts))[cell]
    first, last = step == 0, step == parts[cell] - 1
    bottom = np.where(first, low[cell], begin * factor**step - start[cell])
    top = np.where(last, high[cell], begin * factor ** (step + 1) - start[cell])
    return cell, bottom, top, (top - bottom) / (high - low)[cell]
