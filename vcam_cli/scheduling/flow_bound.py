"""An upper bound on the mean SNR of the weighted estimate, for captures at whole frames.

With frames 1..T and x_t in {0, 1} for a read at t, the precision of a pixel's photocurrent is

    F(x) = t' (K + read^2 / X)^-1 t,   K_jl = s min(t_j, t_l) + reset^2,   s = i + dark,

over the frames before its saturation: a parallel sum of K^-1 and X, and therefore concave in x
([1]_, and as in the design of experiments [2]_). Its derivative by x_t is (t - (K w)_t)^2 / read^2,
w = (K + read^2 / X)^-1 t.

A schedule is a path through the frames. Pixels that never saturate see all of it: their part of the
mean SNR is concave in the mean x of a mixture of paths. A pixel that saturates between the k-th
capture, at a, and the next sees k captures. With the first and the last two known, at a' and a,
its precision is at most V_k(a', a), that of the k - 3 others where they are best for this very
pixel (beyond PAIRED captures, V_k(a) with the last one known). So a step of a path from a to b
earns the sum of V_k over the pixels that saturate between the two, and

    bound = max over mixtures of paths of  concave(mean x) + mean of the steps' earnings.

The best path for given derivatives is found by dynamic programming over pairs of frames, the best
mixture by adding paths one at a time (simplicial decomposition, [3]_). At each step concavity gives
a bound: the value, plus what the best path is worth above the mixture. V_k itself is bounded the
same way, from reads at both ends of the range, which are nearly the best ones: t - K w is linear
between two reads, so that its square is largest beside one of them.

References
----------
.. [1] W. N. Anderson and R. J. Duffin, "Series and parallel addition of matrices", J. Math. Anal.
   Appl. 26, 1969, doi:10.1016/0022-247X(69)90200-5.
.. [2] F. Pukelsheim, "Optimal Design of Experiments", SIAM, 2006, chapter 3.
.. [3] B. von Hohenbalken, "Simplicial decomposition in nonlinear programming algorithms",
   Mathematical Programming 13, 1977, doi:10.1007/BF01584323.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.chain_bound import upper_bounds
from vcam_cli.scheduling.mixtures import best_mixture
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf
from vcam_cli.scheduling.sensor import Constraints, Sensor, first_capture_time
from vcam_cli.scheduling.weighted_snr import Pixels, pixels_by_saturation

MOST_FRAMES, MOST_PIXELS = 200, 4096
"""Frames and kinds of pixels up to which the bound is worked out: a few seconds."""
PAIRED = 8
"""Captures up to which the last two are known to the bound of a pixel's precision."""
ROUNDED = 1 + 2e-6
"""Factor that makes sums of 32-bit numbers no smaller than what they are rounded from."""
MOST_PATHS = 60
"""Paths that are mixed, at most."""
CLOSE = 2e-4
"""Relative distance of a mixture from the best one that ends the search."""


@lru_cache(maxsize=8)
def least_bounds(
    pdf: Pdf, counts: tuple[int, ...], sensor: Sensor, constraints: Constraints
) -> tuple[float, ...]:
    """Return the lower of `flow_bounds` and `chain_bound.upper_bounds` for each count.

    Parameters
    ----------
    pdf, counts, sensor, constraints
        As those of `full_noise.optimal_schedules`.

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
    """Return the mean SNR that no schedule of a number of captures at whole frames exceeds.

    Parameters
    ----------
    pdf, counts, sensor, constraints
        As those of `full_noise.optimal_schedules`; the pixel has a longest exposure.

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
    pixels = pixels_by_saturation(pdf, frames, sensor)
    if len(pixels.rate) > MOST_PIXELS:
        return unknown
    gap = max(1, round(constraints.read_interval / constraints.frame_time))
    fitting = [count for count in counts if (count - 1) * gap < len(frames)]
    if not fitting:
        return unknown
    problem = _Flow(frames, pixels, sensor, gap, max(fitting))
    return unknown | {count: problem.bound(count) for count in fitting}


