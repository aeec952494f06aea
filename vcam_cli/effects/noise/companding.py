"""Companding: codes of fewer bits, straight from knee to knee.

    dn = round(interpolation of the ADC's code between the knees)

A step of a segment is dx / dy codes of the ADC wide, and rounding there has the variance
(dx / dy)^2 / 12 of these.
"""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.signal_chain import Quantizer
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class CompandedQuantization(Quantizer):
    """A linear ADC whose codes are compressed and rounded once more."""

    adc: Quantizer
    knees: tuple[tuple[int, int], ...]
    """(code of the ADC, code that is written), rising, without (0, 0) [DN]."""

    name = "quantization"
    reference = "piecewise linear companding, as in data sheets of automotive sensors"
    absent = "every camera has it"
    seconds_per_pixel = 25e-9
    on_device = False

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> None:
        """Return None: it is made of the ADC of a camera (`quantization`)."""
        return None

    @property
    def bits(self) -> int:  # type: ignore[override]
        """Bits of the codes that are written."""
        return self.highest_code.bit_length()

    @property
    def highest_code(self) -> int:
        """The highest code that is written [DN]."""
        return self.knees[-1][1]

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        (below, under), (top, highest) = ((0, 0), *self.knees)[-2:]
        coarse = (top - below) / (highest - under)
        return f"{self.adc.describe()}, companded to {highest + 1} codes of up to {coarse:.3g} DN"

    def response(self, electrons: Array) -> Array:
        """Return the codes before rounding and clipping [DN]."""
        return self._between(self.adc.response(electrons), 0, 1)

    def apply(self, electrons: Array) -> Array:
        """Return the codes of `electrons`, rounded and clipped [DN]."""
        # In 64 bits: floats of 32 bits round products of codes of 24 bits.
        code = self._between(self.adc.apply(electrons).astype(np.float64), 0, 1)
        np.rint(code, out=code)
        return np.clip(code, 0, self.highest_code, out=code).astype(electrons.dtype)

    def moved(self, electrons: Array, codes: Array) -> Array:
        """Return the signal whose response differs by codes of the ADC [DN] from another's [e]."""
        return self.adc.moved(electrons, codes)

    def linear(self, dn: Array) -> Array:
        """Return the codes of the ADC that companded ones represent, in their float type [DN]."""
        kind = np.result_type(dn, np.float32)  # of whole numbers, floats
        return self._between(np.asarray(dn, np.float64), 1, 0).astype(kind)

    def _between(self, codes: Array, given: int, wanted: int) -> Array:
        """Return codes of one side of the knees on the other; the end segments go on [DN]."""
        knees = np.array(((0, 0), *self.knees), float)
        x, y = knees[:, given], knees[:, wanted]
        slopes = np.diff(y) / np.diff(x)
        segment = np.clip(np.searchsorted(x, codes, side="right") - 1, 0, len(slopes) - 1)
        found: Array = y[segment] + slopes[segment] * (codes - x[segment])
        return found.astype(codes.dtype, copy=False)
