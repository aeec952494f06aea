"""Where a corrected picture takes its pixels from: the step `lens_distortion: correct`."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.lens_mapping import border, lens_mapping
from vcam_cli.physics.distortion import Mapping
from vcam_cli.records import dataclass

STEP = "lens_distortion"
WIDER = 4
"""Rows beyond those that a correction looks at, for the splines between them."""
HALVINGS = 40


@dataclass(frozen=True)
class LensCorrection:
    """A picture without the distortion of its lens, and as large as it was."""

    mapping: Mapping
    geometry: Geometry
    """Of the array, with pixels as they are shown."""

    def seen(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return where in the distorted picture is what the corrected one shows at x, y [m]."""
        scale = self.geometry.image_distance
        at_x, at_y = np.broadcast_arrays(x / (self.zoom * scale), y / (self.zoom * scale))
        u, v = self.mapping.distort(at_x, at_y)
        return u * scale, v * scale

    @cached_property
    def zoom(self) -> float:
        """Magnification, the least from 1 on with which the corrected picture has no empty rim."""
        g = self.geometry
        x, y = border(g)

        def sees_beyond(zoom: float) -> bool:
            scale = g.image_distance
            u, v = self.mapping.distort(x / (zoom * scale), y / (zoom * scale))
            across = np.abs(u).max() * scale > g.sensor_width / 2 * (1 + 1e-12)
            return bool(across or np.abs(v).max() * scale > g.sensor_height / 2 * (1 + 1e-12))

        low, high = 1.0, 1.0
        while sees_beyond(high) and high < 1e3:
            low, high = high, 2 * high
        for _ in range(HALVINGS if high > 1 else 0):
            middle = (low + high) / 2
            low, high = (middle, high) if sees_beyond(middle) else (low, middle)
        return high

    def sources(self, start: int, stop: int) -> tuple[Array, Array]:
        """Return the rows and columns of the distorted picture that rows of the corrected one show.

        Parameters
        ----------
        start, stop : int
            First row and the end.

        Returns
        -------
        rows, columns : ndarray
            Places in the picture, counted in pixels (stop - start, columns).
        """
        g = self.geometry
        x = (np.arange(g.columns) - (g.columns - 1) / 2) * g.pitch_x
        y = (np.arange(start, stop) - (g.rows - 1) / 2) * g.pitch_y
        u, v = self.seen(x[None, :], y[:, None])
        return v / g.pitch_y + (g.rows - 1) / 2, u / g.pitch_x + (g.columns - 1) / 2

    @cached_property
    def halo(self) -> int:
        """Rows above and below that a row looks at, at most."""
        rows, _ = self.sources(0, self.geometry.rows)
        moved = np.abs(rows - np.arange(self.geometry.rows)[:, None]).max()
        return math.ceil(float(moved)) + WIDER


def lens_correction(camera: Camera, geometry: Geometry) -> LensCorrection | None:
    """Return the correction that a camera's processing makes; None without one.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Geometry of its picture.
    """
    asked = any(step.name == STEP and step.value == "correct" for step in camera.processing)
    off = isinstance(camera.effects, dict) and camera.effects.get("distortion") == "off"
    if not asked or off or not camera.optics.is_lens:
        return None
    mapping = lens_mapping(camera, geometry)
    return None if mapping is None else LensCorrection(mapping, geometry)
