"""Schedules on candidate times, made exact: the same dynamic program on ever finer candidates.

Why not Newton's method: best times often stand on an edge of the pdf, where the worth has a kink,
or the least gap apart. A program over points around each capture, the capture itself and the
candidates beside it among them, needs no case for either and is never worse.
"""

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling import candidates, rewards
from vcam_cli.scheduling.chain import Chains, longest_chains
from vcam_cli.scheduling.objective import SLACK, Constraints, Sensor, expected_snr
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

ROUNDS = 8
POINTS = 5
"""New candidates on each side of a capture."""
SHRINK = 0.4
"""Of the reach from round to round: two points, so that captures may still move together. The
worth is off by the square of the points' distance, after all rounds 1e-7 of what it was."""


def best_chains(
    pdf: Pdf, times: Floats, sensor: Sensor, constraints: Constraints, most: int
) -> Chains:
    """Best chains of up to `most` captures at candidate times (G,), the first at times[0]."""
    first = candidates.followers(times, times, candidates.least_gap(constraints))
    return longest_chains(rewards.stage(pdf, times, sensor), first, most)


def polished(
    pdf: Pdf, schedules: dict[int, Floats], times: Floats, sensor: Sensor, constraints: Constraints
) -> dict[int, Floats]:
    """`schedules`, by number of captures, on `times` (G,), moved off them to what is best."""
    gap = candidates.least_gap(constraints)
    found = dict(schedules)
    places = {count: np.searchsorted(times, when) for count, when in found.items()}
    beside = [times[np.clip(np.concatenate([p - 1, p + 1]), 0, len(times) - 1)]
              for p in places.values()]  # fmt: skip
    reach = {count: _widths(times)[place] for count, place in places.items()}
    for _ in range(ROUNDS):
        around = [_around(when, reach[count], gap) for count, when in found.items()]
        near = np.unique(np.concatenate([*beside, *around, *found.values()]))
        near = near[(near >= times[0]) & (near <= times[-1])]
        chains = best_chains(pdf, near, sensor, constraints, max(found))
        for count in found:
            found[count] = near[chains.path(count)]
            reach[count] = _fitted(reach[count] * SHRINK, len(found[count]))
    return {count: _better(pdf, found[count], schedules[count], sensor) for count in schedules}


def _widths(times: Floats) -> Floats:
    """The wider cell beside each candidate."""
    steps = np.diff(times, prepend=times[0], append=times[-1])
    return np.maximum(steps[:-1], steps[1:])


def _around(times: Floats, reach: Floats, gap: float) -> Floats:
    """Points around each capture, and of captures about a gap apart each other's points too."""
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


def _fitted(reach: Floats, count: int) -> Floats:
    """`reach` for a path that has become longer or shorter."""
    return np.append(reach, np.full(count, reach[-1]))[:count]


def _better(pdf: Pdf, new: Floats, old: Floats, sensor: Sensor) -> Floats:
    """The one that is worth more; the tables are exact to twelve digits only."""
    return new if expected_snr(pdf, new, sensor) >= expected_snr(pdf, old, sensor) else old
