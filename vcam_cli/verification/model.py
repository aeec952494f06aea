"""A measurement file: what was measured, and under which conditions."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli import units
from vcam_cli.camera.illuminant import Illuminant, IlluminantSpec
from vcam_cli.config.lists import check_list, read_items
from vcam_cli.config.model import FileModel, Model, at_most_one, key
from vcam_cli.config.quantities import Number, Percentage, Quantity
from vcam_cli.config.validation_messages import describe, fault, refusal
from vcam_cli.config.values import TIME, Either, Text, Word
from vcam_cli.config.yaml_type import YamlType, to_yaml

DIMENSIONS = {"volts": "voltage", "dn": "dn", "electrons": "charge"}
"""What a signal may be counted in -> its dimension."""
UNITS = {"volts": "V", "dn": "DN", "electrons": "e"}
"""The unit of each in tables."""


@dataclass(frozen=True)
class Signal:
    """A mean raw signal, dark signal and offset in it."""

    value: float
    """In the unit of `UNITS`."""
    channel: str
    """volts at the ADC, dn, or electrons: the channel of a raw frame."""


class SignalType(YamlType):
    """The type of a measured signal, told by its unit."""

    forms = Annotated[str, "0.42 V, 312.5 DN or 12 ke"]

    def read(self, given: Any) -> Signal:
        """Return the signal; raise ValueError with a sentence."""
        if isinstance(given, Signal):
            return given
        for channel, dimension in DIMENSIONS.items():
            try:
                return Signal(units.parse(given, dimension), channel)
            except ValueError:
                continue
        message = f"{describe(given)} is not a signal; write for example 0.42 V, 312.5 DN or 12 ke"
        raise ValueError(message)

    def write(self, value: Signal) -> str:
        """Return the signal with its unit."""
        return units.render(value.value, DIMENSIONS[value.channel])


class Light(Illuminant):
    """The type of the light of a measurement: a lamp, or none."""

    def read(self, given: Any) -> IlluminantSpec | None:  # type: ignore[override]
        """Return the lamp; None for none."""
        return None if given is None or given == "none" else super().read(given)

    def write(self, value: IlluminantSpec | None) -> Any:
        """Return the YAML form."""
        return "none" if value is None else value.to_yaml()

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of a lamp, or of none."""
        lamp = super().json_schema(forms)
        return {"anyOf": [{"const": "none"}, *lamp["anyOf"]]}


def _is_lit(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Require a level where there is light, and none where there is none."""
    levels = [name for name in ("irradiance", "photons") if name in given]
    dark = given.get("light", "none") == "none"
    if dark and levels:
        message = "there is no light to be measured"
        yield fault((levels[0],), message, "add light: {monochromatic: 532 nm}", given[levels[0]])
    if not dark and not levels:
        remedy = "add irradiance: 0.12 W/m2, or photons: 4500"
        yield fault((), "how much light there is, is missing", remedy)


class Point(Model):
    """A mean signal under even light."""

    name: Text = key(
        "name in the tables; default its number", example="blue, brightest", default=""
    )
    signal: Annotated[Signal, SignalType()] = key(
        "mean raw signal, with dark signal and offset in it: volts at the ADC, DN, or electrons",
        unit="V",
        example="0.42 V",
    )
    channel: Text = key(
        "color of the pixels; needed where the camera has several", example="G", default=""
    )
    exposure: Annotated[float, TIME] = key("exposure time", example="30 ms")
    light: Annotated[IlluminantSpec | None, Light()] = key(
        "the light on the sensor: a lamp as scene.illuminant has it, filters and all; or none",
        example={"monochromatic": "532 nm"},
        default=None,
    )
    irradiance: Annotated[
        float | Literal["from-file"] | None,
        Quantity("irradiance", least=0, words={"from-file": "from-file"}),
    ] = key(
        "on the sensor, over the camera's wavelengths; from-file: the light's file is in W/(m2 nm)",
        unit="W/m2",
        example="0.12 W/m2",
        default=None,
    )
    photons: Annotated[float | None, Number(least=0, example="4500")] = key(
        "on the whole area of a pixel in the exposure, in place of irradiance (EMVA 1288)",
        example=4500,
        default=None,
    )
    tolerance: Annotated[float | None, Percentage(above=0, most=1)] = key(
        "of this signal; default the measurement's", example="8 %", default=None
    )

    rules = (at_most_one("irradiance", "photons"), _is_lit)

    @model_validator(mode="after")
    def _has_a_file(self) -> Self:
        if self.irradiance == "from-file" and not (self.light and self.light.is_measured):
            message = "the light is no file"
            raise refusal(("irradiance",), message, "write light: {file: blue.csv}")
        return self


def _points(given: Any) -> tuple[Point, ...]:
    check_list(given, "[{signal: 0.42 V, exposure: 30 ms}]", 1, "a list of measured points")
    return tuple(read_items(enumerate(given), Point.model_validate))


class Measurement(FileModel):
    """What was measured of one sensor."""

    kind: Literal["measurement"] = key("the kind of file", example="measurement")
    name: Word = key(
        "name of the measurement and of its output folder; default the file's",
        example="my-sensor",
        default="measurement",
    )
    frames: Annotated[tuple[Point, ...], Either(_points, list[Point], yaml_form=to_yaml)] = key(
        "what was measured, one entry a condition",
        example=[{"signal": "0.42 V", "exposure": "30 ms"}],
    )
    tolerance: Annotated[float | None, Percentage(above=0, most=1)] = key(
        "largest error of a prediction; default none is asked for", example="8 %", default=None
    )
    source: Text = key("where the numbers come from", example="bench of ...", default="")

    def label(self, number: int) -> str:
        """Return the name of an entry, or its number from 1."""
        return self.frames[number].name or str(number + 1)
