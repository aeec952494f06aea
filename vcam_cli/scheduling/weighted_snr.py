"""The mean SNR of the best linear estimate from all samples before saturation; pixels for bounds.

With k samples of one integration before saturation the estimate's SNR is i^2 t' C^-1 t, with

    C_jl = (i + dark) min(t_j, t_l) + read^2 delta_jl + reset^2.

Differences of neighboring samples have a tridiagonal covariance, so that elimination takes one
step a capture and gives the value for every k on its way ([1]_).

The mean over the pdf is by Gauss's rule. As a function of s = i + dark the value's only poles are
real, negative and at least read^2 / (t_1 + .. + t_k) from 0: generalized eigenvalues of noise and
min(t_j, t_l). Segments whose ends are at most a factor 2 apart, counted from that distance, have
their poles three half-widths from their middle, where each node gains a factor 34.

References
----------
.. [1] X. Liu and A. El Gamal, "Synthesis of high dynamic range motion blur free image from multiple
   captures", IEEE Trans. Circuits Syst. I 50(4), 2003, doi:10.1109/TCSI.2003.809815.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.records import dataclass
from vcam_cli.scheduling import objective
from vcam_cli.scheduling.objective import TINY, sorted_times
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf
from vcam_cli.scheduling.sensor import SLACK, Sensor

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


@cache
def gauss_rule(nodes: int) -> tuple[Floats, Floats]:
    """Return points and weights of Gauss's rule on [-1, 1].

    Parameters
    ----------
    nodes : int
        Number of points.

    Returns
    -------
    points, weights : (nodes,) arrays
        Rising points in [-1, 1], and their weights, of sum 2.
    """
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

    Parameters
    ----------
    low, high : (K,) arrays
        Ends of the segments, low < high.
    shift : (K,) array
        What is added to the ends of each before their ratio is taken, in their unit.

    Returns
    -------
    source : (M,) array
        Index of the segment that each part comes from.
    low, high : (M,) arrays
        Ends of the parts.
    share : (M,) array
        Width of each part over that of its segment.
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


@dataclass(frozen=True)
class Pixels:
    """Kinds of pixels: nodes of a quadrature over the pdf.

    Parameters
    ----------
    rate : (M,) array
        Photocurrent and dark current [e/s].
    weight : (M,) array
        Probability times i^2.
    last : (M,) array
        Index of the last time before saturation.
    """

    rate: Floats
    weight: Floats
    last: Indices

    def chosen(self, which: NDArray[np.bool_]) -> "Pixels":
        """Return some of the pixels.

        Parameters
        ----------
        which : (M,) array of bool
            Whether to keep each kind.

        Returns
        -------
        Pixels
            Those that are kept.
        """
        return Pixels(self.rate[which], self.weight[which], self.last[which])


def pixels_by_saturation(pdf: Pdf, times: Floats, sensor: Sensor, order: int = ROUGH) -> Pixels:
    """Return nodes of a quadrature as in `mean_snr`, of lit pixels.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    times : (T,) array
        Rising times; within one of them each pixel saturates as a whole or not [s].
    sensor : Sensor
        The pixel.
    order : int
        Number of Gauss points on a segment.

    Returns
    -------
    Pixels
        Those that do not saturate in the first of the times.
    """
    if pdf.discrete:
        i, share = pdf.low, pdf.probability
    else:
        limits = sensor.saturation_limit(times)
        inside = limits[(limits > pdf.low[0]) & (limits < pdf.high[-1])]
        edges = np.unique(np.concatenate([pdf.low, pdf.high, inside]))
        low, high = edges[:-1], edges[1:]
        middle = low + (high - low) / 2
        segment = np.minimum(np.searchsorted(pdf.high, middle, side="right"), len(pdf.low) - 1)
        density = np.where(pdf.low[segment] <= middle, pdf.density[segment], 0.0)
        shift = np.full(len(low), sensor.dark + sensor.read**2 / times.sum())
        part, low, high, _ = split_octaves(low, high, shift)
        i, share = _nodes(low, high, density[part], order)
    rate = i + sensor.dark
    filled = sensor.well * (1 + SLACK) / times  # the largest rate that each time holds
    last = len(times) - 1 - np.searchsorted(filled[::-1], rate * (1 - SLACK), side="left")
    used = (share > 0) & (i > 0) & (last >= 0)
    return Pixels(rate[used], share[used] * i[used] ** 2, last[used])


def _nodes(low: Floats, high: Floats, density: Floats, order: int) -> tuple[Floats, Floats]:
    """Return photocurrents and probabilities, fewer of them in narrow segments."""
    parts = []
    for nodes, which in ((3, high <= NARROW * low), (order, high > NARROW * low)):
        points, weights = gauss_rule(nodes)
        half = (high[which] - low[which]) / 2
        i = (low[which] + half)[:, None] + half[:, None] * points
        parts.append((i.ravel(), ((density[which] * half)[:, None] * weights).ravel()))
    return np.concatenate([i for i, _ in parts]), np.concatenate([share for _, share in parts])
