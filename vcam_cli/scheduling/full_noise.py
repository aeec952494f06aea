"""Globally optimal schedules with all noise and the readout's constraints (eq 4.1 of [1]_).

Dark current fills the well too, read and reset noise weigh on short exposures, and captures may
be limited to a longest exposure, a least distance and whole frames. None of this breaks what
makes the problem easy: a chain of rewards that grow with exposure (`chains`), so that dynamic
programming over candidate times (`candidates`) finds the best of all schedules on them, for all
numbers of captures at once. The same program on ever finer candidates then makes it exact.

Why the gap is small: the distance from the best schedule at any times is of second order in the
spacing of candidates, where moving every capture to the candidate before it shows the first order
only: times shrink by at most the candidates' ratio, SNR by its square. Where dark current or
readout noise mask nearly all of the signal that is still the tighter bound.

Why no Newton's method: best times often stand on an edge of the pdf, where the mean SNR has a kink,
or the least gap apart. A program over points around each capture, the capture itself and the
candidates beside it among them, needs no case for either and is never worse.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vcam_cli.scheduling.candidates import Candidates, candidate_times, level_candidates
from vcam_cli.scheduling.chains import (
    Chains,
    best_chains,
    first_followers,
    last_sample_rewards,
    longest_chains,
)
from vcam_cli.scheduling.objective import Schedule, evaluate_schedule, expected_snr
from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import SLACK, UNCONSTRAINED, Constraints, Sensor

REFINEMENTS = 8
POINTS = 5
"""New candidates on each side of a capture."""
SHRINK = 0.4
"""Of the reach from refinement to refinement: two points, so that captures may still move together.
The mean SNR is off by the square of the points' distance, at the end 1e-7 of what it was."""


def optimal_schedules(
    pdf: Pdf, counts: Sequence[int], sensor: Sensor, constraints: Constraints = UNCONSTRAINED
) -> dict[int, Schedule]:
    """Find the best schedule of each number of captures, for the last sample before saturation.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    counts : sequence of int
        Numbers of captures, each at least 1.
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands.

    Returns
    -------
    dict
        Schedules by number of captures, in the order of `counts`. A schedule repeats its last time
        where fewer captures are of use or fit. Its certified `gap` is 0 where the candidates hold a
        best schedule (levels, few frames).

    Raises
    ------
    ValueError
        If a count is below 1, or no whole frame is as short as the first capture must be.
    """
    if not counts:
        return {}
    if min(counts) < 1:
        raise ValueError("at least one capture is needed")
    most = max(counts)
    candidates = candidate_times(pdf, sensor, constraints, most)
    chains = best_chains(pdf, candidates.times, sensor, constraints, most)
    times = {count: candidates.times[chains.path(count)] for count in counts}
    if not pdf.discrete and not constraints.frame_time:
        times = refine_times(pdf, times, candidates.times, sensor, constraints)
    bounds = _upper_bounds(pdf, candidates, chains, sensor, constraints, most)
    return {
        count: _padded_schedule(
            pdf, chosen, count, sensor, None if bounds is None else bounds[count - 1]
        )
        for count, chosen in times.items()
    }


def refine_times(
    pdf: Pdf, schedules: dict[int, Floats], times: Floats, sensor: Sensor, constraints: Constraints
) -> dict[int, Floats]:
    """Move schedules off the candidates to the best times beside them.

    Parameters
    ----------
    pdf, sensor, constraints
        As those of `optimal_schedules`; of the constraints the least gap counts.
    schedules : dict
        Best times on the candidates by number of captures [s].
    times : (G,) array
        The candidates, rising [s].

    Returns
    -------
    dict
        Times by number of captures [s], worth no less than those in `schedules`.
    """
    gap = constraints.least_gap
    refined = dict(schedules)
    positions = {count: np.searchsorted(times, when) for count, when in refined.items()}
    beside = [times[np.clip(np.concatenate([p - 1, p + 1]), 0, len(times) - 1)]
              for p in positions.values()]  # fmt: skip
    reach = {count: _cell_widths(times)[position] for count, position in positions.items()}
    for _ in range(REFINEMENTS):
        around = [_points_around(when, reach[count], gap) for count, when in refined.items()]
        near = np.unique(np.concatenate([*beside, *around, *refined.values()]))
        near = near[(near >= times[0]) & (near <= times[-1])]
        chains = best_chains(pdf, near, sensor, constraints, max(refined))
        for count in refined:
            refined[count] = near[chains.path(count)]
            shrunk = reach[count] * SHRINK
            length = len(refined[count])  # a path may have become longer or shorter
            reach[count] = np.append(shrunk, np.full(length, shrunk[-1]))[:length]
    return {n: _better_times(pdf, refined[n], schedules[n], sensor) for n in schedules}


