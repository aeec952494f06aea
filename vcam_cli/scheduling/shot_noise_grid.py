"""The best schedules for shot noise alone among the photocurrents of a grid.

A schedule is worth J = sum of (M(i_k) - M(i_{k+1})) / i_k, M the first moment up to a photocurrent.
Move one capture of the best schedule to an end of its grid cell [lo, hi] of density f: there

    -d2J/di^2 <= (f / lo) (2 + (hi^2 - lo^2) / lo^2),

also where a neighbor stands in the same cell, so the better end loses no more than 1/8 (hi - lo)^2
times that (the error of linear interpolation). Hence with N captures, the first one fixed,

    J* <= J_grid + (N - 1) max over cells of that loss + F(g_0),

F(g_0) the probability below the first grid point. In a gap between segments J rises towards the
gap's lower end, so gaps need no points.

On the grid, the best n captures from g_j on are worth

    V_1(j) = M_j / g_j,    V_n(j) = M_j x_j + max over a of (V_{n-1}(a) - M_a x_j),   x_j = 1 / g_j:

the upper envelope of lines in x, that is the concave hull of the points (M_a, V_{n-1}(a)). The
next capture a need not be kept to a <= j: one above j is never worth more than a = j (each of its
photocurrents above g_j weighs less than 1 / g_j), and a = j means that the capture is not used.
All n up to N come from one pass at a cost linear in N, and in the number of points but for the
searches in sorted arrays.

Why the hull is thinned by chords instead of swept with a stack: a sweep is a Python loop over all
points. A point below a chord between any two others is outside the hull whatever becomes of those
two, so all points can be tried at once, against chords over 1, 2, 4, ... neighbors. There remain
a few concave arcs, and common tangents bridge the dents between them. A sweep finishes a
hostile case of many dents. Measured for 1 to 20 captures: a uniform pdf takes 0.08 s against 0.28 s
by sweeps alone, a histogram of 4096 bins 0.14 s against 0.50 s, and 0.22 s without bridges.
"""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf

COARSEST = 0.01
"""Width of a cell over its lower end, at most."""
FAR = 1e-4
"""A darkest photocurrent this far below the quantile that may be left out counts as 0."""
ROUNDS = 8
"""Rounds of all chord lengths, before the points that are left are swept."""
POINTS_PER_BRIDGE = 256
"""A bridge costs as much as a round of chords over that many points."""
EQUAL = 1e-14
"""Relative: values this close are the same but for rounding."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Photocurrents that captures are kept to, and what a schedule may lose by it.

    Parameters
    ----------
    points : (G,) array
        Rising photocurrents, the upper ends of all segments among them.
    loss : float
        Loss of J for each capture that is moved to a point, at most.
    below : float
        F(g_0), the probability below the first point.
    """

    points: Floats
    loss: float
    below: float

    def bound(self, on_grid: float, count: int) -> float:
        """Return J that no `count` captures exceed, from J of the best `on_grid`.

        Parameters
        ----------
        on_grid : float
            J of the best captures on the grid.
        count : int
            Captures.

        Returns
        -------
        float
            Upper bound of J.
        """
        return on_grid + (count - 1) * self.loss + self.below


def photocurrent_grid(pdf: Pdf, loss: float, below: float) -> Grid:
    """Divide a piecewise uniform pdf into a grid.

    Cells are as wide as the square root of lo / f allows and never wider than `COARSEST`. Their
    number grows with 1 / sqrt(loss) and with the logarithm of the range, and is never below the
    number of segments that occur.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent.
    loss : float
        About what J may lose for each capture that is moved to a point.
    below : float
        Probability that may lie below the first point.
    """
    first = _first_point(pdf, below)
    used = (pdf.probability > 0) & (pdf.high > first)
    low, high, density = np.maximum(pdf.low[used], first), pdf.high[used], pdf.density[used]
    points = np.unique(np.append(_cell_bottoms(low, high, density, 2 * np.sqrt(loss)), high))
    return Grid(points, _largest_loss(pdf, points), float(pdf.cdf(points[0])))


def best_captures(values: Floats, moments: Floats, count: int) -> list[Indices]:
    """Find the best chains of 1, 2, ... `count` captures over photocurrents.

    Parameters
    ----------
    values : (G,) array
        Rising photocurrents, above 0.
    moments : (G,) array
        First moment up to each, above 0 and never falling.
    count : int
        The largest number of captures.

    Returns
    -------
    list of arrays
        Falling indices of each chain, the first G - 1, with repeats left out: as many as are of
        use. Of chains worth the same the one with the brightest captures is returned, hence with
        the shortest last time.
    """
    x = 1.0 / values
    single = moments * x
    # Points that add nothing to the moment (rounding) are dearer, not better: never next.
    candidates = np.flatnonzero(np.diff(moments, prepend=0.0) > 0)
    height = moments[candidates]
    value, following = single, []
    for _ in range(count - 1):
        chosen = candidates[_best_lines(height, value[candidates], x)]
        value = single + (value[chosen] - moments[chosen] * x)
        following.append(chosen.astype(np.int32))
    return [_trace(following[:n]) for n in range(count)]


