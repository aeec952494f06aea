"""Shot noise of light and dark current: independent arrivals of electrons.

    P(n) = e^(-mu) mu^n / n!,   variance = mean = mu

mu is the mean number of electrons of light and dark current together.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import switched_off
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.physics import noise
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class ShotNoise(NoiseSource):
    """Poisson statistics of the collected electrons."""

    model: str = "exact"
    coupled: float = 1.0
    """Share of its variance that a pixel shows where sense nodes couple with each other."""

    name = "shot_noise"
    reference = "Chen 2003, eq 2.26: variance = number of electrons collected"
    keys_behind_light = ("accuracy.shot_noise",)
    absent = "every pixel has it"
    seconds_per_pixel = 10e-9
    sample_draws = "cumulative"
    in_charge = True

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the shot noise in the model of the file's accuracy."""
        given = camera.pixel.crosstalk
        coupling = None if given is None else given.interpixel_capacitance
        coupled = 1.0
        if coupling is not None and not switched_off(camera, "crosstalk"):
            [(_, kernel)] = coupling.points
            coupled = sum(share**2 for row in kernel for share in row)
        return cls(camera.accuracy.knobs.get("shot_noise", "exact"), coupled)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return "variance equal to the mean signal in electrons"

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return Poisson numbers of the block's means [electrons]."""
        if self.model == "gaussian":
            return noise.gaussian_shot_noise(electrons, site.normal(self.name))
        return site.poisson(self.name, electrons)

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance of a Poisson number, its mean [electrons squared].

        Where sense nodes couple it is that of weighted numbers of pixels that are equally bright.
        """
        return mean * self.coupled
