"""Reset noise (kTC): the random charge that a reset leaves.

    variance = k T C / q^2   [electrons squared]

C is the capacitance that is reset, T its temperature.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import circuit
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.physics import readout
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class ResetNoise(NoiseSource):
    """Thermal noise of the reset node, or a stated number [electrons rms].

    The architecture determines the node: the photodiode, or the bit line of a passive pixel. With
    correlated double sampling a stated noise is not simulated.
    """

    electrons: float

    name = "reset_noise"
    reference = "Chen 2003, section 2.2.3: kTC, sigma^2 = kTC/q^2"
    keys_behind_light = ("pixel.readout.reset_noise",)
    absent = (
        "pixel.readout.reset_noise has the value none or 0, or correlated double sampling"
        " removes it (aps-4t, ccd)"
    )
    seconds_per_pixel = 8e-9
    sample_draws = "common"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the noise of the reset, or None where the architecture removes it."""
        electrons = _noise(camera)
        return cls(electrons) if electrons else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.electrons:.4g} e rms"

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with the noise of a reset in it; it reuses the array [electrons]."""
        return site.add_normal(self.name, electrons, self.electrons)

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to a pixel [electrons squared]."""
        return self.electrons**2


def _noise(camera: Camera) -> float:
    """Return the noise that the reset leaves in a frame, 0 after its removal [e rms]."""
    given = camera.pixel.readout.reset_noise
    of_what = ARCHITECTURES[camera.pixel.architecture].reset_noise
    if given == "none" or of_what == "none":
        return 0.0
    if given != "ktc":
        return float(given)
    if of_what == "bit line":
        capacitance = camera.pixel.readout.bit_line_capacitance
    else:
        capacitance = circuit(camera).capacitance
    if capacitance is None:  # `electrical.check` refuses that where the file is read
        return 0.0
    variance = readout.reset_noise_variance(capacitance, camera.pixel.temperature)
    return float(float(variance) ** 0.5)
