"""How electrons become volts and numbers: gain, swing, full well, ADC.

`circuit` solves what does not depend on the ADC's offset; an automatic offset follows from the
noise in front of the ADC, which effects know: `effects/readout_chain.py`.
"""

from __future__ import annotations

from dataclasses import fields

from vcam_cli.arrays import Array
from vcam_cli.camera.derived import sense_node
from vcam_cli.camera.derived.charge_storage import capacity
from vcam_cli.camera.derived.mosaic import BLOCKS
from vcam_cli.camera.derived.transfer_curve import PATH as CURVE
from vcam_cli.camera.derived.transfer_curve import Curve, transfer_curve
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.camera.sensor.pixel import AGREE
from vcam_cli.errors import BadInput, bad
from vcam_cli.physics import readout
from vcam_cli.records import dataclass

NOMINAL_SWING = 1.0
"""Volts of a full well where the file gives no voltage; nothing that is counted depends on it."""
LEAST_COUNT, MOST_COUNT = 1e-12, 1e12
"""Electrons of a full well and of a step of the ADC: between them double precision tells codes."""


@dataclass(frozen=True, kw_only=True)
class Circuit:
    """Readout of one pixel in front of the ADC, and the ADC's resolution."""

    conversion_gain: float
    """Voltage per electron on the sense node [V/e]."""
    voltage_swing: float
    """Voltage of the full well [V]."""
    full_well: float
    """Electrons that a pixel holds [e]."""
    capacitance: float | None
    """Capacitance of the sense node, for kTC noise [F]; None where the file gives no voltage."""
    readout_gain: float
    """Gain of the fixed readout chain."""
    exposure_gain: float
    """Gain in front of the ADC; the ADC's full scale does not depend on it."""
    bits: int
    """Resolution of the ADC."""
    curve: Curve | None = None
    """Volts over electrons at the end of the pixel; None where they are proportional."""

    @property
    def has_volts(self) -> bool:
        """Whether volts are volts; else they are parts of a nominal swing."""
        return self.capacitance is not None

    @property
    def analog_gain(self) -> float:
        """Voltage at the ADC per voltage on the sense node."""
        return self.readout_gain * self.exposure_gain

    @property
    def highest_code(self) -> int:
        """Highest ADC code [DN]."""
        return (1 << self.bits) - 1

    @property
    def output(self) -> float:
        """Voltage of a full well at the end of the pixel [V]."""
        return self.voltage_swing if self.curve is None else self.curve.volts[-1]

    @property
    def slope(self) -> float:
        """Voltage per electron in the dark at the end of the pixel [V/e]."""
        return self.conversion_gain if self.curve is None else self.curve.slope

    def volts_of(self, electrons: Array) -> Array:
        """Return the voltage at the ADC of charges [e], in their shape and float type [V]."""
        if self.curve is None:
            volts: Array = electrons * electrons.dtype.type(self.conversion_gain * self.analog_gain)
            return volts
        volts = self.curve.volts_of(electrons) * self.analog_gain
        return volts.astype(electrons.dtype)


@dataclass(frozen=True, kw_only=True)
class Electrical(Circuit):
    """Readout of one pixel, the ADC included."""

    offset: float
    """ADC code of no signal [DN]."""
    full_scale: float
    """Voltage of the highest ADC code [V]."""
    reference: float | None = None
    """Voltage at which a logarithmic ADC's curve bends [V]; None for a linear one."""
    black_steps: tuple[tuple[str, float], ...] = ()
    """Colors, and how far their black level is from `offset`, the mean of all [DN]."""
    companded: bool = False
    """Whether codes are compressed behind the ADC."""

    @property
    def linearized(self) -> bool:
        """Whether codes are made linear before the processing."""
        return (
            self.companded
            or self.reference is not None
            or (self.curve is not None and self.curve.corrected)
        )

    @property
    def electrons_per_dn(self) -> float:
        """Step of a linear ADC [e/DN]; a logarithmic one has as many from black to full scale.

        So has one behind a transfer curve that is no line.
        """
        if self.curve is not None:
            full = self.curve.electrons_of(self.full_scale / self.analog_gain)
            return float(full) / (self.highest_code - self.offset)
        return self.full_scale / (
            self.conversion_gain * self.analog_gain * (self.highest_code - self.offset)
        )

    @property
    def saturation(self) -> float:
        """Electrons at which the well or the ADC is full, whichever comes first [e]."""
        return min(self.full_well, self.adc_full_scale)

    @property
    def adc_full_scale(self) -> float:
        """Electrons from black to the highest code [e]."""
        return (self.highest_code - self.offset) * self.electrons_per_dn


