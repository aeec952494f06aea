"""Charge that the reset leaves uncertain.

    variance = k T C / q^2   [electrons squared]

C is the capacitance that is reset, T its temperature.
"""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.camera.derived.dark_noise import reset_noise
from vcam_cli.camera.derived.electrical import electrical
from vcam_cli.effects.signal_chain import NoiseSource


@dataclass(frozen=True)
class ResetNoise(NoiseSource):
    """Thermal noise of what is reset, or a stated number [electrons rms].

    What is reset is the architecture's: the photodiode, or the bit line of a passive pixel. Where
    correlated double sampling takes the noise away there is none, stated or not.
    """

    electrons: float

    name = "reset_noise"
    reference = "Chen 2003, section 2.2.3: kTC, sigma^2 = kTC/q^2"
    absent = (
        "pixel.readout.reset_noise is none or 0, or correlated double sampling removes it"
        " (aps-4t, ccd)"
    )
    seconds_per_pixel = 9e-9
    sample_draws = "common"

    @classmethod
    def from_camera(cls, camera, geometry):
        """Return the noise of the reset, or None where the architecture removes it."""
        electrons = reset_noise(camera, electrical(camera).capacitance)
        return cls(electrons) if electrons else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.electrons:.4g} e rms"

    def apply(self, electrons, site):
        """Return the block with the noise of a reset in it; it reuses the array [electrons]."""
        z = site.normal(self.name)
        z *= self.electrons
        electrons += z
        return electrons

    def variance(self, mean, dark=0.0):
        """Return the variance that it adds to a pixel [electrons squared]."""
        return self.electrons**2
