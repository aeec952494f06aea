"""The figures of a sweep: for each the table behind it, and the panels that show it.

Curves and optima are made here from the records of the points and the figure's cameras; what
compares pictures is made in `error_maps`. Only a whole sweep has figures: where points are left to
other shares there are none, and those of a former study go.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import BadInput, Collector, VcamError, bad, one_line
from vcam_cli.files.tables import write_table
from vcam_cli.progress import Observer
from vcam_cli.records import dataclass
from vcam_cli.sweeps import error_maps, plots, properties, quantities
from vcam_cli.sweeps.error_maps import MapCache
from vcam_cli.sweeps.figure_model import Figure
from vcam_cli.sweeps.plots import Curve, FigureContent, Panel
from vcam_cli.sweeps.quantities import FREQUENCY, POSITION
from vcam_cli.sweeps.study_cameras import FIGURES, PlannedFigure, StudyCameras
from vcam_cli.sweeps.sweep_file import Cell, Parameter
from vcam_cli.sweeps.sweep_result import CaseOptimum
from vcam_cli.sweeps.sweep_tables import Findings, Row, Writers

MANY = 36
"""The most curves of a panel; what is beyond is in the table."""


def plan(cameras: StudyCameras) -> tuple[PlannedFigure, ...]:
    """Return the figures of a study, in its order.

    Raises BadInput with everything wrong: what a figure names and the study does not have, cameras
    that are refused, quantities that they do not have.
    """
    problems, planned = Collector(), list[PlannedFigure]()
    study = cameras.grid.study
    for name, figure in study.model.figures.items():
        try:
            planned.append(cameras.figure(name, figure))
            if not figure.is_rendered:  # refuses cameras without closed forms
                _content(planned[-1], Findings(cameras.grid, {}), MapCache(1))
        except BadInput as error:
            where = study.locate((FIGURES, name, "show"))
            problems.extend(BadInput(replace(p, where=p.where or where) for p in error.problems))
    problems.raise_if_any()
    return tuple(planned)


def writers(
    planned: Sequence[PlannedFigure],
    findings: Findings,
    watch: Observer,
    tell: Callable[[str], None],
) -> tuple[Writers, dict[str, str]]:
    """Return what writes each figure's files; and why figures cannot be made, by name."""
    found, unmade = Writers(), dict[str, str]()
    cache = MapCache(findings.grid.study.model.seeds)
    if planned:
        watch.begin("figures")
    for number, figure in enumerate(planned):
        watch.step(number, len(planned))
        try:
            content = _content(figure, findings, cache)
        except (VcamError, MemoryError) as error:
            unmade[figure.name] = one_line(str(error)) or "not enough memory; use a smaller array"
            tell(f"figure {figure.name}: {unmade[figure.name]}")
            continue
        table = partial(write_table, columns=content.columns, rows=content.rows)
        found[f"{figure.name}.csv"] = table
        found[f"{figure.name}.png"] = partial(plots.draw, title=figure.title, content=content)
    return found, unmade


def metric_plots(findings: Findings) -> Writers:
    """Return what writes the plot of every metric over the parameter of most values."""
    grid, found = findings.grid, Writers()
    if not grid.case_parameters:  # a single point has no curve
        return found
    parameter = max(grid.case_parameters, key=lambda p: len(p.nodes))
    cases = tuple(c.name for c in grid.cases.values() if parameter.path in c.parameters)
    for metric in grid.study.model.metrics:
        figure = Figure(show="curves", quantities=(metric,), title=grid.study.model.name)
        planned = PlannedFigure(metric, figure, parameter, cases, (metric,))
        content = _parameter_panels(planned, findings)
        found[f"{metric}.png"] = partial(plots.draw, title=planned.title, content=content)
    return found


def _content(planned: PlannedFigure, findings: Findings, cache: MapCache) -> FigureContent:
    match planned.figure.show:
        case "curves" if planned.figure.abscissa:
            return _abscissa_panels(planned)
        case "curves":
            return _parameter_panels(planned, findings)
        case "optima":
            return _optima(planned, findings)
        case "pictures":
            return error_maps.pictures(planned, cache)
        case "iso-lines":
            return error_maps.iso_line_figure(planned, cache)
    return error_maps.distribution(planned, cache)


