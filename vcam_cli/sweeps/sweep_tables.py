"""What a sweep found, and its tables: points.csv, timings.csv, optimum.csv."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.files.tables import Cell, write_table
from vcam_cli.records import dataclass
from vcam_cli.sweeps.joint_optimum import MIN_POINTS, find_joint_optimum
from vcam_cli.sweeps.model import Optimize
from vcam_cli.sweeps.optimum import Optimum, find_optimum
from vcam_cli.sweeps.sweep_file import Parameter
from vcam_cli.sweeps.sweep_points import Grid, Point
from vcam_cli.sweeps.sweep_result import (
    OPTIMUM_COLUMNS,
    CaseOptimum,
    ExpectationResult,
    Outcome,
    SweepResult,
    error_cell,
)

DIGITS = 6
"""Of numbers in optimum.csv and expected.csv: more than any interval is worth."""

Row = tuple[Cell, ...]
Writers = dict[str, Callable[[Path], None]]
"""Name of a file -> what writes it."""


def table_number(value: float) -> float:
    """Return a number as optimum.csv and expected.csv have it."""
    return float(f"{value:.{DIGITS}g}")


@dataclass(frozen=True)
class Surface:
    """A metric over the grid of a case: (values of each parameter ..., repeats x seeds)."""

    parameters: tuple[Parameter, ...]
    values: Array

    @property
    def mean(self) -> Array:
        """Over repeats and seeds; nan where one of them is missing or not finite."""
        with np.errstate(invalid="ignore"):
            mean = self.values.mean(axis=-1)
        return np.where(np.isfinite(mean), mean, np.nan)


@dataclass(frozen=True)
class Findings:
    """Records of the points of a study."""

    grid: Grid
    outcomes: Mapping[str, Outcome]
    """By the hash of the point."""

    def surface(self, case: str, metric: str) -> Surface:
        """Return a metric in a case; nan where nothing is known of it."""
        parameters = tuple(self.grid.cases[case].parameters.values())
        points = [point for point in self.grid.points if point.case == case]
        known = [self.outcomes[p.id].metrics if p.id in self.outcomes else {} for p in points]
        values = np.array([metrics.get(metric, math.nan) for metrics in known], float)
        return Surface(parameters, values.reshape(*(len(p.nodes) for p in parameters), -1))

    @cached_property
    def optima(self) -> tuple[CaseOptimum, ...]:
        """The optimum of every parameter in every case, where the study seeks it."""
        wanted = self.grid.study.model.optimize
        if wanted is None:
            return ()
        return tuple(o for case in self.grid.cases for o in self._case_optima(case, wanted))

    def optimum(self, case: str, parameter: str) -> CaseOptimum | None:
        """Return the optimum of a parameter in a case; None without one."""
        found = (o for o in self.optima if (o.case, o.parameter) == (case, parameter))
        return next(found, None)

    def _case_optima(self, case: str, wanted: Optimize) -> Iterator[CaseOptimum]:
        """Yield the joint optimum of the parameters that are numbers.

        Of those that have too few values or are words, and where points are missing, those along
        lines through the best point of all.
        """
        surface = self.surface(case, wanted.metric)
        sign = 1 if wanted.goal == "min" else -1
        if np.isnan(surface.mean).all():
            return
        shape = surface.mean.shape
        best = [int(i) for i in np.unravel_index(np.nanargmin(sign * surface.mean), shape)]
        joint = _joint_optima(case, surface, best, wanted)
        for axis, parameter in enumerate(surface.parameters):
            if axis in joint:
                yield joint[axis]
                continue
            line = tuple(slice(None) if i == axis else b for i, b in enumerate(best))
            yield _optimum(case, parameter, surface.values[line], wanted)


def _joint_optima(
    case: str, surface: Surface, best: Sequence[int], wanted: Optimize
) -> dict[int, CaseOptimum]:
    """Return the joint optimum by axis, of two parameters or more; {} without one."""
    axes = [
        i
        for i, parameter in enumerate(surface.parameters)
        if len(parameter.cells) >= MIN_POINTS and isinstance(parameter.cells[0], float)
    ]
    plane = tuple(slice(None) if i in axes else b for i, b in enumerate(best))
    curves = np.moveaxis(surface.values[plane], -1, 0)
    if len(axes) < 2 or not np.isfinite(curves).all():
        return {}
    numbers = [np.array(surface.parameters[i].cells, float) for i in axes]
    found = find_joint_optimum(numbers, curves, wanted.goal)
    return {
        i: _table_row(case, surface.parameters[i], optimum, wanted)
        for i, optimum in zip(axes, found, strict=True)
    }


def _optimum(case: str, parameter: Parameter, values: Array, wanted: Optimize) -> CaseOptimum:
    """Return the optimum of values (values of the parameter, repeats x seeds)."""
    good = np.asarray(np.isfinite(values).all(axis=1))
    about = (case, parameter.path, parameter.unit)
    cells = [cell for cell, is_good in zip(parameter.cells, good, strict=True) if is_good]
    if any(isinstance(cell, str) for cell in cells):
        means = values[good].mean(axis=1)
        i = int(np.argmin(means) if wanted.goal == "min" else np.argmax(means))
        value = table_number(float(means[i]))
        return CaseOptimum(*about, str(cells[i]), math.nan, math.nan, wanted.metric, value, "")
    found = find_optimum(np.array(cells, float), values[good].T, wanted.goal)
    return _table_row(case, parameter, found, wanted)


def _table_row(case: str, parameter: Parameter, found: Optimum, wanted: Optimize) -> CaseOptimum:
    """Return an optimum with its numbers rounded."""
    numbers = (found.place, found.low, found.high, found.value, found.fitted)
    place, low, high, value, fitted = map(table_number, numbers)
    about, none = (case, parameter.path, parameter.unit), math.nan
    if found.edge:
        return CaseOptimum(*about, none, none, none, wanted.metric, value, found.edge, place)
    return CaseOptimum(*about, place, low, high, wanted.metric, value, "", none, fitted)


def result(
    findings: Findings, out: Path, expectations: tuple[ExpectationResult, ...], computed: int
) -> SweepResult:
    """Return the result of a sweep; computed: number of points computed now."""
    grid, outcomes = findings.grid, findings.outcomes
    names = _point_columns(grid)
    refused = [not p.id or (p.id in outcomes and _is_refused(outcomes[p.id])) for p in grid.points]
    return SweepResult(
        name=grid.study.model.name,
        out=out,
        ids=tuple(point.id for point in grid.points),
        points=[dict(zip(names, row, strict=True)) for row in _point_rows(findings)],
        averaged=tuple(parameter.column for parameter in grid.averaged_parameters),
        missing=sum(1 for p in grid.points if p.id and p.id not in outcomes),
        refused=tuple(map(str, grid.problems)),
        all_refused=all(refused),
        optima=findings.optima,
        expectations=expectations,
        computed=computed,
    )


def _is_refused(outcome: Outcome) -> bool:
    return bool(outcome.error) and outcome.final


def writers(findings: Findings) -> Writers:
    """Return what writes the tables."""
    grid = findings.grid
    tables = {
        "points.csv": (_point_columns(grid), _point_rows(findings)),
        "timings.csv": ((*_key_columns(grid), "seconds"), _timing_rows(findings)),
    }
    if grid.study.model.optimize is not None:
        tables["optimum.csv"] = (OPTIMUM_COLUMNS, (o.row for o in findings.optima))
    return {
        name: partial(write_table, columns=columns, rows=rows)
        for name, (columns, rows) in tables.items()
    }


def _key_columns(grid: Grid) -> tuple[str, ...]:
    """Return the columns that tell points from each other."""
    return ("case", *(p.column for p in (*grid.case_parameters, *grid.averaged_parameters)), "seed")


def _key_cells(grid: Grid, point: Point) -> Row:
    cells = point.case_values | point.averaged_values
    named = [cells.get(p.path, "") for p in (*grid.case_parameters, *grid.averaged_parameters)]
    return (point.case, *named, "" if point.seed is None else point.seed)


def _point_columns(grid: Grid) -> tuple[str, ...]:
    return (*_key_columns(grid), *grid.study.model.metrics, "error")


def _point_rows(findings: Findings) -> Iterator[Row]:
    """Yield the rows of all points that have a record."""
    metrics = findings.grid.study.model.metrics
    for point in findings.grid.points:
        error, values = error_cell(point.problems), {}
        if point.id:
            if point.id not in findings.outcomes:
                continue
            outcome = findings.outcomes[point.id]
            error, values = outcome.error, outcome.metrics
        yield (*_key_cells(findings.grid, point), *(values.get(m, "") for m in metrics), error)


def _timing_rows(findings: Findings) -> Iterator[Row]:
    """Yield the seconds of every point that was computed."""
    for point in findings.grid.points:
        if point.id in findings.outcomes:
            seconds = round(findings.outcomes[point.id].seconds, 6)
            yield (*_key_cells(findings.grid, point), seconds)
