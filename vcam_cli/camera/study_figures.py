"""What a sweep study may say about its figures: each is a PNG and the CSV behind it.

`show` tells what a figure shows. Cameras of a figure are those of a case with a value of the
parameter that is varied, which need not be one of the study's values, and overrides of its own.
Which cases there are, and whether a camera can be made, is known only where the study's cameras
are: see `studies.figures`.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic_core import InitErrorDetails

from vcam_cli.camera.base import Model, Rule, at_most_one, key
from vcam_cli.camera.explain import failure, fault, one_of, shown
from vcam_cli.camera.values import Either, Number, Positive, Text

PROPERTIES = {
    "fill_factor": "",
    "effective_fill_factor": "",
    "photodetector_area": "um2",
    "photodetector_perimeter": "um",
    "capacitance": "fF",
    "conversion_gain": "uV/e",
    "voltage_swing": "V",
    "full_well": "e",
    "well_capacity": "e",
    "dark_current": "e/s",
    "dark_current_density": "nA/cm2",
    "nyquist_frequency": "lp/mm",
    "feature_size": "um",
    "corner_vignetting": "",
    "dynamic_range_db": "dB",
    "snr_db": "dB",
}
"""What is known of a camera without a frame -> its unit."""
TIMED = ("dynamic_range_db", "snr_db")
"""Of these, what depends on the exposure time."""
TABLES = ("points", "timings", "optimum", "study")
"""Files of a sweep that a figure cannot be called like."""


def _several(what: str, example: str) -> Any:
    """Reads one or a list of things, each once."""

    def read(given: Any) -> tuple[Any, ...]:
        found = given if isinstance(given, (list, tuple)) else [given]
        if not found or any(item is None or isinstance(item, Mapping) for item in found):
            raise ValueError(f"{shown(given)} is no {what}; write for example {example}")
        twice = [i for i, item in enumerate(found) if item in found[:i]]
        if twice:
            said = [(i, f"{shown(found[i])} comes twice", "keep one of them") for i in twice]
            raise failure([fault((i,), message, remedy) for i, message, remedy in said])
        return tuple(found)

    return read


def _names(given: Any) -> tuple[str, ...]:
    found = _several("name of a case", "[nominal]")(given)
    wrong = [i for i, item in enumerate(found) if not isinstance(item, str)]
    if wrong:
        message = f"{shown(found[wrong[0]])} is no name of a case"
        raise ValueError(f"{message}; write for example [nominal]")
    return tuple(found)


def _properties(given: Any) -> tuple[str, ...]:
    found = _several("property", "[fill_factor]")(given)
    wrong = [(i, item) for i, item in enumerate(found) if item not in PROPERTIES]
    if wrong:
        raise failure([fault((i,), *one_of(item, PROPERTIES), given=item) for i, item in wrong])
    return found


_LEVEL = Number(above=0, example="3")


def _levels(given: Any) -> tuple[float, ...]:
    return tuple(sorted(_LEVEL.read(level) for level in _several("level", "[1, 2, 3, 5]")(given)))


_ANY = str | float | list[Any]
_WORDS = str | list[str]
_Values = Annotated[tuple[Any, ...], Either(_several("value", "[6 um, 12 um]"), _ANY)]
_Cases = Annotated[tuple[str, ...] | None, Either(_names, _WORDS)]


def _value(given: Any) -> Any:
    if given is None or isinstance(given, (Mapping, list, tuple)):
        raise ValueError(f"{shown(given)} is no value; write for example 8 um")
    return given


_Value = Annotated[Any, Either(_value, str | float)]


def _name(given: Any) -> str:
    if not isinstance(given, str) or not given:
        raise ValueError(f"{shown(given)} is no name of a case; write for example nominal")
    return given


_Case = Annotated[str | None, Either(_name, str)]


def _cases_key() -> Any:
    return key("names of cases; default all", example=["nominal"], default=None)


def _case_key() -> Any:
    return key("name of a case; default the first", example="nominal", default=None)


def _at_key() -> Any:
    return key("values of the parameter that is varied", example=["6 um", "12 um"])


def _set_key() -> Any:
    return key(
        "path -> value, laid over every camera of the figure",
        example={"exposure.time": "30 ms"},
        default=dict,
    )


class StudyFigure(Model):
    """What all figures may say."""

    title: Text = key("above the figure; default its name", example="(a)", default="")
    over: Text = key(
        "path of the parameter that `at` gives values of, or that is drawn to the right; default "
        "the one that is varied over the most values",
        example="pixel.width",
        default="",
    )

    needs_frames: ClassVar[bool] = False

    @property
    def overrides(self) -> Mapping[str, Any]:
        """Path -> value, laid over its cameras."""
        return getattr(self, "set", {})

    @property
    def named(self) -> tuple[str, ...] | None:
        """Names of its cases; None where it says nothing."""
        one = getattr(self, "case", None)
        return (one,) if one else getattr(self, "cases", None)


class Lines(StudyFigure):
    """A metric over the parameter, as the sweep found it, the optima as crosses."""

    show: Literal["lines"] = key("what the figure shows", example="lines")
    metric: Text = key("one of the study's metrics", example="mean_s_cielab")
    cases: _Cases = _cases_key()


class Optima(StudyFigure):
    """The optimum of every case over a property of its camera, beside a proportional one."""

    show: Literal["optima"] = key("what the figure shows", example="optima")
    against: Literal[tuple(PROPERTIES)] = key(  # type: ignore[valid-type]
        "a property that the cases differ in", example="feature_size", default="feature_size"
    )
    cases: _Cases = _cases_key()


class Properties(StudyFigure):
    """What is known of the cameras without a frame, over the parameter."""

    show: Literal["properties"] = key("what the figure shows", example="properties")
    of: Annotated[tuple[str, ...], Either(_properties, list[Literal[tuple(PROPERTIES)]])] = key(
        "which; those of one unit share a panel", example=["fill_factor", "capacitance"]
    )
    cases: _Cases = _cases_key()
    set: dict[str, Any] = _set_key()


class OfValues(StudyFigure):
    """A figure of cameras of some cases, at some values of the parameter."""

    at: _Values = _at_key()
    case: _Case = _case_key()
    cases: _Cases = _cases_key()
    set: dict[str, Any] = _set_key()
    rules: ClassVar[tuple[Rule, ...]] = (at_most_one("case", "cases"),)


class Mtf(OfValues):
    """Transfer of the system and of the sensor alone over spatial frequency."""

    show: Literal["mtf"] = key("what the figure shows", example="mtf")


class SpectralResponse(OfValues):
    """Quantum efficiency over wavelength."""

    show: Literal["spectral-response"] = key("what the figure shows", example="spectral-response")


class OffAxis(OfValues):
    """What pixels along the diagonal of the sensor collect, over that on the axis."""

    show: Literal["off-axis"] = key("what the figure shows", example="off-axis")


class Picture(StudyFigure):
    """The perfect image, the camera's, their difference and lines of equal difference."""

    show: Literal["picture"] = key("what the figure shows", example="picture")
    at: _Value = key("value of the parameter that is varied", example="8 um")
    levels: Annotated[tuple[float, ...], Either(_levels, list[float])] = key(
        "of Delta E, at which lines are drawn", example=[1, 2, 3, 5], default=(1.0, 2.0, 3.0, 5.0)
    )
    case: _Case = _case_key()
    set: dict[str, Any] = _set_key()
    needs_frames: ClassVar[bool] = True