@dataclass(frozen=True)
class _Series:
    """A quantity over the parameter, in a case with values of the other parameters."""

    quantity: str
    case: str
    others: tuple[tuple[Parameter, Cell], ...]
    cells: tuple[Cell, ...]
    values: Array
    low: Array | None = None
    high: Array | None = None
    optimum: CaseOptimum | None = None

    @property
    def line(self) -> str:
        """The case and the values of the other parameters, in a legend."""
        values = [f"{p.path.rpartition('.')[2]} {p.text(c)}" for p, c in self.others]
        return ", ".join([self.case, *values])

    @property
    def head(self) -> dict[str, Cell]:
        """The case and the values of the other parameters, by column."""
        return {"case": self.case, **{p.column: cell for p, cell in self.others}}


def _parameter_panels(planned: PlannedFigure, findings: Findings) -> FigureContent:
    """Return quantities over the parameter: means and ranges of metrics, optima as crosses."""
    series = list[_Series]()
    for quantity in planned.figure.quantities:
        for case in planned.cases:
            if quantity in planned.measured:
                series += _metric_curves(findings, case, quantity, planned.parameter.path)
            else:
                series.append(_property_curve(planned, case, quantity))
    panels = dict[str, list[_Series]]()
    for one in series:
        panels.setdefault(quantities.unit(one.quantity), []).append(one)
    shown = tuple(_panel(planned.parameter, some) for some in panels.values())
    return FigureContent(*_table(planned, series), shown)


def _metric_curves(findings: Findings, case: str, metric: str, path: str) -> Iterator[_Series]:
    """Yield a metric in a case over a parameter, for each of the values of the others."""
    surface = findings.surface(case, metric)
    axis = next(i for i, p in enumerate(surface.parameters) if p.path == path)
    others = [p for p in surface.parameters if p.path != path]
    cells = surface.parameters[axis].cells
    has_words = isinstance(cells[0], str)
    order = range(len(cells)) if has_words else np.argsort(cells)
    optimum = findings.optimum(case, path)
    has_cross = not others and not has_words and optimum and optimum.metric == metric
    values = np.moveaxis(surface.values, axis, -2)
    for index in np.ndindex(values.shape[:-2]):
        known = [i for i in order if np.isfinite(values[index][i]).all()]
        line = values[index][known]
        yield _Series(
            metric,
            case,
            tuple((p, p.cells[i]) for p, i in zip(others, index, strict=True)),
            tuple(cells[i] for i in known),
            line.mean(axis=1),
            line.min(axis=1),
            line.max(axis=1),
            optimum if has_cross else None,
        )


def _property_curve(planned: PlannedFigure, case: str, quantity: str) -> _Series:
    """Return a property of the cameras of a case."""
    cameras = [camera for camera in planned.cameras if camera.case == case]
    if not isinstance(cameras[0].cell, str):
        cameras.sort(key=lambda camera: camera.cell)
    values = np.array([properties.value(c.camera, quantity) for c in cameras])
    if np.isnan(values).all():
        message = f"the case {case} has no {quantity}"
        raise bad((FIGURES, planned.name), message, "leave one of the two out of the figure")
    return _Series(quantity, case, (), tuple(c.cell for c in cameras), values)


def _table(planned: PlannedFigure, series: Sequence[_Series]) -> tuple[tuple[str, ...], list[Row]]:
    """Return columns and rows: one for each value of the parameter, optima after their curves."""
    place, mark = planned.parameter.column, ("mark",) if planned.measured else ()
    columns = ["case", place, *(column for s in series for column in s.head)]
    rows: dict[tuple[Cell, ...], dict[str, Cell]] = {}
    for s in series:
        name, low, high = quantities.column(s.quantity), "low", "high"
        if len(planned.measured) > 1:
            low, high = f"{s.quantity} low", f"{s.quantity} high"
        columns += [name] if s.low is None else [name, low, high]
        head = s.head
        for i, cell in enumerate(s.cells):
            row = rows.setdefault((*head.values(), cell), {**head, place: cell})
            row[name] = s.values[i]
            if s.low is not None and s.high is not None:
                row[low], row[high] = s.low[i], s.high[i]
        if s.optimum is not None:
            at = s.optimum.end if s.optimum.edge else s.optimum.optimum
            row = {**head, place: at, name: s.optimum.value}
            rows[*head.values(), "optimum"] = row | {"mark": s.optimum.mark}
    names = tuple(dict.fromkeys([*columns, *mark]))
    return names, [tuple(row.get(name, "") for name in names) for row in rows.values()]


