"""An ADC whose codes are raised, so that noise in the dark keeps its lower half."""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.signal_chain import Quantizer
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class RaisedCodes(Quantizer):
    """The codes of an ADC and a pedestal, up to a highest code of their own."""

    adc: Quantizer
    pedestal: int
    """What is added to every code [DN]."""
    highest: int
    """The highest code, pedestal included [DN]."""

    name = "quantization"
    reference = "EMVA Standard 1288, release 4.0, section 6.5: no clipping in the dark"

    @property
    def highest_code(self) -> int:
        """The highest code, pedestal included [DN]."""
        return self.highest

    @property
    def on_device(self) -> bool:  # type: ignore[override]
        """Whether `apply` takes arrays of a graphics processor."""
        return self.adc.on_device

    @property
    def bits(self) -> int:  # type: ignore[override]
        """Bits of the highest code."""
        return self.highest.bit_length()

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> None:
        """Return None: no camera has it."""
        return None

    def describe(self) -> str:
        """Return a short clause with its numbers and units."""
        return f"{self.adc.describe()}, raised by {self.pedestal} DN"

    def response(self, electrons: Array) -> Array:
        """Return the codes before rounding and clipping [DN]."""
        return self.adc.response(electrons) + self.pedestal

    def apply(self, electrons: Array) -> Array:
        """Return the codes of `electrons`, rounded and clipped [DN]."""
        return np.clip(np.rint(self.response(electrons)), 0, self.highest)

    def moved(self, electrons: Array, codes: Array) -> Array:
        """Return the signal whose response differs by codes [DN] from another's [electrons]."""
        return self.adc.moved(electrons, codes)

    def linear(self, dn: Array) -> Array:
        """Return what a linear ADC has for these codes, without the pedestal [DN]."""
        return self.adc.linear(dn - self.pedestal)
