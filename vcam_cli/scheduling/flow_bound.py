"""An upper bound on the mean SNR of the weighted estimate, for captures at whole frames.

With frames 1..T and x_t in {0, 1} for a read at t, the precision of a pixel's photocurrent is

    F(x) = t' (K + read^2 / X)^-1 t,   K_jl = s min(t_j, t_l) + reset^2,   s = i + dark,

over the frames before its saturation: a parallel sum of K^-1 and X, and therefore concave in x
([1]_, and as in the design of experiments [2]_). Its derivative by x_t is (t - (K w)_t)^2 / read^2,
w = (K + read^2 / X)^-1 t.

A schedule is a path through the frames. Pixels that never saturate see all of it: their part of the
mean SNR is concave in the mean x of a mixture of paths. A pixel that saturates between the k-th
capture, at a, and the next sees k captures, the first and the last of them known: its precision
is at most V_k(a), that of the k - 2 others where they are best for this very pixel. So a step of a
path from a to b earns the sum of V_k(a) over the pixels that saturate between the two, and

    bound = max over mixtures of paths of  concave(mean x) + mean of the steps' earnings.

The best path for given derivatives is found by dynamic programming, the best mixture by adding
paths one at a time (simplicial decomposition, [3]_). At each step concavity gives a bound: the
value, plus what the best path is worth above the mixture. V_k itself is bounded the same way, from
reads at both ends of the range, which are nearly the best ones.

References
----------
.. [1] W. N. Anderson and R. J. Duffin, "Series and parallel addition of matrices", J. Math. Anal.
   Appl. 26, 1969, doi:10.1016/0022-247X(69)90200-5.
.. [2] F. Pukelsheim, "Optimal Design of Experiments", SIAM, 2006, chapter 3.
.. [3] B. von Hohenbalken, "Simplicial decomposition in nonlinear programming algorithms",
   Mathematical Programming 13, 1977, doi:10.1007/BF01584323.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.mixtures import best_mixture
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf
from vcam_cli.scheduling.sensor import SLACK, Constraints, Sensor, first_capture_time
from vcam_cli.scheduling.weighted_snr import NARROW, ROUGH, gauss_rule, split_octaves, upper_bounds

MOST_FRAMES, MOST_PIXELS = 256, 4096
"""Frames and kinds of pixels up to which the bound is worked out: a few seconds."""
MOST_PATHS = 60
"""Paths that are mixed, at most."""
CLOSE = 2e-4
"""Relative distance of a mixture from the best one that ends the search."""


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
        Index of the last frame before saturation.
    """

    rate: Floats
    weight: Floats
    last: Indices

    def chosen(self, which: NDArray[np.bool_]) -> "Pixels":
        """Return some of the pixels."""
        return Pixels(self.rate[which], self.weight[which], self.last[which])


@lru_cache(maxsize=8)
def least_bounds(
    pdf: Pdf, counts: tuple[int, ...], sensor: Sensor, constraints: Constraints
) -> tuple[float, ...]:
    """Return the lower of `flow_bounds` and `weighted_snr.upper_bounds` for each count.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    counts : tuple of int
        Numbers of captures, each at least 1.
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands.

    Returns
    -------
    tuple of float
        Upper bounds of the mean SNR, as power ratios.
    """
    chains = upper_bounds(pdf, max(counts), sensor, constraints)
    flows = flow_bounds(pdf, counts, sensor, constraints)
    return tuple(min(float(chains[count - 1]), flows[count]) for count in counts)


def flow_bounds(
    pdf: Pdf, counts: Sequence[int], sensor: Sensor, constraints: Constraints
) -> dict[int, float]:
    """Return the mean SNR that no schedule of so many captures at whole frames exceeds.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    counts : sequence of int
        Numbers of captures, each at least 1.
    sensor : Sensor
        The pixel, with a longest exposure.
    constraints : Constraints
        What the readout demands.

    Returns
    -------
    dict
        Upper bounds by number of captures, as power ratios; infinite where there are no frames, too
        many, or no read noise, and for more captures than fit.
    """
    unknown = dict.fromkeys(counts, np.inf)
    if not (constraints.frame_time and sensor.read) or sensor.max_time == np.inf:
        return unknown
    first = round(first_capture_time(pdf, sensor, constraints) / constraints.frame_time)
    end = int(constraints.whole_frames(sensor.max_time))
    if end - first >= MOST_FRAMES:
        return unknown
    frames = np.arange(first, end + 1, dtype=np.float64) * constraints.frame_time
    pixels = _pixels(pdf, frames, sensor)
    if len(pixels.rate) > MOST_PIXELS:
        return unknown
    gap = max(1, round(constraints.read_interval / constraints.frame_time))
    fitting = [count for count in counts if (count - 1) * gap < len(frames)]
    if not fitting:
        return unknown
    problem = _Flow(frames, pixels, sensor, gap, max(fitting))
    return unknown | {count: problem.bound(count) for count in fitting}


