"""Blur by the pixel aperture: each pixel averages over the area that collects its light.

    H(f) = sinc(f_x w) sinc(f_y h),   sinc(u) = sin(pi u) / (pi u)

w and h are width and height of the area that collects the pixel's light: the photodetector, or that
of its microlens. Frequencies above the Nyquist frequency of the pitch alias.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.blurs import SeparableTransfer
from vcam_cli.effects.optics.turned_transfer import TurnedTransfer
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class PixelAperture(SeparableTransfer):
    """Rectangular sampling aperture [m]: sinc(f w) along each axis."""

    width: float
    height: float

    name = "pixel_aperture"
    reference = "Chen 2003, eq 2.23 (integral over the photodetector) and section 2.2.2"
    absent = "every pixel has one"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the aperture that collects the pixel's light."""
        return cls(geometry.collecting_width, geometry.collecting_height)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"averages over {self.width * 1e6:.4g} x {self.height * 1e6:.4g} um"

    def seen_by_turned(self, angle: float) -> TurnedTransfer:
        """Return the aperture as a scene meets it that is turned clockwise by an angle [rad]."""
        return TurnedTransfer(self, angle)

    @property
    def box(self) -> tuple[float, float]:
        """Width and height of the area that it averages over evenly [m]."""
        return self.width, self.height

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|): the rms distance from the center [m]."""
        return np.full(len(wavelengths), np.hypot(self.width, self.height) / np.sqrt(12))

    def along_x(self, frequency: Array) -> Array:
        """Return the transfer along x at `frequency` [cycles/m]."""
        return np.sinc(frequency * self.width)

    def along_y(self, frequency: Array) -> Array:
        """Return the transfer along y at `frequency` [cycles/m]."""
        return np.sinc(frequency * self.height)
