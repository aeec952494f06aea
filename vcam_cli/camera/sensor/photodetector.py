"""The photodetector: size, quantum efficiency, dark current, capacitance, junction."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from vcam_cli.camera.sensor.technology import DOUBLING, Junction
from vcam_cli.camera.spectrum import Spectral, SpectrumSpec
from vcam_cli.config.model import Model, all_or_none, at_most_one, key, needs
from vcam_cli.config.quantities import Number, Quantity
from vcam_cli.config.values import (
    Either,
    Length,
    MaybeGap,
    MaybeLength,
    MaybeSiliconTemperature,
    word_or,
)
from vcam_cli.records import dataclass
from vcam_cli.spectra.spectrum import Outside

_EFFICIENCY = Spectral(most=1.0)


@dataclass(frozen=True)
class QuantumEfficiency:
    """External QE at normal incidence."""

    given: SpectrumSpec | None
    """Spectrum of the file; None where the QE follows from the junction."""
    per_pixel: bool = False
    """Whether it is that of the pixel's area, fill factor included, and not the photodetector's."""

    def with_outside(self, outside: Outside) -> "QuantumEfficiency":
        """Return the same, where `outside` holds beyond the tables that do not say it."""
        return self if self.given is None else replace(self, given=self.given.with_outside(outside))

    def to_yaml(self) -> Any:
        """Return the YAML form."""
        if self.given is None:
            return "junction"
        return {"pixel": self.given.to_yaml()} if self.per_pixel else self.given.to_yaml()


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


class AtTemperature(Model):
    """Where the value of a dark current, or of its density, holds."""

    temperature: MaybeSiliconTemperature = key(
        "temperature of the given value; default the pixel's", example="300 K", default=None
    )
    doubling: Annotated[float | Literal["silicon"], DOUBLING] = key(
        "temperature rise that doubles it; silicon: by the band gap (8.5 K at 300 K, 3.9 K at "
        "200 K)",
        example="8 K",
        default=8.0,
    )

    rules = (needs("doubling", "temperature", "a doubling needs the temperature it starts from"),)

    def to_yaml(self) -> Any:
        """Return the YAML form: the bare value where no temperature is given."""
        form = self.model_dump(mode="json")
        return form if self.temperature is not None else form["value"]


class DarkCurrentDensity(AtTemperature):
    """Dark current density of the photodetector, at a temperature."""

    value: Annotated[float, Quantity("current_density", least=0)] = key(
        "dark current density", example="1 nA/cm2"
    )


class DarkCurrent(AtTemperature):
    """Dark current of the whole pixel, at a temperature, as data sheets print it."""

    value: Annotated[float, Quantity("rate", least=0)] = key(
        "dark current of the pixel", example="12 e/s"
    )


_RATE = Quantity("rate", least=0)
_DENSITY = Quantity("current_density", least=0, words={"junction": "junction"})


def _dark_density(given: Any) -> Any:
    if isinstance(given, (Mapping, DarkCurrentDensity)):
        return DarkCurrentDensity.model_validate(given)
    value = _DENSITY.read(given)
    return value if value == "junction" else DarkCurrentDensity(value=_DENSITY.text(value))


def _dark_current(given: Any) -> DarkCurrent:
    if isinstance(given, (Mapping, DarkCurrent)):
        return DarkCurrent.model_validate(given)
    return DarkCurrent(value=_RATE.text(_RATE.read(given)))


class ChargeDiffusion(Model):
    """Diffusion of charge in the silicon before it is collected."""

    diffusion_length: Length = key("of electrons", example="50 um")
    depletion_width: Length = key("width of the depletion region", example="1 um")
    substrate_depth: Length = key("depth of the neutral region", example="10 um")


class Photodetector(Model):
    """The photodetector of a pixel."""

    kind: Literal["ndiff-psub", "nwell-psub", "photogate", "pinned"] = key(
        "type of the photodetector", default="ndiff-psub"
    )
    fill_factor: Annotated[float | None, Number(above=0, most=1, example="0.3")] = key(
        "photodetector area / (width x height of the pixel): centered, of the pixel's shape; "
        "default the technology's layout",
        example=0.3,
        default=None,
    )
    width: MaybeLength = key("width", example="3.5 um", default=None)
    height: MaybeLength = key("height", example="3.5 um", default=None)
    x: MaybeGap = key(
        "left edge, from the pixel's left; default centered", example="1.5 um", default=None
    )
    y: MaybeGap = key(
        "upper edge, from the pixel's top; default centered", example="1.5 um", default=None
    )
    quantum_efficiency: Annotated[
        QuantumEfficiency,
        Either(_efficiency, _EFFICIENCY_FORMS, yaml_form=QuantumEfficiency.to_yaml),
    ] = key(
        "external QE of the photodetector at normal incidence: a spectrum; {pixel: spectrum} = "
        "per pixel area, fill factor included; junction = from the junction (internal; default "
        "with a technology)",
        example=0.5,
        default=QuantumEfficiency(None),
    )
    dark_current_density: Annotated[
        DarkCurrentDensity | Literal["junction"] | None,
        Either(
            _dark_density,
            Annotated[float, _DENSITY] | DarkCurrentDensity,
            yaml_form=lambda v: v.to_yaml() if isinstance(v, DarkCurrentDensity) else v,
        ),
    ] = key(
        "of the photodetector, at the pixel's temperature; or {value, temperature, doubling}; or "
        "junction; default the technology's, else none",
        example="1 nA/cm2",
        default=None,
    )
    dark_current: Annotated[
        DarkCurrent | None,
        Either(
            _dark_current,
            Annotated[float, _RATE] | DarkCurrent,
            yaml_form=lambda v: v if v is None else v.to_yaml(),
        ),
    ] = key(
        "of the whole pixel, at its temperature, in place of a density; or {value, temperature,"
        " doubling}",
        example="12 e/s",
        default=None,
    )
    dark_current_scale: Annotated[float, Number(least=0, example="1")] = key(
        "multiplies the dark current", default=1.0
    )
    capacitance: Annotated[
        float | Literal["junction"] | None,
        Quantity("capacitance", above=0, words={"junction": "junction"}),
    ] = key(
        "of the sense node, or junction (default with a technology); sets kTC noise and, by "
        "default, the conversion gain",
        example="12 fF",
        default=None,
    )
    charge_diffusion: Annotated[
        ChargeDiffusion | Literal["junction"] | None,
        word_or(ChargeDiffusion, {"none": None, "junction": "junction"}),
    ] = key(
        "lateral diffusion of charge: none, junction, or its lengths", example="none", default=None
    )
    junction: Junction = key(
        "overrides of the technology's junction (or of its well)",
        example={"depth": "0.2 um"},
        default=Junction.model_construct,
    )

    rules = (at_most_one("dark_current_density", "dark_current"), all_or_none("width", "height"))
