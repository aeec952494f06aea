"""The detail of even light between straight edges.

An edge of height A has the energy A^2 / (2 pi f)^2 at the frequency f across it, for each unit of
its length. Of edges that lie further apart than a lens blurs, the energies add up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scenes.base import ChartScene, Rectangles

LOWEST, HIGHEST = 0.02, 32.0
"""Ends of the frequencies that are looked at, over the lowest and the highest that count."""
STEPS = 5
"""Frequencies within a factor of e."""
IN_STEP = 2.6
"""Largest mean square of what a blur changes at the pixels' centers, where edges all lie alike to
them, over that of all places, for pixels as wide as the inverse cut-off frequency. It grows with
the root of their width: measured 2.5 for a width of 1, 4.4 for 3.2, 9.1 for 13."""
HARMONICS = 32
"""Waves over a pixel by which it is told how alike edges lie to the pixels."""


@dataclass(frozen=True)
class EdgePower:
    """The waves that edges are made of."""

    fx: NDArray
    """Frequencies along x (n,), from 0 [cycles/m]."""
    fy: NDArray
    """Frequencies along y (n,), from 0 [cycles/m]."""
    power: NDArray
    """Mean squares (n, n) over frequencies along y and x, at the pixels' centers at most
    [(electrons / s)^2]."""
    beyond: float
    """Mean square of all that is beyond the highest of them [(electrons / s)^2]."""
    brightest: float
    """Largest signal [electrons / s]."""


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


@dataclass(frozen=True)
class PixelLattice:
    """The pixels that edges lie alike to, or not."""

    pitch: tuple[float, float]
    """Distance of the pixels along x and y [m]."""
    size: tuple[float, float]
    """Width and height of the array [m]."""
    cutoff: float
    """Highest frequency that the lens passes; inf without one [cycles/m]."""

    def in_step(self, places: NDArray, weights: NDArray, pitch: float) -> float:
        """Return how much more a blur changes at the pixels' centers than at all places.

        What it changes of an edge is taken for a Poisson kernel over where the edge lies between
        two pixels, with the peak that was measured at the worst place: that edges lie there is
        assumed of those that lie alike.

        Parameters
        ----------
        places, weights : NDArray
            Places of edges (n,) [m], and the energy of each (n,) in any unit.
        pitch : float
            Distance of the pixels across them [m].

        Returns
        -------
        float
            Ratio of mean squares: 1 for edges everywhere, most for those that all lie alike.
        """
        peak = IN_STEP * math.sqrt(max(1.0, pitch * self.cutoff))
        wave = np.arange(1, HARMONICS + 1)
        turns = np.exp(2j * np.pi / pitch * np.outer(wave, places))
        alike = np.abs((turns * weights).sum(axis=1)) / (weights.sum() or 1.0)
        return 1 + 2 * float(((1 - 2 / (peak + 1)) ** wave * alike).sum())


def rectangles_power(
    rectangles: Rectangles, pixels: PixelLattice, low: float, high: float
) -> EdgePower:
    """Return the waves across the edges of rectangles.

    Parameters
    ----------
    rectangles : Rectangles
        Their places, and the signal of every one (1, d, e) [electrons / s].
    pixels : PixelLattice
        Pixels of the array.
    low, high : float
        Lowest and highest frequency that counts [cycles/m].

    Returns
    -------
    EdgePower
        Waves along x and along y.
    """
    frequency, of_edge, beyond = _waves_of_edge(low, high)
    light, sides = rectangles.values[0], (np.diff(rectangles.y), np.diff(rectangles.x))
    area = float(sides[0].sum() * sides[1].sum())
    of_x = sides[0] @ np.square(np.diff(light, axis=1)) / area
    of_y = np.square(np.diff(light, axis=0)) @ sides[1] / area
    across_x, across_y = (
        float(energies.sum()) * pixels.in_step(edges[1:-1], energies, pitch)
        for energies, edges, pitch in zip(
            (of_x, of_y), (rectangles.x, rectangles.y), pixels.pitch, strict=True
        )
    )
    power = np.zeros((len(frequency), len(frequency)))
    power[0, 1:], power[1:, 0] = across_x * of_edge, across_y * of_edge
    beyond *= across_x + across_y
    return EdgePower(frequency, frequency, power, beyond, float(light.max()))


def straight_edge_power(
    across: tuple[float, float],
    signals: NDArray,
    pixels: PixelLattice,
    low: float,
    high: float,
) -> EdgePower:
    """Return the waves across a straight edge through the array's center.

    Parameters
    ----------
    across : tuple of float
        Unit vector (x, y) across the edge.
    signals : NDArray
        Signals (2,) of its sides [electrons / s].
    pixels : PixelLattice
        Pixels of the array.
    low, high : float
        Lowest and highest frequency that counts [cycles/m].

    Returns
    -------
    EdgePower
        Waves across it.
    """
    frequency, of_edge, beyond = _waves_of_edge(low, high)
    x, y = (abs(part) for part in across)
    width, height = pixels.size
    length = min(width / max(y, 1e-9), height / max(x, 1e-9))
    # Where it passes the rows, or of a flat one the columns, that it crosses.
    steps, lines = np.multiply((x, y), pixels.pitch), length * np.divide((x, y), pixels.pitch[::-1])
    steep = int(steps[1] > steps[0])
    places = np.arange(max(1.0, round(lines[steep]))) * steps[1 - steep]
    energy = float(np.diff(signals)[0]) ** 2 * length / (width * height)
    energy *= pixels.in_step(places, np.ones(len(places)), steps[steep])
    return EdgePower(
        fx=frequency * x,
        fy=frequency * y,
        power=np.diag(np.append(0.0, energy * of_edge)),
        beyond=energy * beyond,
        brightest=float(signals.max()),
    )


def _waves_of_edge(low: float, high: float) -> tuple[NDArray, NDArray, float]:
    """Return frequencies (n,) from 0, and an edge's energies at those above and beyond them all.

    The energies are those of an edge of height 1, for each unit of its length.
    """
    low, high = LOWEST * low, HIGHEST * high
    ends = np.geomspace(low, high, math.ceil(STEPS * math.log(high / low)) + 1)
    of_edge = (1 / ends[:-1] - 1 / ends[1:]) / (2 * np.pi**2)
    middle = np.append(0.0, np.sqrt(ends[:-1] * ends[1:]))
    return middle, of_edge, 1 / (2 * np.pi**2 * high)
