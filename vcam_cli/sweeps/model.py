"""What a study file may say: a camera, what is varied, what is measured, what is sought.

Overrides are keys of a camera by their dotted path, as in `--set`. Their values are checked as
part of each camera that they make (see `sweep_points`).
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.config.lists import list_of_any, words_of
from vcam_cli.config.model import Model, Rule, all_or_none, at_most_one, exactly_one, key, needs
from vcam_cli.config.quantities import Whole
from vcam_cli.config.validation_messages import describe, failure, fault, one_of
from vcam_cli.config.values import Either, Text, Word, mapping
from vcam_cli.errors import split
from vcam_cli.sweeps import figure_model
from vcam_cli.sweeps.figure_model import Figure
from vcam_cli.sweeps.quantities import METRICS, PROPERTIES, is_measured

KEPT = ("raw", "render")
KINDS = ("sweep", "schedule")
"""What `kind` of a study may be."""
VARY = "vary"
"""The key of a case that is no path."""
OPTIMUM = "optimum"
"""The quantity that is the best value of the parameter; and as a value of `at`, its place."""
Basis = Literal["predicted", "calibrated", "chosen"]
"""How the number of an expectation came about: from physics alone, fitted, or picked."""


class Variation(Model):
    """The values that a parameter takes: a range of equal steps or ratios, or a list."""

    start: Annotated[str | float | None, Either(lambda given: given, str | float)] = key(
        "the first value, with its unit", unit="", example="5.3 um", default=None
    )
    stop: Annotated[str | float | None, Either(lambda given: given, str | float)] = key(
        "the last value", unit="", example="15 um", default=None
    )
    count: Annotated[int | None, Whole(least=1, most=100_000, example="20")] = key(
        "number of values", example=20, default=None
    )
    spacing: Literal["linear", "log"] = key(
        "of the values of a range: equal steps (linear), or equal ratios (log)",
        example="log",
        default="linear",
    )
    values: Annotated[tuple[Any, ...] | None, list_of_any("[4 um, 6 um]")] = key(
        "the values themselves, in place of a range", example=["4 um", "6 um"], default=None
    )

    rules = (
        exactly_one("start", "values", of="varied values", remedy="write {values: [...]}"),
        all_or_none("start", "stop", "count"),
        needs("spacing", "start", "a list of values has no spacing"),
    )


class Optimize(Model):
    """Objective of the optimization."""

    metric: Literal[tuple(METRICS)] = key("one of the metrics", example="mean_s_cielab")  # type: ignore[valid-type]
    goal: Literal["min", "max"] = key("minimize or maximize it", example="min")


def _cameras(given: Any) -> tuple[str, ...]:
    found = given if isinstance(given, (list, tuple)) else [given]
    if not found:
        raise ValueError("is an empty list; name at least one camera")
    for item in found:
        if not isinstance(item, str) or not item:
            what = f"{describe(item)} is not the name or path of a camera file"
            raise ValueError(f"{what}; write for example starter")
    return tuple(found)


def _two_values(given: Any) -> tuple[Any, Any]:
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise ValueError(
            f"{describe(given)} is not two values; write for example [6.35 um, 6.65 um]"
        )
    return given[0], given[1]


def _place(given: Any) -> Any:
    if isinstance(given, (Mapping, list, tuple)):
        raise ValueError(f"{describe(given)} is no value; write for example 15 um, or {OPTIMUM}")
    return given


_Place = Annotated[Any, Either(_place, str | float)]


class Expectation(Model):
    """An expected range of a quantity of the study; it does not change the sweep.

    It is the study's own list of what was published or derived elsewhere; its output says what of
    it came out, and what was set so that it comes out, which proves nothing.
    """

    quantity: Text = key(
        "optimum (the best value itself), one of the study's metrics, or a property of the camera",
        example="optimum",
    )
    between: Annotated[tuple[Any, Any], Either(_two_values, list[str | float])] = key(
        "expected range: least and most", example=["6.35 um", "6.65 um"]
    )
    case: Text = key("name of a case; default the first", example="nominal", default="")
    at: _Place = key(
        "value of the parameter that is varied, or optimum",
        unit="",
        example="15 um",
        default=None,
    )
    over: _Place = key(
        "ratio to the quantity at this value of the parameter, or at the optimum",
        example="optimum",
        default=None,
    )
    minus: _Place = key(
        "difference from the quantity at this value of the parameter; for optima, from another "
        "case's",
        unit="",
        example="5.3 um",
        default=None,
    )
    set: dict[str, Any] = key(
        "of properties: path -> value, laid over the camera",
        example={"exposure.time": "30 ms"},
        default=dict,
    )
    calibrated: Text = key(
        "parameters fitted to this very number; default nothing: it is predicted",
        example="the dark current at the edge",
        default="",
    )
    chosen: Text = key(
        "parameters missing in the source and chosen to reproduce this number; default nothing",
        example="the f-number",
        default="",
    )
    source: Text = key("source of the expected value", example="Chen 2003, figure 3.8", default="")
    why: Text = key("known reason for a deviation", example="kTC", default="")

    rules: ClassVar[tuple[Rule, ...]] = (
        at_most_one("over", "minus"),
        at_most_one("calibrated", "chosen"),
    )

    @property
    def basis(self) -> Basis:
        """How the number came about."""
        return "calibrated" if self.calibrated else "chosen" if self.chosen else "predicted"

    @property
    def setting(self) -> str:
        """What was calibrated or chosen."""
        return self.calibrated or self.chosen


class Case(Model):
    """Overrides of a case: any paths of the camera, and `vary`."""

    model_config = Model.model_config | {"extra": "allow"}
    vary: dict[str, Variation] = key(
        "replaces keys that the study varies, by path",
        example={"pixel.width": {"start": "3 um", "stop": "8 um", "count": 20}},
        default=dict,
    )

    @property
    def overrides(self) -> dict[str, Any]:
        """Path -> value."""
        return dict(self.__pydantic_extra__ or {})


class Sweep(Model):
    """A study that measures a camera while its parameters change."""

    kind: Literal["sweep"] = key("the kind of study", example="sweep")
    name: Word = key(
        "name of the study and of its output folder; default the file's",
        example="pixel-size",
        default="sweep",
    )
    camera: Annotated[tuple[str, ...], Either(_cameras, str | list[str])] = key(
        "name or path of a camera file, or a list of them", example="starter"
    )
    vary: dict[str, Variation] = key(
        "path in the camera -> its values; several make a grid, none is one point",
        example={"pixel.width": {"start": "3 um", "stop": "8 um", "count": 20}},
        default=dict,
    )
    cases: dict[Word, Case] = key(
        "name -> overrides by path: the sweep is repeated for each",
        example={"nominal": {}, "dim": {"scene.luminance": "10 cd/m2"}},
        default=dict,
    )
    repeat: dict[str, Annotated[tuple[Any, ...], list_of_any("[0 deg, 90 deg]")]] = key(
        "path -> values over which metrics are averaged",
        example={"scene.source.phase": ["0 deg", "90 deg"]},
        default=dict,
    )
    seeds: Annotated[int, Whole(least=1, most=100_000, example="4")] = key(
        "number of frame seeds, from the camera's up, likewise averaged", example=4, default=1
    )
    metrics: Annotated[tuple[str, ...], words_of(tuple(METRICS), 1)] = key(
        "measured metrics", example=["snr_db"]
    )
    optimize: Annotated[Optimize | None, mapping(Optimize)] = key(
        "find the best value of each parameter",
        example={"metric": "mean_s_cielab", "goal": "min"},
        default=None,
    )
    keep: Annotated[tuple[str, ...], words_of(KEPT, 0)] = key(
        "frames kept of every point: raw, render", example=[], default=()
    )
    figures: dict[Word, Figure] = key(
        "name of a PNG and a CSV -> figure",
        example={"best": {"show": "curves", "quantities": ["snr_db"]}},
        default=dict,
    )
    expect: dict[Word, Expectation] = key(
        "name -> a quantity and its expected range: expected.csv",
        example={"best": {"quantity": "optimum", "between": ["6 um", "7 um"]}},
        default=dict,
    )

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        mistakes = list(self._wrong_paths())
        if not self.varies:
            given = {"optimize": self.optimize is not None, "figures": bool(self.figures)}
            message, remedy = "the study varies nothing", "add vary, or remove this"
            mistakes += [fault((name,), message, remedy) for name in given if given[name]]
        if self.optimize is not None and self.optimize.metric not in self.metrics:
            message = f"{self.optimize.metric} is not among the metrics"
            mistakes.append(fault(("optimize", "metric"), message, "add it to metrics"))
        sought = self.optimize is not None
        mistakes += figure_model.mistakes(self.figures, self.metrics, sought)
        for name, item in self.expect.items():
            mistakes += _wrong_expectation(("expect", name), item, self, sought)
        if mistakes:
            raise failure(mistakes)
        return self

    @property
    def varies(self) -> bool:
        """Whether the study has more than a point in some case."""
        return bool(self.vary) or any(case.vary for case in self.cases.values())

    def _wrong_paths(self) -> Iterator[InitErrorDetails]:
        found: dict[tuple[str, ...], InitErrorDetails] = {}
        for name in ("", *self.cases):
            found |= self._overlaps(name)
        yield from found.values()
        places: list[tuple[tuple[str, ...], Mapping[str, Any]]] = [
            ((VARY,), self.vary),
            (("repeat",), self.repeat),
        ]
        for name, case in self.cases.items():
            places += [(("cases", name), case.overrides), (("cases", name, VARY), case.vary)]
        for place, paths in places:
            for name in paths:
                if not name or "" in name.split("."):
                    message = f"{describe(name)} is not a path of a camera"
                    yield fault((*place, name), message, "write for example pixel.width")

    def _overlaps(self, case: str) -> dict[tuple[str, ...], InitErrorDetails]:
        """Place -> mistake of keys where one would change the value in another's column."""
        own = self.cases[case].vary if case else {}
        varied: dict[str, tuple[str, ...]] = {path: (VARY, path) for path in self.vary}
        varied |= {path: ("cases", case, VARY, path) for path in own}
        places = [*varied.values(), *(("repeat", path) for path in self.repeat)]
        found: dict[tuple[str, ...], InitErrorDetails] = {}
        for number, place in enumerate(places):
            if self.seeds > 1 and overlap(place[-1], "seed.frame"):
                message = "seeds counts on from this key, and rows would have other values"
                found[place] = fault(place, message, "remove this key, or seeds")
            for other in places[:number]:
                if overlap(place[-1], other[-1]):
                    message = f"is varied too, by {'.'.join(other)}"
                    found[place] = fault(place, message, "keep one of the two")
        return found


