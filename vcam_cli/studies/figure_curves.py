"""Figures of numbers and curves: each a table, and what draws it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.study import METRICS
from vcam_cli.camera.study_figures import (
    PROPERTIES,
    Lines,
    Optima,
    Properties,
)
from vcam_cli.files.figure_plots import Curve, Panel, draw_panels, labelled, unit
from vcam_cli.files.sweep_plots import over_parameter
from vcam_cli.files.tables import Cell
from vcam_cli.studies import properties
from vcam_cli.studies.figures import Planned, View
from vcam_cli.studies.properties import FREQUENCIES
from vcam_cli.studies.study_file import Parameter
from vcam_cli.studies.sweep_points import Grid
from vcam_cli.studies.sweep_result import Found
from vcam_cli.studies.sweep_tables import LABELS, Outcomes, lines_of

Row = tuple[Cell, ...]


@dataclass(frozen=True)
class Made:
    """A figure: its table, and what draws it."""

    columns: tuple[str, ...]
    rows: list[Row]
    draw: Callable[[Path], None]


def name_of(parameter: Parameter) -> str:
    """A parameter as an axis calls it: "pixel width [µm]"."""
    words = " ".join(parameter.path.split(".")[-2:]).replace("_", " ")
    return labelled(words, parameter.unit)


def called(planned: Planned, view: View) -> str:
    """A camera of a figure as its legend calls it: by what the others differ in."""
    parameter = planned.parameter
    cell = view.cell
    value = cell if isinstance(cell, str) else f"{cell:.6g} {unit(parameter.unit)}".rstrip()
    cases = len({v.case for v in planned.views}) > 1
    values = len({v.cell for v in planned.views}) > 1
    return ", ".join([view.case] * cases + [value] * (values or not cases))


def head(planned: Planned, view: View) -> Row:
    """What the rows of a camera begin with."""
    return (view.case, view.cell)


def header(planned: Planned) -> tuple[str, str]:
    """The names of these columns."""
    return ("case", planned.parameter.column)


def lines(planned: Planned, grid: Grid, outcomes: Outcomes, found: Sequence[Found]) -> Made:
    """The metric over the parameter, mean and range of repeats and seeds; optima are marked."""
    figure, parameter = planned.figure, planned.parameter
    assert isinstance(figure, Lines)
    metric, drawn, rows = figure.metric, [], list[Row]()
    words = parameter.cells if any(isinstance(c, str) for c in parameter.cells) else ()
    for case in planned.cases:
        for line in lines_of(grid, outcomes, case, metric, parameter.path, found):
            drawn.append(line)
            own = grid.cases[case][parameter.path]
            for values in zip(line.x, line.mean, line.low, line.high, strict=True):
                x: Cell = own.cells[int(values[0])] if words else values[0]
                rows.append((line.name, x, *values[1:], ""))
            if line.optimum is not None:
                at, low, high, value = line.optimum
                interval = f"{low:.6g} to {high:.6g}" if low == low else ""
                rows.append((line.name, at, value, "", "", f"optimum {interval}".rstrip()))
    columns = ("line", parameter.column, metric, "low", "high", "mark")
    y = labelled(LABELS.get(metric, metric.replace("_", " ")), METRICS[metric])
    text = [str(word) for word in words]
    draw = partial(
        over_parameter, title=planned.title, x_label=name_of(parameter), y_label=y, lines=drawn,
        words=text,
    )  # fmt: skip
    return Made(columns, rows, lambda path: draw(path))


def optima(planned: Planned, found: Sequence[Found]) -> Made:
    """The optimum of every case over a property of its camera."""
    figure, parameter = planned.figure, planned.parameter
    assert isinstance(figure, Optima)
    name, kind = figure.against, PROPERTIES[figure.against]
    best = {f.case: f for f in found if f.parameter == parameter.path}
    rows, curves = list[Row](), list[Curve]()
    for number, view in enumerate(v for v in planned.views if v.case in best):
        (x,) = properties.values(view.camera, (name,))
        f = best[view.case]
        _, _, _, at, low, high, *_ = f.row
        rows.append((view.case, x, at, low, high))
        if isinstance(f.optimum, str):
            continue
        error = np.array([[f.low], [f.high]]) if f.low == f.low else None
        curves.append(
            Curve("", np.array([x]), np.array([f.optimum]), number, points=True, line=False,
                  error=error, label=view.case)
        )  # fmt: skip
    curves += _proportional(curves)
    panel = Panel(
        labelled(_words(name), kind), f"best {name_of(parameter)}", tuple(curves), from_zero=True
    )
    columns = ("case", f"{name} [{kind}]", parameter.column, "low", "high")
    return Made(columns, rows, lambda path: draw_panels(path, planned.title, [panel]))


def _proportional(curves: Sequence[Curve]) -> list[Curve]:
    """The line through the first optimum and the origin."""
    if len(curves) < 2:
        return []
    x = np.array([0.0, max(float(c.x[0]) for c in curves) * 1.05])
    slope = float(curves[0].y[0] / curves[0].x[0])
    return [Curve("proportional", x, slope * x, len(curves), 1)]


def _words(name: str) -> str:
    return LABELS.get(name, name.replace("_", " "))


def of_properties(planned: Planned) -> Made:
    """Properties over the parameter, a panel for each unit."""
    figure, parameter = planned.figure, planned.parameter
    assert isinstance(figure, Properties)
    found = [(view, properties.values(view.camera, figure.of)) for view in planned.views]
    units = list(dict.fromkeys(PROPERTIES[name] for name in figure.of))
    columns = tuple(f"{n} [{PROPERTIES[n]}]" if PROPERTIES[n] else n for n in figure.of)
    rows = [(*head(planned, view), *values) for view, values in found]
    named = any(isinstance(view.cell, str) for view in planned.views)
    words = tuple(str(c) for c in parameter.cells) if named else ()
    panels = [
        _property_panel(planned, found, [n for n in figure.of if PROPERTIES[n] == kind], words)
        for kind in units
    ]
    draw = partial(draw_panels, title=planned.title, panels=panels)
    return Made((*header(planned), *columns), rows, lambda path: draw(path))


def _property_panel(
    planned: Planned,
    found: Sequence[tuple[View, tuple[float, ...]]],
    names: Sequence[str],
    words: tuple[str, ...],
) -> Panel:
    """Curves of properties of one unit: of one case by color, else dashes tell them apart."""
    figure = planned.figure
    assert isinstance(figure, Properties)
    curves = []
    several = len(planned.cases) > 1
    for kind, name in enumerate(names):
        column = figure.of.index(name)
        for number, case in enumerate(planned.cases):
            mine = [(v, values[column]) for v, values in found if v.case == case]
            x = [words.index(str(v.cell)) if words else float(v.cell) for v, _ in mine]
            y = [value for _, value in mine]
            order = np.argsort(x)
            label = (case if not kind else "") if several else _words(name) * (len(names) > 1)
            look = (number, kind) if several else (kind, 0)
            curves.append(
                Curve(label, np.array(x, float)[order], np.array(y, float)[order], *look,
                      points=True)
            )  # fmt: skip
    unit_ = PROPERTIES[names[0]]
    y_label = labelled(", ".join(_words(name) for name in names), unit_)
    keys = tuple(_words(name) for name in names) if several and len(names) > 1 else ()
    return Panel(
        name_of(planned.parameter), y_label, tuple(curves), words=words, keys=keys,
        from_zero=unit_ == "" or not _spans(curves),
    )  # fmt: skip


def _spans(curves: Sequence[Curve]) -> bool:
    """Whether values are better seen without a zero: decibels, and those over many decades."""
    values = np.concatenate([c.y for c in curves])
    values = values[np.isfinite(values)]
    return bool(len(values) and values.min() > 0 and values.max() / values.min() < 4) or bool(
        len(values) and values.min() > 0 and values.max() / values.min() > 50
    )


def mtf(planned: Planned) -> Made:
    """Transfer over spatial frequency, up to the Nyquist frequency of the finest pixels."""
    nyquist = max(_nyquist(view) for view in planned.views)
    frequency = np.linspace(0, nyquist, FREQUENCIES)
    rows, curves, marks = list[Row](), list[Curve](), list[tuple[float, int]]()
    number = 0
    for view in planned.views:
        found = properties.mtf(view.camera, frequency)
        for one in found:
            label = called(planned, view) + (f", {one.color}" if len(found) > 1 else "")
            curves.append(Curve(label, frequency / 1e3, one.system, number, 0))
            curves.append(Curve("", frequency / 1e3, one.sensor, number, 1))
            for f, system, sensor in zip(frequency, one.system, one.sensor, strict=True):
                first = (*head(planned, view), one.color)
                rows.append((*first, f / 1e3, f / nyquist, system, sensor))
            if one.nyquist < nyquist * (1 - 1e-9):
                marks.append((one.nyquist / 1e3, number))
            number += 1
    panel = Panel(
        "spatial frequency [lp/mm]",
        "MTF",
        tuple(curves),
        from_zero=True,
        ends=(0, nyquist / 1e3),
        top=("over the Nyquist frequency of the finest pixels", nyquist / 1e3),
        marks=tuple(dict.fromkeys(marks)),
        keys=("system", "sensor alone", "Nyquist frequency"),
    )
    columns = ("color", "spatial_frequency [lp/mm]", "of_nyquist", "system_mtf", "sensor_mtf")
    draw = partial(draw_panels, title=planned.title, panels=[panel])
    return Made((*header(planned), *columns), rows, lambda path: draw(path))


def _nyquist(view: View) -> float:
    (found,) = properties.values(view.camera, ("nyquist_frequency",))
    return found * 1e3


def spectral_response(planned: Planned) -> Made:
    """Quantum efficiency over wavelength."""
    rows, curves, number = list[Row](), list[Curve](), 0
    for view in planned.views:
        wavelength, found = properties.spectral_response(view.camera)
        for color, values in found.items():
            label = called(planned, view) + (f", {color}" if len(found) > 1 else "")
            curves.append(Curve(label, wavelength * 1e9, values, number))
            number += 1
            for w, value in zip(wavelength, values, strict=True):
                rows.append((*head(planned, view), color, _nm(w), value))
    ends = (float(curves[0].x[0]), float(curves[0].x[-1]))
    panel = Panel("wavelength [nm]", "quantum efficiency", tuple(curves), from_zero=True, ends=ends)
    columns = ("color", "wavelength [nm]", "quantum_efficiency")
    draw = partial(draw_panels, title=planned.title, panels=[panel])
    return Made((*header(planned), *columns), rows, lambda path: draw(path))


def _nm(wavelength: float) -> float:
    return float(f"{wavelength * 1e9:.6g}")


def off_axis(planned: Planned) -> Made:
    """What pixels along the diagonal collect, over pixels without a tunnel above them."""
    rows, curves = list[Row](), list[Curve]()
    falls, fades = False, False
    for number, view in enumerate(planned.views):
        found = properties.diagonal(view.camera)
        at = found.position * 1e3
        falls |= bool(np.ptp(found.falloff) > 0)
        fades |= bool(np.ptp(found.vignetting) > 0)
        label = called(planned, view)
        curves.append(Curve(label, at, found.vignetting if fades else found.falloff, number))
        if falls and fades:
            curves.append(Curve("", at, found.vignetting * found.falloff, number, 1))
        each = (at, found.relative, found.vignetting, found.falloff, found.signal)
        rows += [(*head(planned, view), *values) for values in zip(*each, strict=True)]
    panel = Panel(
        "distance from the center along the diagonal [mm]",
        "quantum efficiency / without tunnel" if fades else "relative illumination",
        tuple(curves),
        keys=("pixel vignetting", "with the lens's falloff") if falls and fades else (),
        ends=(float(curves[0].x[0]), float(curves[0].x[-1])),
    )
    columns = (
        "position [mm]", "relative_qe", "qe_over_no_vignetting", "lens_falloff", "relative_signal",
    )  # fmt: skip
    draw = partial(draw_panels, title=planned.title, panels=[panel])
    return Made((*header(planned), *columns), rows, lambda path: draw(path))


def points_of(line: NDArray) -> Iterator[tuple[float, float]]:
    """The points of a line (n, 2) that are there."""
    for x, y in line:
        if np.isfinite(x) and np.isfinite(y):
            yield float(x), float(y)