def _pixels(pdf: Pdf, frames: Floats, sensor: Sensor) -> Pixels:
    """Return nodes of a quadrature that is good to 1e-9, as in `weighted_snr.mean_snr`."""
    if pdf.discrete:
        i, share = pdf.low, pdf.probability
    else:
        limits = sensor.saturation_limit(frames)
        inside = limits[(limits > pdf.low[0]) & (limits < pdf.high[-1])]
        edges = np.unique(np.concatenate([pdf.low, pdf.high, inside]))
        low, high = edges[:-1], edges[1:]
        middle = low + (high - low) / 2
        segment = np.minimum(np.searchsorted(pdf.high, middle, side="right"), len(pdf.low) - 1)
        density = np.where(pdf.low[segment] <= middle, pdf.density[segment], 0.0)
        shift = np.full(len(low), sensor.dark + sensor.read**2 / frames.sum())
        part, low, high, _ = split_octaves(low, high, shift)
        i, share = _nodes(low, high, density[part])
    used = (share > 0) & (i > 0)
    rate = i[used] + sensor.dark
    filled = sensor.well * (1 + SLACK) / frames  # the largest rate that each frame holds
    last = len(frames) - 1 - np.searchsorted(filled[::-1], rate * (1 - SLACK), side="left")
    return Pixels(rate, share[used] * i[used] ** 2, last)


def _nodes(low: Floats, high: Floats, density: Floats) -> tuple[Floats, Floats]:
    """Return photocurrents and probabilities, fewer of them in narrow segments."""
    parts = []
    for order, which in ((3, high <= NARROW * low), (ROUGH, high > NARROW * low)):
        points, weights = gauss_rule(order)
        half = (high[which] - low[which]) / 2
        i = (low[which] + half)[:, None] + half[:, None] * points
        parts.append((i.ravel(), ((density[which] * half)[:, None] * weights).ravel()))
    return np.concatenate([i for i, _ in parts]), np.concatenate([share for _, share in parts])


class _Flow:
    """The relaxed problem: mixtures of paths through the frames."""

    def __init__(self, frames: Floats, pixels: Pixels, sensor: Sensor, gap: int, most: int) -> None:
        self.frames, self.sensor = frames, sensor
        size = len(frames)
        self.lasting = pixels.chosen(pixels.last == size - 1)
        saturating = pixels.chosen((pixels.last >= 0) & (pixels.last < size - 1))
        self.earned = [
            _step_earnings(self._best_precision(saturating, k), saturating)
            for k in range(1, most + 1)
        ]
        own = np.arange(size)
        self.allowed = own[None, :] >= own[:, None] + gap

    def bound(self, count: int) -> float:
        """Return what no schedule of `count` captures exceeds, which fit."""
        path, earned, _ = self._best_path(count, np.zeros(len(self.frames)))
        paths, earnings, least = [path], [earned], np.inf
        shares = np.ones(1)
        for _ in range(MOST_PATHS):
            reads = np.zeros((len(paths), len(self.frames)))
            for row, frames in zip(reads, paths, strict=True):
                row[frames] = 1.0
            shares = best_mixture(self._lasting_value, reads, np.array(earnings), shares)
            value, slope = self._lasting_value(shares @ reads)
            path, earned, top = self._best_path(count, slope)
            mixed = float(shares @ earnings)
            least = min(least, value + mixed + top - float(slope @ (shares @ reads)) - mixed)
            if least <= (value + mixed) * (1 + CLOSE):
                break
            paths.append(path)
            earnings.append(earned)
            shares = np.append(shares, 0.0)
        return least

    def _best_path(self, count: int, slope: Floats) -> tuple[list[int], float, float]:
        """Return the path that earns most with `slope` for each read: frames, earnings, total."""
        value = self.earned[count - 1][:, -1] + slope
        choices = []
        for earned in reversed(self.earned[: count - 1]):
            ahead = np.where(self.allowed, earned[:, :-1] + value, -np.inf)
            choices.append(ahead.argmax(axis=1))
            value = ahead.max(axis=1) + slope
        path = [0]
        for choice in reversed(choices):
            path.append(int(choice[path[-1]]))
        ends = [*path[1:], len(self.frames)]
        earned_by = [self.earned[k][a, b] for k, (a, b) in enumerate(zip(path, ends, strict=True))]
        return path, float(sum(earned_by)), float(value[0])

    def _lasting_value(self, reads: Floats) -> tuple[float, Floats]:
        """Return what the pixels that never saturate add for (T,) reads, and its derivative."""
        times, rate = self.frames[:, None], self.lasting.rate
        precision, residuals = _filter(times, reads[:, None], rate, self.sensor)
        slopes = residuals**2 @ self.lasting.weight / self.sensor.read**2
        return float(precision @ self.lasting.weight), slopes

    def _best_precision(self, pixels: Pixels, count: int) -> Floats:
        """Return V_k(a) for each last frame a and pixel, (T, M); 0 where k reads do not fit."""
        size = len(self.frames)
        best, chosen = np.zeros((size, len(pixels.rate))), np.zeros((size, len(pixels.rate)), int)
        for early in range(1, max(count, 2)):
            ends = self._ends(early, count)
            value, _ = self._end_reads(ends, early, count, pixels.rate)
            better = value > best[ends]
            best[ends] = np.where(better, value, best[ends])
            chosen[ends] = np.where(better, early, chosen[ends])
        alive = pixels.last >= np.arange(size)[:, None]
        if count > 2:
            for early in range(1, count):
                ends = self._ends(early, count)
                _, residuals = self._end_reads(ends, early, count, pixels.rate)
                for row, end in enumerate(ends):
                    which = alive[end] & (chosen[end] == early)
                    if which.any():
                        reads = _end_frames(ends[row : row + 1], early, count - early)[0]
                        own = residuals[:, row, which]
                        best[end, which] += self._slack(reads, own, pixels.rate[which])
        return np.where(alive, best, 0.0)

    def _ends(self, early: int, count: int) -> Indices:
        """Return the last frames up to which so many reads fit, `early` of them at the start."""
        every = np.arange(len(self.frames))
        return every[:1] if count == 1 else every[every - (count - early) + 1 >= early]

    def _end_reads(
        self, ends: Indices, early: int, count: int, rate: Floats
    ) -> tuple[Floats, Floats]:
        """Return the precision of reads at both ends (E, M), and their residuals (k, E, M)."""
        times = self.frames[_end_frames(ends, early, count - early).T][:, :, None]
        return _filter(times, np.ones((count, 1, 1)), rate[None, :], self.sensor)

    def _slack(self, reads: Indices, residuals: Floats, rate: Floats) -> Floats:
        """Return how much more than these reads, others between their ends would give, at most.

        The derivative at any frame follows from the residuals (k, M) at the reads.
        """
        noise, end = self.sensor.read**2, int(reads[-1])
        weights = residuals / noise
        shared = np.minimum(self.frames[1:end, None], self.frames[reads]) @ weights
        explained = rate * shared + self.sensor.reset**2 * weights.sum(axis=0)
        slopes = (self.frames[1:end, None] - explained) ** 2 / noise
        count = len(reads) - 2
        taken = (residuals[1:-1] ** 2).sum(axis=0) / noise
        most = np.partition(slopes, -count, axis=0)[-count:].sum(axis=0)
        return np.asarray(np.maximum(most - taken, 0.0))


