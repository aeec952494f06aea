"""Electrons that heat makes."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.effects.base import Charge
from vcam_cli.physics import readout


@dataclass(frozen=True)
class DarkCurrent(Charge):
    """Mean dark current of a pixel [e/s]; its shot noise is part of `shot_noise`."""

    electrons_per_second: float

    name = "dark_current"
    reference = "Chen 2003, eq 2.26; temperature: Janesick, Scientific CCDs, 2001, section 7.1.1"
    absent = "the file gives no dark current, or 0"
    seconds_per_pixel = 0.5e-9

    @classmethod
    def of(cls, camera, geometry):
        rate = _rate(camera, geometry)
        return cls(rate) if rate > 0 else None

    def describe(self) -> str:
        return f"{self.electrons_per_second:.4g} electrons a second in every pixel"

    def rate(self) -> float:
        return self.electrons_per_second

    def mean_error(self, outlook) -> float:
        return self.electrons_per_second * outlook.time


def _rate(camera, geometry) -> float:
    """Dark current of a pixel at its temperature [e/s]."""
    pd = camera.pixel.photodetector
    if pd.dark_current is not None:
        return pd.dark_current * pd.dark_current_scale
    density = pd.dark_current_density
    if density is None:
        return 0.0
    value = density.value
    if density.temperature is not None:
        value *= 2 ** ((camera.pixel.temperature - density.temperature) / density.doubling)
    return value * geometry.detector_area / readout.ELEMENTARY_CHARGE * pd.dark_current_scale
