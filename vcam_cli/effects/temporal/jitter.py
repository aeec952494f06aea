"""Pointing jitter of the camera, fast relative to the exposure: a Gaussian blur.

    H(f) = exp(-2 pi^2 sigma^2 f^2)

sigma is the rms displacement of the image along each axis.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.blurs import RadialTransfer
from vcam_cli.records import dataclass

REACH = 4.0
"""Standard deviations within which almost all of the light stays: all but 3e-4 of it."""


@dataclass(frozen=True)
class Jitter(RadialTransfer):
    """Normally distributed pointing error, equal along both axes, fast relative to the exposure.

    It is the same in every frame and sample: slow drift from frame to frame is not simulated, nor
    how a rolling shutter turns jitter into wobble.
    """

    sigma: float
    """Rms displacement of the image along each axis [m]."""
    pitch: float
    """Of the pixels [m]."""

    name = "jitter"
    reference = (
        "Holst, Electro-Optical Imaging System Performance, 5th ed., 2008: MTF of random motion"
    )
    absent = "scene.camera_motion has no jitter"
    origin = "lens"
    largest_loss = 1.0

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the jitter of a camera's pointing, or None where it has none."""
        motion = camera.scene.camera_motion
        if motion is None or motion.jitter == 0:
            return None
        return cls(motion.jitter * geometry.pitch_x, geometry.pitch_x)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        at = float(self.otf(np.array([0.25 / self.pitch]), 550e-9)[0])
        return (
            f"{self.sigma / self.pitch:.3g} pixels rms along each axis:"
            f" MTF {100 * at:.3g} % at 0.25 cycles per pixel"
        )

    @property
    def reach(self) -> float:
        """How far it throws almost all of the light [m]."""
        return REACH * self.sigma

    def otf(self, frequency: Array, wavelength: float) -> Array:
        """Return the transfer at `frequency` [cycles/m] and `wavelength` [m]."""
        # At 1000 radians nothing is left, and the square is still a number.
        turn = np.minimum(np.abs(np.pi * self.sigma * frequency), 1e3)
        return np.asarray(np.exp(-2 * turn**2))

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or inf [cycles/m]."""
        return np.inf
