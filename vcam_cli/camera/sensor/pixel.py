"""The pixel: photodetector, readout, fixed-pattern noise, and what lies above it."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AliasChoices, model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.camera.sensor.architecture import ARCHITECTURES, article
from vcam_cli.camera.sensor.crosstalk import Crosstalk
from vcam_cli.camera.sensor.noise import (
    CorrelatedRowNoise,
    HeavyTailedNoise,
    Noise,
    NoiseTable,
    PatternShading,
    TelegraphNoise,
)
from vcam_cli.camera.sensor.phase_detection import PHASE_DETECTION, PhaseDetection
from vcam_cli.camera.sensor.photodetector import Photodetector
from vcam_cli.camera.sensor.several_readouts import GAINS, SmallPhotodiode
from vcam_cli.camera.sensor.technology import CHOICE, TechnologyChoice
from vcam_cli.camera.sensor.transfer_curve import TransferCurve
from vcam_cli.config.model import Model, at_most_one, exactly_one, key
from vcam_cli.config.quantities import Number, Percentage, Quantity, Whole
from vcam_cli.config.validation_messages import fault, refusal
from vcam_cli.config.values import (
    MOST_ELECTRONS,
    Electrons,
    FileName,
    Fraction,
    MaybeFraction,
    MaybeTime,
    Percent,
    Positive,
    SiliconTemperature,
    mapping,
    word_or,
)

Size = Annotated[float, Quantity("length", above=0, least=1e-9, most=1e-2)]
"""Of a pixel, up to that of a detector of X-rays."""
Gap = Annotated[float, Quantity("length", least=0, most=1e-3)]
"""Between pixels."""
Thickness = Annotated[float, Quantity("length", least=0, most=1e-2)]
"""Of a layer on a pixel."""
AGREE = 1e-3
"""Relative difference up to which redundant numbers of a file count as equal."""


class ChargeTransfer(Model):
    """Transfer of charge in a CCD."""

    inefficiency: Annotated[float, Number(least=0, below=1, example="3e-5")] = key(
        "charge left behind at a stage", example=3e-5, default=3e-5
    )
    phases: Annotated[int, Whole(least=1, most=8, example="3")] = key("stages per pixel", default=3)
    smear: Annotated[float, Percentage(least=0, below=1, example="0.01 %")] = key(
        "share of the light on a column that falls on charge on its way and is spread over the"
        " column: transfer time over exposure and transfer time of a frame-transfer ccd; of an"
        " interline ccd ten times the smear of data sheets, of light on a tenth of the rows",
        example="0.01 %",
        default=0.0,
    )


class Timing(Model):
    """Clocks of the readout, from which `vcam plan` computes the frame rate."""

    pixel_time: MaybeTime = key(
        "of one pixel at an output; default of a ccd: as fast as its charge transfer allows, of"
        " others none, where columns have an ADC each",
        example="25 ns",
        default=None,
    )
    row_time: MaybeTime = key(
        "row time: transfer of a row to the column circuits", example="10 us", default=None
    )
    conversion_time: Annotated[float, Quantity("time", least=0, most=1e9)] = key(
        "of the ADCs in all pixels of a dps", example="1 ms", unit="ms", default=0.0
    )
    outputs: Annotated[int, Whole(least=1, most=10_000, example="1")] = key(
        "number of parallel outputs", default=1
    )


class Readout(Model):
    """From electrons to volts: two of conversion_gain, voltage_swing and full_well.

    Or full_well alone, as data sheets count: then there are no volts, and the ADC is full with it.
    """

    conversion_gain: Annotated[float | None, Quantity("conversion_gain", above=0)] = key(
        "volts per electron; default q / capacitance", example="20 uV/e", default=None
    )
    voltage_swing: Annotated[float | None, Quantity("voltage", above=0)] = key(
        "volts at the full well", example="1.38 V", default=None
    )
    full_well: Annotated[float | None, Quantity("charge", above=0)] = key(
        "full-well capacity: signal and noise are clipped at it; default voltage_swing / "
        "conversion_gain; the saturation capacity of EMVA 1288, where the noise begins to fall,"
        " is slightly lower",
        example="69 ke",
        default=None,
    )
    transfer_curve: Annotated[TransferCurve | None, word_or(TransferCurve, {"linear": None})] = key(
        "charge to pixel output: linear, or by its capacitance and source follower",
        example="linear",
        default=None,
    )
    gain: Positive = key(
        "fixed analog gain of the readout chain; exposure.gain is the adjustable one", default=1.0
    )
    gains: Annotated[tuple[float, ...], GAINS] = key(
        "conversion gains with which every pixel is read in one exposure, times exposure.gain, and"
        " merged; channels dn (merged) and dn.gain1, dn.gain8",
        example=[1, 8],
        default=(),
    )
    merge: Literal["snr", "switch"] = key(
        "merging of several readouts: snr, by inverse variance of the unsaturated ones; or "
        "switch, the highest unsaturated gain",
        default="snr",
    )
    small: Annotated[SmallPhotodiode | None, word_or(SmallPhotodiode, {"none": None})] = key(
        "split pixel: a second, less sensitive photodiode, read, merged and written like a "
        "further gain (dn.small)",
        example={"sensitivity": "1 %", "full_well": "60 ke"},
        default=None,
    )
    read_noise: Noise = key(
        "temporal noise of one readout of a pixel, rms, in electrons of the pixel; reset noise,"
        " that of columns and rows, and the ADC's noise and rounding come on top; or a table by"
        " exposure.gain, {table: {1: 5 e, 16: 1.5 e}}: between its gains the logarithm of the noise"
        " is linear in that of the gain, beyond them the noise of the nearest holds",
        unit="e",
        example="5 e",
        default=0.0,
    )
    column_noise: Noise = key(
        "temporal, one draw a column and frame, or a table by exposure.gain as of read_noise; none"
        " in dps and ccd",
        unit="e",
        example="0 e",
        default=0.0,
    )
    row_noise: Noise = key(
        "temporal, one draw a row and frame, or a table by exposure.gain as of read_noise",
        unit="e",
        example="0 e",
        default=0.0,
    )
    heavy_tailed_noise: Annotated[
        HeavyTailedNoise | None, word_or(HeavyTailedNoise, {"none": None})
    ] = key(
        "temporal read noise with heavier tails than a normal distribution",
        example={"rms": "3 e", "shape": -0.1},
        default=None,
    )
    correlated_row_noise: Annotated[
        CorrelatedRowNoise | None, word_or(CorrelatedRowNoise, {"none": None})
    ] = key(
        "temporal row noise, correlated between neighboring rows",
        example={"rms": "1 e", "correlation": 0.9},
        default=None,
    )
    telegraph_noise: Annotated[TelegraphNoise | None, word_or(TelegraphNoise, {"none": None})] = (
        key(
            "random telegraph noise of pixels with a trap",
            example={"fraction": "2 %", "amplitude": "10 e"},
            default=None,
        )
    )
    reset_noise: Annotated[
        float | Literal["ktc", "none"],
        Quantity("charge", least=0, most=MOST_ELECTRONS, words={"ktc": "ktc", "none": "none"}),
    ] = key(
        "ktc (from the capacitance that is reset), none, or electrons; correlated double sampling "
        "removes it in aps-4t and ccd",
        unit="e",
        example="ktc",
        default="none",
    )
    bit_line_capacitance: Annotated[float | None, Quantity("capacitance", above=0)] = key(
        "of a column's bit line; its kTC is the reset noise of a pps",
        example="2000 fF",
        default=None,
    )
    charge_transfer: Annotated[ChargeTransfer | None, mapping(ChargeTransfer)] = key(
        "of a ccd; default the example's", example={"inefficiency": 3e-5, "phases": 3}, default=None
    )

    timing: Annotated[Timing | None, mapping(Timing)] = key(
        "readout clocks, used only for the frame rate of vcam plan",
        example={"row_time": "10 us"},
        default=None,
    )

    @property
    def noise_tables(self) -> dict[str, NoiseTable]:
        """The noises that are given by gain, each by its path in the camera."""
        tails = self.heavy_tailed_noise
        noises = {
            "read_noise": self.read_noise,
            "column_noise": self.column_noise,
            "row_noise": self.row_noise,
            "heavy_tailed_noise.rms": tails and tails.rms,
            "heavy_tailed_noise.scale": tails and tails.scale,
        }
        return {
            f"pixel.readout.{name}": noise
            for name, noise in noises.items()
            if isinstance(noise, NoiseTable)
        }

    @property
    def has_several(self) -> bool:
        """Whether a pixel is read more than once in an exposure."""
        return bool(self.gains) or self.small is not None

    @model_validator(mode="after")
    def _check_agreement(self) -> Self:
        if self.merge == "switch" and not self.has_several:
            message = "needs several readouts; this camera has one"
            raise refusal(("merge",), message, "add gains: [1, 8], or remove merge")
        g, v, well = self.conversion_gain, self.voltage_swing, self.full_well
        if g is not None and v is not None and well is not None and abs(v / g / well - 1) > AGREE:
            message = f"voltage_swing / conversion_gain is {v / g:.6g} e, not {well:.6g} e"
            raise refusal(("full_well",), message, "give two of the three")
        return self


_MAP = (
    "in addition to the drawn pattern; an image or NPY file of one channel, as large as the array"
    " or larger; its center is taken"
)


class FixedPattern(Model):
    """Fixed-pattern noise of pixels and columns, equal in every frame."""

    offset_pixel: Electrons = key(
        "spread of the pixels' offsets (also: dsnu)",
        example="2 e",
        default=0.0,
        validation_alias=AliasChoices("offset_pixel", "dsnu"),
    )
    offset_column: Electrons = key(
        "spread of the columns' offsets; none in dps and ccd", example="1 e", default=0.0
    )
    gain_pixel: Percent = key(
        "spread of the pixels' gains (also: prnu)",
        example="0.5 %",
        default=0.0,
        validation_alias=AliasChoices("gain_pixel", "prnu"),
    )
    gain_column: Percent = key(
        "spread of the columns' gains; none in dps and ccd", example="0 %", default=0.0
    )
    dark: Percent = key("spread of the pixels' dark currents", example="0 %", default=0.0)
    shading: Annotated[PatternShading | None, word_or(PatternShading, {"none": None})] = key(
        "low-frequency offset and gain differences over the array",
        example={"offset": "2 e", "gain": "0.5 %"},
        default=None,
    )
    offset_map: Annotated[str | None, FileName()] = key(
        f"file with the offset of every pixel in e, less the mean over the array; {_MAP}",
        example="offset.exr",
        default=None,
    )
    gain_map: Annotated[str | None, FileName()] = key(
        f"file with the gain of every pixel in any unit, over the mean; {_MAP}",
        example="gain.exr",
        default=None,
    )
    dark_map: Annotated[str | None, FileName()] = key(
        f"file with the dark current of every pixel in any unit, over the mean; {_MAP}",
        example="dark.exr",
        default=None,
    )

    rules = (at_most_one("offset_pixel", "dsnu"), at_most_one("gain_pixel", "prnu"))


class Defects(Model):
    """Pixels that do not work."""

    hot: Fraction = key(
        "fraction of pixels that read the full well at any light, or, with hot_current, have a"
        " raised dark current",
        example=1e-4,
        default=0.0,
    )
    hot_current: Annotated[float | None, Number(above=0, most=1e9, example="200")] = key(
        "dark current of hot pixels over that of the others, mean of an exponential distribution;"
        " scales with time and temperature; default: hot pixels read the full well",
        example=200,
        default=None,
    )
    dead: Fraction = key("fraction of pixels that collect nothing", example=1e-4, default=0.0)
    columns: Fraction = key(
        "fraction of columns all of whose pixels collect nothing", example=1e-3, default=0.0
    )
    rows: Fraction = key(
        "fraction of rows all of whose pixels collect nothing", example=1e-3, default=0.0
    )

    @model_validator(mode="after")
    def _check_fractions(self) -> Self:
        if self.hot + self.dead > 1:
            message = f"hot and dead pixels are {self.hot + self.dead:g} of all"
            raise refusal((), message, "give fractions that add up to at most 1")
        return self


class Layer(Model):
    """A dielectric layer."""

    thickness: Thickness = key("thickness", example="0.7 um")
    index: Annotated[float, Number(least=1, most=10, example="1.46")] = key(
        "refractive index", example=1.46
    )


class Stack(Model):
    """Layers above the photodetector, which cause pixel vignetting."""

    passivation: Layer = key("the upper layer", example={"thickness": "0.7 um", "index": 2.0})
    oxide: Layer = key("the lower layer", example={"thickness": "6 um", "index": 1.46})


class Microlens(Model):
    """A lens on every pixel; effective fill factor = min(gain x fill factor, 0.95)."""

    gain: Annotated[float | None, Number(least=1, example="1.8")] = key(
        "factor on the fill factor", example=1.8, default=None
    )
    efficiency: MaybeFraction = key(
        "effective fill factor, in place of a gain", example=0.9, default=None
    )
    shift: Literal["optimal", "centered"] = key(
        "optimal: shifted toward the axis to follow the chief ray", default="optimal"
    )

    rules = (
        exactly_one("gain", "efficiency", of="its strength", remedy="write for example gain: 1.8"),
    )


def _is_determined(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Without a technology, require the keys that it would have set."""
    if "technology" in given:
        return
    detector, readout = given.get("photodetector"), given.get("readout", {})
    if not isinstance(detector, Mapping) or not isinstance(readout, Mapping):
        return
    here = ("photodetector",)
    if not {"fill_factor", "width", "height"} & set(detector):
        message = "the photodetector's size is missing"
        remedy = "add fill_factor: 0.3 (1 for a data sheet's QE of the whole pixel)"
        yield fault(here, message, f"{remedy}, or width and height")
    if "quantum_efficiency" not in detector:
        example = "add it, for example quantum_efficiency: 0.5"
        yield fault((*here, "quantum_efficiency"), "is missing", example)
    known = [name for name in ("voltage_swing", "full_well") if name in readout]
    if "conversion_gain" in readout or "capacitance" in detector:
        known.append("conversion_gain")
    if len(known) >= 2 or known == ["full_well"]:  # then the ADC is full with it
        return
    message = (
        "the readout is not determined: two of conversion_gain, voltage_swing and full_well are "
        "needed (photodetector.capacitance may replace conversion_gain)"
    )
    remedy = "add conversion_gain: 20 uV/e" if known else "add two of them"
    if "conversion_gain" in known:
        remedy = "add voltage_swing: 1.38 V or full_well: 69 ke"
    yield fault(("readout",), message, remedy)


