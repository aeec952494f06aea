"""Bright points on black: round ones on a square grid, one of them at the array's center.

The points have the radiance of a perfect white; the grid goes on without end.
"""

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes import discs
from vcam_cli.scenes.base import Chart
from vcam_cli.scenes.disc_edges import Discs
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region, counted_height


@dataclass(frozen=True)
class PointGrid(Chart):
    """Points of a diameter, at most the spacing of their centers [m]."""

    spacing: float
    diameter: float

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells, exactly: the area of circles within them."""
        points = self._points(x_edges[[0, -1]], y_edges[[0, -1]])
        light = discs.separate_cover(points, x_edges, y_edges).astype(mix.dtype)
        for plane, level in zip(out, mix[:, 0], strict=True):
            np.multiply(light, level, out=plane)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points: 1 within a disc, else 0."""
        across, down = (
            position - self.spacing * np.rint(position / self.spacing)
            for position in (np.asarray(x), np.asarray(y))
        )
        light = np.add.outer(down**2, across**2) <= (self.diameter / 2) ** 2
        return np.asarray(np.multiply.outer(mix[:, 0], light.astype(mix.dtype)))

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the points' outlines."""
        height = float(counted_height(np.zeros(1), level[:1], ceiling)[0])
        return EdgeEnergy(oblique=height * math.pi * self.diameter / self.spacing**2)

    @property
    def period(self) -> tuple[float, float]:
        """Period along x and y, the spacing of the points [m]."""
        return self.spacing, self.spacing

    def amplitudes(self, count_x: int, count_y: int) -> Array:
        """Return the Fourier series of a lattice of discs.

        It is pi d^2 / 4 p^2 times 2 J1(x) / x, with x = pi d sqrt(k^2 + l^2) / p; a cosine with
        k > 0 represents k and -k.

        Parameters
        ----------
        count_x, count_y : int
            Terms along x and y.

        Returns
        -------
        Array
            Amplitudes (count_y, count_x), relative to the perfect white.
        """
        from scipy.special import j1

        k, m = np.arange(count_x), np.arange(count_y)
        x = math.pi * self.diameter / self.spacing * np.hypot(k, m[:, None])
        shape = np.divide(2 * j1(x), x, out=np.ones_like(x), where=x > 0)
        twice = np.outer(np.where(m > 0, 2, 1), np.where(k > 0, 2, 1))
        return np.asarray(math.pi / 4 * (self.diameter / self.spacing) ** 2 * shape * twice)

    def _points(self, x: Array, y: Array) -> Discs:
        """Return the points that may reach into a rectangle, row by row."""
        across, down = (self._places(*ends) for ends in (x, y))
        rows, columns = np.repeat(down, len(across)), np.tile(across, len(down))
        return Discs(columns, rows, np.full(len(rows), self.diameter / 2))

    def _places(self, low: float, high: float) -> Array:
        first = math.ceil((low - self.diameter / 2) / self.spacing)
        last = math.floor((high + self.diameter / 2) / self.spacing)
        return np.arange(first, last + 1) * self.spacing