def overlap(path: str, other: str) -> bool:
    """Tell whether two paths are the same key, or one a part of the other."""
    a, b = split(path), split(other)
    shared = min(len(a), len(b))
    return a[:shared] == b[:shared]


def _wrong_expectation(
    place: tuple[str, ...], item: Expectation, study: Sweep, sought: bool
) -> Iterator[InitErrorDetails]:
    """Mistakes of an expectation that take the rest of the study to tell; see `Figure`."""
    metrics = study.metrics
    known = (OPTIMUM, *metrics, *PROPERTIES)
    if item.quantity not in known:
        yield fault((*place, "quantity"), *one_of(item.quantity, known), given=item.quantity)
        return
    is_place = item.quantity == OPTIMUM
    if OPTIMUM in (item.quantity, item.at, item.over, item.minus) and not sought:
        remedy = "add optimize: {metric: ..., goal: min}"
        yield fault((*place, "quantity"), "the study seeks no optimum", remedy)
    if is_place and (item.at is not None or item.over is not None):
        wrong = "at" if item.at is not None else "over"
        yield fault((*place, wrong), "an optimum has no place", f"remove {wrong}")
    if not is_place and item.at is None and study.varies:
        yield fault((*place, "at"), "is missing", "write a value of the parameter, or optimum")
    if item.set and (is_place or is_measured(item.quantity, metrics, item.set)):
        message = f"{item.quantity} is taken from the sweep, which has no such overrides"
        yield fault((*place, "set"), message, "remove set, or name a property")
