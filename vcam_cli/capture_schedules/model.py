"""What a study of capture schedules may say: pdf, numbers of captures, methods, sensor, frames."""

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import (
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails, core_schema

from vcam_cli.camera.exposure import rising_times, times_to_yaml
from vcam_cli.capture_schedules.pdf_source import (
    PdfSource,
    Rate,
    camera_name,
    raise_mistakes,
)
from vcam_cli.config.lists import distinct_words, list_of, words_of
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import describe, failure, fault, faults_at
from vcam_cli.config.values import Either, Electrons, Fraction, MaybeTime, Switch, Word, mapping
from vcam_cli.scheduling.density_estimators import ESTIMATORS, HISTOGRAM

RANDOM_STARTS = ("sqp", "sqp-assigned")
"""Methods that search from random starts."""
METHODS = (
    "optimal",
    "heuristic",
    "uniform",
    "exponential",
    "geometric",
    *RANDOM_STARTS,
    "weighted",
    "bracket",
)
MOST_CAPTURES = 1000

FRAME_METHODS = ("uniform", "optimal", "heuristic", "exponential", "geometric")
"""How the times of the pictures may be found."""
_TIMES_EXAMPLE = {"mine": ["5 ms", "15 ms", "30 ms", "200 ms"]}
_NAME: TypeAdapter[str] = TypeAdapter(Word)

_COUNT = Whole(least=1, most=MOST_CAPTURES, example="8")
_SEGMENTS = Whole(least=1, most=100_000, example="3")
_GAIN = Number(above=0, example="1.5")


DENSITIES = (HISTOGRAM, *ESTIMATORS)
"""Estimates of a pdf from its pixels."""
FRAME_ESTIMATORS = ("lsbs", "weighted")


class _Null:
    """YAML's null, in a JSON Schema."""

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.none_schema()

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"const": None}


_COUNTS = list_of(_COUNT.read, "[2, 4, 8]", 1, "numbers of captures")
_TARGETS = list_of(_GAIN.read, "[1.5, 1.7]", 0, "gains")
_STEPS = list_of(_SEGMENTS.read, "[1, 2, 3, 4]", 1, "numbers of segments")


def _segments(given: Any) -> tuple[int, ...]:
    """Return numbers of segments, rising; none of `null`."""
    if given is None:
        return ()
    if not isinstance(given, (list, tuple)):
        return (_SEGMENTS.read(given),)
    return tuple(sorted(_STEPS(given)))


def _densities(given: Any) -> tuple[str, ...]:
    """Return names of estimators; of one, or a list."""
    return distinct_words(given if isinstance(given, (list, tuple)) else [given], DENSITIES)


