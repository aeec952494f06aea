"""The detail of rectangles of even light, which is that of their edges.

An edge of height A has the energy A^2 / (2 pi f)^2 at the frequency f across it, for each unit of
its length. Of edges that lie further apart than a lens blurs, the energies add up.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scenes.base import ChartScene, Rectangles

LOWEST, HIGHEST = 0.02, 32.0
"""Ends of the frequencies that are looked at, over the lowest and the highest that count."""
STEPS = 5
"""Frequencies within a factor of e."""


def isolated_edges(
    scene: ChartScene, level: NDArray, size: tuple[float, float], apart: float
) -> Rectangles | None:
    """Return the rectangles of a chart that lie before the array, if they are wide enough.

    Parameters
    ----------
    scene : ChartScene
        The chart.
    level : NDArray
        Signal of each of its components (K,) [electrons / s].
    size : tuple of float
        Width and height of the array [m].
    apart : float
        Shortest side that they may have [m].

    Returns
    -------
    Rectangles or None
        Their places, and the signal of every one; None of other charts.
    """
    found = scene.rectangles(level[None])
    if found is None:
        return None
    kept, sides = [], []
    for edges, length in zip((found.x, found.y), size, strict=True):
        inside = np.clip(edges, -length / 2, length / 2)
        kept.append(np.flatnonzero(np.diff(inside)))
        sides.append(inside[kept[-1][0] : kept[-1][-1] + 2])
    if min(float(np.diff(side).min()) for side in sides) < apart:
        return None
    (x, y), (columns, rows) = sides, kept
    return Rectangles(x, y, found.values[:, rows[:, None], columns])


def edge_power(rectangles: Rectangles, low: float, high: float) -> tuple[NDArray, NDArray, float]:
    """Return the mean squares of the waves of edges across them.

    Parameters
    ----------
    rectangles : Rectangles
        Their places, and the signal of every one (1, d, e) [electrons / s].
    low, high : float
        Lowest and highest frequency that counts [cycles/m].

    Returns
    -------
    frequency : NDArray
        Frequencies (n,), from 0 [cycles/m].
    power : NDArray
        Mean squares (n, n) over frequencies along y and x [(electrons / s)^2].
    beyond : float
        Mean square of all that is beyond the highest of them [(electrons / s)^2].
    """
    low, high = LOWEST * low, HIGHEST * high
    ends = np.geomspace(low, high, math.ceil(STEPS * math.log(high / low)) + 1)
    of_edge = (1 / ends[:-1] - 1 / ends[1:]) / (2 * np.pi**2)
    light, sides = rectangles.values[0], (np.diff(rectangles.y), np.diff(rectangles.x))
    area = float(sides[0].sum() * sides[1].sum())
    across_x = float(sides[0] @ np.square(np.diff(light, axis=1)).sum(axis=1)) / area
    across_y = float(np.square(np.diff(light, axis=0)).sum(axis=0) @ sides[1]) / area
    power = np.zeros((len(ends), len(ends)))
    power[0, 1:], power[1:, 0] = across_x * of_edge, across_y * of_edge
    beyond = (across_x + across_y) / (2 * np.pi**2 * high)
    return np.append(0.0, np.sqrt(ends[:-1] * ends[1:])), power, beyond