def concave_hull(m: Floats, v: Floats) -> Indices:
    """Return the indices of the upper hull of points (m, v) with rising `m`, ends included.

    Parameters
    ----------
    m : (P,) array
        Rising abscissas.
    v : (P,) array
        Ordinates.

    Returns
    -------
    (H,) array
        Rising indices of the hull's points.
    """
    kept = np.arange(m.size)
    for _ in range(ROUNDS):
        dents = np.flatnonzero(~_above_chords(m[kept], v[kept], 1))
        if not dents.size:
            return kept
        if dents.size * POINTS_PER_BRIDGE < kept.size:
            return _bridged_arcs(m, v, np.split(kept, dents + 2))
        stride = 1 << max(kept.size.bit_length() - 2, 0)
        while stride:
            kept = _thin(m, v, kept, stride)
            stride //= 2
    return _swept_hull(m, v, kept)


def _first_point(pdf: Pdf, below: float) -> float:
    """Return g_0, the darkest photocurrent unless it is too dark to be worth the points."""
    cumulative = pdf.cdf(pdf.high)
    segment = int(np.argmax(cumulative > below))
    before = cumulative[segment - 1] if segment else 0.0
    share = (below - before) / pdf.probability[segment]
    quantile = pdf.low[segment] + share * (pdf.high[segment] - pdf.low[segment])
    return max(pdf.min, float(quantile)) if pdf.min < FAR * quantile else pdf.min


def _cell_bottoms(low: Floats, high: Floats, density: Floats, width: float) -> Floats:
    """Return the lower ends of the cells of all segments.

    A cell at lo is min(width sqrt(lo / f), 1 % lo) wide: in the dark part of a segment cells have
    equal ratios, above `turn` equal steps of the root.
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
    bottoms = np.where(place <= in_ratio[segment], dark, bright**2)
    inside: Floats = np.clip(bottoms, low[segment], high[segment])
    return inside


def _largest_loss(pdf: Pdf, points: Floats) -> float:
    """Return the most that J loses when one capture moves to an end of its cell."""
    if points.size < 2:
        return 0.0
    low, wider = points[:-1], np.diff(points) / points[:-1]
    segment = np.searchsorted(pdf.high, low, side="right")
    density = np.where(pdf.low[segment] <= low, pdf.density[segment], 0.0)
    return float(np.max(wider**2 / 8 * (density * low) * (2 + wider * (2 + wider))))


def _trace(following: list[NDArray[np.int32]]) -> Indices:
    """Return the chain from the brightest on; `following[-1]` holds its second capture."""
    if not following:
        return np.array([-1])
    chain = [following[0].size - 1]
    for step in reversed(following):
        chain.append(int(step[chain[-1]]))
    return np.unique(chain)[::-1]


def _best_lines(m: Floats, v: Floats, x: Floats) -> Indices:
    """Return for each of falling `x` the index of the largest v - m x, of equal ones the last."""
    hull = concave_hull(m, v)
    height, value = m[hull], v[hull]
    gain = np.diff(value) + EQUAL * value[1:]
    slopes = np.minimum.accumulate(gain / np.diff(height))
    return hull[np.searchsorted(-slopes, -x, side="right")]


def _above_chords(m: Floats, v: Floats, stride: int) -> NDArray[np.bool_]:
    """Say of each point whether it lies above the chord between those `stride` before and after.

    The first and the last `stride` points are left out.
    """
    run, rise = m[stride:] - m[:-stride], v[stride:] - v[:-stride]
    return rise[:-stride] * run[stride:] > rise[stride:] * run[:-stride]


def _thin(m: Floats, v: Floats, kept: Indices, stride: int) -> Indices:
    """Drop the points on or below the chord between those `stride` before and after."""
    if kept.size <= 2 * stride:
        return kept
    above = _above_chords(m[kept], v[kept], stride)
    if above.all():
        return kept
    return np.concatenate([kept[:stride], kept[stride:-stride][above], kept[-stride:]])


def _bridged_arcs(m: Floats, v: Floats, arcs: list[Indices]) -> Indices:
    """Join concave arcs that follow each other to their hull, by halves."""
    if len(arcs) == 1:
        return arcs[0]
    half = len(arcs) // 2
    left, right = _bridged_arcs(m, v, arcs[:half]), _bridged_arcs(m, v, arcs[half:])
    start, end = _common_tangent(m[left], v[left], m[right], v[right])
    return np.concatenate([left[: start + 1], right[end:]])


def _common_tangent(m: Floats, v: Floats, m2: Floats, v2: Floats) -> tuple[int, int]:
    """Return where the common tangent touches two hulls, the first to the left of the second.

    The slope of the tangent is where max(v - s m) of the two are equal; their difference rises
    with s, and the slopes of a hull fall.
    """
    slopes, slopes2 = np.diff(v) / np.diff(m), np.diff(v2) / np.diff(m2)
    falling = -slopes2

    def touches(k: int) -> bool:
        slope = slopes[k]
        other = np.searchsorted(falling, -slope)
        return bool(v[k] - slope * m[k] <= v2[other] - slope * m2[other])

    start = bisect_left(range(slopes.size), True, key=touches)
    ahead, up = m2 - m[start], v2 - v[start]
    visible = slopes2 * ahead[:-1] <= up[:-1]
    return start, int(np.argmax(np.append(visible, True)))


def _swept_hull(m: Floats, v: Floats, kept: Indices) -> Indices:
    """Return the hull of the points `kept` by the sweep of Andrew (1979)."""
    hull: list[int] = []
    height, value = m.tolist(), v.tolist()
    for point in kept.tolist():
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            left = (value[b] - value[a]) * (height[point] - height[b])
            if left > (value[point] - value[b]) * (height[b] - height[a]):
                break
            hull.pop()
        hull.append(point)
    return np.array(hull)