def _or_null(read: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda given: None if given is None else read(given)


class ScheduleSensor(Model):
    """Full well and noise of a pixel: equation 4.1."""

    well_capacity: Annotated[float, Quantity("charge", above=0)] = key(
        "of a pixel", unit="e", example="20000 e"
    )
    dark_current: Rate = key(
        "of a pixel, in electrons or ampere", unit="e/s", example="5 fA", default=0.0
    )
    read_noise: Electrons = key("rms, of every readout", unit="e", example="10 e", default=0.0)
    reset_noise: Electrons = key("rms, of the reset", unit="e", example="15 e", default=0.0)
    max_time: MaybeTime = key(
        "longest exposure; default none", unit="ms", example="100 ms", default=None
    )


class ScheduleConstraints(Model):
    """Constraints of the readout on capture times."""

    min_gap: Annotated[float, Quantity("time", least=0)] = key(
        "least time between two captures", unit="ms", example="1 ms", default=0.0
    )
    frame_time: Annotated[float, Quantity("time", least=0)] = key(
        "captures come at whole multiples of it; 0: at any time",
        unit="ms",
        example="0.5 ms",
        default=0.0,
    )


def _named_times(given: Any) -> dict[str, tuple[float, ...]]:
    """Return rising times [s] by name, or raise all mistakes at once."""
    if not isinstance(given, Mapping):
        message = f"{describe(given)} is not a mapping of names to times"
        raise ValueError(f"{message}; write for example mine: [5 ms, 15 ms]")
    named: dict[str, tuple[float, ...]] = {}
    mistakes: list[InitErrorDetails] = []
    for name, times in given.items():
        mistakes += _name_mistakes(name)
        try:
            named[str(name)] = rising_times(times)
        except ValueError as error:
            mistakes += faults_at(name, error, times)
    if mistakes:
        raise failure(mistakes)
    return named


def _name_mistakes(name: Any) -> Iterator[InitErrorDetails]:
    try:
        _NAME.validate_python(name)
    except ValidationError:
        message = f"{describe(name)} is not a name of letters, digits, '.', '_' and '-'"
        yield fault((name,), message, "files are named after it")
    if name in FRAME_METHODS:
        yield fault((name,), "is a method's name", "call the times something else")


class Zoom(Model):
    """Enlarged square of the picture."""

    x: Fraction = key("its center from the left, over the picture's width", example=0.5)
    y: Fraction = key("its center from the top, over the picture's height", example=0.5)
    size: Annotated[float, Number(above=0, most=1, example="0.2")] = key(
        "its side over the picture's shorter one", example=0.2, default=0.2
    )


class ScheduleFrames(Model):
    """Pictures that a camera takes with several schedules of the same length, and their noise."""

    camera: Annotated[str | None, Either(camera_name("hdr-scene"), str)] = key(
        "name or path of a camera file; default the pdf's", example="hdr-scene", default=None
    )
    count: Annotated[int | None, Whole(least=1, most=1000, example="8")] = key(
        "number of captures of each method; default the camera's", example=8, default=None
    )
    max: MaybeTime = key(
        "longest exposure; default the camera's", unit="ms", example="100 ms", default=None
    )
    methods: Annotated[tuple[str, ...], words_of(FRAME_METHODS, 0)] = key(
        "methods that choose the capture times",
        example=["uniform", "optimal", "heuristic"],
        default=FRAME_METHODS[:3],
    )
    times: Annotated[
        dict[str, tuple[float, ...]],
        Either(
            _named_times,
            dict[str, list[Annotated[float, Quantity("time", above=0)]]],
            yaml_form=lambda value: {name: times_to_yaml(times) for name, times in value.items()},
        ),
    ] = key("name -> times of your own", unit="ms", example=_TIMES_EXAMPLE, default=dict)
    estimators: Annotated[tuple[str, ...], words_of(FRAME_ESTIMATORS, 1)] = key(
        "estimator of the picture from its captures",
        example=["lsbs", "weighted"],
        default=FRAME_ESTIMATORS,
    )
    segments: Annotated[int, Whole(least=1, most=100_000, example="3")] = key(
        "of the pdf that the heuristic plans with", example=3, default=3
    )
    seeds: Annotated[int, Whole(least=6, most=10_000, example="16")] = key(
        "integrations over which the noise of every pixel is measured", example=16, default=16
    )
    zoom: Annotated[Zoom | None, mapping(Zoom)] = key(
        "enlarged square of the picture",
        example={"x": 0.5, "y": 0.5, "size": 0.2},
        default=None,
    )

    @model_validator(mode="after")
    def _shows_something(self) -> Self:
        if not self.methods and not self.times:
            raise failure([fault(("methods",), "there is no schedule", "name a method, or times")])
        return self


class ScheduleStudy(Model):
    """A study that finds when to read a pixel: capture schedules for a pdf of photocurrents."""

    kind: Literal["schedule"] = key("the kind of study", example="schedule")
    name: Word = key(
        "name of the study and of its output folder; default the file's",
        example="captures",
        default="schedule",
    )
    pdf: PdfSource = key(
        "probability density of photocurrents", example={"uniform": {"min": 0, "max": 1}}
    )
    counts: Annotated[tuple[int, ...], Either(_COUNTS, list[Annotated[int, _COUNT]])] = key(
        "numbers of captures", example=[2, 4, 8]
    )
    methods: Annotated[tuple[str, ...], words_of(METHODS, 1)] = key(
        "methods that compute schedules; bracket: merged exposures one after the other, each with"
        " charge of its own, within the longest time of the captures",
        example=["optimal", "uniform"],
        default=("optimal",),
    )
    segments: Annotated[
        tuple[int, ...],
        Either(
            _segments,
            _Null | Annotated[int, _SEGMENTS] | list[Annotated[int, _SEGMENTS]],
            yaml_form=lambda value: (
                (list(value) if len(value) > 1 else value[0]) if value else None
            ),
        ),
    ] = key(
        "number of segments that approximate the pdf, by iterative histogram binning; several: "
        "compared in segments.csv, other tables use the largest",
        example=3,
        default=(),
    )
    density: Annotated[
        tuple[str, ...],
        Either(
            _densities,
            Literal[DENSITIES] | list[Literal[DENSITIES]],
            yaml_form=lambda value: list(value) if len(value) > 1 else value[0],
        ),
    ] = key(
        "estimator of the pdf from its pixels, before approximation by segments; several: "
        "compared in segments.csv, other tables use the first",
        example="histogram",
        default=(HISTOGRAM,),
    )
    sensor: Annotated[
        ScheduleSensor | None,
        Either(_or_null(ScheduleSensor.model_validate), _Null | ScheduleSensor),
    ] = key(
        "well and noise of a pixel; null: shot noise alone",
        example={"well_capacity": "20000 e", "read_noise": "10 e"},
        default=None,
    )
    constraints: ScheduleConstraints = key(
        "Constraints of the readout on capture times.",
        example={"min_gap": "1 ms"},
        default=ScheduleConstraints,
    )
    starts: Annotated[int, Whole(least=1, most=1000, example="10")] = key(
        "random starts of sqp, and of sqp-assigned for each assignment of captures to segments; "
        "the best counts",
        example=10,
        default=1,
    )
    max_time_of: Annotated[
        int | None, Either(_or_null(_COUNT.read), _Null | Annotated[int, _COUNT])
    ] = key(
        "longest exposure of all schedules: that of the optimal schedule with this number of "
        "captures; default none: rules such as uniform end with the optimum of each number",
        example=10,
        default=None,
    )
    targets: Annotated[tuple[float, ...], Either(_TARGETS, list[Annotated[float, _GAIN]])] = key(
        "gains: the fewest captures that reach each", example=[1.5], default=()
    )
    online: Switch = key(
        "choose each capture time from the captures before it", example=False, default=False
    )
    frames: Annotated[ScheduleFrames | None, mapping(ScheduleFrames)] = key(
        "pictures that a camera takes with several schedules, and their noise",
        example={"camera": "hdr-scene", "methods": ["uniform", "optimal"]},
        default=None,
    )

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        raise_mistakes(self._contradictions())
        return self

    def _contradictions(self) -> Iterator[InitErrorDetails]:
        if self.frames is not None and self.frames.camera is None and self.pdf.camera is None:
            message = "is missing: the pdf is of no camera either"
            yield fault(("frames", "camera"), message, "add for example camera: hdr-scene")
        if self.sensor is None:
            give = "add for example sensor: {well_capacity: 20000 e}"
            if self.pdf.brightest is not None:
                message = "has no effect: without a sensor only ratios of photocurrents matter"
                yield fault(("pdf", "brightest"), message, f"remove it, or {give}")
            for name, value in self.constraints:
                if not value:
                    continue
                message = "is a time and needs a sensor, without which times are relative"
                yield fault(("constraints", name), message, give)
            if "weighted" in self.methods:
                at = ("methods", self.methods.index("weighted"))
                message = "weighted needs a sensor: with shot noise alone it is optimal"
                yield fault(at, message, give)
            if self.online:
                message = "online needs a sensor: estimates during capture depend on its noise"
                yield fault(("online",), message, give)
        if self.density != (HISTOGRAM,) and not self.segments:
            message = "has no effect: the pdf is not approximated"
            yield fault(("density",), message, "add for example segments: 3")
        if self.starts > 1 and not set(RANDOM_STARTS) & set(self.methods):
            message = "has no effect: no method of the study has random starts"
            yield fault(("starts",), message, "add the method sqp or sqp-assigned")
        if self.max_time_of is not None and self.sensor is not None and self.sensor.max_time:
            message = "is a longest exposure, and so is sensor.max_time"
            yield fault(("max_time_of",), message, "keep one of the two")
        smooth = {
            "heuristic": ("histogram", "levels", "camera"),
            "sqp": ("levels",),
            "sqp-assigned": ("histogram", "levels", "camera"),
        }
        for method, sources in smooth.items():
            if method in self.methods and self.pdf.kind in sources and not self.segments:
                at = ("methods", self.methods.index(method))
                message = f"{method} needs a pdf of segments, and this is {_OF[self.pdf.kind]}"
                yield fault(at, message, "add for example segments: 3, which approximates it")


_OF = {"histogram": "a histogram", "levels": "one of levels", "camera": "a histogram"}
