"""Patches of widely different radiance on black cloth, and a lamp that shines into the camera.

The patches are squares, row by row from the brightest, a perfect white at the upper left, to the
darkest, each by the same factor darker than the last. The cloth is half as bright as the darkest.
The lamp is a disc in the middle above them, `lamp` times as bright as the perfect white and of the
illuminant's color. The cloth goes on beyond the frame.
"""

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import product
from vcam_cli.records import dataclass
from vcam_cli.scenes import discs
from vcam_cli.scenes.base import Chart, Frame
from vcam_cli.scenes.cells import clip_cells, overlap
from vcam_cli.scenes.closed_form import LightDisc
from vcam_cli.scenes.disc_edges import Discs

CLOTH = 0.5
"""Reflectance of the cloth over that of the darkest patch."""
HEADROOM = 0.22
"""Part of the frame's height above the patches."""
LAMP_HEIGHT = 0.11
"""Part of the frame's height between its upper edge and the lamp's center."""
LAMP_RADIUS = 0.05
"""Radius of the lamp over the frame's shorter side."""
FILL_FACTOR = 0.8
"""Side of a patch over the distance of patches."""


@dataclass(frozen=True)
class HdrPatches(Chart):
    """Patches on cloth, and a lamp above them."""

    levels: Array
    """Level of each patch (rows, columns), 0 without a patch."""
    left: Array
    """Left edges of the patches (columns,) [m]."""
    top: Array
    """Upper edges of the patches (rows,) [m]."""
    side: float
    """Side of the patches [m]."""
    cloth: float
    """Level of the cloth."""
    lamp: float
    """Level of the lamp."""
    lamp_y: float
    """Center of the lamp down from that of the array [m]."""
    radius: float
    """Radius of the lamp [m]."""

    @property
    def brightest(self) -> float:
        """Brightest light, relative to the perfect white: that of the lamp."""
        return max(1.0, self.lamp)

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the averages over the cells into `out`.

        Exact: rectangles, and the area of a circle within the cells.
        """
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
            light[down, across] += (self.lamp - self.cloth) * discs.separate_cover(
                self._disc(), *cells
            )
        self._mix_levels(light, mix, out)

    def edges(self) -> tuple[Array, Array]:
        """Return where patches start and stop, x and y [m]."""
        x, y = (np.concatenate([e, e + self.side]) for e in (self.left, self.top))
        return np.sort(x), np.sort(y)

    def discs(self, mix: Array) -> tuple[LightDisc, ...]:
        """Return the lamp."""
        height = (self.lamp - self.cloth) * np.asarray(mix)[:, 0]
        return (LightDisc(0.0, self.lamp_y, self.radius, height),)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        out = self.even_values(x, y, mix)
        is_lamp = np.add.outer((np.asarray(y) - self.lamp_y) ** 2, np.asarray(x) ** 2)
        out[:, is_lamp <= self.radius**2] = self.lamp * mix[:, :1]
        return out

    def even_values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values of cloth and patches at points."""
        columns, rows = (
            np.array([(at >= start) & (at <= start + self.side) for start in starts], float)
            for at, starts in ((x, self.left), (y, self.top))
        )
        light = self._patches(columns, rows)
        out = np.empty((len(mix), len(y), len(x)), mix.dtype)
        self._mix_levels(light, mix, out)
        return out

    def _patches(self, columns: Array, rows: Array) -> Array:
        """Return the light of cloth and patches from the parts they cover: (c, nx) and (r, ny)."""
        above = np.where(self.levels > 0, self.levels - self.cloth, 0.0)
        return product(rows.T, above @ columns) + self.cloth

    def _disc(self) -> Discs:
        return Discs(np.zeros(1), np.array([self.lamp_y]), np.array([self.radius]))

    def _mix_levels(self, light: Array, mix: Array, out: Array) -> None:
        for plane, level in zip(out, mix[:, 0], strict=True):
            np.multiply(light, level, out=plane, casting="same_kind")


def hdr_patches(patches: int, dynamic_range: float, lamp: float, frame: Frame) -> HdrPatches:
    """Return the patches as large as they fit below the lamp.

    Parameters
    ----------
    patches : int
        Number of patches, 2 or more.
    dynamic_range : float
        Light of the brightest patch over that of the darkest.
    lamp : float
        Light of the lamp, relative to white.
    frame : Frame
        Size of the frame [m].

    Returns
    -------
    HdrPatches
        The chart.
    """
    height = (1 - HEADROOM) * frame.height
    columns = max(range(1, patches + 1), key=lambda n: _pitch(n, patches, frame.width, height))
    rows = math.ceil(patches / columns)
    pitch = _pitch(columns, patches, frame.width, height)
    levels = np.zeros(rows * columns)
    levels[:patches] = dynamic_range ** (-np.arange(patches) / (patches - 1))
    middle = frame.height / 2 - height / 2
    gap = (1 - FILL_FACTOR) * pitch / 2
    return HdrPatches(
        levels=levels.reshape(rows, columns),
        left=(np.arange(columns) - columns / 2) * pitch + gap,
        top=middle + (np.arange(rows) - rows / 2) * pitch + gap,
        side=FILL_FACTOR * pitch,
        cloth=CLOTH * float(levels[:patches].min()),
        lamp=lamp,
        lamp_y=(LAMP_HEIGHT - 0.5) * frame.height,
        radius=LAMP_RADIUS * min(frame.width, frame.height),
    )


def _pitch(columns: int, patches: int, width: float, height: float) -> float:
    """Return the distance of patches that many in a row [m]."""
    return min(width / columns, height / math.ceil(patches / columns))
