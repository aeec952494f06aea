"""What a sweep leaves: points.csv, timings.csv, optimum.csv, a plot of every metric."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.study import METRICS
from vcam_cli.files.sweep_plots import Line, over_parameter
from vcam_cli.files.tables import Cell, write_table
from vcam_cli.studies import optimum
from vcam_cli.studies.outcome import Outcome, in_a_cell
from vcam_cli.studies.study_file import Parameter
from vcam_cli.studies.sweep_points import Grid, Point
from vcam_cli.studies.sweep_result import OPTIMUM, Found, SweepResult, Verdict

DIGITS = 6
"""Of numbers in optimum.csv: more than any interval is worth."""
MANY = 36
"""Lines of a plot at most; what is beyond is in points.csv."""

LABELS = {
    "snr_db": "SNR at 20 % of the well",
    "dynamic_range_db": "dynamic range",
    "mse": "mean squared error",
    "psnr_db": "PSNR",
    "mean_delta_e": "mean CIELAB Delta E",
    "mean_s_cielab": "mean S-CIELAB Delta E",
}
"""How a plot names a metric, where its name would not do."""

Outcomes = Mapping[str, Outcome]
Row = tuple[Cell, ...]


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def columns(grid: Grid) -> tuple[str, ...]:
    """What points.csv and timings.csv begin with."""
    return ("case", *(p.column for p in (*grid.varied, *grid.repeated)), "seed")


def rows(grid: Grid, outcomes: Outcomes) -> Iterator[Row]:
    """The rows of points.csv, of all points of which something is known."""
    metrics = grid.study.model.metrics
    for point in grid.points:
        error, values = in_a_cell(point.problems), {}
        if point.id:
            if point.id not in outcomes:
                continue
            error, values = outcomes[point.id].error, outcomes[point.id].metrics
        yield (*_head(grid, point), *(values.get(m, "") for m in metrics), error)


def timings(grid: Grid, outcomes: Outcomes) -> Iterator[Row]:
    """The rows of timings.csv: seconds of every point that was computed."""
    for point in grid.points:
        if point.id in outcomes:
            yield (*_head(grid, point), round(outcomes[point.id].seconds, 6))


def _head(grid: Grid, point: Point) -> Row:
    cells = point.varied | point.repeated
    named = [cells.get(p.path, "") for p in (*grid.varied, *grid.repeated)]
    return (point.case, *named, "" if point.seed is None else point.seed)


@dataclass(frozen=True)
class Surface:
    """A metric over the grid of a case: (values of each parameter ..., repeats x seeds)."""

    parameters: tuple[Parameter, ...]
    values: NDArray

    @property
    def mean(self) -> NDArray:
        """Over repeats and seeds; nan where one of them is missing or not finite."""
        with np.errstate(invalid="ignore"):
            mean = self.values.mean(axis=-1)
        return np.where(np.isfinite(mean), mean, np.nan)


def surface(grid: Grid, case: str, metric: str, outcomes: Outcomes) -> Surface:
    """What was found of a metric in a case; nan where nothing was."""
    parameters = tuple(grid.cases[case].values())
    found = [
        outcomes[p.id].metrics.get(metric, math.nan) if p.id in outcomes else math.nan
        for p in grid.points
        if p.case == case
    ]
    shape = tuple(len(p.nodes) for p in parameters)
    return Surface(parameters, np.array(found, float).reshape(*shape, -1))


def optima(grid: Grid, outcomes: Outcomes) -> Iterator[Found]:
    """The optimum of every parameter in every case, where the study asks for it.

    Of a grid of several parameters: along each, through the best point of all.
    """
    wanted = grid.study.model.optimize
    if wanted is None:
        return
    for case in grid.cases:
        here = surface(grid, case, wanted.metric, outcomes)
        sign = 1 if wanted.goal == "min" else -1
        if np.isnan(here.mean).all():
            continue
        best = np.unravel_index(int(np.nanargmin(sign * here.mean)), here.mean.shape)
        for axis, parameter in enumerate(here.parameters):
            line = tuple(slice(None) if i == axis else b for i, b in enumerate(best))
            yield _optimum(case, parameter, here.values[line], wanted.metric, wanted.goal)


def _optimum(case: str, parameter: Parameter, values: NDArray, metric: str, goal: str) -> Found:
    """values: (values of the parameter, repeats x seeds)"""
    good = np.isfinite(values).all(axis=1)
    about = (case, parameter.path, parameter.unit)
    cells = [c for c, there in zip(parameter.cells, good, strict=True) if there]
    if any(isinstance(c, str) for c in cells):
        means = values[good].mean(axis=1)
        i = int(np.argmin(means) if goal == "min" else np.argmax(means))
        mean = _rounded(float(means[i]))
        return Found(*about, str(cells[i]), math.nan, math.nan, metric, mean, "")
    found = optimum.find(np.array(cells, float), values[good].T, goal)
    at, low, high, value = map(_rounded, (found.at, found.low, found.high, found.value))
    return Found(*about, at, low, high, metric, value, found.edge)


def result(
    grid: Grid,
    out: Path,
    outcomes: Outcomes,
    best: tuple[Found, ...],
    verdicts: tuple[Verdict, ...],
    computed: int,
) -> SweepResult:
    """The result of a sweep whose outcomes are known, by hash of the point."""
    names = (*columns(grid), *grid.study.model.metrics, "error")
    wrong = [not p.id or (p.id in outcomes and _refused(outcomes[p.id])) for p in grid.points]
    return SweepResult(
        name=grid.study.model.name,
        out=out,
        ids=tuple(point.id for point in grid.points),
        points=[dict(zip(names, row, strict=True)) for row in rows(grid, outcomes)],
        missing=sum(1 for p in grid.points if p.id and p.id not in outcomes),
        refused=tuple(map(str, grid.refused)),
        all_refused=all(wrong),
        optima=best,
        verdicts=verdicts,
        computed=computed,
    )


def _refused(outcome: Outcome) -> bool:
    return bool(outcome.error) and outcome.final


Writers = dict[str, Callable[[Path], None]]


def writers(grid: Grid, outcomes: Outcomes, found: Sequence[Found]) -> Writers:
    """Name of a file -> what writes it."""
    model, head = grid.study.model, columns(grid)
    out: Writers = {
        "points.csv": partial(
            write_table, columns=(*head, *model.metrics, "error"), rows=rows(grid, outcomes)
        ),
        "timings.csv": partial(
            write_table, columns=(*head, "seconds"), rows=timings(grid, outcomes)
        ),
    }
    if model.optimize is not None:
        table = [f.row for f in found]
        out["optimum.csv"] = partial(write_table, columns=OPTIMUM, rows=table)
    for metric in model.metrics:
        out[f"{metric}.png"] = partial(_plot, grid, outcomes, found, metric)
    return out


def _plot(grid: Grid, outcomes: Outcomes, found: Sequence[Found], metric: str, path: Path) -> None:
    """The metric over the parameter of most values, a line for each case and other value."""
    drawn = max(grid.varied, key=lambda p: len(p.nodes))
    words = drawn.cells if any(isinstance(c, str) for c in drawn.cells) else ()
    lines = [
        line
        for case in grid.cases
        if drawn.path in grid.cases[case]
        for line in lines_of(grid, outcomes, case, metric, drawn.path, found)
    ]
    unit = METRICS[metric]
    label = LABELS.get(metric, metric.replace("_", " ")) + (f" [{unit}]" if unit else "")
    text = [str(word) for word in words]
    over_parameter(path, grid.study.model.name, drawn.column, label, lines[:MANY], text)


def lines_of(
    grid: Grid, outcomes: Outcomes, case: str, metric: str, path: str, found: Sequence[Found]
) -> Iterator[Line]:
    """What was found of a metric in a case over a parameter: a line for each of the others."""
    here = surface(grid, case, metric, outcomes)
    axis = next(i for i, p in enumerate(here.parameters) if p.path == path)
    others = [p for i, p in enumerate(here.parameters) if i != axis]
    parameter = here.parameters[axis]
    word = any(isinstance(c, str) for c in parameter.cells)
    x = np.arange(len(parameter.cells)) if word else np.array(parameter.cells, float)
    order = np.argsort(x)
    values = np.moveaxis(here.values, axis, -2)
    best = next((f for f in found if (f.case, f.parameter, f.metric) == (case, path, metric)), None)
    for index in np.ndindex(values.shape[:-2]):
        line = values[index][order]
        good = np.isfinite(line).all(axis=1)
        names = [
            f"{p.path.rpartition('.')[2]} {_short(p.cells[i])} {p.unit}".rstrip()
            for p, i in zip(others, index, strict=True)
        ]
        several = len(grid.cases) > 1 or not names
        mark = None
        if best is not None and not isinstance(best.optimum, str) and not others:
            mark = (best.optimum, best.low, best.high, best.value)
        yield Line(
            ", ".join([case, *names] if several else names),
            tuple(x[order][good].tolist()),
            tuple(line[good].mean(axis=1).tolist()),
            tuple(line[good].min(axis=1).tolist()),
            tuple(line[good].max(axis=1).tolist()),
            mark,
        )


def _short(cell: float | str) -> str:
    return cell if isinstance(cell, str) else f"{cell:.6g}"