class Pixel(Model):
    """One pixel of the array."""

    architecture: Literal["aps-3t", "aps-4t", "pps", "dps", "ccd"] = key(
        "readout architecture", default="aps-3t"
    )
    technology: Annotated[TechnologyChoice | None, CHOICE] = key(
        "defaults of process parameters: a name, or {from: name, ...} with changes",
        example="cmos-0.35um",
        default=None,
    )
    width: Size = key("width of the pixel", example="6.5 um")
    height: Size = key("height of the pixel; default its width", example="6.5 um", default=None)
    gap_x: Gap = key("between pixels of a row; pitch = width + gap", example="0 um", default=0.0)
    gap_y: Gap = key("between pixels of a column", example="0 um", default=0.0)
    photodetector: Photodetector = key(
        "the photodetector", example={"fill_factor": 0.3, "quantum_efficiency": 0.5}
    )
    readout: Readout = key(
        "readout from electrons to volts",
        example={"conversion_gain": "20 uV/e", "full_well": "69 ke"},
        default=Readout,
    )
    fpn: FixedPattern = key(
        "fixed-pattern noise", example={"offset_pixel": "2 e"}, default=FixedPattern
    )
    defects: Defects = key(
        "pixels that do not work", example={"hot": 0}, default=Defects.model_construct
    )
    stack: Annotated[Stack | None, word_or(Stack, {"none": None})] = key(
        "layers above the photodetector, which vignette it", example="none", default=None
    )
    microlens: Annotated[Microlens | None, word_or(Microlens, {"none": None})] = key(
        "a lens on every pixel", example="none", default=None
    )
    phase_detection: Annotated[PhaseDetection | None, PHASE_DETECTION] = key(
        "phase-detection pixels: dual (each a left and a right half), or {masked: {period: [16,"
        " 16], offset: [4, 4]}}; output.phase writes their signals",
        example="dual",
        default=None,
    )
    crosstalk: Annotated[Crosstalk | None, word_or(Crosstalk, {"none": None})] = key(
        "crosstalk to neighbors", example="none", default=None
    )
    blooming: Percent = key(
        "share of the charge beyond the full well that fills neighbors along the column; a drain"
        " takes the rest",
        example="20 %",
        default=0.0,
    )
    lag: Annotated[float, Percentage(least=0, below=1, example="2 %")] = key(
        "share of a pixel's charge that is read in the next frame of a sequence",
        example="2 %",
        default=0.0,
    )
    temperature: SiliconTemperature = key(
        "sensor temperature: sets kTC noise, and scales dark current given at another temperature",
        example="300 K",
        default=300.0,
    )

    rules = (_is_determined,)

    @model_validator(mode="after")
    def _defaults(self) -> Self:
        if "height" not in self.model_fields_set:
            self._fill(height=self.width)
        return self

    @model_validator(mode="after")
    def _sizes_agree(self) -> Self:
        pd = self.photodetector
        if pd.fill_factor is None or pd.width is None or pd.height is None:
            return self
        actual = pd.width * pd.height / (self.width * self.height)
        if abs(actual / pd.fill_factor - 1) > AGREE:
            message = f"is {pd.fill_factor:g}, but width and height make it {actual:.6g}"
            where = ("photodetector", "fill_factor")
            raise refusal(where, message, "give the fill factor or the size")
        return self

    @model_validator(mode="after")
    def _readout_suits(self) -> Self:
        name, readout = self.architecture, self.readout
        kind = ARCHITECTURES[name]
        if readout.charge_transfer is not None and not kind.transfers:
            where = ("readout", "charge_transfer")
            message = f"{article(name)} {name} pixel transfers no charge"
            raise refusal(where, message, "remove it, or write architecture: ccd")
        curve = readout.transfer_curve
        if curve is not None and curve.follower is not None and name == "pps":
            path = ("readout", "transfer_curve", "follower")
            raise refusal(path, "a passive pixel has no follower", "remove it")
        of_bit_line = kind.reset_noise == "bit line" and readout.reset_noise == "ktc"
        if of_bit_line and readout.bit_line_capacitance is None:
            where = ("readout", "bit_line_capacitance")
            message = f"is missing: the reset noise of {article(name)} {name} is its bit line's"
            remedy = "add bit_line_capacitance: 2000 fF, or give reset_noise in electrons"
            raise refusal(where, message, remedy)
        if kind.transfers and readout.charge_transfer is None:
            usual = {"charge_transfer": ChargeTransfer()}
            self._fill(readout=readout.model_copy(update=usual))
        return self
