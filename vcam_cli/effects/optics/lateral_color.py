"""Lateral color: the lens magnifies by wavelength.

    x' = (1 + m(wavelength)) x

The image is warped at several wavelengths and interpolated linearly between them; the tolerance
sets their number (`image_formation.warps`).
"""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.color_errors import WavelengthTable
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.traced import traced_view
from vcam_cli.effects.warps import Magnification
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class LateralColor(Magnification):
    """The change of magnification by wavelength."""

    table: WavelengthTable
    corner: float
    """Distance of the array's corner from the axis [m]."""
    pitch: float
    """From one pixel to the next, the larger of both [m]."""

    name = "lateral_color"
    reference = "lateral chromatic aberration: Born and Wolf, Principles of Optics, 7th ed., 4.7.3"
    absent = "optics.lateral_color has the value none"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> LateralColor | None:
        """Return the lateral color of a camera's lens, or None where it has none."""
        table = camera.optics.lateral_color
        corner = float(np.hypot(geometry.sensor_width, geometry.sensor_height)) / 2
        if view := traced_view(camera, geometry.object_distance):
            from vcam_cli.camera.derived.prescription import lateral_color as traced_lateral_color

            band = camera.scene.wavelengths
            table = traced_lateral_color(view, corner, band.start, band.stop)
        if not camera.optics.is_lens or table is None or not any(v for _, v in table.points):
            return None
        return cls(table, corner, max(geometry.pitch_x, geometry.pitch_y))

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        values = [value for _, value in self.table.points]
        low, high = min(values), max(values)
        pixels = (high - low) * self.corner / self.pitch
        return (
            f"magnification changes by {100 * low:.3g} to {100 * high:.3g} %: colors lie up to"
            f" {pixels:.3g} pixels apart in the corner"
        )

    @property
    def knots(self) -> tuple[float, ...]:
        """Wavelengths of the table [m]."""
        return tuple(self.table.knots.tolist())

    def factor(self, wavelength: float) -> float:
        """Return the magnification at a wavelength [m], over that of a lens without the table."""
        return 1 + float(self.table.at(wavelength))

    def displacements(self, wavelengths: Array) -> Array:
        """Return how far it displaces what the sensor sees, at most: (J,) [m]."""
        change = np.abs(self.table.at(wavelengths))
        return np.asarray(self.corner * change / (1 - change))
