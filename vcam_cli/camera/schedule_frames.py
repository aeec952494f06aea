"""What a study of capture schedules may say of pictures: a camera that takes them with each."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Self

from pydantic import TypeAdapter, ValidationError, model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.camera.base import Model, key
from vcam_cli.camera.explain import failure, fault, problems, shown
from vcam_cli.camera.exposure import rising_times, written_times
from vcam_cli.camera.study import words_of
from vcam_cli.camera.values import (
    Either,
    Fraction,
    MaybeTime,
    Number,
    Quantity,
    Whole,
    Word,
    mapping,
)

METHODS = ("uniform", "optimal", "heuristic", "exponential", "geometric")
"""How the times of the pictures may be found."""
ESTIMATORS = ("lsbs", "weighted")
_EXAMPLE = {"mine": ["5 ms", "15 ms", "30 ms", "200 ms"]}
_NAME: TypeAdapter[str] = TypeAdapter(Word)


def _times(given: Any) -> dict[str, tuple[float, ...]]:
    """Name -> rising times [s]; all mistakes at once."""
    if not isinstance(given, Mapping):
        message = f"{shown(given)} is not a mapping of names to times"
        raise ValueError(f"{message}; write for example mine: [5 ms, 15 ms]")
    found: dict[str, tuple[float, ...]] = {}
    mistakes: list[InitErrorDetails] = []
    for name, times in given.items():
        mistakes += _wrong_name(name)
        try:
            found[str(name)] = rising_times(times)
        except ValidationError as error:
            mistakes += [fault((name, *p.path), p.message, p.remedy) for p in problems(error)]
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            mistakes.append(fault((name,), message, remedy, times))
    if mistakes:
        raise failure(mistakes)
    return found


def _wrong_name(name: Any) -> Iterator[InitErrorDetails]:
    try:
        _NAME.validate_python(name)
    except ValidationError:
        message = f"{shown(name)} is not a name of letters, digits, '.', '_' and '-'"
        yield fault((name,), message, "files are named after it")
    if name in METHODS:
        yield fault((name,), "is a method's name", "call the times something else")


def camera_name(given: Any) -> str:
    """The name or path of a camera file; ValueError for anything else."""
    if not isinstance(given, str) or not given.strip():
        what = f"{shown(given)} is not the name or path of a camera file"
        raise ValueError(f"{what}; write for example hdr-scene")
    return given


class Zoom(Model):
    """A square of the picture that is shown larger."""

    x: Fraction = key("its center from the left, over the picture's width", example=0.5)
    y: Fraction = key("its center from the top, over the picture's height", example=0.5)
    size: Annotated[float, Number(above=0, most=1, example="0.2")] = key(
        "its side over the picture's shorter one", example=0.2, default=0.2
    )


class ScheduleFrames(Model):
    """Pictures that a camera takes with several schedules of the same length, and their noise."""

    camera: Annotated[str | None, Either(camera_name, str)] = key(
        "name or path of a camera file; default the pdf's", example="hdr-scene", default=None
    )
    count: Annotated[int | None, Whole(least=1, most=1000, example="8")] = key(
        "number of captures of each method; default the camera's", example=8, default=None
    )
    max: MaybeTime = key(
        "longest exposure; default the camera's", unit="ms", example="100 ms", default=None
    )
    methods: Annotated[tuple[str, ...], words_of(METHODS, 0)] = key(
        "how times are found", example=["uniform", "optimal", "heuristic"], default=METHODS[:3]
    )
    times: Annotated[
        dict[str, tuple[float, ...]],
        Either(
            _times,
            dict[str, list[Annotated[float, Quantity("time", above=0)]]],
            write=lambda value: {name: written_times(times) for name, times in value.items()},
        ),
    ] = key("name -> times of your own", unit="ms", example=_EXAMPLE, default=dict)
    estimators: Annotated[tuple[str, ...], words_of(ESTIMATORS, 1)] = key(
        "how captures become one picture", example=["lsbs", "weighted"], default=ESTIMATORS
    )
    segments: Annotated[int, Whole(least=1, most=100_000, example="3")] = key(
        "of the pdf that the heuristic plans with", example=3, default=3
    )
    seeds: Annotated[int, Whole(least=6, most=10_000, example="16")] = key(
        "integrations over which the noise of every pixel is measured", example=16, default=16
    )
    zoom: Annotated[Zoom | None, mapping(Zoom)] = key(
        "a square of the picture that is shown larger",
        example={"x": 0.5, "y": 0.5, "size": 0.2},
        default=None,
    )

    @model_validator(mode="after")
    def _shows_something(self) -> Self:
        if not self.methods and not self.times:
            raise failure([fault(("methods",), "there is no schedule", "name a method, or times")])
        return self
