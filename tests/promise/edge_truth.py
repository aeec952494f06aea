"""Charts that change along one direction only: step-wedge and slanted-edge, by one integral.

The light of borders b_j, where it rises by r_j along a direction, is on a pixel at the distance u

    (first + last) / 2 + 1 / pi  integral_0^cutoff  T(f) / f  sum_j r_j sin(2 pi f (u - b_j))  df,

T the transfer along that direction. The integral is Gauss's, to rounding; there is no margin.
"""

from __future__ import annotations

import math

import numpy as np
from fourier import cutoff, places, transfer
from reference import Setup


def mean_signal(setup: Setup, angle: float, borders: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Mean photo-electrons of every pixel: (rows, columns).

    levels (n + 1,): light between borders (n,) [m], which rise along (cos angle, sin angle).
    """
    x, y, gather = places(setup)
    along = math.cos(angle), math.sin(angle)
    farthest = abs(along[0] * x).max() + abs(along[1] * y).max() + abs(borders).max()
    end = cutoff(setup, along)
    f, weight = _rule(end, 4 + math.ceil(farthest * end))
    passed = transfer(setup, f * along[0], f * along[1])  # (C, F)
    waves = np.exp(-2j * math.pi * np.outer(f, borders)) @ np.diff(levels)
    down = np.exp(2j * math.pi * np.outer(y * along[1], f))
    across = np.exp(2j * math.pi * np.outer(x * along[0], f))
    amount = waves * weight / f / math.pi
    light = np.array([((down * (amount * one)) @ across.T).imag for one in passed])
    even = (levels[0] + levels[-1]) / 2 * transfer(setup, np.zeros(1), np.zeros(1)).real
    return gather(light + even[..., None])


def step_wedge(setup: Setup, steps: int, density_range: float) -> np.ndarray:
    """Mean photo-electrons of every pixel before a step wedge."""
    return mean_signal(setup, 0.0, *bars(setup, steps, density_range))


def bars(setup: Setup, steps: int, density_range: float) -> tuple[np.ndarray, np.ndarray]:
    """Borders [m] and levels of bars of equal width over the array, 10^(-D i / (n - 1)), the first
    and last without end."""
    return (np.arange(1, steps) / steps - 0.5) * setup.size[0], levels(steps, density_range)


def levels(steps: int, density_range: float) -> np.ndarray:
    """Levels of the bars, from the left."""
    return 10.0 ** (-density_range * np.arange(steps) / (steps - 1))


def slanted_edge(setup: Setup, angle: float, contrast: float) -> np.ndarray:
    """(1 - contrast) / 2 on the left of a line through the center, (1 + contrast) / 2 on its
    right; the angle of its normal [rad]."""
    levels = np.array([1 - contrast, 1 + contrast]) / 2
    return mean_signal(setup, angle, np.zeros(1), levels)


def _rule(stop: float, panels: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of Gauss's rule on panels from 0; the last ones ever shorter, since the
    OTF ends as a power of 3/2."""
    edges = np.linspace(0, 1, panels + 1)
    edges = np.concatenate([edges[:-1], 1 - (1 - edges[-2]) * 0.5 ** np.arange(1, 12), [1.0]])
    node, weight = np.polynomial.legendre.leggauss(12)
    half = np.diff(edges)[:, None] / 2
    points = (edges[:-1, None] + half * (node + 1)).ravel()
    return stop * points, stop * (half * weight).ravel()
