"""The best capture times for a scene's photocurrents and shot noise alone.

A capture of time t = 1 / i just fills the well (of one electron) with photocurrent i. With captures
at i_1 = imax >= i_2 >= ... >= i_N, the mean SNR under the last sample before saturation is

    J = sum over k of (M(i_k) - M(i_{k+1})) / i_k,    M(x) = first moment up to x, M(i_{N+1}) = 0

([1]_, section 4.3). J has many local maxima, so the search from random starts of [1]_ may miss the
best; dynamic programming over a finite set of photocurrents (`shot_noise_grid`) cannot. For levels,
which the best captures stand on, that is the answer. For segments the best schedule on a grid is
within a proved distance of the best of all, and is then moved to the maximum beside it by Newton's
method: J couples neighbors only, and its Hessian is tridiagonal. J has a kink at the ends of
segments. Where the density drops the kink can be a maximum: the slope towards it is positive from
below and negative from above. A capture there stays, and one that meets the end of its segment
stops there.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from vcam_cli.scheduling.objective import Schedule, expected_snr
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf
from vcam_cli.scheduling.shot_noise_grid import Grid, best_captures, photocurrent_grid

GAP = 1e-6
"""Certified relative distance from the global optimum that a grid is made for, at most."""
TO_GRID, TO_START = 0.4, 0.1
"""Parts of it that the grid's cells and its dark end may take: half is left as reserve."""
SURVEY = 1e-4
"""Loss on the coarse grid that tells how much a schedule is worth, hence what it may lose."""
LARGEST = 50_000_000
"""Points times captures, at 4 bytes: hundreds of captures get a coarser grid and a larger gap."""
STEPS = 50
HALVINGS = 40
CONVERGED = 1e-13
"""Relative change of all captures that ends Newton's method."""
ROUNDING = 1e-15
"""Relative loss of J that is no loss."""


def optimal_schedules(pdf: Pdf, counts: Sequence[int], gap: float = GAP) -> dict[int, Schedule]:
    """Find the globally best schedule of each number of captures.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene, in any unit.
    counts : sequence of int
        Numbers of captures, each at least 1.
    gap : float
        Requested certified relative distance from the optimum.

    Returns
    -------
    dict
        Schedules by number of captures, in the order of `counts`; times are in 1/unit of the
        photocurrents. Their certified `gap` is 0 for levels, else about half of the requested one.
        Of schedules worth the same it is the one with the shortest last time. A capture without
        use (more captures than levels above 0) repeats the last.

    Raises
    ------
    ValueError
        If a count is not a whole number from 1.
    """
    wanted = sorted(set(counts))
    if not wanted:
        return {}
    if wanted[0] < 1 or any(count != int(count) for count in wanted):
        raise ValueError("the number of captures must be a whole number from 1")
    best = _level_schedules(pdf, wanted) if pdf.discrete else _segment_schedules(pdf, wanted, gap)
    return {count: best[count] for count in counts}


def objective_value(pdf: Pdf, captures: Floats) -> float:
    """Return J of photocurrents `captures` (N,) that fall from the brightest.

    Of captures in any other order it gives no more than of the same ones sorted.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents, of any unit.
    captures : (N,) array
        Photocurrents that just fill the well in each capture, falling from the brightest, in that
        unit.

    Returns
    -------
    float
        J, the mean charge of the pixels over the well.
    """
    moments = np.append(pdf.first_moment(captures), 0.0)
    return float(np.sum(-np.diff(moments) / captures))


def local_maximum(pdf: Pdf, captures: Floats) -> Floats:
    """Find the local maximum of J beside some captures by Newton's method.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent.
    captures : (N,) array
        Falling photocurrents to begin with; the first stays.

    Returns
    -------
    (N,) array
        Falling photocurrents.
    """
    now, value = captures, objective_value(pdf, captures)
    for _ in range(STEPS):
        low, high, step = _bounded_step(pdf, now)
        for halving in range(HALVINGS):
            new = np.clip(now * (1 + step / 2**halving), low, high)
            better = objective_value(pdf, new)
            if better >= value * (1 - ROUNDING):
                break
        else:
            return now
        moved = np.max(np.abs(new / now - 1))
        now, value = new, better
        if moved < CONVERGED:
            break
    return np.sort(now)[::-1]


def _level_schedules(pdf: Pdf, counts: list[int]) -> dict[int, Schedule]:
    useful = (pdf.probability > 0) & (pdf.low > 0)
    values = pdf.low[useful]
    moments = np.cumsum(values * pdf.probability[useful])
    chains = best_captures(values, moments, min(counts[-1], values.size))
    captures = {n: values[chains[min(n, len(chains)) - 1]] for n in counts}
    return {n: _padded_schedule(pdf, i, n, 0.0) for n, i in captures.items()}


