"""What a sweep study expected to find, beside what it found: expected.csv.

Everything that an expectation needs is looked up before anything runs: its case, the values of the
parameter, cameras whose properties it needs. At the end numbers are only read from
the tables and compared.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from pathlib import Path

from vcam_cli import units
from vcam_cli.config.validation_messages import one_of
from vcam_cli.errors import BadInput, Collector
from vcam_cli.files.tables import Cell, write_table
from vcam_cli.records import dataclass
from vcam_cli.sweeps import properties, quantities
from vcam_cli.sweeps.model import OPTIMUM, Expectation
from vcam_cli.sweeps.study_cameras import StudyCameras
from vcam_cli.sweeps.sweep_file import Parameter
from vcam_cli.sweeps.sweep_result import ExpectationResult
from vcam_cli.sweeps.sweep_tables import Findings, table_number

EXPECT = "expect"
"""The key of the study file."""
COLUMNS = (
    "expectation", "case", "quantity", "found", "unit", "least", "most", "verdict", "basis",
    "setting", "source", "why",
)  # fmt: skip
ROUNDING = 1e-9
"""Relative difference up to which two values of a parameter are the same."""

Lookup = Callable[[Findings], float]
"""Takes a number out of what was found; nan where it is not there."""


@dataclass(frozen=True)
class PlannedExpectation:
    """An expectation, and how its number is found."""

    name: str
    item: Expectation
    case: str
    unit: str
    least: float
    most: float
    lookup: Lookup
    optima: tuple[tuple[str, str], ...] = ()
    """Case and parameter of each optimum that the number is taken from."""

    def result(self, findings: Findings) -> ExpectationResult:
        """Compare the number that was found with those that were expected."""
        value = table_number(self.lookup(findings))
        verdict, said, cell = "missed", f"{value:g}", _finite_cell(value)
        if none := self._without_optimum(findings):
            said, cell = none, "none"
        elif self.least <= value <= self.most:
            verdict = "inside"
        elif math.isnan(value):
            verdict = "unknown"
        item, name = self.item, self.name
        summary = f"{name}: {said}, expected {self.least:g} to {self.most:g} {self.unit}"
        if item.why and verdict == "missed":
            summary = f"{summary.rstrip()} ({item.why})"
        row: tuple[Cell, ...] = (
            name, self.case, item.quantity, cell, self.unit,
            _finite_cell(self.least), _finite_cell(self.most), verdict, item.basis,
            item.setting, item.source, item.why,
        )  # fmt: skip
        return ExpectationResult(name, verdict, summary.rstrip(), item.basis, row)

    def _without_optimum(self, findings: Findings) -> str:
        """Return that a case the number needs has no optimum inside its range; "" otherwise."""
        for best in (findings.optimum(*place) for place in self.optima):
            if best is not None and best.edge:
                return f"no optimum in {best.case}, best at the {best.edge} end of the range"
        return ""


def _finite_cell(value: float) -> Cell:
    return value if math.isfinite(value) else ""


def plan(cameras: StudyCameras) -> tuple[PlannedExpectation, ...]:
    """Return the expectations of a study, in its order. Raises BadInput with everything wrong."""
    problems, planned = Collector(), []
    for name, item in cameras.grid.study.model.expect.items():
        try:
            planned.append(_Planner(cameras, name, item).resolve())
        except BadInput as error:
            problems.extend(error)
    problems.raise_if_any()
    return tuple(planned)


def write(results: Sequence[ExpectationResult], path: Path) -> None:
    """Write expected.csv."""
    write_table(path, COLUMNS, (result.row for result in results))


class _Planner:
    """Finds what one expectation names."""

    def __init__(self, cameras: StudyCameras, name: str, item: Expectation) -> None:
        self._grid, self._cameras, self._name, self._item = cameras.grid, cameras, name, item
        self._case = self._known_case(item.case or next(iter(cameras.grid.cases)), "case")
        self._parameter = self._only_parameter()
        self._optima: list[tuple[str, str]] = []

    def resolve(self) -> PlannedExpectation:
        """Return the expectation with the numbers that it names."""
        item = self._item
        own = quantities.unit(item.quantity)
        if item.quantity == OPTIMUM:
            own = self._varied("quantity").unit
        unit = "" if item.over is not None else own
        least, most = (self._number(given, unit) for given in item.between)
        if least > most:
            raise self._wrong("between", f"{least:g} is more than {most:g}", "swap them")
        lookup = self._lookup()
        optima = tuple(self._optima)
        return PlannedExpectation(self._name, item, self._case, unit, least, most, lookup, optima)

    def _wrong(self, key: str, message: str, remedy: str) -> BadInput:
        return self._grid.study.mistake((EXPECT, self._name, key), message, remedy)

    def _known_case(self, name: str, key: str) -> str:
        if name not in self._grid.cases:
            raise self._wrong(key, *one_of(name, tuple(self._grid.cases)))
        return name

    def _only_parameter(self) -> Parameter | None:
        """Return what is varied; None of a case that is a single point."""
        parameters = tuple(self._grid.cases[self._case].parameters.values())
        if not parameters:
            return None
        if len(parameters) > 1:
            message = f"the case {self._case} varies {len(parameters)} parameters"
            raise self._wrong("case", message, "expectations are of studies that vary one")
        return parameters[0]

    def _varied(self, key: str) -> Parameter:
        if self._parameter is None:
            message = f"the case {self._case} varies nothing"
            raise self._wrong(key, message, "remove this key, or name another case")
        return self._parameter

    def _number(self, given: object, unit: str) -> float:
        if isinstance(given, float) and math.isinf(given):
            return given
        try:
            number, own = units.split(given)
            return float(units.convert(number, own, unit) if own else number)
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            raise self._wrong("between", message, remedy) from None

    def _lookup(self) -> Lookup:
        """Return the quantity at its place, over or minus what it is elsewhere."""
        first = self._term("at")
        for key, combine in (("over", _ratio), ("minus", operator.sub)):
            if getattr(self._item, key) is not None:
                second = self._term(key)
                return lambda findings: combine(first(findings), second(findings))
        return first

    def _optimum(self, case: str, name: str) -> Lookup:
        """Return the place of a case's optimum, or the value there."""
        path = self._varied("quantity").path
        self._optima.append((case, path))
        return lambda findings: float(getattr(findings.optimum(case, path), name, math.nan))

    def _term(self, key: str) -> Lookup:
        """Return the quantity at the value that stands at a key; an optimum, of the case there."""
        item, model = self._item, self._grid.study.model
        if item.quantity == OPTIMUM:
            case = self._case if key == "at" else self._known_case(item.minus, key)
            return self._optimum(case, "optimum")
        is_measured = quantities.is_measured(item.quantity, model.metrics, item.set)
        if getattr(item, key) != OPTIMUM:
            return self._metric(key) if is_measured else self._property(key)
        if not is_measured:
            message = "properties cannot be evaluated at the optimum"
            raise self._wrong(key, message, "write a value of the parameter")
        if model.optimize is None or model.optimize.metric != item.quantity:
            message = f"the study does not optimize {item.quantity}"
            raise self._wrong(key, message, "write a value of the parameter")
        return self._optimum(self._case, "value")

    def _metric(self, key: str) -> Lookup:
        case, metric = self._case, self._item.quantity
        if self._is_point(key):
            return lambda findings: float(findings.surface(case, metric).mean)
        parameter = self._varied(key)
        (wanted,) = self._grid.study.values(parameter, EXPECT, self._name, key).cells
        cells = parameter.cells
        near = [i for i, cell in enumerate(cells) if _is_same(cell, wanted)]
        if not near:
            message = f"the study has no point at {wanted} {parameter.unit}".rstrip()
            raise self._wrong(key, message, f"write one of its values, for example {cells[0]}")
        return lambda findings: float(findings.surface(case, metric).mean[near[0]])

    def _is_point(self, key: str) -> bool:
        """Return whether a case is a single point, which needs no place."""
        return self._parameter is None and getattr(self._item, key) is None

    def _property(self, key: str) -> Lookup:
        place, nodes = (EXPECT, self._name), {}
        if not self._is_point(key):
            parameter = self._varied(key)
            (node,) = self._grid.study.values(parameter, EXPECT, self._name, key).nodes
            nodes = {parameter.path: node}
        (camera,) = self._cameras.frames(place, self._case, nodes)
        value = properties.value(camera, self._item.quantity)
        return lambda _: value


def _is_same(one: float | str, other: float | str) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return math.isclose(one, other, rel_tol=ROUNDING)


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else math.nan
