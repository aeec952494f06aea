"""A grid of photocurrents that holds a near-optimal schedule of a piecewise uniform pdf.

The schedule is worth J = sum of (M(i_k) - M(i_{k+1})) / i_k. Move one capture of the best schedule
to an end of its grid cell [lo, hi] of density f: there

    -d2J/di^2 <= (f / lo) (2 + (hi^2 - lo^2) / lo^2),

also where a neighbour sits in the same cell, so the better end loses no more than 1/8 (hi - lo)^2
times that (the error of linear interpolation). Hence with N captures, of which the first is fixed,

    J* <= J_grid + (N - 1) max over cells of that loss + F(g_0),

F(g_0) the probability below the first grid point. In a gap between segments J rises towards the
gap's lower end, so gaps need no points.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

COARSEST = 0.01
"""Width of a cell over its lower end, at most."""
FAR = 1e-4
"""A darkest photocurrent this far below the quantile that may be left out counts as 0."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Rising photocurrents and what a schedule may lose by keeping to them."""

    points: Floats  # (G,), the upper ends of all segments among them
    loss: float  # of J, for each capture that is moved
    below: float  # F(g_0)

    def bound(self, on_grid: float, count: int) -> float:
        """What no schedule of `count` captures exceeds; `on_grid` = J of the best on the grid."""
        return on_grid + (count - 1) * self.loss + self.below


def make(pdf: Pdf, loss: float, below: float) -> Grid:
    """The grid of a piecewise uniform pdf that loses about `loss` a capture, and `below` at g_0.

    Cells are as wide as the square root of lo / f allows and never wider than `COARSEST`. Their
    number grows with 1 / sqrt(loss) and with the logarithm of the range, and is never below the
    number of segments that occur.
    """
    first = _start(pdf, below)
    seen = (pdf.probability > 0) & (pdf.high > first)
    low, high, density = np.maximum(pdf.low[seen], first), pdf.high[seen], pdf.density[seen]
    points = np.unique(np.append(_divided(low, high, density, 2 * np.sqrt(loss)), high))
    return Grid(points, _worst(pdf, points), float(pdf.below(points[0])))


def _start(pdf: Pdf, below: float) -> float:
    """g_0: the darkest photocurrent, unless it is so dark that it is not worth the points."""
    cumulative = pdf.below(pdf.high)
    segment = int(np.argmax(cumulative > below))
    before = cumulative[segment - 1] if segment else 0.0
    share = (below - before) / pdf.probability[segment]
    quantile = pdf.low[segment] + share * (pdf.high[segment] - pdf.low[segment])
    return max(pdf.min, float(quantile)) if pdf.min < FAR * quantile else pdf.min


def _divided(low: Floats, high: Floats, density: Floats, width: float) -> Floats:
    """The lower ends of the cells of all segments, a cell at lo min(width sqrt(lo/f), 1 % lo) wide.

    In the dark part of a segment cells have equal ratios, above `turn` equal steps of the root.
    """
    turn = np.clip((width / COARSEST) ** 2 / density, low, high)
    ratio, step = np.log1p(COARSEST), width / 2 / np.sqrt(density)
    in_ratio = np.log(turn / low) / ratio
    total = in_ratio + (np.sqrt(high) - np.sqrt(turn)) / step
    cells = np.maximum(np.ceil(total), 1).astype(np.intp)
    segment = np.repeat(np.arange(cells.size), cells)
    number = np.arange(segment.size) - np.repeat(np.cumsum(cells) - cells, cells)
    place = number * (total / cells)[segment]
    dark = low[segment] * np.exp(np.minimum(place, in_ratio[segment]) * ratio)
    bright = np.sqrt(turn)[segment] + (place - in_ratio[segment]) * step[segment]
    found = np.where(place <= in_ratio[segment], dark, bright**2)
    return np.clip(found, low[segment], high[segment])


def _worst(pdf: Pdf, points: Floats) -> float:
    """The most that J loses when one capture moves to an end of its cell."""
    if points.size < 2:
        return 0.0
    low, wider = points[:-1], np.diff(points) / points[:-1]
    segment = np.searchsorted(pdf.high, low, side="right")
    density = np.where(pdf.low[segment] <= low, pdf.density[segment], 0.0)
    return float(np.max(wider**2 / 8 * (density * low) * (2 + wider * (2 + wider))))
