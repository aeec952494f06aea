"""The blur of slopes of depth: a paraboloid, as wide as the disc to which a point blurs."""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.blurs import RadialTransfer
from vcam_cli.physics.aberration import paraboloid_transfer
from vcam_cli.physics.ray_spot import RaySpot
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Paraboloid(RadialTransfer):
    """What slopes of depth add to a disc, by the transfer of its gradient's potential.

    No camera has it as such: image formation puts it in place of a layer's defocus.
    """

    radius: float
    """Of the disc [m]."""

    name = "depth"
    reference = "Hopkins, Proc. R. Soc. A 231, 91, 1955, its limit by rays"
    absent = "the scene has no depth"
    origin = "lens"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return None: cameras have it by their scene alone."""
        return None

    def describe(self) -> str:
        """Return a short clause with its numbers and units."""
        return f"radius {self.radius * 1e6:.3g} um"

    @property
    def reach(self) -> float:
        """How far from its place the blur throws light [m]."""
        return self.radius

    @property
    def spot(self) -> RaySpot:
        """The paraboloid."""
        return RaySpot(self.radius, 1)

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or inf [cycles/m]."""
        return np.inf

    def otf(self, frequency: Array, wavelength: float) -> Array:
        """Return the transfer at `frequency` [cycles/m] and `wavelength` [m]."""
        return paraboloid_transfer(frequency, self.radius)
