"""How much edge a chart has: what the errors of the cells on which it is painted follow from.

An edge of height A and length L has the energy A^2 L / (2 pi f)^2 at the frequency f across it.
Edges along rows and columns lie alike to the cells of a grid; others, of all directions alike, do
not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

RINGING = 0.1
"""Part of an edge's height by which light beside it may err: edges between two lights that both
fill pixels count up to the error that would leave one of them unsaturated."""

ALIGNED = 0.02
"""Slope of sides that lie along rows or columns: over 50 pixels they move by one at most."""
EXACT = 1e-9
"""Slope of sides that lie exactly along them: rounding."""


@dataclass(frozen=True)
class Region:
    """A rectangle of the sensor plane."""

    center: tuple[float, float]
    """x and y from the array's center [m]."""
    size: tuple[float, float]
    """Width and height [m]."""

    @property
    def area(self) -> float:
        """Area [m2]."""
        return self.size[0] * self.size[1]

    def moved(self, x: float, y: float) -> Region:
        """Return the region as it is seen from another place.

        Parameters
        ----------
        x, y : float
            The place [m].

        Returns
        -------
        Region
            The region.
        """
        return Region((self.center[0] - x, self.center[1] - y), self.size)

    def lengths_inside(self, start: Array, stop: Array) -> Array:
        """Return the lengths of straight lines within it.

        Parameters
        ----------
        start, stop : Array
            Ends (2, n) of the lines, x and y [m].

        Returns
        -------
        Array
            Lengths (n,) [m].
        """
        along = stop - start
        low, high = np.zeros(start.shape[1]), np.ones(start.shape[1])
        for axis in (0, 1):
            half = self.size[axis] / 2
            ends = (np.array([[-half], [half]]) + self.center[axis] - start[axis]) / np.where(
                along[axis] == 0, 1e-300, along[axis]
            )
            low = np.maximum(low, ends.min(axis=0))
            high = np.minimum(high, ends.max(axis=0))
        lengths: Array = np.hypot(*along) * np.maximum(high - low, 0.0)
        return lengths


@dataclass(frozen=True)
class EdgeEnergy:
    """Sums of A^2 L over the edges in a region, over its area."""

    aligned: float = 0.0
    """Of edges along rows and columns [square of the light's unit / m]."""
    oblique: float = 0.0
    """Of edges of other directions, likewise."""
    alike: float = 0.0
    """Of the aligned ones, that of a line exactly along rows or columns: all of it lies in one
    place of the cells, and of the pixels."""

    def __add__(self, other: EdgeEnergy) -> EdgeEnergy:
        """Return the energy of both."""
        return EdgeEnergy(
            self.aligned + other.aligned, self.oblique + other.oblique, self.alike + other.alike
        )

    def at_least(self, other: EdgeEnergy) -> EdgeEnergy:
        """Return the larger energy of each kind of edge."""
        return EdgeEnergy(
            max(self.aligned, other.aligned),
            max(self.oblique, other.oblique),
            max(self.alike, other.alike),
        )

    def scaled(self, factor: float) -> EdgeEnergy:
        """Return it times a factor.

        Parameters
        ----------
        factor : float
            The factor, without unit.

        Returns
        -------
        EdgeEnergy
            The product.
        """
        return EdgeEnergy(self.aligned * factor, self.oblique * factor, self.alike * factor)


def counted_height(first: Array, second: Array, ceiling: float) -> Array:
    """Return the squared heights of edges between two lights, 0 where both fill pixels.

    Parameters
    ----------
    first, second : Array
        Lights on both sides, of shapes that broadcast, in the unit of the ceiling.
    ceiling : float
        Light that fills a pixel.
    """
    if math.isinf(ceiling):
        return np.asarray(np.square(first - second))
    height = np.abs(first - second)
    counts = np.minimum(first, second) < ceiling + RINGING * height
    return np.where(counts, np.square(height), 0.0)


def outline_energy(start: Array, stop: Array, height: float, region: Region) -> EdgeEnergy:
    """Return the energy of straight edges of one height.

    Parameters
    ----------
    start, stop : Array
        Ends (2, n) of the edges, x and y [m].
    height : float
        Their squared height, as `counted_height` returns it.
    region : Region
        Where edges count.
    """
    lengths = region.lengths_inside(start, stop)
    sides = np.abs(stop - start)
    is_aligned = sides.min(axis=0) <= ALIGNED * sides.max(axis=0)
    aligned, oblique = (float(lengths[some].sum()) for some in (is_aligned, ~is_aligned))
    return EdgeEnergy(height * aligned / region.area, height * oblique / region.area)


def rectangle_energy(
    x: Array, y: Array, light: Array, region: Region, ceiling: float
) -> EdgeEnergy:
    """Return the energy of even rectangles in rows and columns.

    Parameters
    ----------
    x, y : Array
        Edges (e + 1,) and (d + 1,), rising, between which the light is even [m].
    light : Array
        Light (d, e) of each.
    region : Region
        Where edges count.
    ceiling : float
        Light that fills a pixel.
    """
    total = 0.0
    for axis, (across, along) in enumerate(((x, y), (y, x))):
        low, high = (region.center[1 - axis] + side * region.size[1 - axis] / 2 for side in (-1, 1))
        lengths = np.diff(np.clip(along, low, high))
        inside = np.abs(across[1:-1] - region.center[axis]) < region.size[axis] / 2
        rows = light if axis == 0 else light.T
        squares = counted_height(rows[:, 1:], rows[:, :-1], ceiling)[:, inside]
        total += float((lengths @ squares).sum())
    return EdgeEnergy(aligned=total / region.area)


def total_energy(parts: Iterable[EdgeEnergy]) -> EdgeEnergy:
    """Return the energy of several parts together.

    Parameters
    ----------
    parts : iterable of EdgeEnergy
        Energy of each part.

    Returns
    -------
    EdgeEnergy
        Their sum.
    """
    return sum(parts, EdgeEnergy())
