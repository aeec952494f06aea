"""Veiling glare: lens and housing scatter light over the whole sensor.

    E' = (1 - s) E + s mean(E)

s is the veiling glare index, the mean is that of a color over the array.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import VeilingGlare
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class StrayLight(VeilingGlare):
    """Veiling glare: E becomes (1 - s) E + s mean(E), the mean of a color over the array.

    Light from outside the picture is not simulated.
    """

    fraction: float

    name = "stray_light"
    reference = "ISO 9358:1994 (veiling glare index); Matsuda and Nitoh, Appl. Opt. 11, 1972"
    absent = "optics.stray_light is 0"
    origin = "lens"
    seconds_per_pixel = 1.5e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the veiling glare of the lens, or None where it has none."""
        fraction = camera.optics.stray_light
        return cls(fraction) if fraction > 0 else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{100 * self.fraction:.4g} % of the light, evenly over the sensor"

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        # Numbers from 0 to full signal deviate from their mean by half of it rms, at most.
        return self.fraction * signal.full_signal / 2
