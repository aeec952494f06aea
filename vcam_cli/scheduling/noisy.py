"""Globally optimal schedules with all noise and the readout's constraints (eq 4.1).

Dark current fills the well too, read and reset noise weigh on short exposures, and captures may
be limited to a longest exposure, a least distance and whole frames. None of this breaks what
makes the problem easy: a chain of rewards that grow with exposure (`chain`), so that dynamic
programming over candidate times (`candidates`) finds the best of all schedules on them, for all
numbers of captures at once.

Why the gap is small: the distance from the best schedule at any times is of second order in the
spacing of candidates (`candidates._cells`), where moving every capture to the candidate before it
shows the first order only: times shrink by at most the candidates' ratio, SNR by its square. Where
dark current or readout noise hide nearly all of the signal that is still the tighter bound.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling import candidates, rewards
from vcam_cli.scheduling.candidates import UNCONSTRAINED, Grid, followers
from vcam_cli.scheduling.chain import Chains, longest_chains
from vcam_cli.scheduling.objective import SLACK, Constraints, Schedule, Sensor, at
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.refine import best_chains, polished

Floats = NDArray[np.float64]


def optimal(
    pdf: Pdf, counts: Sequence[int], sensor: Sensor, constraints: Constraints = UNCONSTRAINED
) -> dict[int, Schedule]:
    """The best schedules of each number of captures, last sample before saturation.

    counts : each at least 1. A schedule repeats its last time where fewer captures are of use
    or fit. `gap` bounds the relative distance from the best possible; it is 0 where the
    candidates hold a best schedule (levels, few frames). Raises ValueError for counts below 1
    and where no whole frame is as short as the first capture must be.
    """
    if not counts:
        return {}
    if min(counts) < 1:
        raise ValueError("at least one capture is needed")
    most = max(counts)
    grid = candidates.grid(pdf, sensor, constraints, most)
    chains = best_chains(pdf, grid.times, sensor, constraints, most)
    times = {count: grid.times[chains.path(count)] for count in counts}
    if not pdf.discrete and not constraints.frame_time:
        times = polished(pdf, times, grid.times, sensor, constraints)
    bounds = _bounds(pdf, grid, chains, sensor, constraints, most)
    return {
        count: _schedule(pdf, found, count, sensor, None if bounds is None else bounds[count - 1])
        for count, found in times.items()
    }


def _bounds(
    pdf: Pdf, grid: Grid, chains: Chains, sensor: Sensor, constraints: Constraints, most: int
) -> Floats | None:
    """(most,) mean SNR that no schedule of so many captures exceeds; None: the chains are it.

    Moving captures to candidates may break a least gap: the bound then allows what begins and
    ends of their cells allow.
    """
    if grid.complete and not grid.tail:
        return None
    gap = candidates.least_gap(constraints)
    if gap and not grid.complete:
        cells = candidates.levels(pdf, sensor, constraints) if pdf.discrete else grid
        first = followers(cells.begin, cells.end, gap)
        chains = longest_chains(rewards.stage(pdf, cells.times, sensor), first, most)
    moved = np.arange(most, dtype=float)  # the first capture stays
    if gap:
        moved = np.minimum(moved, np.floor((grid.times[-1] - grid.times[0]) / gap * (1 + SLACK)))
    worth = chains.values[:, 0]
    return np.minimum(worth + grid.error * moved, worth * grid.ratio**2) + grid.tail


def _schedule(pdf: Pdf, found: Floats, count: int, sensor: Sensor, bound: float | None) -> Schedule:
    """`found` without captures that nobody needs, its last time repeated up to `count`."""
    found = np.unique(found)
    seen = np.append(pdf.below(sensor.limit(found / (1 + SLACK))), 0.0)
    needed = seen[:-1] > seen[1:]  # somebody saturates in the next, or this is the last
    needed[0] = True
    times = found[needed]
    times = np.append(times, np.full(count - len(times), times[-1]))
    result = at(pdf, times, sensor)
    gap = 0.0 if bound is None else max(float(bound) / result.expected_snr - 1, 0.0)
    return replace(result, gap=gap)