def _panel(parameter: Parameter, series: Sequence[_Series]) -> Panel:
    """Return curves of quantities of one unit; colors tell cases apart, dashes quantities."""
    names = list(dict.fromkeys(s.quantity for s in series))
    lines = list(dict.fromkeys(s.line for s in series))
    curves = []
    for s in series[:MANY]:
        color, dash, name = lines.index(s.line), names.index(s.quantity), [s.line]
        if len(lines) == 1 and len(names) > 1:
            color, dash, name = dash, 0, []
        if len(names) > 1:
            name.append(quantities.label(s.quantity))
        text = ", ".join(name)
        curves.append(Curve(text, s.cells, s.values, color, dash, True, s.low, s.high, s.optimum))
    label = ", ".join(map(quantities.label, names if len(names) < 3 else ()))
    y_label = quantities.axis_label(label, quantities.unit(names[0])).lstrip()
    return Panel(_axis_label(parameter), y_label, tuple(curves))


def _axis_label(parameter: Parameter) -> str:
    """Return a parameter on an axis: "pixel width [µm]"."""
    words = " ".join(parameter.path.split(".")[-2:]).replace("_", " ")
    return quantities.axis_label(words, parameter.unit)


def _abscissa_panels(planned: PlannedFigure) -> FigureContent:
    """Return curves of cameras over a frequency, a wavelength or a position."""
    figure, rows, drawn, marks = planned.figure, list[Row](), list[Curve](), []
    nyquists = [properties.value(c.camera, "nyquist_frequency") for c in planned.cameras]
    for camera, nyquist in zip(planned.cameras, nyquists, strict=True):
        curves = properties.curves(camera.camera, figure.abscissa, max(nyquists))
        for curve in curves:
            x, number = curve.x[figure.abscissa], len(drawn) // len(figure.quantities)
            for dash, quantity in enumerate(figure.quantities):
                name = [planned.label(camera)]
                name += [curve.color] if len(curves) > 1 else []
                name += [quantities.label(quantity)] if len(figure.quantities) > 1 else []
                drawn.append(Curve(", ".join(name), x, curve.y[quantity], number, dash))
            head = (camera.case, camera.cell, curve.color)
            values = zip(*curve.x.values(), *curve.y.values(), strict=True)
            rows += [(*head, *row) for row in values]
            if figure.abscissa == FREQUENCY and nyquist < max(nyquists) * (1 - 1e-9):
                marks.append((nyquist, number))
    label = figure.abscissa.replace("_", " ") + ("; dotted: Nyquist frequency" if marks else "")
    panel = Panel(
        label,
        ", ".join(map(quantities.label, figure.quantities if len(figure.quantities) < 3 else ())),
        tuple(drawn),
        marks=tuple(marks),
        x_limits=(x[0], x[-1]),
        y_limits=None if figure.abscissa == POSITION else (0, None),
    )
    columns = (*planned.head, "color", *curve.x, *curve.y)
    return FigureContent(columns, rows, (panel,))


def _optima(planned: PlannedFigure, findings: Findings) -> FigureContent:
    """Return the optima of the cases over a property of their cameras, beside proportional ones."""
    parameter, name = planned.parameter, planned.figure.against or ""
    rows, curves = list[Row](), list[Curve]()
    for case in planned.cases:
        (x,) = _property_curve(planned, case, name).values
        optimum = findings.optimum(case, parameter.path)
        if optimum is not None:
            rows.append((case, x, *optimum.row[3:6]))
        has_place = optimum is not None and not isinstance(optimum.optimum, str)
        if optimum is not None and has_place and not optimum.edge:
            y, low, high = (np.array([v]) for v in (optimum.optimum, optimum.low, optimum.high))
            curves.append(Curve(case, np.array([x]), y, len(curves), None, True, low, high))
    if len(curves) > 1:
        ends = np.array([0.0, 1.05 * max(float(curve.x[0]) for curve in curves)])
        slope = curves[0].y[0] / float(curves[0].x[0])
        curves.append(Curve("proportional", ends, slope * ends, len(curves), 1))
    x_label = quantities.axis_label(quantities.label(name), quantities.unit(name))
    panel = Panel(x_label, f"best {_axis_label(parameter)}", tuple(curves), y_limits=(0, None))
    columns = ("case", quantities.column(name), parameter.column, "low", "high")
    return FigureContent(columns, rows, (panel,))
