"""What a sweep study expected to find, beside what it found: expected.csv.

Everything that an expectation needs is looked up before anything runs: its case, the values of the
parameter, cameras whose properties it asks for. What is left for the end is to take numbers out of
the tables and compare.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vcam_cli import units
from vcam_cli.camera.explain import one_of
from vcam_cli.camera.study import METRICS
from vcam_cli.camera.study_expect import OPTIMUM, Expectation
from vcam_cli.camera.study_figures import PROPERTIES
from vcam_cli.errors import BadInput, Collector, Problem
from vcam_cli.files.tables import Cell, write_table
from vcam_cli.studies import properties, sweep_tables
from vcam_cli.studies.figures import Planner
from vcam_cli.studies.study_file import Parameter
from vcam_cli.studies.sweep_points import Grid
from vcam_cli.studies.sweep_result import Found, Verdict
from vcam_cli.studies.sweep_tables import Outcomes

EXPECT = "expect"
"""The key of the study file."""
COLUMNS = (
    "expectation", "case", "quantity", "found", "unit", "least", "most", "verdict", "calibrated",
    "source", "why",
)  # fmt: skip
SAME = 1e-9
"""Relative difference of two values of a parameter that is rounding."""

Look = Callable[[Outcomes, Sequence[Found]], float]
"""Takes a number out of what was found; nan where it is not there."""


@dataclass(frozen=True)
class Expected:
    """An expectation, and how its number is found."""

    name: str
    item: Expectation
    case: str
    unit: str
    least: float
    most: float
    look: Look

    def verdict(self, outcomes: Outcomes, found: Sequence[Found]) -> Verdict:
        """What became of it."""
        value = float(f"{self.look(outcomes, found):.{sweep_tables.DIGITS}g}")
        word = "inside" if self.least <= value <= self.most else "missed"
        if math.isnan(value):
            word = "unknown"
        return Verdict(
            self.name, word, self._said(value, word), self.item.calibrated, self._row(value, word)
        )

    def _row(self, value: float, word: str) -> tuple[Cell, ...]:
        item = self.item
        ends = ("" if math.isinf(end) else end for end in (self.least, self.most))
        about = (item.calibrated, item.source, item.why)
        known = "" if math.isnan(value) else value
        return (self.name, self.case, item.quantity, known, self.unit, *ends, word, *about)

    def _said(self, value: float, word: str) -> str:
        said = f"{self.name}: {value:g}, expected {self.least:g} to {self.most:g} {self.unit}"
        why = self.item.why
        return said.rstrip() + (f" ({why})" if why and word == "missed" else "")


def plan(grid: Grid, planner: Planner) -> tuple[Expected, ...]:
    """The expectations of a study, in its order. Raises BadInput with everything wrong."""
    problems, out = Collector(), []
    for name, item in grid.study.model.expect.items():
        try:
            out.append(_Resolver(grid, planner, name, item).expected())
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return tuple(out)


def write(verdicts: Sequence[Verdict], path: Path) -> None:
    """Writes expected.csv."""
    write_table(path, COLUMNS, (verdict.row for verdict in verdicts))


class _Resolver:
    """Looks up what an expectation names."""

    def __init__(self, grid: Grid, planner: Planner, name: str, item: Expectation) -> None:
        self._grid, self._planner, self._name, self._item = grid, planner, name, item
        self._case = self._known_case(item.case or next(iter(grid.cases)), "case")
        self._parameter = self._only_parameter()

    def expected(self) -> Expected:
        item = self._item
        unit = "" if item.over is not None else self._unit
        least, most = (self._number(i, unit) for i in range(2))
        if least > most:
            raise self._wrong("between", f"{least:g} is more than {most:g}", "turn them round")
        return Expected(self._name, item, self._case, unit, least, most, self._look())

    def _wrong(self, key: str, message: str, remedy: str) -> BadInput:
        path = (EXPECT, self._name, key)
        return BadInput([Problem(path, message, remedy, self._grid.study.locate(path))])

    def _known_case(self, name: str, key: str) -> str:
        if name not in self._grid.cases:
            raise self._wrong(key, *one_of(name, tuple(self._grid.cases)))
        return name

    def _only_parameter(self) -> Parameter:
        parameters = tuple(self._grid.cases[self._case].values())
        if len(parameters) != 1:
            message = f"the case {self._case} varies {len(parameters)} parameters"
            raise self._wrong("case", message, "expectations are of studies that vary one")
        return parameters[0]

    @property
    def _of_property(self) -> bool:
        item = self._item
        measured = item.quantity in self._grid.study.model.metrics
        return item.quantity in PROPERTIES and (bool(item.set) or not measured)

    @property
    def _unit(self) -> str:
        if self._item.quantity == OPTIMUM:
            return self._parameter.unit
        return (METRICS | PROPERTIES)[self._item.quantity]

    def _number(self, index: int, unit: str) -> float:
        given = self._item.between[index]
        if isinstance(given, float) and math.isinf(given):
            return given
        try:
            number, own = units.split(given)
            return float(units.convert(number, own, unit) if own else number)
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            raise self._wrong("between", message, remedy) from None

    def _look(self) -> Look:
        item = self._item
        if item.quantity == OPTIMUM:
            first = self._optimum(self._case, "optimum")
            if item.minus is None:
                return first
            return _combined(first, self._optimum(self._known_case(item.minus, "minus"), "optimum"))
        first = self._at("at")
        if item.over is not None:
            return _combined(first, self._at("over"), ratio=True)
        return first if item.minus is None else _combined(first, self._at("minus"))

    def _optimum(self, case: str, what: str) -> Look:
        path = self._parameter.path

        def look(_: Outcomes, found: Sequence[Found]) -> float:
            here = [f for f in found if (f.case, f.parameter) == (case, path)]
            return float(getattr(here[0], what)) if here else math.nan

        return look

    def _at(self, key: str) -> Look:
        """The quantity at the value of the parameter that stands at a key."""
        given = getattr(self._item, key)
        if self._of_property:
            return self._property(key)
        if given == OPTIMUM:
            goal = self._grid.study.model.optimize
            if goal is None or goal.metric != self._item.quantity:
                message = f"{self._item.quantity} is not what the optimum is of"
                raise self._wrong(key, message, "write a value of the parameter")
            return self._optimum(self._case, "value")
        return self._metric(key)

    def _values(self, key: str) -> Parameter:
        parameter = self._parameter
        return self._grid.study.values(parameter.path, parameter.unit, EXPECT, self._name, key)

    def _metric(self, key: str) -> Look:
        (wanted,) = self._values(key).cells
        cells = self._parameter.cells
        near = [i for i, c in enumerate(cells) if _same(c, wanted)]
        if not near:
            message = f"the study has no point at {wanted} {self._parameter.unit}".rstrip()
            raise self._wrong(key, message, f"write one of its values, for example {cells[0]}")
        grid, case, metric = self._grid, self._case, self._item.quantity

        def look(outcomes: Outcomes, _: Sequence[Found]) -> float:
            return float(sweep_tables.surface(grid, case, metric, outcomes).mean[near[0]])

        return look

    def _property(self, key: str) -> Look:
        if getattr(self._item, key) == OPTIMUM:
            message = "properties are looked up before the optimum is known"
            raise self._wrong(key, message, "write a value of the parameter")
        (node,) = self._values(key).nodes
        place = (EXPECT, self._name)
        camera = self._planner.camera(place, self._item.set, self._case, self._parameter.path, node)
        (value,) = properties.values(camera, (self._item.quantity,))
        return lambda *_: value


def _same(one: float | str, other: float | str) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return math.isclose(one, other, rel_tol=SAME)


def _combined(first: Look, second: Look, ratio: bool = False) -> Look:
    """The ratio of two numbers, or their difference."""

    def look(outcomes: Outcomes, found: Sequence[Found]) -> float:
        a, b = first(outcomes, found), second(outcomes, found)
        if not ratio:
            return a - b
        return a / b if b else math.nan

    return look
