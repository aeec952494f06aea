"""A Siemens star: bright and dark spokes that run to the center, where their frequency has no end.

At a distance r from the center there are n / (2 pi r) spokes a meter. The edges are sharp; one
bright spoke lies along the row to the right of the center. The spokes fill the frame and go on
beyond it. Reflectances (1 - contrast) / 2 and (1 + contrast) / 2.
"""

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes import polygons
from vcam_cli.scenes.base import Chart
from vcam_cli.scenes.edge_energy import (
    EXACT,
    EdgeEnergy,
    Region,
    counted_height,
    outline_energy,
)

MEAN = 0.5
"""Mean reflectance."""


@dataclass(frozen=True)
class SiemensStar(Chart):
    """Bright and dark spokes of equal width."""

    spokes: int
    """Number of bright spokes, at least 2."""
    contrast: float
    """Michelson contrast, 0..1."""

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells into `out`.

        Exact: bright spokes are triangles that reach beyond the cells.
        """
        corner = math.hypot(abs(x_edges[[0, -1]]).max(), abs(y_edges[[0, -1]]).max())
        reach = 1.01 * corner / math.cos(math.pi / (2 * self.spokes))
        self._mix_levels(polygons.cover(self._triangles(reach), x_edges, y_edges), mix, out)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        angle = np.arctan2(np.asarray(y)[:, None], np.asarray(x)[None, :])
        out = np.empty((len(mix), len(y), len(x)), mix.dtype)
        bright = np.heaviside(np.cos(self.spokes * angle), 0.5)
        bright[np.hypot.outer(y, x) == 0.0] = 0.5
        self._mix_levels(bright, mix, out)
        return out

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the spokes' sides."""
        far = 2 * math.hypot(*np.abs(region.center) + region.size)
        angle = (np.arange(2 * self.spokes) + 0.5) * (math.pi / self.spokes)
        ends = far * np.stack([np.cos(angle), np.sin(angle)])
        dark, bright = (MEAN * (1 + s * self.contrast) * float(level[0]) for s in (-1, 1))
        height = float(counted_height(np.array(dark), np.array(bright), ceiling))
        found = outline_energy(np.zeros_like(ends), ends, height, region)
        upright = ends[
            :, np.abs(ends[0]) <= EXACT * far
        ]  # of an odd number of spokes; none is level
        line = outline_energy(np.zeros_like(upright), upright, height, region)
        return replace(found, alike=line.aligned)

    def _triangles(self, reach: float) -> polygons.Sides:
        """Return the bright spokes up to a distance [m]."""
        middle = 2 * math.pi * np.arange(self.spokes) / self.spokes
        half = math.pi / (2 * self.spokes)
        # y is down: counterclockwise as seen is toward falling angles
        first, second = middle + half, middle - half
        corners = np.zeros((self.spokes, 3, 2))
        corners[:, 1] = reach * np.stack([np.cos(first), np.sin(first)], axis=1)
        corners[:, 2] = reach * np.stack([np.cos(second), np.sin(second)], axis=1)
        return polygons.sides(corners)

    def _mix_levels(self, bright: Array, mix: Array, out: Array) -> None:
        light = (MEAN * (1 - self.contrast + 2 * self.contrast * bright)).astype(mix.dtype)
        for plane, level in zip(out, mix[:, 0], strict=True):
            np.multiply(light, level, out=plane)