def _end_frames(ends: Indices, early: int, late: int) -> Indices:
    """Return (E, early + late) frames: the first `early` ones, and `late` ones up to each end."""
    begin = np.broadcast_to(np.arange(early), (len(ends), early))
    return np.concatenate([begin, ends[:, None] - np.arange(late)[::-1]], axis=1)


def _step_earnings(precision: Floats, pixels: Pixels) -> Floats:
    """Return (T, T + 1) what a step from frame a to b earns: of pixels last alive in a..b-1."""
    size = len(precision)
    by_last = np.zeros((size, size))
    np.add.at(by_last.T, pixels.last, (precision * pixels.weight).T)
    below = np.concatenate([np.zeros((size, 1)), np.cumsum(by_last, axis=1)], axis=1)
    own = np.arange(size)
    return np.asarray(below - below[own, own][:, None])


def _filter(times: Floats, reads: Floats, rate: Floats, sensor: Sensor) -> tuple[Floats, Floats]:
    """Return the precision t' (K + read^2 / X)^-1 t, and t - K w at each time.

    A Kalman filter of the charge's noise and, backward, its smoother; a read of 0 is none.

    Parameters
    ----------
    times : (T, ...) array
        Rising times [s].
    reads : (T, ...) array
        Reads at each, 0 to 1.
    rate : (...) array
        Photocurrent and dark current of pixels [e/s].
    sensor : Sensor
        The pixel, with read noise.

    Returns
    -------
    precision : (...) array
        Precision [s^2/e^2].
    residuals : (T, ...) array
        Residuals [s]; their squares over read^2 are the derivatives by each read.
    """
    noise = sensor.read**2
    variance = rate * times[0] + sensor.reset**2
    mean, precision = np.zeros_like(variance), np.zeros_like(variance)
    before, after, means = [], [], []
    for k in range(len(times)):
        if k:
            variance = variance + rate * (times[k] - times[k - 1])
        whole = reads[k] * variance + noise
        surprise = times[k] - mean
        precision = precision + surprise**2 * reads[k] / whole
        mean = mean + surprise * variance * reads[k] / whole
        before.append(variance)
        variance = variance * noise / whole
        after.append(variance)
        means.append(mean)
    residuals = np.empty((len(times), *np.shape(mean)))
    smooth = means[-1]
    residuals[-1] = times[-1] - smooth
    for k in reversed(range(len(times) - 1)):
        share = np.ones_like(mean)
        np.divide(after[k], before[k + 1], out=share, where=before[k + 1] > 0)
        smooth = means[k] + share * (smooth - means[k])
        residuals[k] = times[k] - smooth
    return precision, residuals
