"""Noise of the ADC, behind all gains: the same in DN at any gain.

    variance = (n / K)^2   [electrons squared]

n is the noise in codes, K the codes of an electron at the exposure's gain and the signal's level.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.effects.signal_chain import NoiseSource, Quantizer, Site
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class AdcNoise(NoiseSource):
    """Normal noise of every conversion [DN rms], referred to the pixel.

    It acts behind the well, so full pixels show it.
    """

    codes: float
    """Standard deviation [DN]."""
    adc: Quantizer
    """What tells how many electrons these codes are."""

    name = "adc_noise"
    reference = "EMVA Standard 1288, release 4.0, section 2.2: noise behind the gain"
    keys_behind_light = ("adc.noise",)
    absent = "adc.noise is 0"
    seconds_per_pixel = 8e-9
    origin = "readout"
    behind_well = True

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the noise of the ADC, or None where the file gives none."""
        if not camera.adc.noise:
            return None
        return cls(camera.adc.noise, Quantization.uncompanded(camera))

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.codes:.4g} DN rms, {self.codes * self.adc.step(0.0):.4g} e in the dark"

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with the noise of one conversion in it [electrons]."""
        z = site.normal(self.name)
        z *= self.codes
        return self.adc.moved(electrons, z)

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to a pixel [electrons squared]."""
        return (self.codes * self.adc.step(mean)) ** 2
