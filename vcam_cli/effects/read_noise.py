"""Noise of the readout chain."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.effects.base import Draw


@dataclass(frozen=True)
class ReadNoise(Draw):
    """Input-referred noise of one readout [electrons rms]."""

    electrons: float

    name = "read_noise"
    reference = "Chen 2003, eq 2.26 (Q_r)"
    absent = "the file gives no pixel.readout.read_noise, or 0"
    seconds_per_pixel = 9e-9
    scope = "frame"

    @classmethod
    def of(cls, camera, geometry):
        sigma = camera.pixel.readout.read_noise
        return cls(sigma) if sigma > 0 else None

    def describe(self) -> str:
        return f"{self.electrons:.4g} electrons rms"

    def apply(self, electrons, site):
        z = site.normal(self.name)
        z *= self.electrons
        electrons += z
        return electrons

    def variance(self, mean):
        return self.electrons**2
