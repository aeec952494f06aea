"""The best chain of captures over a finite set of photocurrents, for shot noise alone.

With M the first moment up to a photocurrent, the best n captures of which the first is g_j are
worth

    V_1(j) = M_j / g_j,    V_n(j) = M_j x_j + max over a of (V_{n-1}(a) - M_a x_j),   x_j = 1 / g_j:

the upper envelope of lines in x, that is the concave hull of the points (M_a, V_{n-1}(a)). The
next capture a need not be held to a <= j: one above j is never worth more than a = j (each of its
photocurrents above g_j weighs less than 1 / g_j), and a = j means that the capture is not used.

All n up to N come from one pass at a cost linear in N, and in the number of points but for the
searches in sorted arrays.

Why the hull is thinned by chords instead of swept with a stack: a sweep is a Python loop over all
points. A point below a chord between any two others is outside the hull whatever becomes of those
two, so all points can be tried at once, against chords over 1, 2, 4, ... neighbours. What is left
are a few concave arcs, and common tangents bridge the dents between them. (A sweep finishes a
hostile case of many dents.)
"""

from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

ROUNDS = 8
"""Of all chord lengths, before the points that are left are swept."""
POINTS_PER_BRIDGE = 256
"""A bridge costs as much as a round of chords over that many points."""
EQUAL = 1e-14
"""Relative: worths this close are the same but for rounding."""


def chains(values: Floats, moments: Floats, count: int) -> list[Indices]:
    """The best chains of 1, 2, ... `count` captures over rising photocurrents `values` (G,).

    moments : (G,) first moment up to each, above 0 and never falling. Each chain is an array of
    falling indices, the first G - 1, with repeats left out: as many as are of use. Of chains worth
    the same the one with the brightest captures is returned, hence with the shortest last time.
    """
    x = 1.0 / values
    single = moments * x
    # Points that add nothing to the moment (rounding) are dearer, not better: never next.
    candidates = np.flatnonzero(np.diff(moments, prepend=0.0) > 0)
    height = moments[candidates]
    worth, following = single, []
    for _ in range(count - 1):
        chosen = candidates[_best(height, worth[candidates], x)]
        worth = single + (worth[chosen] - moments[chosen] * x)
        following.append(chosen.astype(np.int32))
    return [_trace(following[:n]) for n in range(count)]


def _trace(following: list[NDArray[np.int32]]) -> Indices:
    """The chain from the brightest: `following[-1]` tells its second capture."""
    if not following:
        return np.array([-1])
    chain = [following[0].size - 1]
    for step in reversed(following):
        chain.append(int(step[chain[-1]]))
    return np.unique(chain)[::-1]


def _best(m: Floats, v: Floats, x: Floats) -> Indices:
    """For each of falling `x` the index of the largest v - m x, of equal ones the last."""
    hull = concave_hull(m, v)
    height, worth = m[hull], v[hull]
    gain = np.diff(worth) + EQUAL * worth[1:]
    slopes = np.minimum.accumulate(gain / np.diff(height))
    return hull[np.searchsorted(-slopes, -x, side="right")]


def concave_hull(m: Floats, v: Floats) -> Indices:
    """Indices of the upper hull of points with strictly rising `m`, ends included."""
    kept = np.arange(m.size)
    for _ in range(ROUNDS):
        dents = np.flatnonzero(~_above_chords(m[kept], v[kept], 1))
        if not dents.size:
            return kept
        if dents.size * POINTS_PER_BRIDGE < kept.size:
            return _bridged(m, v, np.split(kept, dents + 2))
        stride = 1 << max(kept.size.bit_length() - 2, 0)
        while stride:
            kept = _thinned(m, v, kept, stride)
            stride //= 2
    return _swept(m, v, kept)


def _above_chords(m: Floats, v: Floats, stride: int) -> NDArray[np.bool_]:
    """Whether points lie above the chord between those `stride` before and after.

    Without the first and the last `stride` points.
    """
    run, rise = m[stride:] - m[:-stride], v[stride:] - v[:-stride]
    return rise[:-stride] * run[stride:] > rise[stride:] * run[:-stride]


def _thinned(m: Floats, v: Floats, kept: Indices, stride: int) -> Indices:
    """`kept` without the points on or below the chord between those `stride` before and after."""
    if kept.size <= 2 * stride:
        return kept
    above = _above_chords(m[kept], v[kept], stride)
    if above.all():
        return kept
    return np.concatenate([kept[:stride], kept[stride:-stride][above], kept[-stride:]])


def _bridged(m: Floats, v: Floats, arcs: list[Indices]) -> Indices:
    """The hull of concave arcs that follow each other, by halves."""
    if len(arcs) == 1:
        return arcs[0]
    half = len(arcs) // 2
    left, right = _bridged(m, v, arcs[:half]), _bridged(m, v, arcs[half:])
    start, end = _bridge(m[left], v[left], m[right], v[right])
    return np.concatenate([left[: start + 1], right[end:]])


def _bridge(m: Floats, v: Floats, m2: Floats, v2: Floats) -> tuple[int, int]:
    """Where the common tangent touches two hulls, the first to the left of the second.

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
    seen = slopes2 * ahead[:-1] <= up[:-1]
    return start, int(np.argmax(np.append(seen, True)))


def _swept(m: Floats, v: Floats, kept: Indices) -> Indices:
    """The hull of the points `kept` by the sweep of Andrew (1979)."""
    hull: list[int] = []
    height, worth = m.tolist(), v.tolist()
    for point in kept.tolist():
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            left = (worth[b] - worth[a]) * (height[point] - height[b])
            if left > (worth[point] - worth[b]) * (height[b] - height[a]):
                break
            hull.pop()
        hull.append(point)
    return np.array(hull)
