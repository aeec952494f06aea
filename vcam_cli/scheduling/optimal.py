"""The best capture times there are for a scene's photocurrents and shot noise alone.

A capture of time t = 1 / i just fills the well (of one electron) with photocurrent i. With captures
at i_1 = imax >= i_2 >= ... >= i_N, the mean SNR under the last sample before saturation is

    J = sum over k of (M(i_k) - M(i_{k+1})) / i_k,    M(x) = first moment up to x, M(i_{N+1}) = 0

(Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University, 2003,
section 4.3). J has many local maxima, so the thesis's search from random starts may miss the
best; dynamic programming over a finite set of photocurrents (`hull.chains`) cannot. For levels,
which the best captures sit on, that is the answer. For segments the best schedule on a grid is
within a proved distance of the best of all (`grid`), and is then moved to the maximum beside it
(`polish`).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling import grid, hull, polish
from vcam_cli.scheduling.objective import Schedule, expected_snr
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

GAP = 1e-6
"""Certified relative distance from the global optimum that a grid is made for, at most."""
TO_GRID, TO_START = 0.4, 0.1
"""Parts of it that the grid's cells and its dark end may take: half is left as reserve."""
SURVEY = 1e-4
"""Loss on the coarse grid that tells how much a schedule is worth, hence what it may lose."""
LARGEST = 50_000_000
"""Points times captures, at 4 bytes: hundreds of captures get a coarser grid and a larger gap."""


def optimal(pdf: Pdf, counts: Sequence[int], gap: float = GAP) -> dict[int, Schedule]:
    """The globally best schedule of each of `counts` captures, in the order of `counts`.

    Its `gap` is the certified relative distance from the optimum: 0 for levels, else about half of
    the `gap` asked for. Of schedules worth the same it is the one with the shortest last time. A
    capture without use (more captures than levels above 0) repeats the last. Times are in 1/unit
    of the photocurrents. Raises ValueError for counts below 1.
    """
    wanted = sorted(set(counts))
    if not wanted:
        return {}
    if wanted[0] < 1 or any(count != int(count) for count in wanted):
        raise ValueError("the number of captures must be a whole number from 1")
    best = _of_levels(pdf, wanted) if pdf.discrete else _of_segments(pdf, wanted, gap)
    return {count: best[count] for count in counts}


def _of_levels(pdf: Pdf, counts: list[int]) -> dict[int, Schedule]:
    useful = (pdf.probability > 0) & (pdf.low > 0)
    values = pdf.low[useful]
    moments = np.cumsum(values * pdf.probability[useful])
    chains = hull.chains(values, moments, min(counts[-1], values.size))
    found = {n: values[chains[min(n, len(chains)) - 1]] for n in counts}
    return {n: _schedule(pdf, captures, n, 0.0) for n, captures in found.items()}


def _of_segments(pdf: Pdf, counts: list[int], gap: float) -> dict[int, Schedule]:
    chosen = _grid(pdf, counts, gap)
    found = {}
    for count, captures in _on_grid(pdf, chosen, counts).items():
        bound = chosen.bound(polish.worth(pdf, captures), count) if count > 1 else 0.0
        best = _schedule(pdf, polish.polished(pdf, captures), count, 0.0)
        distance = max(bound / best.expected_snr - 1, 0.0)
        found[count] = Schedule(best.times, best.photocurrents, best.expected_snr, distance)
    return found


def _grid(pdf: Pdf, counts: list[int], gap: float) -> grid.Grid:
    """As fine as the most demanding of `counts` needs."""
    survey = grid.make(pdf, SURVEY, SURVEY)
    worths = {n: polish.worth(pdf, i) for n, i in _on_grid(pdf, survey, counts).items() if n > 1}
    if not worths:  # a single capture is where it must be
        return survey
    loss = min(TO_GRID * gap * worth / (n - 1) for n, worth in worths.items())
    below = TO_START * gap * min(worths.values())
    fine = grid.make(pdf, loss, below)
    excess = fine.points.size * counts[-1] / LARGEST
    return grid.make(pdf, loss * excess**2, below) if excess > 1 else fine


def _on_grid(pdf: Pdf, chosen: grid.Grid, counts: list[int]) -> dict[int, Floats]:
    """The best captures among the grid's points."""
    chains = hull.chains(chosen.points, pdf.first_moment(chosen.points), counts[-1])
    return {n: chosen.points[chains[n - 1]] for n in counts}


def _schedule(pdf: Pdf, captures: Floats, count: int, gap: float) -> Schedule:
    """`captures` with the last repeated up to `count`."""
    filled = np.append(captures, np.full(count - captures.size, captures[-1]))
    times = 1.0 / filled
    return Schedule(times, filled, expected_snr(pdf, times), gap)
