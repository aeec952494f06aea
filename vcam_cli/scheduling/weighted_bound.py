"""What no schedule of the weighted estimator exceeds.

After k captures, the last at T, the estimate's variance is the least of s w' m w + w' N w over
weights with w' t = 1, s = i + dark, m = min(t_j, t_l), N = read^2 + reset^2 11'. Apart, the two
are at least s / T (the last sample, free of noise) and 1 / B_k,

    B_k = max t' N^-1 t over the times of captures 2..k in [t_1, T]:

a convex function, greatest where each is at one end. So

    SNR <= i^2 / (s / T + 1 / B_k(T)) = T i^2 / (i + c_k),   c_k = dark + T / B_k(T),

which grows with T and k: a chain of rewards again, one stage a capture, with a global optimum.
"""

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling import candidates, rewards
from vcam_cli.scheduling.candidates import UNCONSTRAINED, Grid
from vcam_cli.scheduling.chain import row_maxima
from vcam_cli.scheduling.objective import SLACK, Constraints, Sensor
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.rewards import Stage

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


def upper_bounds(
    pdf: Pdf, most: int, sensor: Sensor, constraints: Constraints = UNCONSTRAINED
) -> Floats:
    """(most,) mean SNR that no schedule of 1, 2, .. captures exceeds.

    A capture inside a cell of candidates is given the exposure of the cell's end and the
    saturation of its beginning, which is only more. Errors as `candidates.grid`.
    """
    grid = _grid(pdf, sensor, constraints)
    ladder = [
        (reach, sensor.dark + reach / _information(k, grid.times[0], reach, sensor))
        for k, reach in enumerate([grid.times, *[grid.end] * (most - 1)], start=1)
    ]
    stages = rewards.stages(pdf, grid.times, ladder, sensor)
    last = _predecessors(grid, _apart(constraints))
    best = np.maximum.accumulate(_chain(stages, last))
    return best + grid.tail * (1 + sensor.floor / sensor.well)  # the tail with a full well each


def _grid(pdf: Pdf, sensor: Sensor, constraints: Constraints) -> Grid:
    if pdf.discrete:
        return candidates.levels(pdf, sensor, constraints)
    grid = candidates.grid(pdf, sensor, Constraints(0.0, constraints.frame_time), 1)
    return Grid(grid.times, grid.times, grid.end, tail=grid.tail)


def _apart(constraints: Constraints) -> float:
    """The least time between two reads [s]; one a frame."""
    return max(candidates.least_gap(constraints), constraints.frame_time)


def _information(k: int, first: float, last: Floats, sensor: Sensor) -> Floats:
    """B_k(T) of the formula above for T = `last` (G,) and t_1 = `first`; may be infinite."""
    read, reset = sensor.read**2, sensor.reset**2
    if k == 1:
        return last**2 / sensor.floor if sensor.floor else np.full(last.shape, np.inf)
    if not read:
        same = first**2 / reset if reset else np.inf
        return np.where(last > first, np.inf, same)  # the difference of two is free of reset
    early = np.arange(1, k)[:, None]
    square = early * first**2 + (k - early) * last**2
    total = early * first + (k - early) * last
    values = (square - total**2 * (reset / (read + k * reset))) / read
    return np.asarray(values.max(axis=0))


def _predecessors(grid: Grid, gap: float) -> Indices:
    """The last candidate that each may follow; -1 where it may follow none."""
    own = np.arange(len(grid.times))
    if not gap:
        return own
    latest = np.searchsorted(grid.begin, grid.end * (1 + SLACK) - gap, side="right") - 1
    return np.minimum(latest, own)


def _chain(stages: list[Stage], last: Indices) -> Floats:
    """(N,) best worth of chains of exactly 1..N captures; -inf where so many do not fit.

    ahead[l]: worth of all captures before the one at l. Rows l >= `start` can be reached.
    """
    size = len(last)
    worth = np.full(len(stages), -np.inf)
    worth[0] = stages[0].own[0]
    ahead, start = np.zeros(1), 0
    for k in range(1, len(stages)):
        begin = int(np.searchsorted(last, start, side="left"))
        if begin == size:
            break
        ahead = _advanced(stages[k - 1], ahead, start, last, begin)
        start = begin
        worth[k] = float(np.max(ahead + stages[k].own[start:]))
    return worth


def _advanced(before: Stage, ahead: Floats, start: int, last: Indices, begin: int) -> Floats:
    """`ahead` of rows `begin` on, from that of the columns `start` on, of the capture before."""

    def value(rows: Indices, columns: Indices) -> Floats:
        earned = before.own[columns] - before.given_up(columns, rows + begin)
        return ahead[columns - start] + earned

    lower = np.full(len(last) - begin, start)
    upper = np.minimum(last[begin:], start + len(ahead) - 1)
    return row_maxima(value, lower, upper)[0]
