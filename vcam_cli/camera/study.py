"""What a study file may say: a camera, what is varied, what is measured, what is sought.

Overrides are keys of a camera by their dotted path, as in `--set`. Their values are checked as
part of each camera that they make (see `variants`), so here they are only taken apart.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.camera.base import Model, exactly_one, key, together
from vcam_cli.camera.explain import failure, fault, one_of, repeats, shown
from vcam_cli.camera.study_expect import Expectation
from vcam_cli.camera.study_expect import mistakes as mistakes_of_expectations
from vcam_cli.camera.study_figures import Figure
from vcam_cli.camera.study_figures import mistakes as mistakes_of_figures
from vcam_cli.camera.values import Either, Whole, Word, mapping

METRICS = {
    "exposure_time": "s",
    "mean_electrons": "e",
    "saturated_fraction": "",
    "snr_db": "dB",
    "dynamic_range_db": "dB",
    "well_capacity": "e",
    "mse": "",
    "psnr_db": "dB",
    "mean_delta_e": "",
    "mean_s_cielab": "",
}
"""Metric -> its unit."""
QUALITY = {
    "mse": "mse",
    "psnr_db": "psnr",
    "mean_delta_e": "cielab",
    "mean_s_cielab": "s-cielab",
}
"""Metric -> what a camera has to be asked for to get it; the others every run has."""
KEPT = ("raw", "render")
KINDS = ("sweep", "schedule")
"""What `kind` of a study may be."""
VARY = "vary"
"""The key of a case that is no path."""


class Variation(Model):
    """The values that a parameter takes: a range of equal steps, or a list."""

    start: Annotated[str | float | None, Either(lambda given: given, str | float)] = key(
        "the first value, with its unit", example="5.3 um", default=None
    )
    stop: Annotated[str | float | None, Either(lambda given: given, str | float)] = key(
        "the last value", example="15 um", default=None
    )
    count: Annotated[int | None, Whole(least=1, most=100_000, example="20")] = key(
        "number of values", example=20, default=None
    )
    values: Annotated[tuple[Any, ...] | None, Either(lambda given: _list(given), list[Any])] = key(
        "the values themselves, in place of a range", example=["4 um", "6 um"], default=None
    )

    rules = (
        exactly_one("start", "values", of="what it varies over", remedy="write {values: [...]}"),
        together("start", "stop", "count"),
    )


def _list(given: Any) -> tuple[Any, ...]:
    if not isinstance(given, (list, tuple)):
        raise ValueError(f"{shown(given)} is not a list of values; write for example [4 um, 6 um]")
    if not given:
        raise ValueError("is an empty list; give at least one value")
    twice = sorted(repeats(given))
    if twice:
        raise failure([fault((i,), f"{shown(given[i])} comes twice", "", given[i]) for i in twice])
    return tuple(given)


class Optimize(Model):
    """What is sought."""

    metric: Literal[tuple(METRICS)] = key("one of the metrics", example="mean_s_cielab")  # type: ignore[valid-type]
    goal: Literal["min", "max"] = key("the least or the most of it", example="min")


def _cameras(given: Any) -> tuple[str, ...]:
    found = given if isinstance(given, (list, tuple)) else [given]
    if not found:
        raise ValueError("is an empty list; name at least one camera")
    for item in found:
        if not isinstance(item, str) or not item:
            what = f"{shown(item)} is not the name or path of a camera file"
            raise ValueError(f"{what}; write for example starter")
    return tuple(found)


def words_of(allowed: tuple[str, ...], least: int) -> Any:
    """Reads a list of some of the words."""

    def pick(given: Any) -> tuple[str, ...]:
        if not isinstance(given, (list, tuple)):
            raise ValueError(f"{shown(given)} is not a list; write for example [{allowed[0]}]")
        if len(given) < least:
            raise ValueError(f"is an empty list; write for example [{allowed[0]}]")
        mistakes, twice = [], repeats(given)
        for i, item in enumerate(given):
            if item not in allowed:
                mistakes.append(fault((i,), *one_of(item, allowed), given=item))
            elif i in twice:
                mistakes.append(fault((i,), f"{item} comes twice", "keep one of them", item))
        if mistakes:
            raise failure(mistakes)
        return tuple(given)

    return Either(pick, list[Literal[allowed]])  # type: ignore[valid-type]


_REPEATED = Annotated[tuple[Any, ...], Either(lambda given: _list(given), list[Any])]


class Case(Model):
    """Overrides of a case: any paths of the camera, and `vary`."""

    model_config = Model.model_config | {"extra": "allow"}
    vary: dict[str, Variation] = key(
        "in place of what the study varies, path by path",
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
        "path in the camera -> its values; several make a grid",
        example={"pixel.width": {"start": "3 um", "stop": "8 um", "count": 20}},
    )
    cases: dict[Word, Case] = key(
        "name -> overrides by path: the sweep is repeated for each",
        example={"nominal": {}, "dim": {"scene.luminance": "10 cd/m2"}},
        default=dict,
    )
    repeat: dict[str, _REPEATED] = key(
        "path -> values over which metrics are averaged",
        example={"scene.source.phase": ["0 deg", "90 deg"]},
        default=dict,
    )
    seeds: Annotated[int, Whole(least=1, most=100_000, example="4")] = key(
        "number of frame seeds, from the camera's up, likewise averaged", example=4, default=1
    )
    metrics: Annotated[tuple[str, ...], words_of(tuple(METRICS), 1)] = key(
        "what is measured", example=["snr_db"]
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
        "name of a PNG and a CSV -> what they show",
        example={"best": {"show": "lines", "metric": "snr_db"}},
        default=dict,
    )

    expect: dict[Word, Expectation] = key(
        "name -> a quantity, and between which values it is expected: expected.csv",
        example={"best": {"quantity": "optimum", "between": ["6 um", "7 um"]}},
        default=dict,
    )

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        mistakes = list(self._wrong_paths())
        if not self.vary:
            message = "varies nothing: the grid is empty"
            mistakes.append(fault((VARY,), message, "name a path and its values"))
        if self.optimize is not None and self.optimize.metric not in self.metrics:
            message = f"{self.optimize.metric} is not among the metrics"
            mistakes.append(fault(("optimize", "metric"), message, "add it to metrics"))
        sought = self.optimize is not None
        mistakes += mistakes_of_figures(self.figures, self.metrics, sought)
        mistakes += mistakes_of_expectations(self.expect, self.metrics, sought)
        if mistakes:
            raise failure(mistakes, "study")
        return self

    def _wrong_paths(self) -> Iterator[InitErrorDetails]:
        for name in self.repeat:
            if name in self.vary:
                yield fault(("repeat", name), "is varied too", "keep one of the two")
        places: list[tuple[tuple[str, ...], Mapping[str, Any]]] = [
            ((VARY,), self.vary),
            (("repeat",), self.repeat),
        ]
        for name, case in self.cases.items():
            places += [(("cases", name), case.overrides), (("cases", name, VARY), case.vary)]
        for place, paths in places:
            for name in paths:
                if not name or "" in name.split("."):
                    message = f"{shown(name)} is not a path of a camera"
                    yield fault((*place, name), message, "write for example pixel.width")
