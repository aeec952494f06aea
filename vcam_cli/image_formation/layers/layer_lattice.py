"""Cells on which the images of layers are put one before the other, finer than the pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.scenes.layered import LayerPart

BORDER = 4
"""Pixels that the lattice goes on beyond the array, for charge that comes from there."""


@dataclass(frozen=True)
class Lattice:
    """Cells on which layers are put one before the other."""

    geometry: Geometry
    """Of the cells, as if they were pixels; or of the pixels themselves."""

    @classmethod
    def over_array(cls, g: Geometry, count: int) -> Lattice:
        """Return so many cells along each side of a pixel, over the array and its border."""
        rows, columns = g.rows + 2 * BORDER, g.columns + 2 * BORDER
        cells = _with_cells(g, rows * count, columns * count, g.pitch_x / count, g.pitch_y / count)
        return cls(cells)

    def window(self, part: LayerPart, beyond: float) -> Window:
        """Return the cells that a layer's light reaches, so far beyond its frame [m]."""
        g = self.geometry
        spans = []
        for axis, (count, pitch) in enumerate(((g.columns, g.pitch_x), (g.rows, g.pitch_y))):
            first, last = 0, count
            if part.size is not None:
                half = (part.size.width, part.size.height)[axis] / 2 + beyond
                center = part.chart.center[axis]
                first = math.floor(max((center - half) / pitch + count / 2, 0))
                last = math.ceil(min((center + half) / pitch + count / 2, count))
            spans.append(slice(first, max(first, last)))
        return Window(rows=spans[1], columns=spans[0], lattice=g)


@dataclass(frozen=True)
class Window:
    """A rectangle of a lattice."""

    rows: slice
    columns: slice
    lattice: Geometry

    @property
    def geometry(self) -> Geometry:
        """Geometry of its cells, as if they were pixels."""
        g = self.lattice
        rows, columns = self.rows.stop - self.rows.start, self.columns.stop - self.columns.start
        size = columns * g.pitch_x, rows * g.pitch_y
        return replace(g, rows=rows, columns=columns, sensor_width=size[0], sensor_height=size[1])

    @property
    def center(self) -> tuple[float, float]:
        """Its center, as its cells see it, right of and below the lattice's [m]."""
        g = self.lattice
        x = (self.columns.start + self.columns.stop - g.columns) / 2 * g.pitch_x
        y = (self.rows.start + self.rows.stop - g.rows) / 2 * g.pitch_y
        return x * g.sampling_scale, y * g.sampling_scale


def _with_cells(g: Geometry, rows: int, columns: int, width: float, height: float) -> Geometry:
    """Return a geometry of so many cells, each of which collects its own light."""
    return replace(
        g,
        rows=rows,
        columns=columns,
        pixel_width=width,
        pixel_height=height,
        pitch_x=width,
        pitch_y=height,
        sensor_width=columns * width,
        sensor_height=rows * height,
        detector_width=width,
        detector_height=height,
        detector_x=0.0,
        detector_y=0.0,
        collecting_width=width,
        collecting_height=height,
        collecting_x=0.0,
        collecting_y=0.0,
        sampling_scale=1.0,
        scene_width_on_sensor=None,
    )
