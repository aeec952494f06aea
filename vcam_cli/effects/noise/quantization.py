"""The ADC, linear or logarithmic, and the curve of the readout in front of it.

    dn = clip(round(offset + electrons / electrons_per_dn), 0, 2^bits - 1)

A logarithmic ADC takes the logarithm of 1 + electrons / bend in place of the electrons.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.transfer_curve import Curve
from vcam_cli.effects.noise.companding import CompandedQuantization
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.effects.signal_chain import Quantizer
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Quantization(Quantizer):
    """Linear ADC: dn = clip(round(offset + electrons / electrons_per_dn), 0, 2^bits - 1)."""

    offset: float
    electrons_per_dn: float
    bits: int

    name = "quantization"
    reference = "Chen 2003, section 2.3.4"
    keys_behind_light = ("adc",)
    absent = "every camera has it"
    seconds_per_pixel = 0.75e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Quantizer:
        """Return the camera's ADC with the curve of the readout, and with companding behind it."""
        found = cls.uncompanded(camera)
        companding = camera.adc.companding
        return found if companding is None else CompandedQuantization(found, companding.knees)

    @classmethod
    def uncompanded(cls, camera: Camera) -> Quantizer:
        """Return the camera's ADC, linear or logarithmic, with the readout's curve.

        Parameters
        ----------
        camera : Camera
            Camera as its file describes it.

        Returns
        -------
        Quantizer
            The ADC, without companding of its codes.

        Raises
        ------
        BadInput
            Where the circuit has no solution.
        """
        e = electrical(camera)
        if e.curve is not None and e.reference is None:
            return CurvedQuantization(e.curve, e.offset, e.full_scale / e.analog_gain, e.bits)
        if e.reference is None:
            return cls(e.offset, e.electrons_per_dn, e.bits)
        volts_per_electron = e.conversion_gain * e.analog_gain
        bend, full = e.reference / volts_per_electron, e.full_scale / volts_per_electron
        return LogarithmicQuantization(e.offset, bend, full, e.bits)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{self.electrons_per_dn:.4g} e per step, {2**self.bits} codes"

    @property
    def line(self) -> tuple[float, float]:
        """Slope [DN/e] and offset [DN]."""
        return 1 / self.electrons_per_dn, self.offset

    def response(self, electrons: Array) -> Array:
        """Return the codes before rounding and clipping [DN]."""
        return electrons * (1 / self.electrons_per_dn) + self.offset

    def moved(self, electrons: Array, codes: Array) -> Array:
        """Return the signal whose response differs by codes [DN] from another's [electrons]."""
        codes *= codes.dtype.type(self.electrons_per_dn)
        electrons += codes
        return electrons

    def apply(self, electrons: Array) -> Array:
        """Return the codes of `electrons`, rounded and clipped [DN]."""
        code = electrons * electrons.dtype.type(1 / self.electrons_per_dn)
        code += electrons.dtype.type(self.offset)
        return _round_and_clip(code, self.bits)