class Iso(OfValues):
    """The line of one Delta E, for several values of the parameter."""

    show: Literal["iso"] = key("what the figure shows", example="iso")
    level: Positive = key("of Delta E", example=3.0)
    needs_frames: ClassVar[bool] = True


class Distribution(OfValues):
    """How Delta E is distributed over the picture, and whether around one value."""

    show: Literal["distribution"] = key("what the figure shows", example="distribution")
    needs_frames: ClassVar[bool] = True


SHOWN: dict[str, type[StudyFigure]] = {
    "lines": Lines,
    "optima": Optima,
    "properties": Properties,
    "mtf": Mtf,
    "spectral-response": SpectralResponse,
    "off-axis": OffAxis,
    "picture": Picture,
    "iso": Iso,
    "distribution": Distribution,
}
"""What a figure may show."""
_FORMS = (
    Lines
    | Optima
    | Properties
    | Mtf
    | SpectralResponse
    | OffAxis
    | Picture
    | Iso
    | Distribution
)  # fmt: skip


def _figure(given: Any) -> StudyFigure:
    """The figure that a mapping describes, told apart by what it shows."""
    if isinstance(given, StudyFigure):
        return given
    if not isinstance(given, Mapping):
        raise ValueError(f"{shown(given)} is no figure; write {{show: lines, metric: snr_db}}")
    word = given.get("show")
    if not isinstance(word, str) or word not in SHOWN:
        if "show" not in given:
            raise failure([fault(("show",), "is missing", f"write one of: {', '.join(SHOWN)}")])
        raise failure([fault(("show",), *one_of(word, SHOWN), given=word)])
    return SHOWN[word].model_validate(given)


Figure = Annotated[StudyFigure, Either(_figure, _FORMS)]


def mistakes(
    figures: Mapping[str, StudyFigure], metrics: Iterable[str], sought: bool
) -> Iterator[InitErrorDetails]:
    """What figures have wrong that takes the rest of the study to say.

    metrics: those that are measured; sought: whether an optimum is.
    """
    measured = tuple(metrics)
    taken = {name.lower(): "the sweep" for name in (*TABLES, *measured)}
    for name, figure in figures.items():
        if other := taken.get(name.lower()):
            message = f"{other} has files of this name"
            yield fault(("figures", name), message, "give the figure another one")
        taken[name.lower()] = f"the figure {name}"
        if isinstance(figure, Lines) and figure.metric not in measured:
            message = f"{shown(figure.metric)} is not among the metrics: {', '.join(measured)}"
            remedy = "write one of them, or add it to metrics"
            yield fault(("figures", name, "metric"), message, remedy, figure.metric)
        if isinstance(figure, Optima) and not sought:
            remedy = "add optimize: {metric: ..., goal: min}"
            yield fault(("figures", name, "show"), "the study seeks no optimum", remedy)
        for path in figure.overrides:
            if not path or "" in path.split("."):
                message = f"{shown(path)} is not a path of a camera"
                yield fault(("figures", name, "set", path), message, "write exposure.time")
