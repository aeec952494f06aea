"""Electrons that heat makes."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.effects.base import Charge
from vcam_cli.errors import bad
from vcam_cli.physics import readout

MOST_DOUBLINGS = 60
"""The rule of a doubling every few kelvin holds over some tens of them, not over hundreds."""


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
        doublings = (camera.pixel.temperature - density.temperature) / density.doubling
        if abs(doublings) > MOST_DOUBLINGS:
            raise bad(
                "pixel.photodetector.dark_current_density",
                f"from {density.temperature:g} K to {camera.pixel.temperature:g} K it doubles"
                f" {doublings:.3g} times",
                "give it at a temperature nearer to the pixel's, or another doubling",
            )
        value *= 2**doublings
    return value * geometry.detector_area / readout.ELEMENTARY_CHARGE * pd.dark_current_scale
