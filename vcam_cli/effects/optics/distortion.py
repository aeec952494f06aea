"""Distortion: the lens images directions to other places than a pinhole.

    x' = D(X / Z, Y / Z)     in units of the image distance

D is the lens's projection and OpenCV's model, or a table. The pixel at x' sees the light that comes
from there, through the blur at x': blur is that of the image plane. Compression does not make the
image brighter: `optics.off_axis` gives the relative illumination of each place on the sensor, with
the change of area included.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.lens_mapping import border, lens_mapping
from vcam_cli.effects.warps import StillWarp
from vcam_cli.physics.distortion import Mapping
from vcam_cli.records import dataclass

INSIDE = (0.25, 0.5, 0.75, 1.0)
"""Parts of the way to the border at which the displacement is looked at."""


@dataclass(frozen=True)
class Distortion(StillWarp):
    """Geometric distortion: the mapping from directions to places on the sensor."""

    mapping: Mapping
    geometry: Geometry

    name = "distortion"
    reference = (
        "OpenCV calibrateCamera and fisheye; Brown 1966; Kannala and Brandt 2006,"
        " doi:10.1109/TPAMI.2006.153"
    )
    absent = "optics has projection: rectilinear and distortion: none"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Distortion | None:
        """Return the distortion of a camera's lens, or None where it has none."""
        if not camera.optics.is_lens:
            return None
        mapping = lens_mapping(camera, geometry)
        return None if mapping is None else cls(mapping, geometry)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        g = self.geometry
        x, y = np.array([g.sensor_width / 2]), np.array([g.sensor_height / 2])
        ideal = np.hypot(*self.places(x, y, 0.0, 0.0))
        height = np.hypot(x, y)
        percent = float(100 * (height / ideal - 1)[0])
        pixels = float(self.displacements(np.zeros(1))[0]) / max(g.pitch_x, g.pitch_y)
        return f"{percent:+.3g} % in the corner, moves the image by up to {pixels:.3g} pixels"

    def places(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where in the image of a pinhole the places x, y look [m]."""
        scale = self.geometry.image_distance
        u, v = self.mapping.undistort(*np.broadcast_arrays(x / scale, y / scale))
        return u * scale, v * scale

    def images(
        self, x: Array, y: Array, wavelength: float, time: Array | float
    ) -> tuple[Array, Array]:
        """Return where places x, y of the image of a pinhole are imaged [m]."""
        scale = self.geometry.image_distance
        u, v = self.mapping.distort(*np.broadcast_arrays(x / scale, y / scale))
        return u * scale, v * scale

    def displacements(self, wavelengths: Array) -> Array:
        """Return how far it displaces what the sensor sees, at most: (J,) [m]."""
        return np.full(len(wavelengths), _farthest(self))


@lru_cache(maxsize=16)
def _farthest(distortion: Distortion) -> float:
    """Return the largest displacement of what an array sees, and of what lies on it [m]."""
    ends = border(distortion.geometry)
    x, y = (np.concatenate([side * part for part in INSIDE]) for side in ends)
    found = (distortion.places(x, y, 0.0, 0.0), distortion.images(x, y, 0.0, 0.0))
    return max(float(np.hypot(u - x, v - y).max()) for u, v in found)
