"""Sequential quadratic programming from one start: the thesis's way, to compare and not to trust.

Over a piecewise-uniform pdf E[SNR] is a difference of convex functions of the captures'
photocurrents with many local maxima, and this finds one of them (Chen, "Digital Camera System
Simulator and Applications", PhD thesis, Stanford University, 2003, section 4.4, where ten random
starts agreed with a brute-force search). In general they do not: captures cannot be seen from one
segment to move to another, nor through a gap. `optimal` finds the best of all, and proves it.

Shot noise alone: J = sum of (M(i_k) - M(i_k+1)) / i_k, M the pdf's first moment, with
i_1 = imax >= i_2 >= ... >= i_N >= imin and M(i_N+1) = 0.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.scheduling.objective import Schedule, at
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

NEAREST_ZERO = 1e-6
"""The darkest capture of a pdf that begins at 0, as a share of its first segment."""
TOLERANCE = 1e-12
"""Change of J at which the search ends."""
LONGEST_SEARCH = 1000


def sqp(pdf: Pdf, count: int, start: ArrayLike | None = None, seed: int = 0) -> Schedule:
    """The local maximum of E[SNR] for shot noise that the search ends in; never below its start.

    Parameters
    ----------
    start : (count,) photocurrents to begin with, in any order; the brightest moves to pdf.max and
        others into the pdf's range. None: drawn evenly over the range from `seed`.

    Returns
    -------
    schedule with times in 1/[photocurrent] and `gap` None: nothing is known of better ones

    Raises ValueError for fewer than one capture, a pdf of levels (J jumps there, and has no
    gradient) and a start of another length.
    """
    if count < 1:
        raise ValueError("at least one capture is needed")
    if pdf.discrete:
        raise ValueError("sequential quadratic programming needs segments, not levels")
    lowest = _lowest(pdf)
    if start is None:
        drawn = np.random.default_rng(seed).uniform(lowest, pdf.max, count - 1)
        begin = np.append(pdf.max, np.sort(drawn)[::-1])
    else:
        begin = np.sort(np.atleast_1d(np.asarray(start, float)))[::-1]
        if begin.shape != (count,) or not np.isfinite(begin).all():
            raise ValueError(f"the start needs {count} finite photocurrents")
        begin[0] = pdf.max
    begin = np.clip(begin, lowest, pdf.max)
    ends = [at(pdf, 1 / photocurrents) for photocurrents in (_search(pdf, begin), begin)]
    return max(ends, key=lambda schedule: schedule.expected_snr)


def value_and_gradient(pdf: Pdf, photocurrents: Floats) -> tuple[float, Floats]:
    """J and its derivative by each photocurrent, (N,) descending; the first is held by callers.

    At the edge of a segment the derivative is that of its upper side.
    """
    i = photocurrents
    moment = np.append(pdf.first_moment(i), 0.0)
    collected = moment[:-1] - moment[1:]
    before = np.append(np.inf, i[:-1])
    segment = np.searchsorted(pdf.high, i, side="right").clip(max=pdf.high.size - 1)
    density = np.where(i >= pdf.low[segment], pdf.density[segment], 0.0)
    gradient = i * density * (1 / i - 1 / before) - collected / i**2
    return float(np.sum(collected / i)), gradient


def _search(pdf: Pdf, begin: Floats) -> Floats:
    """SLSQP over x = i / imax of all captures but the first."""
    from scipy.optimize import LinearConstraint, minimize

    if begin.size == 1:
        return begin
    top, lowest = pdf.max, _lowest(pdf) / pdf.max

    def descending(x: Floats) -> Floats:
        """What is tried between feasible points may break the order by a rounding error."""
        return top * np.minimum.accumulate(np.append(1.0, np.clip(x, lowest, 1.0)))

    def negative(x: Floats) -> tuple[float, Floats]:
        value, gradient = value_and_gradient(pdf, descending(x))
        return -value, -gradient[1:] * top

    steps = _differences(begin.size)
    apart = np.append(np.zeros(begin.size - 1), lowest)
    apart[0] = -1.0  # 1 - x_1 >= 0, with the 1 on this side
    found = minimize(
        negative,
        begin[1:] / top,
        jac=True,
        method="SLSQP",
        constraints=[LinearConstraint(steps, apart, np.inf)],
        options={"ftol": TOLERANCE, "maxiter": LONGEST_SEARCH},
    )
    return descending(found.x if np.isfinite(found.x).all() else begin[1:] / top)


def _differences(count: int) -> Floats:
    """(count, count - 1): -x_1; x_k - x_k+1; x of the last."""
    matrix = np.zeros((count, count - 1))
    index = np.arange(count - 1)
    matrix[index, index] = -1.0
    matrix[index + 1, index] = 1.0
    return matrix


def _lowest(pdf: Pdf) -> float:
    """The darkest photocurrent a capture may be planned for, above 0."""
    return max(pdf.min, NEAREST_ZERO * float(pdf.high[pdf.probability > 0][0]))
