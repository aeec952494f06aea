"""The pixel: photodetector, readout, fixed-pattern noise, and what lies above it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import AliasChoices, model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.camera.base import Model, at_most_one, exactly_one, key, needs, together
from vcam_cli.camera.explain import failure, fault
from vcam_cli.camera.spectrum import Spectral, SpectrumSpec
from vcam_cli.camera.technology import CHOICE, Junction, TechnologyChoice
from vcam_cli.camera.values import (
    Either,
    Electrons,
    Fraction,
    Gap,
    Length,
    MaybeFraction,
    MaybeGap,
    MaybeLength,
    Number,
    Positive,
    Quantity,
    Temperature,
    Whole,
    mapping,
    word_or,
)

AGREE = 1e-3
"""Relative difference up to which redundant numbers of a file count as equal."""

_EFFICIENCY = Spectral(most=1.0)


@dataclass(frozen=True)
class QuantumEfficiency:
    """External QE at normal incidence; `given` is None where it follows from the junction."""

    given: SpectrumSpec | None
    per_pixel: bool = False
    """Of the pixel's area, fill factor included, and not of the photodetector."""

    @property
    def spectrum(self) -> SpectrumSpec:
        """The QE that the file gives. ValueError where it follows from the junction."""
        if self.given is None:
            raise ValueError("the quantum efficiency follows from the junction")
        return self.given

    def written(self) -> Any:
        """The YAML form."""
        if self.given is None:
            return "junction"
        return {"pixel": self.given.written()} if self.per_pixel else self.given.written()


class PixelEfficiency(Model):
    """QE per pixel area."""

    pixel: Annotated[SpectrumSpec, _EFFICIENCY] = key(
        "QE of the pixel's area, fill factor included: a spectrum", example=0.15
    )


def _efficiency(given: Any) -> QuantumEfficiency:
    if isinstance(given, QuantumEfficiency):
        return given
    if given == "junction":
        return QuantumEfficiency(None)
    if isinstance(given, Mapping) and "pixel" in given:
        return QuantumEfficiency(PixelEfficiency.model_validate(given).pixel, per_pixel=True)
    return QuantumEfficiency(_EFFICIENCY.read(given))


_EFFICIENCY_FORMS = Annotated[SpectrumSpec, _EFFICIENCY] | PixelEfficiency | Literal["junction"]


class DarkCurrentDensity(Model):
    """Dark current density of the photodetector, at a temperature."""

    value: Annotated[float, Quantity("current_density", least=0)] = key(
        "dark current density", unit="nA/cm2", example="1 nA/cm2"
    )
    temperature: Annotated[float | None, Quantity("temperature", above=0)] = key(
        "at which it holds; default the pixel's", unit="K", example="300 K", default=None
    )
    doubling: Annotated[float, Quantity("temperature", above=0, difference=True)] = key(
        "rise of temperature that doubles it", unit="K", example="8 K", default=8.0
    )

    rules = (needs("doubling", "temperature", "a doubling needs the temperature it starts from"),)

    def written(self) -> Any:
        """The YAML form: a bare density where no temperature is given."""
        form = self.model_dump(mode="json")
        return form if self.temperature is not None else form["value"]


_DENSITY = Quantity("current_density", least=0, words={"junction": "junction"})


def _dark_density(given: Any) -> Any:
    if isinstance(given, (Mapping, DarkCurrentDensity)):
        return DarkCurrentDensity.model_validate(given)
    value = _DENSITY.read(given)
    return value if value == "junction" else DarkCurrentDensity(value=_DENSITY.text(value))


class ChargeDiffusion(Model):
    """Diffusion of charge in the silicon before it is collected."""

    diffusion_length: Length = key("of electrons", unit="um", example="50 um")
    depletion_width: Length = key("width of the depletion region", unit="um", example="1 um")
    substrate_depth: Length = key("depth of the neutral region", unit="um", example="10 um")


