"""Schedules by sequential quadratic programming, to compare the optimum with.

This is the method of [1]_, section 4.4, where ten random starts agreed with a brute-force search.
Over a piecewise-uniform pdf E[SNR] is a difference of convex functions of the captures'
photocurrents with many local maxima: captures in one segment have no gradient towards another, nor
across a gap, and a search over all photocurrents at once ends in one of them. As in [1]_, the
number of captures of each segment is fixed, and every such assignment searched: then few starts
disagree. `shot_noise.optimal_schedules` finds the best of all, and certifies it.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

from collections.abc import Iterator
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.scheduling.objective import Schedule, evaluate_schedule
from vcam_cli.scheduling.pdf import Floats, Pdf

NEAREST_ZERO = 1e-6
"""The darkest capture of a pdf that begins at 0, as a share of its first segment."""
TOLERANCE = 1e-12
"""Change of J at which the search ends."""
LONGEST_SEARCH = 1000

Segments = NDArray[np.intp]
"""The segment of each capture, by its place in the pdf."""


def sqp_schedule(pdf: Pdf, count: int, start: ArrayLike | None = None, seed: int = 0) -> Schedule:
    """Find a local maximum of E[SNR] for shot noise from one start.

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
    _check(pdf, count)
    lowest = _darkest_capture(pdf)
    if start is None:
        drawn = np.random.default_rng(seed).uniform(lowest, pdf.max, count - 1)
        begin = np.append(pdf.max, np.sort(drawn)[::-1])
    else:
        begin = np.sort(np.atleast_1d(np.asarray(start, float)))[::-1]
        if begin.shape != (count,) or not np.isfinite(begin).all():
            raise ValueError(f"the start needs {count} finite photocurrents")
        begin[0] = pdf.max
    return _best_of_search(pdf, np.clip(begin, lowest, pdf.max), None)


def assigned_schedule(pdf: Pdf, count: int, starts: int = 1, seed: int = 0) -> Schedule:
    """Find the best schedule over all assignments of captures to segments, from random starts.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent, in any unit.
    count : int
        Number of captures.
    starts : int
        Starts of the search in each assignment, drawn evenly over each segment.
    seed : int
        Seed of those draws.

    Returns
    -------
    Schedule
        The best that was found; `gap` is None: nothing is certified.

    Raises
    ------
    ValueError
        If there is no capture or start, or the pdf is one of levels.
    """
    _check(pdf, count)
    if starts < 1:
        raise ValueError("at least one start is needed")
    rng = np.random.default_rng(seed)
    found = (
        _best_of_search(pdf, _random_start(pdf, segments, rng), segments)
        for segments in _assignments(pdf, count)
        for _ in range(starts)
    )
    return max(found, key=lambda schedule: schedule.expected_snr)


def assignment_count(pdf: Pdf, count: int) -> int:
    """Return in how many ways `count` captures, one of them in the brightest, fall on segments.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent.
    count : int
        Captures.

    Returns
    -------
    int
        Number of assignments of captures to segments with a probability above 0.
    """
    segments = int(np.sum(pdf.probability > 0))
    return comb(count - 1 + segments - 1, segments - 1)


def objective_and_gradient(
    pdf: Pdf, photocurrents: Floats, segments: Segments | None = None
) -> tuple[float, Floats]:
    """Return J and its derivative by each photocurrent.

    J = sum of (M(i_k) - M(i_k+1)) / i_k, M the pdf's first moment, with i_1 = imax and
    M(i_N+1) = 0. At the edge of a segment the derivative is that of its upper side, or within the
    capture's own segment where that is given.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent.
    photocurrents : (N,) array
        Falling photocurrents, the first at pdf.max.
    segments : (N,) array, optional
        The segment of each capture.

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
    if segments is None:
        segments = np.searchsorted(pdf.high, i, side="right").clip(max=pdf.high.size - 1)
    density = np.where(i >= pdf.low[segments], pdf.density[segments], 0.0)
    gradient = i * density * (1 / i - 1 / before) - collected / i**2
    return float(np.sum(collected / i)), gradient


def _check(pdf: Pdf, count: int) -> None:
    """Raise ValueError where there is nothing to search."""
    if count < 1:
        raise ValueError("at least one capture is needed")
    if pdf.discrete:
        raise ValueError("sequential quadratic programming needs segments, not levels")


def _assignments(pdf: Pdf, count: int) -> Iterator[Segments]:
    """Yield the segment (N,) of each capture, the brightest first, in all ways."""
    occurring = np.flatnonzero(pdf.probability > 0)[::-1]

    def divide(captures: int, parts: int) -> Iterator[tuple[int, ...]]:
        if parts == 1:
            yield (captures,)
            return
        for first in range(captures + 1):
            for rest in divide(captures - first, parts - 1):
                yield (first, *rest)

    for shares in divide(count - 1, occurring.size):
        yield np.repeat(occurring, np.array(shares) + (np.arange(occurring.size) == 0))


def _random_start(pdf: Pdf, segments: Segments, rng: np.random.Generator) -> Floats:
    """Return falling photocurrents, the first at pdf.max, evenly drawn over their segments."""
    low = np.maximum(pdf.low[segments], _darkest_capture(pdf))
    begin = np.sort(rng.uniform(low, pdf.high[segments]))[::-1]
    begin[0] = pdf.max
    return begin


def _best_of_search(pdf: Pdf, begin: Floats, segments: Segments | None) -> Schedule:
    """Return the end of the search, or its start where that is better."""
    ends = [evaluate_schedule(pdf, 1 / i) for i in (_local_maximum(pdf, begin, segments), begin)]
    return max(ends, key=lambda schedule: schedule.expected_snr)


def _local_maximum(pdf: Pdf, begin: Floats, segments: Segments | None) -> Floats:
    """Run SLSQP over x = i / imax of all captures but the first, each within its segment if any."""
    from scipy.optimize import LinearConstraint, minimize

    if begin.size == 1:
        return begin
    top, lowest = pdf.max, _darkest_capture(pdf) / pdf.max
    low, high = np.full(begin.size - 1, lowest), np.ones(begin.size - 1)
    if segments is not None:
        low = np.maximum(pdf.low[segments[1:]] / top, lowest)
        high = pdf.high[segments[1:]] / top

    def falling(x: Floats) -> Floats:
        """Return photocurrents in order, which trials between feasible points may break by ulps."""
        return top * np.minimum.accumulate(np.append(1.0, np.clip(x, low, high)))

    def negative(x: Floats) -> tuple[float, Floats]:
        value, gradient = objective_and_gradient(pdf, falling(x), segments)
        return -value, -gradient[1:] * top

    apart = np.append(np.zeros(begin.size - 1), lowest)
    apart[0] = -1.0  # 1 - x_1 >= 0, with the 1 on this side
    result = minimize(
        negative,
        begin[1:] / top,
        jac=True,
        method="SLSQP",
        bounds=None if segments is None else list(zip(low, high, strict=True)),
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
