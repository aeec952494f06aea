"""What a sweep study may say about its figures: each is a PNG and the CSV behind it.

A figure shows cameras of the study: those of some cases, at values of one parameter that is varied,
which need not be the study's own values. Which cases there are, and whether a camera is valid, is
known only where the study's cameras are: see `study_cameras`.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic_core import InitErrorDetails

from vcam_cli.config.lists import list_of_any, read_list, words_of
from vcam_cli.config.model import Model, Rule, key
from vcam_cli.config.validation_messages import describe, fault, yaml_text
from vcam_cli.config.values import Choice, Either, Positive, Text
from vcam_cli.errors import Path
from vcam_cli.sweeps.quantities import CURVES, PROPERTIES, QUANTITIES, is_measured

KINDS = {
    "curves": "quantities over the parameter, a line a case; or curves of cameras",
    "optima": "the optimum of every case over a property of its camera",
    "pictures": "the perfect image, the camera's image and the map of its Delta E, side by side",
    "iso-lines": "lines of equal Delta E",
    "distribution": "the distribution of Delta E over the picture",
}
"""What a figure may show."""
RENDERED = ("pictures", "iso-lines", "distribution")
"""Kinds of figures that need frames of their own."""
TABLES = ("points", "timings", "optimum", "expected", "study")
"""Files of a sweep, whose names no figure may have."""
_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "quantities": (("curves",), ()),
    "against": (("optima",), ()),
    "levels": (("iso-lines",), ("pictures",)),
    "at": (RENDERED, ("curves",)),
    "set": ((), ("curves", *RENDERED)),
}
"""Key -> the kinds of figures that need it, and others that may have it."""


def _keys_of_kind(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Yield mistakes: keys that a kind of figure does not have, and keys that it needs."""
    show = given.get("show")
    if not isinstance(show, str) or show not in KINDS:
        return
    for name, (needing, others) in _KEYS.items():
        if given.get(name) and show not in (*needing, *others):
            message = f"a figure of {show} has no {name}"
            yield fault((name,), message, f"remove it: it is of {', '.join((*needing, *others))}")
        elif not given.get(name) and show in needing:
            example = yaml_text((Figure.model_fields[name].examples or [""])[0])
            yield fault((name,), "is missing", f"add it, for example {name}: {example}")


def _values(given: Any) -> tuple[Any, ...]:
    """Read one value of the parameter, or a list of values."""
    found = read_list(given if isinstance(given, (list, tuple)) else [given], "[6 um]", 0)
    wrong = [item for item in found if item is None or isinstance(item, (Mapping, list, tuple))]
    if wrong:
        raise ValueError(f"{describe(wrong[0])} is no value; write for example [6 um, 12 um]")
    return found


class Figure(Model):
    """A figure of a sweep: a PNG and the CSV behind it."""

    show: Literal[tuple(KINDS)] = key(  # type: ignore[valid-type]
        "; ".join(f"{kind}: {what}" for kind, what in KINDS.items()), example="curves"
    )
    title: Text = key("text above the figure; default its name", example="Light", default="")
    quantities: Annotated[tuple[str, ...], words_of(QUANTITIES, 0)] = key(
        "metrics of the study, properties of the cameras, or curves over one quantity; those of "
        "one unit share a panel",
        example=["fill_factor", "capacitance"],
        default=(),
    )
    against: Annotated[str | None, Choice(*PROPERTIES)] = key(
        "property that differs between the cases", example="feature_size", default=None
    )
    levels: tuple[Positive, ...] = key(
        "levels of Delta E at which lines are drawn", example=[1, 2, 3, 5], default=()
    )
    cases: Annotated[tuple[str, ...], list_of_any("[nominal]", 0)] = key(
        "names of cases; default all for curves over the parameter and optima, else the first",
        example=["nominal"],
        default=(),
    )
    over: Text = key(
        "path of the parameter; default the one that is varied over the most values",
        example="pixel.width",
        default="",
    )
    at: Annotated[tuple[Any, ...], Either(_values, str | float | list[Any])] = key(
        "values of the parameter; default, for curves of properties, those of the study",
        example=["6 um", "12 um"],
        default=(),
    )
    set: dict[str, Any] = key(
        "path -> value, laid over every camera of the figure",
        example={"exposure.time": "30 ms"},
        default=dict,
    )

    rules: ClassVar[tuple[Rule, ...]] = (_keys_of_kind,)

    @property
    def is_rendered(self) -> bool:
        """Whether it needs frames of its own."""
        return self.show in RENDERED

    @property
    def abscissa(self) -> str:
        """The quantity that its curves are functions of; "" for the parameter."""
        return CURVES.get(self.quantities[0], "") if self.quantities else ""

    @property
    def is_over_parameter(self) -> bool:
        """Whether it shows whole sweeps of the parameter, and not cameras at some values of it."""
        return self.show in ("curves", "optima") and not self.abscissa


def mistakes(
    figures: Mapping[str, Figure], metrics: Collection[str], sought: bool
) -> Iterator[InitErrorDetails]:
    """Yield what figures have wrong that takes the rest of the study to tell.

    metrics: those that the study measures; sought: whether it seeks an optimum.
    """
    owners = {name.lower(): "the sweep" for name in (*TABLES, *metrics)}
    for name, figure in figures.items():
        if owner := owners.get(name.lower()):
            message = f"{owner} has files of this name"
            yield fault(("figures", name), message, "give the figure another one")
        owners[name.lower()] = f"the figure {name}"
        if figure.show == "optima" and not sought:
            remedy = "add optimize: {metric: ..., goal: min}"
            yield fault(("figures", name, "show"), "the study seeks no optimum", remedy)
        for path in figure.set:
            if not path or "" in path.split("."):
                message = f"{describe(path)} is not a path of a camera"
                yield fault(("figures", name, "set", path), message, "write exposure.time")
        yield from _wrong_quantities(("figures", name), figure, metrics)


def _wrong_quantities(
    place: Path, figure: Figure, metrics: Collection[str]
) -> Iterator[InitErrorDetails]:
    """Yield mistakes: quantities that the study does not have, or that do not go together."""
    for i, quantity in enumerate(figure.quantities):
        where = (*place, "quantities", i)
        if CURVES.get(quantity, "") != figure.abscissa:
            other = figure.abscissa or "the parameter"
            message = f"{quantity} is not a function of {other}, as {figure.quantities[0]} is"
            yield fault(where, message, "plot it in a separate figure")
        elif quantity not in metrics and quantity not in PROPERTIES | CURVES:
            message = f"{quantity} is not among the metrics: {', '.join(metrics)}"
            yield fault(where, message, "write one of them, or add it to metrics")
        elif is_measured(quantity, metrics, figure.set) and (figure.set or figure.at):
            wrong = "set" if figure.set else "at"
            message = f"{quantity} is measured at the study's own points"
            yield fault((*place, wrong), message, f"remove {wrong}, or name a property")
    if figure.abscissa and not figure.at:
        yield fault((*place, "at"), "is missing", "write a value of the parameter")