def _segment_schedules(pdf: Pdf, counts: list[int], gap: float) -> dict[int, Schedule]:
    grid = _fine_grid(pdf, counts, gap)
    schedules = {}
    for count, captures in _captures_on_grid(pdf, grid, counts).items():
        bound = grid.bound(objective_value(pdf, captures), count) if count > 1 else 0.0
        best = _padded_schedule(pdf, local_maximum(pdf, captures), count, 0.0)
        distance = max(bound / best.expected_snr - 1, 0.0)
        schedules[count] = Schedule(best.times, best.photocurrents, best.expected_snr, distance)
    return schedules


def _fine_grid(pdf: Pdf, counts: list[int], gap: float) -> Grid:
    """Return a grid as fine as the most demanding of `counts` needs."""
    survey = photocurrent_grid(pdf, SURVEY, SURVEY)
    captures = _captures_on_grid(pdf, survey, counts)
    values = {n: objective_value(pdf, i) for n, i in captures.items() if n > 1}
    if not values:  # a single capture is where it must be
        return survey
    loss = min(TO_GRID * gap * value / (n - 1) for n, value in values.items())
    below = TO_START * gap * min(values.values())
    fine = photocurrent_grid(pdf, loss, below)
    excess = fine.points.size * counts[-1] / LARGEST
    return photocurrent_grid(pdf, loss * excess**2, below) if excess > 1 else fine


def _captures_on_grid(pdf: Pdf, grid: Grid, counts: list[int]) -> dict[int, Floats]:
    """Return the best captures among the grid's points, by their number."""
    chains = best_captures(grid.points, pdf.first_moment(grid.points), counts[-1])
    return {n: grid.points[chains[n - 1]] for n in counts}


def _padded_schedule(pdf: Pdf, captures: Floats, count: int, gap: float) -> Schedule:
    """Return the schedule of `captures`, the last repeated up to `count`."""
    filled = np.append(captures, np.full(count - captures.size, captures[-1]))
    times = 1.0 / filled
    return Schedule(times, filled, expected_snr(pdf, times), gap)


def _bounded_step(pdf: Pdf, captures: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the ends between which each capture may move, and its relative Newton step."""
    moments = np.append(pdf.first_moment(captures), 0.0)
    free, ratio = captures[1:], captures[1:] / captures[:-1]
    lost = (moments[1:-1] - moments[2:]) / free
    below, above = _segments_beside(pdf, free)
    rising = _density_inside(pdf, above, free) * free * (1 - ratio) - lost
    falling = _density_inside(pdf, below, free) * free * (1 - ratio) - lost
    segment = np.where(rising > 0, above, below)
    slope = np.where(rising > 0, rising, np.minimum(falling, 0.0))
    low, high, step = captures.copy(), captures.copy(), np.zeros(captures.size)
    moving = np.flatnonzero(slope)
    if moving.size:
        low[moving + 1], high[moving + 1] = pdf.low[segment[moving]], pdf.high[segment[moving]]
        weight = pdf.density[segment] * free
        step[moving + 1] = _newton_step(weight, ratio, lost, slope, moving)
    return low, high, step


def _segments_beside(pdf: Pdf, captures: Floats) -> tuple[Indices, Indices]:
    """Return the segments just below and just above each capture, or the next ones above."""
    last = pdf.high.size - 1
    below = np.searchsorted(pdf.high, captures, side="left")
    above = np.searchsorted(pdf.high, captures, side="right")
    return np.minimum(below, last), np.minimum(above, last)


def _density_inside(pdf: Pdf, segment: Indices, captures: Floats) -> Floats:
    """Return the density in `segment`, 0 where the capture is not in it nor at its end."""
    inside = (pdf.low[segment] <= captures) & (captures <= pdf.high[segment])
    return np.where(inside, pdf.density[segment], 0.0)


def _newton_step(
    weight: Floats, ratio: Floats, lost: Floats, slope: Floats, moving: Indices
) -> Floats:
    """Return the step of the captures `moving` (numbered from the second); uphill in any case.

    All is relative to the captures, hence free of units: weight = f i, ratio = i_k / i_{k-1},
    lost = (M(i_k) - M(i_{k+1})) / i_k.
    """
    diagonal = weight * (1 + ratio) - 2 * lost
    coupled = np.diff(moving) == 1
    bands = np.zeros((2, moving.size))
    bands[0, 1:][coupled] = -(weight * ratio)[moving[1:][coupled]]
    bands[1] = diagonal[moving]
    if moving.size == 1:
        bands = bands[1:]  # LAPACK takes no empty band
    try:
        return np.asarray(solveh_banded(bands, slope[moving]))
    except LinAlgError:  # not concave here
        return slope[moving] / (np.abs(diagonal) + weight)[moving]