def _upper_bounds(
    pdf: Pdf,
    candidates: Candidates,
    chains: Chains,
    sensor: Sensor,
    constraints: Constraints,
    most: int,
) -> Floats | None:
    """Return (most,) bound of the mean SNR by number of captures; None: the chains' own.

    Moving captures to candidates may break a least gap: the bound then allows what the begins and
    ends of their cells allow.
    """
    if candidates.complete and not candidates.tail:
        return None
    gap = constraints.least_gap
    if gap and not candidates.complete:
        cells = level_candidates(pdf, sensor, constraints) if pdf.discrete else candidates
        first = first_followers(cells.begin, cells.end, gap)
        chains = longest_chains(last_sample_rewards(pdf, cells.times, sensor), first, most)
    moved = np.arange(most, dtype=float)  # the first capture stays
    if gap:
        span = candidates.times[-1] - candidates.times[0]
        moved = np.minimum(moved, np.floor(span / gap * (1 + SLACK)))
    value = chains.values[:, 0]
    bounds = np.minimum(value + candidates.error * moved, value * candidates.ratio**2)
    return np.asarray(bounds + candidates.tail)


def _padded_schedule(
    pdf: Pdf, times: Floats, count: int, sensor: Sensor, bound: float | None
) -> Schedule:
    """Drop captures of no use and repeat the last time up to `count`."""
    times = np.unique(times)
    unsaturated = np.append(pdf.cdf(sensor.saturation_limit(times / (1 + SLACK))), 0.0)
    used = unsaturated[:-1] > unsaturated[1:]  # some pixel saturates in the next, or it is the last
    used[0] = True
    times = times[used]
    times = np.append(times, np.full(count - len(times), times[-1]))
    schedule = evaluate_schedule(pdf, times, sensor)
    gap = 0.0 if bound is None else max(float(bound) / schedule.expected_snr - 1, 0.0)
    return replace(schedule, gap=gap)


def _cell_widths(times: Floats) -> Floats:
    """Return the width of the wider cell beside each candidate."""
    steps = np.diff(times, prepend=times[0], append=times[-1])
    return np.maximum(steps[:-1], steps[1:])


def _points_around(times: Floats, reach: Floats, gap: float) -> Floats:
    """Return points around each capture, and of captures about a gap apart each other's too."""
    offsets = np.arange(-POINTS, POINTS + 1) / POINTS
    points = times[:, None] + reach[:, None] * offsets
    if not gap:
        return points.ravel()
    tight = np.diff(times) <= gap * (1 + SLACK) + reach[1:] + reach[:-1]
    run = np.append(0, np.cumsum(~tight))
    shifted = [points.ravel()]
    for member in np.split(np.arange(len(times)), np.flatnonzero(np.diff(run)) + 1):
        steps = (member[:, None] - member) * gap
        shifted.append((points[member][None] + steps[:, :, None]).ravel())
    return np.concatenate(shifted)


def _better_times(pdf: Pdf, new: Floats, old: Floats, sensor: Sensor) -> Floats:
    """Return the times that are worth more; the tables are exact to twelve digits only."""
    return new if expected_snr(pdf, new, sensor) >= expected_snr(pdf, old, sensor) else old
