"""A measurement file: what was measured, and under which conditions."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli import units
from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.config.lists import check_list, read_items
from vcam_cli.config.model import FileModel, Model, at_most_one, key
from vcam_cli.config.quantities import Number, Percentage, Quantity
from vcam_cli.config.validation_messages import describe, fault, refusal
from vcam_cli.config.values import TIME, Either, MaybeSiliconTemperature, Text, Word, mapping
from vcam_cli.config.yaml_type import YamlType, to_yaml
from vcam_cli.records import dataclass
from vcam_cli.verification.frame_sets import PATTERNS, FrameSet, Levels, MeasuredLens, MeasuredPixel
from vcam_cli.verification.light import Light

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


def _is_lit(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Require a level with light, and none without."""
    levels = [name for name in ("irradiance", "photons") if name in given]
    dark = given.get("light", "none") == "none"
    if dark and levels:
        message = "dark frames have no light level"
        yield fault((levels[0],), message, "add light: {monochromatic: 532 nm}", given[levels[0]])
    if not dark and not levels:
        remedy = "add irradiance: 0.12 W/m2, or photons: 4500"
        yield fault((), "the amount of light is missing", remedy)


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
        "light on the sensor: a lamp in the form of scene.illuminant, with filters; or none",
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
    temperature: MaybeSiliconTemperature = key(
        "of the sensor; default the camera's", example="310 K", default=None
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


def _entries(given: Any) -> tuple[Point | FrameSet, ...]:
    check_list(given, "[{signal: 0.42 V, exposure: 30 ms}]", 1, "a list of measured points")
    return tuple(read_items(enumerate(given), _entry))


def _entry(given: Any) -> Point | FrameSet:
    of_frames = isinstance(given, FrameSet) or (isinstance(given, Mapping) and "files" in given)
    return FrameSet.model_validate(given) if of_frames else Point.model_validate(given)


class Measurement(FileModel):
    """Measurements of one sensor."""

    kind: Literal["measurement"] = key("the kind of file", example="measurement")
    name: Word = key(
        "name of the measurement and of its output folder; default the file's",
        example="my-sensor",
        default="measurement",
    )
    frames: Annotated[
        tuple[Point | FrameSet, ...],
        Either(_entries, list[Point | FrameSet], yaml_form=to_yaml),
    ] = key(
        "measurements, one entry per condition: a mean signal, or files of raw frames",
        example=[{"signal": "0.42 V", "exposure": "30 ms"}],
    )
    levels: Annotated[Levels | None, mapping(Levels)] = key(
        "codes of the frames; needed for files", example={"bits": 12}, default=None
    )
    pixel: Annotated[MeasuredPixel | None, mapping(MeasuredPixel)] = key(
        "pixels of the frames; needed for files", example={"width": "3.45 um"}, default=None
    )
    optics: Annotated[MeasuredLens | None, mapping(MeasuredLens)] = key(
        "the lens before the sensor in frames of an edge; fit then writes a camera with that lens",
        example={"f_number": 2.8, "focal_length": "16 mm"},
        default=None,
    )
    pattern: PATTERNS = key("color filter array of the frames", default="monochrome")
    hold_out: Annotated[float, Percentage(least=0, below=1)] = key(
        "number of frames of every entry held out from the fit, the last ones",
        example="20 %",
        default=0.0,
    )
    tolerance: Annotated[float | None, Percentage(above=0, most=1)] = key(
        "largest allowed error of a prediction; default: no limit", example="8 %", default=None
    )
    noise_tolerance: Annotated[float | None, Percentage(above=0, most=10)] = key(
        "largest error of a prediction of variances, spectra and tails of frames; default none",
        example="20 %",
        default=None,
    )
    source: Text = key("where the numbers come from", example="bench of ...", default="")

    @property
    def readout(self) -> str:
        """The readout that the frames are of; "" for the only one, or for merged codes."""
        return self.levels.readout if self.levels else ""

    @property
    def points(self) -> tuple[Point, ...]:
        """The entries that are mean signals."""
        return tuple(entry for entry in self.frames if isinstance(entry, Point))

    @property
    def frame_sets(self) -> tuple[FrameSet, ...]:
        """The entries that are files of raw frames."""
        return tuple(entry for entry in self.frames if isinstance(entry, FrameSet))

    def label(self, number: int) -> str:
        """Return the name of an entry, or its number from 1."""
        return self.frames[number].name or str(number + 1)
