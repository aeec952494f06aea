"""The ADC."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vcam_cli.camera.electrical import electrical
from vcam_cli.effects.base import Code


@dataclass(frozen=True)
class Quantization(Code):
    """Linear ADC: dn = clip(round(offset + electrons / electrons_per_dn), 0, 2^bits - 1)."""

    offset: float
    electrons_per_dn: float
    bits: int

    name = "quantization"
    reference = "Chen 2003, section 2.3.4"
    absent = "every camera has it"
    seconds_per_pixel = 2e-9

    @classmethod
    def of(cls, camera, geometry):
        e = electrical(camera)
        return cls(e.offset, e.electrons_per_dn, e.bits)

    def describe(self) -> str:
        return f"{self.electrons_per_dn:.4g} electrons a step, {2**self.bits} codes"

    def line(self, electrons):
        return electrons * (1 / self.electrons_per_dn) + self.offset

    def apply(self, electrons):
        code = electrons * electrons.dtype.type(1 / self.electrons_per_dn)
        code += electrons.dtype.type(self.offset)
        np.rint(code, out=code)
        return np.clip(code, 0, 2**self.bits - 1, out=code)
