"""Light and dark current arrive one by one."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.effects.base import Draw
from vcam_cli.physics import noise


@dataclass(frozen=True)
class ShotNoise(Draw):
    """Poisson statistics of the collected electrons."""

    model: str = "exact"

    name = "shot_noise"
    reference = "Chen 2003, eq 2.26: variance = number of electrons collected"
    absent = "every pixel has it"
    seconds_per_pixel = 20e-9
    scope = "frame"
    in_samples = "accumulates"

    @classmethod
    def of(cls, camera, geometry):
        return cls(camera.accuracy.knobs.get("shot_noise", "exact"))

    def describe(self) -> str:
        return "variance equal to the number of electrons collected"

    def apply(self, electrons, site):
        z = site.normal(self.name)
        if self.model == "gaussian":
            return noise.gaussian_shot(electrons, z)
        return noise.poisson_from_normal(electrons, z)

    def variance(self, mean, dark=0.0):
        return mean
