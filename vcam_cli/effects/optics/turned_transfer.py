"""A blur of the camera as a scene meets it that is turned."""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.blurs import GeometricTransfer, SeparableTransfer
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class TurnedTransfer(GeometricTransfer):
    """A separable transfer as a scene meets it that is turned by an angle."""

    still: SeparableTransfer
    angle: float
    """Turn of the scene, clockwise [rad]."""

    absent = ""
    is_symmetric = True

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the effect that it is."""
        return self.still.name

    @property
    def reference(self) -> str:  # type: ignore[override]
        """Equation and paper of the effect that is turned."""
        return self.still.reference

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> None:
        """Return nothing: it is made of another effect."""
        return

    def describe(self) -> str:
        """Return what the effect does."""
        return self.still.describe()

    @property
    def reach(self) -> float:
        """How far it throws light [m]."""
        width, height = self.still.box or (0.0, 0.0)
        return math.hypot(width, height) / 2

    def spread(self, wavelengths: Array) -> Array:
        """Return how far it displaces light, at most (J,) [m]."""
        return np.full(len(wavelengths), self.reach)

    def otf_along(self, frequency: Array, across: tuple[float, float], wavelength: float) -> Array:
        """Return the transfer (n,) of waves in one direction."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        along_x = self.still.along_x((cosine * across[0] - sine * across[1]) * frequency)
        return along_x * self.still.along_y((sine * across[0] + cosine * across[1]) * frequency)

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: (m, n)."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        x, y = fx[None, :], fy[:, None]
        along_x = self.still.along_x(cosine * x - sine * y)
        return np.asarray(along_x * self.still.along_y(sine * x + cosine * y))