def circuit(camera: CameraModel) -> Circuit:
    """Return the solved circuit of a camera: any two of gain, swing and well give the third.

    The technology fills in what the file leaves open: the capacitance and with it the gain
    (eq 2.32), then the swing (eq 2.33). A data sheet that counts in electrons and DN alone gives
    the well, and perhaps the ADC's gain, which else follows from its bits; volts are then nominal.

    Raises BadInput where all together leave it open, or the file contradicts itself.
    """
    capacitance = sense_node.capacitance(camera)
    given = camera.pixel.readout
    nominal = capacitance is None and _counts_only(camera)
    swing = given.voltage_swing
    if nominal:
        swing = NOMINAL_SWING
    elif swing is None and given.full_well is None:
        swing = _swing(camera, capacitance)
    gain, swing, well = _solve(given.conversion_gain, swing, given.full_well, capacitance)
    if capacitance is None and not nominal:
        capacitance = float(readout.sense_capacitance(gain))
    return Circuit(
        conversion_gain=gain,
        voltage_swing=swing,
        full_well=well,
        capacitance=capacitance,
        readout_gain=given.gain,
        exposure_gain=camera.exposure_gain,
        bits=camera.adc.bits,
        curve=transfer_curve(camera, swing, well),
    )


def full_scale(camera: CameraModel, found: Circuit) -> float:
    """Return the voltage of the highest code [V], unless `adc.gain` sets it from the offset."""
    given = camera.adc.full_scale
    return found.output * found.readout_gain if given is None else given


def with_offset(camera: CameraModel, found: Circuit, offset: float) -> Electrical:
    """Return the readout with the ADC, whose code of no signal is `offset` [DN].

    Raises BadInput for a well, or a step of the ADC, of more or less than can be computed.
    """
    adc, volts = camera.adc, full_scale(camera, found)
    if adc.gain is not None:
        codes = (adc.gain, adc.bits, offset)
        volts = float(readout.adc_full_scale(found.slope, found.readout_gain, *codes))
    reference = None
    if adc.kind == "logarithmic":
        reference = volts / 1000 if adc.reference is None else adc.reference
    known = {field.name: getattr(found, field.name) for field in fields(found)}
    solved = Electrical(
        **known,
        offset=offset,
        full_scale=volts,
        reference=reference,
        black_steps=tuple(adc.steps.items()),
        companded=adc.companding is not None,
    )
    _check_counts(solved)
    return solved


def _check_counts(found: Electrical) -> None:
    """Raise BadInput for a well, or a step of the ADC, of more or less than can be computed."""
    for path, what, electrons in (
        ("pixel.readout", "the full well is", found.full_well),
        ("adc", "a step of the ADC is", found.electrons_per_dn),
    ):
        if not LEAST_COUNT <= electrons <= MOST_COUNT:
            message = f"{what} {electrons:.3g} electrons"
            raise bad(path, message, "look for a wrong unit in conversion_gain, swing or gain")