class Photodetector(Model):
    """What in a pixel collects light."""

    kind: Literal["ndiff-psub", "nwell-psub", "photogate", "pinned"] = key(
        "how it is built",
        example="ndiff-psub",
        default="ndiff-psub",
        not_yet=("nwell-psub", "photogate", "pinned"),
    )
    fill_factor: Annotated[float | None, Number(above=0, most=1, example="0.3")] = key(
        "photodetector area / (width x height of the pixel): centered, of the pixel's shape",
        example=0.3,
        default=None,
    )
    width: MaybeLength = key("width", unit="um", example="3.5 um", default=None)
    height: MaybeLength = key("height", unit="um", example="3.5 um", default=None)
    x: MaybeGap = key(
        "left edge, from the pixel's left; default centered",
        unit="um",
        example="1.5 um",
        default=None,
    )
    y: MaybeGap = key(
        "upper edge, from the pixel's top; default centered",
        unit="um",
        example="1.5 um",
        default=None,
    )
    quantum_efficiency: Annotated[
        QuantumEfficiency,
        Either(_efficiency, _EFFICIENCY_FORMS, write=QuantumEfficiency.written),
    ] = key(
        "external QE of the photodetector at normal incidence: a spectrum; {pixel: spectrum} = "
        "per pixel area, fill factor included; junction = from the junction (internal)",
        example=0.5,
        default=QuantumEfficiency(None),
        not_yet=("junction",),
    )
    dark_current_density: Annotated[
        DarkCurrentDensity | Literal["junction"] | None,
        Either(
            _dark_density,
            Annotated[float, _DENSITY] | DarkCurrentDensity,
            write=lambda v: v.written() if isinstance(v, DarkCurrentDensity) else v,
        ),
    ] = key(
        "of the photodetector, at the pixel's temperature; or {value, temperature, doubling}; or "
        "junction",
        unit="nA/cm2",
        example="1 nA/cm2",
        default=None,
        not_yet=("junction",),
    )
    dark_current: Annotated[float | None, Quantity("rate", least=0)] = key(
        "of the whole pixel, in place of a density", unit="e/s", example="12 e/s", default=None
    )
    dark_current_scale: Annotated[float, Number(least=0, example="1")] = key(
        "multiplies the dark current", example=1.0, default=1.0
    )
    capacitance: Annotated[
        float | Literal["junction"] | None,
        Quantity("capacitance", above=0, words={"junction": "junction"}),
    ] = key(
        "of the sense node, or junction; sets kTC noise and, by default, the conversion gain",
        unit="fF",
        example="12 fF",
        default=None,
        not_yet=("junction",),
    )
    charge_diffusion: Annotated[
        ChargeDiffusion | Literal["junction"] | None,
        word_or(ChargeDiffusion, {"none": None, "junction": "junction"}),
    ] = key(
        "lateral diffusion of charge: none, junction, or its lengths",
        example="none",
        default=None,
        not_yet=True,
    )
    junction: Junction = key(
        "overrides of the technology's junction",
        example={"depth": "0.2 um"},
        default=Junction,
        not_yet=True,
    )

    rules = (at_most_one("dark_current_density", "dark_current"), together("width", "height"))


class ChargeTransfer(Model):
    """Transfer of charge in a CCD."""

    inefficiency: Fraction = key("charge left behind at a stage", example=3e-5, default=3e-5)
    phases: Annotated[int, Whole(least=1, most=8, example="3")] = key(
        "stages per pixel", example=3, default=3
    )


class Readout(Model):
    """From electrons to volts: two of conversion_gain, voltage_swing and full_well."""

    conversion_gain: Annotated[float | None, Quantity("conversion_gain", above=0)] = key(
        "volts per electron; default q / capacitance", unit="uV/e", example="20 uV/e", default=None
    )
    voltage_swing: Annotated[float | None, Quantity("voltage", above=0)] = key(
        "at the full well", unit="V", example="1.38 V", default=None
    )
    full_well: Annotated[float | None, Quantity("charge", above=0)] = key(
        "electrons a pixel can hold", unit="ke", example="69 ke", default=None
    )
    gain: Positive = key("analog gain (ISO)", example=1.0, default=1.0)
    read_noise: Electrons = key("temporal noise of a readout", unit="e", example="5 e", default=0.0)
    column_noise: Electrons = key(
        "temporal, one draw a column and frame", unit="e", example="0 e", default=0.0, not_yet=True
    )
    row_noise: Electrons = key(
        "temporal, one draw a row and frame", unit="e", example="0 e", default=0.0, not_yet=True
    )
    reset_noise: Annotated[
        float | Literal["ktc", "none"],
        Quantity("charge", least=0, words={"ktc": "ktc", "none": "none"}),
    ] = key(
        "ktc (from the capacitance), none, or electrons; correlated double sampling removes it",
        unit="e",
        example="ktc",
        default="none",
    )
    charge_transfer: Annotated[ChargeTransfer | None, mapping(ChargeTransfer)] = key(
        "of a ccd",
        example={"inefficiency": 3e-5, "phases": 3},
        default=None,
        not_yet=True,
    )

    @model_validator(mode="after")
    def _agree(self) -> Self:
        g, v, well = self.conversion_gain, self.voltage_swing, self.full_well
        if g is not None and v is not None and well is not None and abs(v / g / well - 1) > AGREE:
            message = f"voltage_swing / conversion_gain is {v / g:.6g} e, not {well:.6g} e"
            raise failure([fault(("full_well",), message, "give two of the three")])
        return self


class FixedPattern(Model):
    """What differs from pixel to pixel and column to column, the same in every frame."""

    offset_pixel: Electrons = key(
        "spread of the pixels' offsets (also: dsnu)",
        unit="e",
        example="2 e",
        default=0.0,
        validation_alias=AliasChoices("offset_pixel", "dsnu"),
    )
    offset_column: Electrons = key(
        "spread of the columns' offsets", unit="e", example="1 e", default=0.0
    )
    gain_pixel: Fraction = key(
        "spread of the pixels' gains (also: prnu)",
        unit="%",
        example="0.5 %",
        default=0.0,
        validation_alias=AliasChoices("gain_pixel", "prnu"),
    )
    gain_column: Fraction = key(
        "spread of the columns' gains", unit="%", example="0 %", default=0.0
    )
    dark: Fraction = key(
        "spread of the pixels' dark currents", unit="%", example="0 %", default=0.0, not_yet=True
    )

    rules = (at_most_one("offset_pixel", "dsnu"), at_most_one("gain_pixel", "prnu"))


