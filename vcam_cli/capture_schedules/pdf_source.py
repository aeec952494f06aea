"""Where the pdf of a schedule study comes from: uniform, segments, tables, or a camera.

Photocurrents are bare numbers: a schedule for shot noise alone depends on their ratios only. With
a sensor they are electrons per second, and may have a unit.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli import units
from vcam_cli.config.lists import list_of
from vcam_cli.config.model import Model, exactly_one, key, needs
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import describe, failure, fault
from vcam_cli.config.values import Either, File
from vcam_cli.physics.readout import ELEMENTARY_CHARGE

BINS = 4096
"""Of the histogram of a camera's photocurrents."""
SOURCES = ("uniform", "segments", "histogram", "levels", "camera")
"""Where a pdf may come from."""
MOST_PHOTOCURRENT = 1e30
"""Beyond any light, and its square is still a number."""

_NUMBER = Number(least=0, most=MOST_PHOTOCURRENT, example="0.5")
_RATE = Quantity("rate", least=0, most=MOST_PHOTOCURRENT)
_CURRENT = Quantity("current", least=0)


def _rate(given: Any) -> float:
    """Return a rate of electrons [e/s], of "12 e/s" or "5 fA"."""
    try:
        _, unit = units.split(given)
    except ValueError:
        unit = ""
    if unit.endswith("A"):
        current: float = _CURRENT.read(given)
        return current / ELEMENTARY_CHARGE
    rate: float = _RATE.read(given)
    return rate


def _photocurrent(given: Any) -> float:
    """Return a bare number, or a rate of electrons [e/s]."""
    is_text = isinstance(given, str) and not given.strip().endswith("%")
    return _rate(given) if is_text else _NUMBER.read(given)


Photocurrent = Annotated[
    float,
    Either(
        _photocurrent,
        Annotated[float, _NUMBER] | Annotated[float, _RATE] | Annotated[float, _CURRENT],
    ),
]
Rate = Annotated[
    float,
    Either(_rate, Annotated[float, _RATE] | Annotated[float, _CURRENT], yaml_form=_RATE.text),
]


class PdfUniform(Model):
    """Every photocurrent between two is equally likely."""

    min: Photocurrent = key("the darkest photocurrent", example=0)
    max: Photocurrent = key("the brightest photocurrent", example=1)

    @model_validator(mode="after")
    def _rises(self) -> Self:
        raise_mistakes(_order_mistakes((), self.min, self.max))
        return self


class PdfSegment(Model):
    """A range of equally likely photocurrents."""

    min: Photocurrent = key("its lower end", example=0)
    max: Photocurrent = key("its upper end", example=0.3)
    probability: Annotated[float, Number(least=0, example="0.8")] = key(
        "share of the pixels that lie in it", example=0.8
    )

    @model_validator(mode="after")
    def _rises(self) -> Self:
        raise_mistakes(_order_mistakes((), self.min, self.max))
        return self


def _order_mistakes(
    path: tuple[str | int, ...], low: float, high: float
) -> Iterator[InitErrorDetails]:
    if not high > low:
        message = f"max {high:g} is not above min {low:g}"
        yield fault((*path, "max"), message, "exchange the two, or widen the range")


def raise_mistakes(mistakes: Iterable[InitErrorDetails]) -> None:
    """Raise all of these mistakes, where there are some."""
    every = list(mistakes)
    if every:
        raise failure(every)


class PdfTable(Model):
    """A table in a CSV file."""

    file: File = key("its CSV file", example="histogram.csv")


def _pdf_segments(given: Any) -> tuple[PdfSegment, ...]:
    example = "[{min: 0, max: 0.3, probability: 0.8}, {min: 0.6, max: 1, probability: 0.2}]"
    return list_of(PdfSegment.model_validate, example, 1, "segments")(given)


def camera_name(example: str) -> Callable[[Any], str]:
    """Return a reader of the name or path of a camera file."""

    def read(given: Any) -> str:
        if not isinstance(given, str) or not given.strip():
            what = f"{describe(given)} is not the name or path of a camera file"
            raise ValueError(f"{what}; write for example {example}")
        return given

    return read


def _no_scale_of_cameras(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    if "camera" in given and "brightest" in given:
        message = "a camera's photocurrents are in e/s already"
        yield fault(("brightest",), message, "remove it, or change the camera's light")


class PdfSource(Model):
    """The photocurrents of a scene: exactly one of its keys, `bins` beside `camera`."""

    uniform: Annotated[PdfUniform | None, Either(PdfUniform.model_validate, PdfUniform)] = key(
        "equally likely between two", example={"min": 0, "max": 1}, default=None
    )
    segments: Annotated[tuple[PdfSegment, ...] | None, Either(_pdf_segments, list[PdfSegment])] = (
        key(
            "piecewise uniform: segments that ascend",
            example=[{"min": 0, "max": 0.3, "probability": 0.8}],
            default=None,
        )
    )
    histogram: Annotated[PdfTable | None, Either(PdfTable.model_validate, PdfTable)] = key(
        "piecewise uniform: a file of the columns low,high,count",
        example={"file": "histogram.csv"},
        default=None,
    )
    levels: Annotated[PdfTable | None, Either(PdfTable.model_validate, PdfTable)] = key(
        "discrete photocurrents: a file of the columns level,count",
        example={"file": "levels.csv"},
        default=None,
    )
    camera: Annotated[str | None, Either(camera_name("hdr-patches"), str)] = key(
        "name or path of a camera file: the photocurrents of its pixels, free of noise [e/s]",
        example="hdr-patches",
        default=None,
    )
    bins: Annotated[int | None, Whole(least=1, most=1 << 20, example="4096")] = key(
        f"of the camera's histogram; default {BINS}", example=BINS, default=None
    )

    brightest: Annotated[
        float | None,
        Either(_rate, Annotated[float, _RATE] | Annotated[float, _CURRENT], yaml_form=_RATE.text),
    ] = key(
        "brightest photocurrent on the sensor: scales a pdf in arbitrary units, such as the "
        "histogram of a picture; default unscaled, in e/s",
        unit="e/s",
        example="400 ke/s",
        default=None,
    )

    rules = (
        exactly_one(*SOURCES, of="the pdf", remedy="write for example uniform: {min: 0, max: 1}"),
        needs("bins", "camera", "bins are of the histogram of a camera's photocurrents"),
        _no_scale_of_cameras,
    )

    @property
    def kind(self) -> str:
        """Which of `SOURCES` it is."""
        return next(name for name in SOURCES if getattr(self, name) is not None)

    @model_validator(mode="after")
    def _check_ascending(self) -> Self:
        raise_mistakes(self._segment_mistakes())
        return self

    def _segment_mistakes(self) -> Iterator[InitErrorDetails]:
        for i, (one, next_) in enumerate(pairwise(self.segments or ()), 1):
            if next_.min < one.max:
                descends = next_.max <= one.min
                message = f"{next_.min:g} lies below {one.max:g}, where the segment before ends"
                remedy = "let segments ascend" if descends else "let segments not overlap"
                yield fault(("segments", i, "min"), message, remedy)
        if self.segments and not any(s.probability for s in self.segments):
            yield fault(("segments",), "all probabilities are zero", "give one that is not")