def check(camera: CameraModel) -> None:
    """Raise BadInput when the readout is open, contradicts itself or lacks volts it needs."""
    pixel, adc = camera.pixel, camera.adc
    found = circuit(camera)
    with_offset(camera, found, adc.level or 0.0)  # an automatic one changes its checks by little
    if adc.steps:
        _check_black_levels(camera, found)
    if found.curve is not None and adc.kind == "logarithmic":
        message = "a logarithmic ADC has a curve of its own"
        raise bad(CURVE, message, "write transfer_curve: linear, or adc.kind: linear")
    if found.has_volts:
        return
    if found.curve is not None:
        raise no_volts(CURVE, "it", "write transfer_curve: linear")
    for name in ("full_scale", "reference"):
        if getattr(adc, name) is not None:
            raise no_volts(f"adc.{name}", "it", f"leave out {name}")
    of_photodiode = ARCHITECTURES[pixel.architecture].reset_noise == "photodiode"
    if pixel.readout.reset_noise == "ktc" and of_photodiode:
        raise no_volts("pixel.readout.reset_noise", "ktc", "give it in electrons")
    if "volts" in camera.output.raw:
        raise no_volts("output.raw", "volts", "leave volts out")


def _check_black_levels(camera: CameraModel, found: Circuit) -> None:
    """Raise BadInput for black levels by color of a sensor that has none simulated."""
    block = BLOCKS.get(str(camera.array.pattern), ())
    colors = {color for row in block for color in row}
    given = set(camera.adc.steps)
    alone = "write one offset for all pixels"
    path = "adc.offset"
    if len(colors) < 2 or (len(block), len(block[0])) != (2, 2):
        raise bad(path, "black levels by color are for mosaics of 2 x 2 pixels", alone)
    if given != colors:
        message = f"the mosaic has {', '.join(sorted(colors))}, and levels are given for"
        raise bad(path, f"{message} {', '.join(sorted(given))}", "give one for each color")
    binning = camera.array.binning
    if binning is not None and binning.count > 1:
        raise bad(path, "black levels by color are not simulated of binned pixels", alone)
    if camera.exposure.captures is not None:
        raise bad(path, "black levels by color are not simulated of several captures", alone)
    if found.curve is not None or camera.adc.kind == "logarithmic":
        raise bad(path, "black levels by color are for a linear readout", alone)
    if camera.output.dng:
        message = "raw.dng has one black level for all colors"
        raise bad("output.dng", message, "write dng: false, or one adc.offset")


def no_volts(path: str, what: str, instead: str) -> BadInput:
    """Return the error about `what` that the file requires at `path` without giving a voltage."""
    return bad(
        path,
        f"{what} needs a voltage, and the file counts in electrons and DN alone",
        f"add pixel.readout.conversion_gain: 20 uV/e, or {instead}",
    )


def _swing(camera: CameraModel, capacitance: float | None) -> float | None:
    """Return the technology's swing [V], or less where the photodetector holds less."""
    swing, gain = sense_node.voltage_swing(camera), camera.pixel.readout.conversion_gain
    if gain is None and capacitance is not None:
        gain = float(readout.conversion_gain(capacitance))
    held = capacity(camera)
    if swing is None or gain is None or held is None:
        return swing
    return min(swing, held * gain)


def _counts_only(camera: CameraModel) -> bool:
    """Return whether the file gives the well in electrons and no volts, as data sheets do."""
    given = camera.pixel.readout
    volts = given.conversion_gain is not None or given.voltage_swing is not None
    return not volts and given.full_well is not None


def _solve(
    gain: float | None, swing: float | None, well: float | None, capacitance: float | None
) -> tuple[float, float, float]:
    """Return conversion gain [V/e], swing [V] and full well [e] from the two that are known."""
    if gain is None and capacitance is not None and (swing is None or well is None):
        gain = float(readout.conversion_gain(capacitance))
    if gain is not None and swing is not None:
        if well is not None and abs(swing / gain - well) > AGREE * well:
            raise bad(
                "pixel.readout.full_well",
                f"is {well:.6g} e, but voltage_swing / conversion_gain is {swing / gain:.6g} e",
                "give two of conversion_gain, voltage_swing and full_well",
            )
        return gain, swing, swing / gain
    if gain is not None and well is not None:
        return gain, gain * well, well
    if swing is not None and well is not None:
        return swing / well, swing, well
    raise bad(
        "pixel.readout",
        "the readout is not determined",
        "give two of conversion_gain, voltage_swing and full_well"
        " (photodetector.capacitance may replace conversion_gain),"
        " or full_well alone, as data sheets do",
    )