@dataclass(frozen=True)
class LogarithmicQuantization(Quantizer):
    """Logarithmic ADC: equal ratios of light are equal steps, far above `bend`.

    dn = clip(round(offset + span ln(1 + electrons / bend) / ln(1 + full / bend)), 0, 2^bits - 1),
    span = 2^bits - 1 - offset.

    Noise makes signals of less than nothing: down to -bend the formula holds and gives codes below
    the offset; from there on, where it has no value, the code is 0.
    """

    offset: float
    bend: float
    """Signal at which the curve turns from straight to logarithmic [electrons]."""
    full: float
    """Signal of the highest code [electrons]."""
    bits: int

    name = Quantization.name
    reference = Quantization.reference
    absent = Quantization.absent
    seconds_per_pixel = 15e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the camera's ADC where it is logarithmic, else None."""
        found = Quantization.from_camera(camera, geometry)
        return found if isinstance(found, cls) else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        step = self.bend / self._slope
        return (
            f"{step:.4g} e per step in the dark and {step * (1 + self.full / self.bend):.4g}"
            f" at full scale, {2**self.bits} codes"
        )

    @property
    def _span(self) -> float:
        return (1 << self.bits) - 1 - self.offset

    @property
    def _slope(self) -> float:
        """Codes per natural logarithm [DN]."""
        return self._span / float(np.log1p(self.full / self.bend))

    def response(self, electrons: Array) -> Array:
        """Return the codes before rounding and clipping [DN]."""
        signal = np.maximum(electrons * (1 / self.bend), -1)
        with np.errstate(divide="ignore"):  # ln(0) = -inf, which is clipped
            level = np.log1p(signal, out=signal)
        level *= self._slope
        level += self.offset
        return level

    def moved(self, electrons: Array, codes: Array) -> Array:
        """Return the signal whose response differs by codes [DN] from another's [electrons].

        Where the curve has no value it stays; no signal moves by more than the whole scale.
        """
        most = float(np.log1p(self.full / self.bend))
        codes *= 1 / self._slope
        factor = np.exp(np.clip(codes, -most, most, out=codes), out=codes)
        above = np.maximum(electrons + self.bend, 0)
        electrons += above * (factor - 1)
        return electrons

    def apply(self, electrons: Array) -> Array:
        """Return the codes of `electrons`, rounded and clipped [DN]."""
        return _round_and_clip(self.response(electrons), self.bits)

    def linear(self, dn: Array) -> Array:
        """Return what a linear ADC of the same offset and full scale has for these codes [DN]."""
        signal = np.expm1((dn - self.offset) * (1 / self._slope))
        signal *= self._span * self.bend / self.full
        signal += self.offset
        return signal


@dataclass(frozen=True)
class CurvedQuantization(Quantizer):
    """Linear ADC behind a readout whose volts are not proportional to the charge.

    dn = clip(round(offset + span v(electrons) / full_scale), 0, 2^bits - 1).
    """

    curve: Curve
    offset: float
    full_scale: float
    """Volts of the pixel at the highest code."""
    bits: int

    name = Quantization.name
    reference = "Chen 2003, section 2.4.1 and Fig 2.18"
    absent = Quantization.absent
    seconds_per_pixel = 200e-9
    on_device = False

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the camera's ADC behind a transfer curve, None where that is a line."""
        found = Quantization.from_camera(camera, geometry)
        return found if isinstance(found, cls) else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        dark = 1 / (self.curve.slope * self._codes_per_volt)
        known = ", corrected in the processing" if self.curve.corrected else ""
        return (
            f"{dark:.4g} e per step in the dark, {2**self.bits} codes; nonlinearity residual of at"
            f" most {100 * self.curve.nonlinearity:.3g} % of the output{known}"
        )

    @property
    def _codes_per_volt(self) -> float:
        return ((1 << self.bits) - 1 - self.offset) / self.full_scale

    def response(self, electrons: Array) -> Array:
        """Return the codes before rounding and clipping [DN]."""
        level = self.curve.volts_of(electrons)
        level *= self._codes_per_volt
        level += self.offset
        return level.astype(electrons.dtype)

    def moved(self, electrons: Array, codes: Array) -> Array:
        """Return the signal whose response differs by codes [DN] from another's [electrons]."""
        volts = self.curve.volts_of(electrons) + codes / self._codes_per_volt
        return self.curve.electrons_of(volts).astype(electrons.dtype)

    def apply(self, electrons: Array) -> Array:
        """Return the codes of `electrons`, rounded and clipped [DN]."""
        return _round_and_clip(self.response(electrons), self.bits)

    def linear(self, dn: Array) -> Array:
        """Return the codes [DN] of the curve's chord, where the processing takes the curve out."""
        if not self.curve.corrected:
            return dn
        signal = self.curve.electrons_of((dn - self.offset) / self._codes_per_volt)
        signal *= (2**self.bits - 1 - self.offset) / float(self.curve.electrons_of(self.full_scale))
        signal += self.offset
        return signal.astype(dn.dtype)


def _round_and_clip(level: Array, bits: int) -> Array:
    """Return the nearest codes, clipped; it overwrites its argument."""
    np.rint(level, out=level)
    return np.clip(level, 0, 2**bits - 1, out=level)
