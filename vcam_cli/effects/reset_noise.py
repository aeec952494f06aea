"""Charge that the reset leaves uncertain."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.camera.electrical import electrical
from vcam_cli.effects.base import Draw
from vcam_cli.physics import readout


@dataclass(frozen=True)
class ResetNoise(Draw):
    """Thermal noise of the reset photodiode, or a stated number [electrons rms]."""

    electrons: float

    name = "reset_noise"
    reference = "Chen 2003, section 2.2.3: kTC, sigma^2 = kTC/q^2"
    absent = "the file says pixel.readout.reset_noise: none"
    seconds_per_pixel = 9e-9
    scope = "frame"

    @classmethod
    def of(cls, camera, geometry):
        given = camera.pixel.readout.reset_noise
        if given == "none" or given == 0:
            return None
        if given != "ktc":
            return cls(float(given))
        capacitance = electrical(camera).capacitance
        variance = readout.reset_noise_variance(capacitance, camera.pixel.temperature)
        return cls(float(variance) ** 0.5)

    def describe(self) -> str:
        return f"{self.electrons:.4g} electrons rms"

    def apply(self, electrons, site):
        z = site.normal(self.name)
        z *= self.electrons
        electrons += z
        return electrons

    def variance(self, mean):
        return self.electrons**2
