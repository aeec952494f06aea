"""Schedules to compare the optimum with: rules of time, the heuristic, and a local search.

The rules know nothing of the scene but its brightest photocurrent. They run from t_1, the longest
time in which that does not saturate, to T, the longest exposure; where T < t_1 the first capture
ends at T too. `uniform_times` and `exponential_times` are those of [1]_, sections 4.4 and 4.6: with
t_1 = 5 ms and T = 200 ms four uniform captures end at 5, 67, 133 and 200 ms, as in its Fig 4.13.

The heuristic of [1]_, section 4.4.1, searches nothing: captures in proportion to the probability of
each segment, spread evenly in photocurrent, the first at the segment's bright end. It lies within
some tenths of a decibel of the optimum on ordinary scenes.

Sequential quadratic programming from one start is the method of [1]_, section 4.4, where ten random
starts agreed with a brute-force search. Over a piecewise-uniform pdf E[SNR] is a difference of
convex functions of the captures' photocurrents with many local maxima, and this finds one of them.
In general starts do not agree: captures in one segment have no gradient towards another, nor across
a gap. `shot_noise.optimal_schedules` finds the best of all, and certifies it.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.scheduling.objective import Schedule, evaluate_schedule
from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import SLACK

NEAREST_ZERO = 1e-6
"""The darkest capture of a pdf that begins at 0, as a share of its first segment."""
TOLERANCE = 1e-12
"""Change of J at which the search ends."""
LONGEST_SEARCH = 1000


def uniform_times(t1: float, longest: float, count: int) -> Floats:
    """Return t_1 and j T / (N - 1), j = 1..N-1.

    Parameters
    ----------
    t1, longest : float
        The first time and the longest, T, in the same unit.
    count : int
        Number of captures, N.

    Returns
    -------
    (N,) array
        Rising times.

    Raises
    ------
    ValueError
        If there is no capture, or a time is not finite and above 0.
    """
    first = _first_time(t1, longest, count)
    rest = np.linspace(0.0, longest, count)[1:]
    return np.sort(np.append(rest, first))


def exponential_times(t1: float, longest: float, count: int) -> Floats:
    """Return min(2^(k-1) t_1, T), k = 1..N.

    Parameters, results and errors are those of `uniform_times`; times are equal where they reach T.
    """
    first = _first_time(t1, longest, count)
    with np.errstate(over="ignore"):  # longer than any T
        doubled = np.ldexp(first, np.arange(count))
    return np.minimum(doubled, longest)


def geometric_times(t1: float, longest: float, count: int) -> Floats:
    """Return t_1 (T / t_1)^((k-1)/(N-1)), k = 1..N.

    Parameters, results and errors are those of `uniform_times`.
    """
    first = _first_time(t1, longest, count)
    if count == 1:
        return np.array([first])
    times = np.geomspace(first, longest, count)
    return np.maximum.accumulate(np.minimum(times, longest))  # but for rounding errors


def heuristic_photocurrents(pdf: Pdf, count: int) -> Floats:
    """Return the photocurrents that just fill the well in each capture of the heuristic schedule.

    Segments without probability get no captures.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent.
    count : int
        Number of captures.

    Returns
    -------
    (count,) array
        Photocurrents, falling from pdf.max.

    Raises
    ------
    ValueError
        If there is no capture, or the pdf is one of levels, which has no segments to spread
        captures over.
    """
    if count < 1:
        raise ValueError("at least one capture is needed")
    if pdf.discrete:
        raise ValueError("the heuristic schedule needs segments, not levels")
    occurs = pdf.probability > 0
    bright_first = (values[occurs][::-1] for values in (pdf.low, pdf.high, pdf.probability))
    low, high, probability = bright_first
    spread = zip(low, high, captures_per_segment(probability, count), strict=True)
    return np.concatenate([
        top - (top - bottom) * np.arange(share) / max(share, 1) for bottom, top, share in spread
    ])  # fmt: skip


def captures_per_segment(probability: Floats, count: int) -> list[int]:
    """Divide `count` captures among segments by the heuristic.

    The brightest segment's share is rounded up, so that it has a capture; each other's share of
    those that are left to the nearest, halves up. Why a slack: 0.07 x 100 is 7.000000000000001 in
    floating point, and must still be 7.

    Parameters
    ----------
    probability : (M,) array
        Probabilities above 0, of any sum, the brightest segment first.
    count : int
        Number of captures.

    Returns
    -------
    list of int
        (M,) numbers of captures, of sum `count`.
    """
    left_over = np.cumsum(probability[::-1])[::-1]  # of this segment and all darker ones
    shares = probability / left_over
    counts = [max(1, int(np.ceil(_add_slack(shares[0] * count, -SLACK))))]
    for share in shares[1:]:
        exact = (count - sum(counts)) * share
        counts.append(int(np.floor(_add_slack(exact, SLACK) + 0.5)))
    return counts


def sqp_schedule(pdf: Pdf, count: int, start: ArrayLike | None = None, seed: int = 0) -> Schedule:
    """Find a local maximum of E[SNR] for shot noise by sequential quadratic programming.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent, in any unit.
    count : int
        Number of captures.
    start : (count,) array_like, optional
        Photocurrents to begin with, in any order; the brightest moves to pdf.max and others into
        the pdf's range. By default they are drawn evenly over the range.
    seed : int
        Seed of that draw.

    Returns
    -------
    Schedule
        Worth no less than its start; times are in 1/[photocurrent]. `gap` is None: nothing is
        certified.

    Raises
    ------
    ValueError
        If there is no capture, the pdf is one of levels (J jumps there, and has no gradient), or
        the start is of another length or not finite.
    """
    if count < 1:
        raise ValueError("at least one capture is needed")
    if pdf.discrete:
        raise ValueError("sequential quadratic programming needs segments, not levels")
    lowest = _darkest_capture(pdf)
    if start is None:
        drawn = np.random.default_rng(seed).uniform(lowest, pdf.max, count - 1)
        begin = np.append(pdf.max, np.sort(drawn)[::-1])
    else:
        begin = np.sort(np.atleast_1d(np.asarray(start, float)))[::-1]
        if begin.shape != (count,) or not np.isfinite(begin).all():
            raise ValueError(f"the start needs {count} finite photocurrents")
        begin[0] = pdf.max
    begin = np.clip(begin, lowest, pdf.max)
    ends = [evaluate_schedule(pdf, 1 / i) for i in (_local_maximum(pdf, begin), begin)]
    return max(ends, key=lambda schedule: schedule.expected_snr)


def objective_and_gradient(pdf: Pdf, photocurrents: Floats) -> tuple[float, Floats]:
    """Return J and its derivative by each photocurrent.

    J = sum of (M(i_k) - M(i_k+1)) / i_k, M the pdf's first moment, with i_1 = imax and
    M(i_N+1) = 0. At the edge of a segment the derivative is that of its upper side.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent.
    photocurrents : (N,) array
        Falling photocurrents, the first at pdf.max.

    Returns
    -------
    value : float
        J.
    gradient : (N,) array
        Derivatives; callers keep the first photocurrent where it is.
    """
    i = photocurrents
    moment = np.append(pdf.first_moment(i), 0.0)
    collected = moment[:-1] - moment[1:]
    before = np.append(np.inf, i[:-1])
    segment = np.searchsorted(pdf.high, i, side="right").clip(max=pdf.high.size - 1)
    density = np.where(i >= pdf.low[segment], pdf.density[segment], 0.0)
    gradient = i * density * (1 / i - 1 / before) - collected / i**2
    return float(np.sum(collected / i)), gradient


def _first_time(t1: float, longest: float, count: int) -> float:
    """Return the first time; raise unless both are positive, finite and there is a capture."""
    if count < 1:
        raise ValueError("at least one capture is needed")
    if not (0 < t1 < np.inf and 0 < longest < np.inf):
        raise ValueError("the shortest and the longest time must be finite and above 0")
    return min(t1, longest)


def _add_slack(value: float, slack: float) -> float:
    return value + slack * max(1.0, value)


def _local_maximum(pdf: Pdf, begin: Floats) -> Floats:
    """Run SLSQP over x = i / imax of all captures but the first."""
    from scipy.optimize import LinearConstraint, minimize

    if begin.size == 1:
        return begin
    top, lowest = pdf.max, _darkest_capture(pdf) / pdf.max

    def falling(x: Floats) -> Floats:
        """Return photocurrents in order, which trials between feasible points may break by ulps."""
        return top * np.minimum.accumulate(np.append(1.0, np.clip(x, lowest, 1.0)))

    def negative(x: Floats) -> tuple[float, Floats]:
        value, gradient = objective_and_gradient(pdf, falling(x))
        return -value, -gradient[1:] * top

    apart = np.append(np.zeros(begin.size - 1), lowest)
    apart[0] = -1.0  # 1 - x_1 >= 0, with the 1 on this side
    result = minimize(
        negative,
        begin[1:] / top,
        jac=True,
        method="SLSQP",
        constraints=[LinearConstraint(_difference_matrix(begin.size), apart, np.inf)],
        options={"ftol": TOLERANCE, "maxiter": LONGEST_SEARCH},
    )
    return falling(result.x if np.isfinite(result.x).all() else begin[1:] / top)


def _difference_matrix(count: int) -> Floats:
    """Return the (count, count - 1) matrix of -x_1; x_k - x_k+1; x of the last."""
    matrix = np.zeros((count, count - 1))
    index = np.arange(count - 1)
    matrix[index, index] = -1.0
    matrix[index + 1, index] = 1.0
    return matrix


def _darkest_capture(pdf: Pdf) -> float:
    """Return the darkest photocurrent a capture may be planned for, above 0."""
    return max(pdf.min, NEAREST_ZERO * float(pdf.high[pdf.probability > 0][0]))
