"""A straight edge, dark to the left and bright to the right, turned a little from the vertical.

It passes through the array's center and goes on without end. The angle is that of ISO 12233,
between the edge and the columns; a positive one turns the edge clockwise as seen (its upper end
to the right). Reflectances mean (1 - contrast) and mean (1 + contrast) with mean 1/2, so that a
contrast of 1 is black against white.
"""

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart
from vcam_cli.scenes.cells import Spans
from vcam_cli.scenes.closed_form import Profile
from vcam_cli.scenes.edge_energy import EXACT, EdgeEnergy, Region, counted_height
from vcam_cli.scenes.runs import expand_ranges

MEAN = 0.5
"""Mean reflectance."""


@dataclass(frozen=True)
class SlantedEdge(Chart):
    """A straight edge through the array's center."""

    angle: float
    """Angle between the edge and the columns [rad]."""
    contrast: float
    """Michelson contrast, 0..1."""

    @property
    def darkest(self) -> float:
        """Reflectance of the dark side."""
        return MEAN * (1 - self.contrast)

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells into `out`.

        Exact: the bright half plane's area in every cell.
        """
        x, y = (x_edges[1:] + x_edges[:-1]) / 2, (y_edges[1:] + y_edges[:-1]) / 2
        across, down = self._across
        widths = abs(across) * np.diff(x_edges), abs(down) * np.diff(y_edges)
        if across < 0.0:  # so that every row grows brighter from left to right
            x, widths, out = x[::-1], (widths[0][::-1], widths[1]), out[:, :, ::-1]
        along, offset = across * x, down * y
        reach = (widths[0].max() + widths[1].max()) / 2
        start = np.searchsorted(along, -offset - reach)
        stop = np.searchsorted(along, -offset + reach, side="right")
        row, column = expand_ranges(start, stop)
        part = half_plane_cover(offset[row] + along[column], widths[0][column], widths[1][row])
        is_bright = np.arange(len(x)) >= start[:, None]
        levels = self._mix_levels(np.arange(2.0), mix)
        for plane, edge, level in zip(out, self._mix_levels(part, mix), levels, strict=True):
            plane[:] = np.where(is_bright, level[1], level[0])
            plane[row, column] = edge

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        across, down = self._across
        distance = np.add.outer(down * np.asarray(y), across * np.asarray(x))
        return self._mix_levels(np.heaviside(distance, 0.5), mix)

    def value_ends(self, x: Spans, y: Spans, mix: Array) -> tuple[Array, Array]:
        """Return the least and the largest value in rectangles: both sides where the edge is."""
        corners = [
            np.sort(slope * np.stack(spans), axis=0)
            for slope, spans in zip(self._across[::-1], (y, x), strict=True)
        ]
        sides = [np.add.outer(down, along) > 0 for down, along in zip(*corners, strict=True)]
        ends = [self._mix_levels(side.astype(float), mix) for side in sides]
        return np.minimum(*ends), np.maximum(*ends)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the edge, as if it lay along rows or columns."""
        across, down = self._across
        far = 2 * math.hypot(*np.abs(region.center) + region.size)
        end = far * np.array([[-down], [across]])
        length = float(region.lengths_inside(-end, end)[0])
        dark, bright = (MEAN * (1 + s * self.contrast) * float(level[0]) for s in (-1, 1))
        height = float(counted_height(np.array(dark), np.array(bright), ceiling))
        energy = height * length / region.area
        return EdgeEnergy(
            aligned=energy, alike=energy if min(abs(across), abs(down)) <= EXACT else 0.0
        )

    def profile(self) -> Profile:
        """Return the two sides of the edge."""
        sides = np.array([1 - self.contrast, 1 + self.contrast])
        return Profile(self._across, np.zeros(1), MEAN * sides)

    @property
    def _across(self) -> tuple[float, float]:
        """Unit vector (x, y down) toward the bright side."""
        return math.cos(self.angle), math.sin(self.angle)

    def _mix_levels(self, bright: Array, mix: Array) -> Array:
        value = MEAN * (1.0 + self.contrast * (2.0 * bright - 1.0))
        light = value.astype(mix.dtype)
        return np.asarray(np.multiply.outer(mix[:, 0], light))


def half_plane_cover(distance: Array, width_x: Array, width_y: Array) -> Array:
    """Return the part of a rectangle that lies in a half plane.

    The part is the chance that distance + U_x + U_y > 0 for U uniform on the widths: linear while
    the border crosses two opposite sides, quadratic where it cuts a corner.

    Parameters
    ----------
    distance : ndarray
        Distance of the rectangle's center from the border [m], positive inside.
    width_x, width_y : ndarray
        Sides of the rectangle times |cos| and |sin| of the border's normal [m]. All broadcast.

    Returns
    -------
    ndarray
        Part in 0..1 [dimensionless].
    """
    large = np.maximum(width_x, width_y)
    small = np.minimum(width_x, width_y)
    away = np.abs(distance)
    linear = 0.5 + away / large
    corner = np.maximum((large + small) / 2 - away, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        cut = 1.0 - corner**2 / (2.0 * large * small)
    part = np.where(away <= (large - small) / 2, linear, np.where(corner > 0.0, cut, 1.0))
    return np.where(distance < 0.0, 1.0 - part, part)
