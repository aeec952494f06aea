"""What a study of capture schedules may say: a pdf, numbers of captures, methods, a sensor."""

from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic_core import InitErrorDetails, core_schema

from vcam_cli.camera.base import Model, key
from vcam_cli.camera.explain import fault
from vcam_cli.camera.pdf_source import PdfSource, Rate, list_of, refuse
from vcam_cli.camera.schedule_frames import ScheduleFrames
from vcam_cli.camera.study import words_of
from vcam_cli.camera.values import (
    Either,
    Electrons,
    MaybeTime,
    Number,
    Quantity,
    Switch,
    Whole,
    Word,
    mapping,
)

METHODS = ("optimal", "heuristic", "uniform", "exponential", "geometric", "sqp", "weighted")
MOST_CAPTURES = 1000

_COUNT = Whole(least=1, most=MOST_CAPTURES, example="8")
_SEGMENTS = Whole(least=1, most=100_000, example="3")
_GAIN = Number(above=0, example="1.5")


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
    """Numbers of segments, rising; none of `null`."""
    if given is None:
        return ()
    if not isinstance(given, (list, tuple)):
        return (_SEGMENTS.read(given),)
    return tuple(sorted(_STEPS(given)))


def _or_null(model: type[Model]) -> Callable[[Any], Any]:
    return lambda given: None if given is None else model.model_validate(given)


class ScheduleSensor(Model):
    """What a pixel holds, and its noise: equation 4.1."""

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
    """What the readout demands of capture times."""

    min_gap: Annotated[float, Quantity("time", least=0)] = key(
        "least time between two captures", unit="ms", example="1 ms", default=0.0
    )
    frame_time: Annotated[float, Quantity("time", least=0)] = key(
        "captures come at whole multiples of it; 0: at any time",
        unit="ms",
        example="0.5 ms",
        default=0.0,
    )


class ScheduleStudy(Model):
    """A study that finds when to read a pixel: capture schedules for a pdf of photocurrents."""

    kind: Literal["schedule"] = key("the kind of study", example="schedule")
    name: Word = key(
        "name of the study and of its output folder; default the file's",
        example="captures",
        default="schedule",
    )
    pdf: PdfSource = key(
        "how often which photocurrent occurs", example={"uniform": {"min": 0, "max": 1}}
    )
    counts: Annotated[tuple[int, ...], Either(_COUNTS, list[Annotated[int, _COUNT]])] = key(
        "numbers of captures", example=[2, 4, 8]
    )
    methods: Annotated[tuple[str, ...], words_of(METHODS, 1)] = key(
        "how schedules are found", example=["optimal", "uniform"], default=("optimal",)
    )
    segments: Annotated[
        tuple[int, ...],
        Either(
            _segments,
            _Null | Annotated[int, _SEGMENTS] | list[Annotated[int, _SEGMENTS]],
            write=lambda value: (list(value) if len(value) > 1 else value[0]) if value else None,
        ),
    ] = key(
        "approximate the pdf first, by iterative histogram binning; several: compared in "
        "segments.csv, the largest is what the other tables are of",
        example=3,
        default=(),
    )
    sensor: Annotated[
        ScheduleSensor | None, Either(_or_null(ScheduleSensor), _Null | ScheduleSensor)
    ] = key(
        "well and noise of a pixel; null: shot noise alone",
        example={"well_capacity": "20000 e", "read_noise": "10 e"},
        default=None,
    )
    constraints: ScheduleConstraints = key(
        "what the readout demands of capture times",
        example={"min_gap": "1 ms"},
        default=ScheduleConstraints,
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
        refuse(self._contradictions())
        return self

    def _contradictions(self) -> Iterator[InitErrorDetails]:
        if self.frames is not None and self.frames.camera is None and self.pdf.camera is None:
            message = "is missing: the pdf is of no camera either"
            yield fault(("frames", "camera"), message, "add for example camera: hdr-scene")
        if self.sensor is None:
            give = "add for example sensor: {well_capacity: 20000 e}"
            for name, value in self.constraints:
                if not value:
                    continue
                message = "is a time, and without a sensor there is none"
                yield fault(("constraints", name), message, give)
            if "weighted" in self.methods:
                at = ("methods", self.methods.index("weighted"))
                message = "weighted needs a sensor: with shot noise alone it is optimal"
                yield fault(at, message, give)
            if self.online:
                message = "online needs a sensor: what is believed while capturing depends on noise"
                yield fault(("online",), message, give)
        smooth = {"heuristic": ("histogram", "levels", "camera"), "sqp": ("levels",)}
        for method, sources in smooth.items():
            if method in self.methods and self.pdf.kind in sources and not self.segments:
                at = ("methods", self.methods.index(method))
                message = f"{method} needs a pdf of segments, and this is {_OF[self.pdf.kind]}"
                yield fault(at, message, "add for example segments: 3, which approximates it")


_OF = {"histogram": "a histogram", "levels": "one of levels", "camera": "a histogram"}