class Defects(Model):
    """Pixels that do not work."""

    hot: Fraction = key("fraction of pixels that are hot", example=1e-4, default=0.0, not_yet=True)
    dead: Fraction = key(
        "fraction of pixels that are dead", example=1e-4, default=0.0, not_yet=True
    )


class Layer(Model):
    """A dielectric layer."""

    thickness: Gap = key("thickness", unit="um", example="0.7 um")
    index: Annotated[float, Number(least=1, most=10, example="1.46")] = key(
        "refractive index", example=1.46
    )


class Stack(Model):
    """The layers above the photodetector: a tunnel that shades it."""

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
        "optimal: shifted toward the axis to follow the chief ray",
        example="optimal",
        default="optimal",
    )

    rules = (
        exactly_one("gain", "efficiency", of="its strength", remedy="write for example gain: 1.8"),
    )


class Pixel(Model):
    """One pixel of the array."""

    architecture: Literal["aps-3t", "aps-4t", "pps", "dps", "ccd"] = key(
        "readout architecture",
        example="aps-3t",
        default="aps-3t",
        not_yet=("aps-4t", "pps", "dps", "ccd"),
    )
    technology: Annotated[TechnologyChoice | None, CHOICE] = key(
        "fills in what is not given: a name, or {from: name, ...} with changes",
        example="cmos-0.35um",
        default=None,
        not_yet=True,
    )
    width: Length = key("width of the pixel", unit="um", example="6.5 um")
    height: Annotated[float, Quantity("length", above=0)] = key(
        "height of the pixel; default its width", unit="um", example="6.5 um", default=None
    )
    gap_x: Gap = key(
        "between pixels of a row; pitch = width + gap", unit="um", example="0 um", default=0.0
    )
    gap_y: Gap = key("between pixels of a column", unit="um", example="0 um", default=0.0)
    photodetector: Photodetector = key(
        "what collects light", example={"fill_factor": 0.3, "quantum_efficiency": 0.5}
    )
    readout: Readout = key(
        "from electrons to volts",
        example={"conversion_gain": "20 uV/e", "full_well": "69 ke"},
        default=Readout,
    )
    fpn: FixedPattern = key(
        "fixed-pattern noise", example={"offset_pixel": "2 e"}, default=FixedPattern
    )
    defects: Defects = key("pixels that do not work", example={"hot": 0}, default=Defects)
    stack: Annotated[Stack | None, word_or(Stack, {"none": None})] = key(
        "layers above the photodetector, which shade it",
        example="none",
        default=None,
        not_yet=True,
    )
    microlens: Annotated[Microlens | None, word_or(Microlens, {"none": None})] = key(
        "a lens on every pixel", example="none", default=None, not_yet=True
    )
    temperature: Temperature = key("of the sensor", unit="K", example="300 K", default=300.0)

    @staticmethod
    def _complete(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
        """What a technology could have filled in."""
        if "technology" in given:
            return
        detector, readout = given.get("photodetector"), given.get("readout", {})
        if not isinstance(detector, Mapping) or not isinstance(readout, Mapping):
            return
        here = ("photodetector",)
        if not {"fill_factor", "width", "height"} & set(detector):
            message = "the photodetector's size is missing"
            yield fault(here, message, "add fill_factor: 0.3, or width and height")
        if "quantum_efficiency" not in detector:
            example = "add it, for example quantum_efficiency: 0.5"
            yield fault((*here, "quantum_efficiency"), "is missing", example)
        known = [name for name in ("voltage_swing", "full_well") if name in readout]
        if "conversion_gain" in readout or "capacitance" in detector:
            known.append("conversion_gain")
        if len(known) < 2:
            yield fault(
                ("readout",),
                "the readout is not determined: two of conversion_gain, voltage_swing and "
                "full_well are needed (photodetector.capacitance may stand for conversion_gain)",
                f"add {'conversion_gain: 20 uV/e' if known else 'two of them'}"
                if "conversion_gain" not in known
                else "add voltage_swing: 1.38 V or full_well: 69 ke",
            )

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
            raise failure([fault(where, message, "give the fill factor or the size")])
        return self

    @model_validator(mode="after")
    def _transfer(self) -> Self:
        if self.readout.charge_transfer is not None and self.architecture != "ccd":
            where = ("readout", "charge_transfer")
            message = f"an {self.architecture} pixel transfers no charge"
            raise failure([fault(where, message, "remove it, or write architecture: ccd")])
        return self


Pixel.rules = (Pixel._complete,)