class _Flow:
    """The relaxed problem: mixtures of paths through the frames."""

    def __init__(self, frames: Floats, pixels: Pixels, sensor: Sensor, gap: int, most: int) -> None:
        self.frames, self.sensor = frames, sensor
        size = len(frames)
        self.lasting = pixels.chosen(pixels.last == size - 1)
        saturating = pixels.chosen(pixels.last < size - 1)
        own = np.arange(size)
        self.allowed = own[None, :] >= own[:, None] + gap
        self.earned = [
            self._paired_earnings(saturating, k)
            if 3 <= k <= PAIRED
            else self._single_earnings(saturating, k)
            for k in range(1, most + 1)
        ]

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
        """Return the path that earns most with `slope` for each read: frames, earnings, total.

        Values and choices are (1 or T, T): by the frame before, where it counts, and the frame.
        """
        slope = slope.astype(np.float32)
        value = self.earned[count - 1][:, :, -1] + slope
        choices = []
        for earned in reversed(self.earned[: count - 1]):
            ahead = earned[:, :, :-1] + value
            chosen = ahead.argmax(axis=2)
            choices.append(chosen)
            value = np.take_along_axis(ahead, chosen[:, :, None], axis=2)[:, :, 0] + slope
        path, before = [0], 0
        for choice in reversed(choices):
            row = choice[before if len(choice) > 1 else 0]
            before = path[-1]
            path.append(int(row[before]))
        ends = [*path[1:], len(self.frames)]
        total = 0.0
        for earned, before, a, b in zip(self.earned, [0, *path], path, ends, strict=False):
            total += float(earned[before if len(earned) > 1 else 0, a, b])
        return path, total, float(value[0, 0]) * ROUNDED

    def _lasting_value(self, reads: Floats) -> tuple[float, Floats]:
        """Return what the pixels that never saturate add for (T,) reads, and its derivative."""
        times, rate = self.frames[:, None], self.lasting.rate
        precision, residuals = _filter(times, reads[:, None], rate, self.sensor)
        slopes = residuals**2 @ self.lasting.weight / self.sensor.read**2
        return float(precision @ self.lasting.weight), slopes

    def _single_earnings(self, pixels: Pixels, count: int) -> NDArray[np.float32]:
        """Return (1, T, T + 1) what the step from capture `count` at a to the next at b earns."""
        size = len(self.frames)
        every = np.arange(size)
        most = np.full((size, len(pixels.rate)), np.inf)
        for early in range(1, max(count, 2)):
            ends = every[:1] if count == 1 else every[every - (count - early) + 1 >= early]
            reads = _end_frames(ends, early, count - early)
            found = self._most_precision(reads, early, 1, pixels.rate)
            most[ends] = np.minimum(most[ends], found)
        most[~(np.isfinite(most) & (pixels.last >= every[:, None]))] = 0.0
        earned = self._step_earnings(most, every, pixels)[None] * ROUNDED
        return earned.astype(np.float32)

    def _paired_earnings(self, pixels: Pixels, count: int) -> NDArray[np.float32]:
        """Return (T, T, T + 1) the same by the frame of the capture before, 32 bits."""
        size = len(self.frames)
        earned = np.full((size, size, size + 1), -np.inf, np.float32)
        for a in range(count - 1, size):
            alive = pixels.chosen(pixels.last >= a)
            before = np.arange(count - 2, a)
            most = np.full((len(before), len(alive.rate)), np.inf)
            for early in range(1, count - 1):
                fits = before - (count - 1 - early) + 1 >= early
                reads = _end_frames(before[fits], early, count - 1 - early)
                reads = np.concatenate([reads, np.full((len(reads), 1), a)], axis=1)
                found = self._most_precision(reads, early, 2, alive.rate)
                most[fits] = np.minimum(most[fits], found)
            ends = np.full(len(before), a)
            earned[before, a] = self._step_earnings(most, ends, alive) * ROUNDED
        return earned

    def _most_precision(self, reads: Indices, early: int, known: int, rate: Floats) -> Floats:
        """Return the most precision (E, M) of as many reads as (E, k), others in place of some.

        The first and the last `known` stay. Of the rest, some are the first `early` reads, others
        lie side by side up to the known ones: what lies between the two is the only gap.
        """
        noise, count = self.sensor.read**2, reads.shape[1]
        times = self.frames[reads.T][:, :, None]
        precision, residuals = _filter(times, np.ones((count, 1, 1)), rate[None, :], self.sensor)
        if count <= 1 + known:
            return precision
        width = (reads[:, early] - reads[:, early - 1])[:, None]
        left, right = residuals[early - 1], residuals[early]
        step = (right - left) / width
        beside = np.maximum((left + step) ** 2, (right - step) ** 2) / noise
        beside = np.where(width > 1, beside, 0.0)
        gains = np.maximum(beside - residuals[1 : count - known] ** 2 / noise, 0.0)
        return np.asarray(precision + gains.sum(axis=0))

    def _step_earnings(self, precision: Floats, ends: Indices, pixels: Pixels) -> Floats:
        """Return (E, T + 1) what steps from `ends` to each frame earn; -inf where none may go."""
        size = len(self.frames)
        by_last = np.zeros((size, len(ends)))
        np.add.at(by_last, pixels.last, (precision * pixels.weight).T)
        earned = np.concatenate([np.zeros((len(ends), 1)), np.cumsum(by_last.T, axis=1)], axis=1)
        earned[:, :-1][~self.allowed[ends]] = -np.inf
        return earned


def _end_frames(ends: Indices, early: int, late: int) -> Indices:
    """Return (E, early + late) frames: the first `early` ones, and `late` ones up to each end."""
    begin = np.broadcast_to(np.arange(early), (len(ends), early))
    return np.concatenate([begin, ends[:, None] - np.arange(late)[::-1]], axis=1)


def _filter(times: Floats, reads: Floats, rate: Floats, sensor: Sensor) -> tuple[Floats, Floats]:
    """Return the precision t' (K + read^2 / X)^-1 t, and t - K w at each time.

    A Kalman filter of the charge's noise and, backward, its smoother; a read of 0 is skipped.

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
