"""How electrons become volts and numbers: gain, swing, full well, ADC, solved and checked once."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import AGREE
from vcam_cli.errors import bad
from vcam_cli.physics import readout


@dataclass(frozen=True)
class Electrical:
    """Readout of one pixel."""

    conversion_gain: float
    """[V/e]"""
    voltage_swing: float
    """[V]"""
    full_well: float
    """[electrons]"""
    capacitance: float
    """Of the sense node [F]; decides kTC noise."""
    analog_gain: float
    bits: int
    offset: float
    """ADC code of no signal [DN]"""
    full_scale: float
    """Voltage of the highest ADC code [V]"""
    reference: float | None = None
    """Voltage at which a logarithmic ADC's curve bends [V]; None for a linear one."""

    @property
    def highest_code(self) -> int:
        return 2**self.bits - 1

    @property
    def electrons_per_dn(self) -> float:
        """Of a linear ADC; a logarithmic one's codes are as many from black to full scale."""
        return self.full_scale / (
            self.conversion_gain * self.analog_gain * (self.highest_code - self.offset)
        )

    @property
    def saturation(self) -> float:
        """Electrons at which the well or the ADC is full, whichever comes first."""
        return min(self.full_well, (self.highest_code - self.offset) * self.electrons_per_dn)


def electrical(camera: Camera) -> Electrical:
    """Solves the readout of `camera` (eq 2.32; contract: any two of gain, swing and well).

    Raises BadInput where the file leaves it open or contradicts itself.
    """
    pixel, adc = camera.pixel, camera.adc
    capacitance = _number(pixel.photodetector.capacitance)
    gain, swing, well = _solve(
        pixel.readout.conversion_gain,
        pixel.readout.voltage_swing,
        pixel.readout.full_well,
        capacitance,
    )
    if adc.offset >= 2**adc.bits - 1:
        raise bad(
            "adc.offset",
            f"{adc.offset:g} DN leaves no code of the {adc.bits}-bit ADC for a signal",
            "lower the offset, or give more bits",
        )
    if adc.gain is not None:
        full_scale = float(
            readout.full_scale_of(gain, pixel.readout.gain, adc.gain, adc.bits, adc.offset)
        )
    elif adc.full_scale is not None:
        full_scale = adc.full_scale
    else:
        full_scale = swing * pixel.readout.gain
    reference = None
    if adc.kind == "logarithmic":
        reference = full_scale / 1000 if adc.reference is None else adc.reference
    return Electrical(
        conversion_gain=gain,
        voltage_swing=swing,
        full_well=well,
        capacitance=capacitance or float(readout.sense_capacitance(gain)),
        analog_gain=pixel.readout.gain,
        bits=adc.bits,
        offset=adc.offset,
        full_scale=full_scale,
        reference=reference,
    )


def _number(value: float | str | None) -> float | None:
    """The value, where the file gives one (`junction` stands for one that is computed)."""
    return None if isinstance(value, str) else value


def check(camera: Camera) -> None:
    """Raises BadInput when the camera's readout is open or contradicts itself."""
    electrical(camera)


def _solve(
    gain: float | None, swing: float | None, well: float | None, capacitance: float | None
) -> tuple[float, float, float]:
    """Conversion gain [V/e], swing [V] and full well [e] from the two that are known."""
    if gain is None and capacitance is not None and (swing is None or well is None):
        gain = float(readout.conversion_gain(capacitance))
    if gain is not None and swing is not None and well is not None:
        if abs(swing / gain - well) > AGREE * well:
            raise bad(
                "pixel.readout.full_well",
                f"is {well:.6g} e, but voltage_swing / conversion_gain is {swing / gain:.6g} e",
                "give two of conversion_gain, voltage_swing and full_well",
            )
        return gain, swing, swing / gain
    if gain is not None and swing is not None:
        return gain, swing, swing / gain
    if gain is not None and well is not None:
        return gain, gain * well, well
    if swing is not None and well is not None:
        return swing / well, swing, well
    raise bad(
        "pixel.readout",
        "the readout is not determined",
        "give two of conversion_gain, voltage_swing and full_well"
        " (photodetector.capacitance may stand for conversion_gain)",
    )
