"""Lamps as a camera file writes them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any

from vcam_cli import spectra
from vcam_cli.camera.spectrum import CurveFile, CurveTable, Spectral, SpectrumSpec
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Percentage, Quantity
from vcam_cli.config.validation_messages import describe
from vcam_cli.config.values import Angle, Percent, Temperature, Wavelength, mapping
from vcam_cli.config.yaml_type import DEFINED, YamlType, to_yaml
from vcam_cli.errors import Path, bad
from vcam_cli.lamps import LAMPS
from vcam_cli.records import dataclass
from vcam_cli.spectra.spectrum import Outside

_FORMS = (
    "a CIE name such as D65, equal-energy, {blackbody: 5500 K}, {monochromatic: 550 nm}, "
    "{file: lamp.csv}, {table: {400: 0.5, 700: 1}}, or a list of one and the filters "
    "before it; with flicker: {frequency: 100 Hz, depth: 30 %} where it flickers"
)


class FlickerSpec(Model):
    """Modulation of a lamp over time, about the scene's level as the mean."""

    frequency: Annotated[float, Quantity("frequency", above=0, most=1e9)] = key(
        "of the light: twice the mains frequency for lamps of alternating current",
        example="100 Hz",
    )
    depth: Percent = key("(brightest - darkest) / (brightest + darkest)", example="30 %")
    phase: Angle = key(
        "of the light when the exposure begins: 0 deg = brightest, or a pulse's start",
        example="0 deg",
        default=0.0,
    )
    duty: Annotated[float | None, Percentage(above=0, most=1)] = key(
        "duty cycle of a pulsed lamp; by default the light is a sinusoid",
        example="50 %",
        default=None,
    )


class Lamp(Model):
    """A lamp that may flicker."""

    flicker: Annotated[FlickerSpec | None, mapping(FlickerSpec)] = key(
        "modulation of the light over time, equal at all wavelengths",
        example={"frequency": "100 Hz", "depth": "30 %"},
        default=None,
    )


class LampName(YamlType):
    """The type of a key that holds the name of a lamp."""

    forms = str

    def read(self, given: Any) -> str:
        """Return the name of a lamp that is known; raise ValueError for others."""
        if not isinstance(given, str):
            raise ValueError(f"{describe(given)} is not the name of a lamp; write for example FL2")
        spectra.illuminant(given)
        return given


class Named(Lamp):
    """A lamp by its name, with flicker."""

    lamp: Annotated[str, LampName()] = key(
        "its CIE name, or equal-energy", example="FL2", default="D65"
    )


class Blackbody(Lamp):
    """A black body."""

    blackbody: Temperature = key("its temperature", example="5500 K")


class Monochromatic(Lamp):
    """A single line."""

    monochromatic: Wavelength = key("its wavelength", example="550 nm")


class LampFile(CurveFile, Lamp):
    """The relative spectral power of a lamp, from a CSV file."""


class LampTable(CurveTable, Lamp):
    """The relative spectral power of a lamp, as a table."""


_LampForm = Named | Blackbody | Monochromatic | LampFile | LampTable
_FORM_MODELS: dict[str, type[_LampForm]] = {
    "lamp": Named,
    "blackbody": Blackbody,
    "monochromatic": Monochromatic,
    "file": LampFile,
    "table": LampTable,
}


_GLASS = Spectral(most=1.0)


@dataclass(frozen=True)
class IlluminantSpec:
    """A lamp: a name, or one of the forms above."""

    lamp: str | _LampForm
    filters: tuple[SpectrumSpec, ...] = ()
    """What its light goes through; a stated level is that behind them."""
    outside: Outside = "error"
    """What holds beyond a file that does not say it."""

    def resolve(self, path: Path = ()) -> spectra.Spectrum:
        """Return its relative spectral power. Raises BadInput, at `path`."""
        return self._resolve_lamp(path).multiply(*(glass.resolve(path) for glass in self.filters))

    def _resolve_lamp(self, path: Path) -> spectra.Spectrum:
        lamp = self.steady.lamp
        try:
            if isinstance(lamp, str):
                return spectra.illuminant(lamp)
            if isinstance(lamp, Blackbody):
                return spectra.Spectrum.blackbody(lamp.blackbody)
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            raise bad(path, message, remedy or f"write {_FORMS}") from None
        if isinstance(lamp, Monochromatic):
            return spectra.Spectrum.line(lamp.monochromatic)
        assert isinstance(lamp, LampFile | LampTable)
        return lamp.resolve(path, self.outside)

    @property
    def flicker(self) -> FlickerSpec | None:
        """How the lamp flickers; None for steady light."""
        return None if isinstance(self.lamp, str) else self.lamp.flicker

    @property
    def steady(self) -> "IlluminantSpec":
        """The same lamp without its flicker."""
        if isinstance(self.lamp, str):
            return self
        if isinstance(self.lamp, Named):
            return replace(self, lamp=self.lamp.lamp)
        return replace(self, lamp=self.lamp.model_copy(update={"flicker": None}))

    @property
    def line(self) -> float | None:
        """Wavelength of a monochromatic lamp [m]."""
        return self.lamp.monochromatic if isinstance(self.lamp, Monochromatic) else None

    @property
    def is_measured(self) -> bool:
        """Whether it is a file, which may have units."""
        return isinstance(self.lamp, LampFile)

    def with_outside(self, outside: Outside) -> "IlluminantSpec":
        """Return the same, where `outside` holds beyond the files that do not say it."""
        filters = tuple(glass.with_outside(outside) for glass in self.filters)
        return replace(self, filters=filters, outside=outside)

    def to_yaml(self) -> Any:
        """Return the YAML form."""
        lamp = to_yaml(self.lamp)
        return [lamp, *(glass.to_yaml() for glass in self.filters)] if self.filters else lamp


class Illuminant(YamlType):
    """The type of a key that holds a lamp."""

    forms = _LampForm

    def read(self, given: Any) -> IlluminantSpec:
        """Return the lamp of what is written in YAML; raise ValueError with a sentence."""
        if isinstance(given, IlluminantSpec):
            return given
        if isinstance(given, str):
            spectra.illuminant(given)  # ValueError for an unknown name
            return IlluminantSpec(given)
        if isinstance(given, (list, tuple)) and given:
            alone = self.read(given[0])
            return IlluminantSpec(alone.lamp, tuple(_GLASS.read(glass) for glass in given[1:]))
        if isinstance(given, Mapping):
            models = [model for name, model in _FORM_MODELS.items() if name in given]
            if not models and "flicker" in given:
                models = [Named]
            if len(models) == 1:
                return IlluminantSpec(models[0].model_validate(given))
        raise ValueError(f"{describe(given)} is not a lamp; write {_FORMS}")

    def write(self, value: IlluminantSpec | None) -> Any:
        """Return the YAML form; None for a scene that has no lamp."""
        return None if value is None else value.to_yaml()

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the definition of a lamp."""
        known = [{"const": name, "description": f"{said}."} for name, said in LAMPS.items()]
        named = {"type": "string", "examples": list(spectra.illuminant_names())}
        return {
            DEFINED: {
                "name": "illuminant",
                "description": f"A lamp: {_FORMS}.",
                "examples": ["D65", {"blackbody": "5500 K"}],
            },
            "anyOf": [*known, named, *forms["anyOf"], {"type": "array", "minItems": 1}],
        }
