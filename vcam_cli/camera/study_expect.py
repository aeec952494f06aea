"""What a sweep study may expect to find: a quantity, and between which values it should lie.

Expectations change nothing of what is computed. They are the study's own list of what was published
or derived elsewhere, so that its output can say what of it came out and what did not; and what was
set so that it comes out, which proves nothing.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, ClassVar

from pydantic_core import InitErrorDetails

from vcam_cli.camera.base import Model, Rule, at_most_one, key
from vcam_cli.camera.explain import fault, one_of, shown
from vcam_cli.camera.study_figures import PROPERTIES
from vcam_cli.camera.values import Either, Text

OPTIMUM = "optimum"
"""The quantity that is the best value itself; and as a value of `at`, the place of the optimum."""


def _ends(given: Any) -> tuple[Any, Any]:
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise ValueError(f"{shown(given)} is not two values; write for example [6.35 um, 6.65 um]")
    return given[0], given[1]


def _place(given: Any) -> Any:
    if isinstance(given, (Mapping, list, tuple)):
        raise ValueError(f"{shown(given)} is no value; write for example 15 um, or {OPTIMUM}")
    return given


_Place = Annotated[Any, Either(_place, str | float)]


class Expectation(Model):
    """A quantity of the study, and between which values it is expected."""

    quantity: Text = key(
        "optimum (the best value itself), one of the study's metrics, or a property of the camera",
        example="optimum",
    )
    between: Annotated[tuple[Any, Any], Either(_ends, list[str | float])] = key(
        "the least and the most that is expected", example=["6.35 um", "6.65 um"]
    )
    case: Text = key("name of a case; default the first", example="nominal", default="")
    at: _Place = key(
        "value of the parameter that is varied, or optimum", example="15 um", default=None
    )
    over: _Place = key(
        "the ratio to what it is there: a value of the parameter, or optimum",
        example="optimum",
        default=None,
    )
    minus: _Place = key(
        "the difference from what it is there; of optima from that of another case",
        example="5.3 um",
        default=None,
    )
    set: dict[str, Any] = key(
        "of properties: path -> value, laid over the camera",
        example={"exposure.time": "30 ms"},
        default=dict,
    )
    calibrated: Text = key(
        "what was set so that this comes out; default nothing",
        example="the dark current at the edge",
        default="",
    )
    source: Text = key("who says so", example="Chen 2003, figure 3.8", default="")
    why: Text = key("why it does not come out, where that is known", example="kTC", default="")

    rules: ClassVar[tuple[Rule, ...]] = (at_most_one("over", "minus"),)


def mistakes(
    expected: Mapping[str, Expectation], metrics: Iterable[str], goal: bool
) -> Iterator[InitErrorDetails]:
    """What expectations have wrong that takes the rest of the study to say.

    metrics: of the study; goal: whether it seeks an optimum.
    """
    known = (OPTIMUM, *metrics, *PROPERTIES)
    for name, item in expected.items():
        place = ("expect", name)
        if item.quantity not in known:
            yield fault((*place, "quantity"), *one_of(item.quantity, known), given=item.quantity)
            continue
        wants = OPTIMUM in (item.quantity, item.at, item.over, item.minus)
        if wants and not goal:
            remedy = "add optimize: {metric: ..., goal: min}"
            yield fault((*place, "quantity"), "the study seeks no optimum", remedy)
        if item.quantity == OPTIMUM and (item.at is not None or item.over is not None):
            wrong = "at" if item.at is not None else "over"
            yield fault((*place, wrong), "an optimum has no place of its own", f"remove {wrong}")
        if item.quantity != OPTIMUM and item.at is None:
            yield fault((*place, "at"), "is missing", "write a value of the parameter, or optimum")
        if item.set and (item.quantity == OPTIMUM or item.quantity not in PROPERTIES):
            message = f"{item.quantity} is taken from the sweep, which has no such overrides"
            yield fault((*place, "set"), message, "remove set, or name a property")
