"""Dark current: thermally generated electrons.

    electrons = rate T,   rate(temperature) = rate(T_0) 2^((temperature - T_0) / doubling)

T is the exposure time. The rate is the density times the photodetector's area, or the pixel's own.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.dark_current import dark_rate
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import Charge
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class DarkCurrent(Charge):
    """Mean dark current of a pixel [e/s]; its shot noise is part of `shot_noise`.

    With charge binning it is that of all binned pixels.
    """

    electrons_per_second: float
    pixels: int = 1
    """Number of pixels whose charge is counted as one."""

    name = "dark_current"
    reference = (
        "Chen 2003, eqs 2.26 and 2.31; temperature: Janesick, Scientific CCDs, 2001, section 7.1.1"
    )
    keys_behind_light = (
        "pixel.photodetector.dark_current",
        "pixel.photodetector.dark_current_density",
        "pixel.photodetector.dark_current_scale",
    )
    absent = "the photodetector has no dark current"
    seconds_per_pixel = 0.5e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the dark current at the pixel's temperature, or None where it is 0."""
        pixels = camera.array.summed_charges
        rate = dark_rate(camera) * pixels
        return cls(rate, pixels) if rate > 0 else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        where = "pixel" if self.pixels == 1 else f"group of {self.pixels} binned pixels"
        return f"{self.electrons_per_second:.4g} e/s per {where}"

    def rate(self) -> float:
        """Return the mean electrons that a pixel collects per second [e/s]."""
        return self.electrons_per_second

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return self.electrons_per_second * signal.time
