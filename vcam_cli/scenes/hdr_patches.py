"""Patches of widely different radiance on black cloth, and a lamp that shines into the camera.

The patches are squares, row by row from the brightest, a perfect white at the upper left, to the
darkest, each by the same factor darker than the last. The cloth is half as bright as the darkest.
The lamp is a disc in the middle above them, `lamp` times as bright as the perfect white and of the
illuminant's color. The cloth goes on beyond the frame.
"""

import math
from dataclasses import dataclass

import numpy as np

from vcam_cli.scenes import discs
from vcam_cli.scenes.base import Array, Chart, Frame, clip_cells, overlap
from vcam_cli.scenes.disc_edges import Discs

CLOTH = 0.5  # over the darkest patch
HEADROOM = 0.22  # of the frame's height, above the patches
LAMP_AT = 0.11  # of the frame's height, below its upper edge
LAMP_RADIUS = 0.05  # over the frame's shorter side
FILLED = 0.8  # side of a patch over the distance of patches


@dataclass(frozen=True)
class HdrPatches(Chart):
    """levels (rows, columns): of the patches, 0 where there is none; left (columns,), top (rows,)
    and side: of the patches; lamp: its level; lamp_y, radius: its place; lengths in m."""

    levels: Array
    left: Array
    top: Array
    side: float
    cloth: float
    lamp: float
    lamp_y: float
    radius: float

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Exact: rectangles, and the area of a circle within the cells."""
        columns, rows = (
            np.stack([overlap(edges, start, start + self.side) for start in starts])
            for edges, starts in ((x_edges, self.left), (y_edges, self.top))
        )
        light = self._patches(columns, rows)
        across, _, _ = clip_cells(x_edges, self.radius)
        down, _, _ = clip_cells(y_edges - self.lamp_y, self.radius)
        if across.stop > across.start and down.stop > down.start:
            cells = (
                edges[part.start : part.stop + 1]
                for edges, part in ((x_edges, across), (y_edges, down))
            )
            light[down, across] += (self.lamp - self.cloth) * discs.cover_of_separate(
                self._disc(), *cells
            )
        self._mixed(light, mix, out)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        x, y = np.asarray(x), np.asarray(y)
        columns, rows = (
            np.array([(at >= start) & (at <= start + self.side) for start in starts], float)
            for at, starts in ((x, self.left), (y, self.top))
        )
        light = self._patches(columns, rows)
        light[np.add.outer((y - self.lamp_y) ** 2, x**2) <= self.radius**2] = self.lamp
        out = np.empty((len(mix), len(y), len(x)), mix.dtype)
        self._mixed(light, mix, out)
        return out

    def _patches(self, columns: Array, rows: Array) -> Array:
        """Light of cloth and patches; columns (c, nx), rows (r, ny): the parts they cover."""
        above = np.where(self.levels > 0, self.levels - self.cloth, 0.0)
        return rows.T @ (above @ columns) + self.cloth

    def _disc(self) -> Discs:
        return Discs(np.zeros(1), np.array([self.lamp_y]), np.array([self.radius]))

    def _mixed(self, light: Array, mix: Array, out: Array) -> None:
        for plane, level in zip(out, mix[:, 0], strict=True):
            np.multiply(light, level, out=plane, casting="same_kind")


def hdr_patches(patches: int, dynamic_range: float, lamp: float, frame: Frame) -> HdrPatches:
    """The patches as large as they fit below the lamp."""
    height = (1 - HEADROOM) * frame.height
    columns = max(range(1, patches + 1), key=lambda n: _pitch(n, patches, frame.width, height))
    rows = math.ceil(patches / columns)
    pitch = _pitch(columns, patches, frame.width, height)
    levels = np.zeros(rows * columns)
    levels[:patches] = dynamic_range ** (-np.arange(patches) / (patches - 1))
    middle = frame.height / 2 - height / 2
    gap = (1 - FILLED) * pitch / 2
    return HdrPatches(
        levels=levels.reshape(rows, columns),
        left=(np.arange(columns) - columns / 2) * pitch + gap,
        top=middle + (np.arange(rows) - rows / 2) * pitch + gap,
        side=FILLED * pitch,
        cloth=CLOTH * float(levels[:patches].min()),
        lamp=lamp,
        lamp_y=(LAMP_AT - 0.5) * frame.height,
        radius=LAMP_RADIUS * min(frame.width, frame.height),
    )


def _pitch(columns: int, patches: int, width: float, height: float) -> float:
    """Distance of patches that many in a row [m]."""
    return min(width / columns, height / math.ceil(patches / columns))
