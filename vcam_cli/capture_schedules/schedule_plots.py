"""Plots of a schedule study: captures over time, and what they gain."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.capture_schedules import pdf_plots
from vcam_cli.capture_schedules.charge_plot import plot_charge
from vcam_cli.capture_schedules.methods import BRACKET, MethodResult, Task
from vcam_cli.capture_schedules.model import DENSITIES
from vcam_cli.capture_schedules.pdf_plots import (
    DISPLAYED,
    METHOD_STYLES,
    Units,
    draw_density,
    is_wide,
    label_axes,
)
from vcam_cli.capture_schedules.schedule_result import ScheduleResult
from vcam_cli.files.plots import COLORS, DASHES, GRAY, INK, LIMIT, MARK, SMALL, plot_figure
from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.sensor import Sensor

SHOWN = 8
"""Captures of the schedules that are drawn, or the number of the study nearest to it."""
FEW = 10
"""Largest number of segments of a histogram of which every step of its binning is drawn."""
TIME_UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))
GAIN_LABEL = "mean SNR / that of a single capture"


@dataclass(frozen=True)
class GainCurve:
    """Gains of a method over a number of captures or of segments, and its own upper bound.

    `density` names how the pdf was estimated, where that differs from curve to curve.
    """

    method: str
    x: tuple[int, ...]
    gains: tuple[float, ...]
    bound: tuple[float, ...] = ()
    density: str = ""

    @property
    def label(self) -> str:
        """What the legend says."""
        return f"{self.method}, {self.density}" if self.density else self.method


def plot_gain(result: ScheduleResult, path: Path) -> None:
    """Plot the gain against the number of captures, method by method, beside the pdf.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    task = result.task
    with plot_figure(path, (7.6, 4.1)) as figure:
        grid = figure.add_gridspec(1, 2, width_ratios=(2.1, 1))
        axes = figure.add_subplot(grid[0, 0])
        _draw_gain_curves(axes, _curves_over_captures(result.found, task), ms=3.8, lw=1.1)
        brackets = any(one.method == BRACKET for one in result.found)
        named = "upper bound of captures" if brackets else "upper bound"
        axes.axhline(task.largest_gain, color=GRAY, lw=0.9, ls=LIMIT, label=named)
        axes.set_title(result.study.model.name)
        axes.set_xlabel("number of captures")
        axes.set_ylabel(GAIN_LABEL)
        beside = figure.add_subplot(grid[0, 1])
        wide = is_wide(task.pdf)
        draw_density(beside, task.pdf, wide, COLORS[0])
        beside.set_title("pixels")
        label_axes(beside, study_units(result), wide)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4,
                      fontsize=SMALL)  # fmt: skip


def plot_gain_over_segments(result: ScheduleResult, path: Path) -> None:
    """Plot the gain of the largest number of captures against the number of segments.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    count = max(result.study.model.counts)
    best = result.task.exact_task.optimum([count])[count]
    with plot_figure(path, (5.6, 3.7)) as figure:
        axes = figure.add_subplot()
        _draw_gain_curves(axes, _curves_over_segments(result, count), ms=4, lw=1.2)
        axes.axhline(result.task.gain(best), color=GRAY, lw=0.9, ls=LIMIT,
                     label="optimal for the pdf itself")  # fmt: skip
        axes.set_title(f"{result.study.model.name}: {count} captures")
        axes.set_xlabel("segments of the approximated pdf")
        axes.set_ylabel(GAIN_LABEL)
        axes.legend(fontsize=SMALL)


def plot_captures(result: ScheduleResult, path: Path) -> None:
    """Plot capture times as ticks, a row a method; above, when the scene's pixels saturate.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    count, task, units = shown_count(result), result.task, study_units(result)
    if result.study.model.sensor is None:
        units = Units(units.photocurrent, units.time, task.first)
    rows = _results_of_count(result, count)
    with plot_figure(path, (6.8, 2.3 + 0.32 * len(rows))) as figure:
        grid = figure.add_gridspec(2, 1, height_ratios=(1.2, 0.3 * len(rows) + 0.2))
        top = figure.add_subplot(grid[0, 0])
        axes = figure.add_subplot(grid[1, 0], sharex=top)
        first = min(row.schedule.times[0] for row in rows) / units.size
        last = max(row.schedule.times[-1] for row in rows) / units.size
        reach = (last / first) ** 0.12 if last > first else 2.0
        axes.set_xscale("log")
        axes.set_xlim(first / min(reach, 1.6), last * max(reach, 1.3))
        _draw_saturation(top, task.pdf, task.sensor, units.size, (first, last * max(reach, 1.3)))
        for number, row in enumerate(rows):
            _draw_capture_row(axes, number, row, task.gain(row.schedule), units.size)
        axes.annotate("gain", (1.01, -0.75), xycoords=("axes fraction", "data"), va="center",
                      fontsize=SMALL, color=INK, annotation_clip=False)  # fmt: skip
        axes.set_ylim(len(rows) - 0.45, -0.55)
        axes.set_yticks(range(len(rows)), [row.method for row in rows])
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        _set_plain_ticks(axes.xaxis, *axes.get_xlim())
        axes.set_xlabel(units.time)
        top.set_title(f"{result.study.model.name}: {count} captures")
        top.set_ylabel("pixels that\nsaturate per decade")
        top.tick_params(labelbottom=False)


def plot_charge_over_time(result: ScheduleResult, path: Path) -> None:
    """Plot the charge of two pixels over time, sampled by the study's first method.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    shown = _results_of_count(result, shown_count(result))[0]
    plot_charge(result, shown, study_units(result), path)


def plot_pdf(result: ScheduleResult, path: Path) -> None:
    """Plot the pdf, its approximation where there is one, and the best captures on it.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    task, count = result.task, shown_count(result)
    whole = "photocurrents of the pixels"
    panels = [(whole if task.is_approximate else f"{whole}, and {count} captures", task.pdf)]
    if task.is_approximate:
        name = f"approximated by {segments_text(task.plan)}, and {count} captures"
        panels.append((name, task.plan))
    captures = [
        (one.method, one.schedule.photocurrents)
        for one in _results_of_count(result, count)
        if one.method in ("optimal", "heuristic", "weighted")
    ]
    title, units = result.study.model.name, study_units(result)
    pdf_plots.plot_pdf_and_captures(path, title, panels, captures, units)


def plot_binning(result: ScheduleResult, path: Path) -> None:
    """Plot the steps of the pdf's approximation.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    steps, units = binning_steps(result), study_units(result)
    pdf_plots.plot_binning(path, result.study.model.name, steps, units)


def binning_steps(result: ScheduleResult) -> list[tuple[str, Pdf]]:
    """Return the steps from the pdf to the requested segments, as names and pdfs.

    The original is the first; empty without an approximation.
    """
    whole = result.approximation
    least = min(result.study.model.segments, default=0)
    if whole is None or whole.original_segments <= least:
        return []
    if whole.original_segments <= FEW:
        numbers = list(range(whole.original_segments, least - 1, -1))
    else:
        doubled = (least * 2**k for k in (4, 3, 2, 1, 0))
        numbers = [whole.original_segments, *(n for n in doubled if n < whole.original_segments)]
    first, *later = map(whole.pdf, numbers)
    return [
        (f"{whole.original_segments} bins", first),
        *((segments_text(pdf), pdf) for pdf in later),
    ]


def segments_text(pdf: Pdf) -> str:
    """Return the number of a pdf's segments in words."""
    return "1 segment" if len(pdf.low) == 1 else f"{len(pdf.low)} segments"


def shown_count(result: ScheduleResult) -> int:
    """Return the number of captures whose schedules are drawn."""
    return min(result.study.model.counts, key=lambda n: (abs(n - SHOWN), n))


def study_units(result: ScheduleResult) -> Units:
    """Return the units of a study's photocurrents and times."""
    if result.study.model.sensor is None:
        simulated = result.study.camera is not None
        return Units("photocurrent [e/s]" if simulated else "photocurrent")
    last = max(float(one.schedule.times[-1]) for one in result.found)
    size, name = next((unit for unit in TIME_UNITS if last >= unit[0]), TIME_UNITS[-1])
    return Units("photocurrent [e/s]", f"time [{name}]", size)


def _results_of_count(result: ScheduleResult, count: int) -> list[MethodResult]:
    return [one for one in result.found if one.count == count]


def _curves_over_captures(found: Sequence[MethodResult], task: Task) -> list[GainCurve]:
    curves = []
    for method in dict.fromkeys(one.method for one in found):
        own = sorted((one for one in found if one.method == method), key=lambda one: one.count)
        gains = tuple(task.gain(one.schedule) for one in own)
        bound = tuple(one.bound / task.single for one in own) if method == "weighted" else ()
        curves.append(GainCurve(method, tuple(one.count for one in own), gains, bound))
    return curves


def _curves_over_segments(result: ScheduleResult, count: int) -> list[GainCurve]:
    curves = []
    densities = result.study.model.density
    for density in densities:
        for method in dict.fromkeys(one.method for one in result.steps[0].found):
            points = [
                (step.segments, result.task.gain(one.schedule))
                for step in result.steps
                for one in step.found
                if (step.density, one.method, one.count) == (density, method, count)
            ]
            x, gains = zip(*points, strict=True)
            named = density if len(densities) > 1 else ""
            curves.append(GainCurve(method, x, gains, density=named))
    return curves


def _draw_gain_curves(axes: Any, curves: Sequence[GainCurve], ms: float, lw: float) -> None:
    """Draw gains over whole numbers, with markers and lines of these sizes [pt]."""
    from matplotlib.ticker import MaxNLocator

    for curve in curves:
        color, marker = METHOD_STYLES[curve.method]
        line: Any = "-"
        if curve.density:
            number = DENSITIES.index(curve.density)
            color, line = COLORS[number], DASHES[number]
        axes.plot(curve.x, curve.gains, marker=marker, ms=ms, lw=lw, color=color, ls=line,
                  label=curve.label)  # fmt: skip
        if curve.bound:
            axes.plot(curve.x, curve.bound, color=color, lw=0.9, ls=MARK,
                      label=f"upper bound, {curve.method}")  # fmt: skip
    axes.xaxis.set_major_locator(MaxNLocator(nbins=10, integer=True, min_n_ticks=1))
    numbers = {x for curve in curves for x in curve.x}
    if len(numbers) == 1:
        (only,) = numbers
        axes.set_xlim(only - 1, only + 1)


def _draw_capture_row(axes: Any, number: int, row: MethodResult, gain: float, size: float) -> None:
    """Draw the captures of a method as ticks, its gain beside them; times in units of `size`."""
    color, _ = METHOD_STYLES[row.method]
    found, counts = np.unique(row.schedule.times, return_counts=True)
    x = found / size
    for at, many in zip(x, counts, strict=True):
        if row.method == BRACKET and many > 1:  # equal exposures, one after the other
            axes.annotate(f"{many} x", (at, number - 0.1), xytext=(4, 3), fontsize=7,
                          textcoords="offset points")  # fmt: skip
    axes.hlines(number, x[0], x[-1], color=color, lw=0.6, alpha=0.5)
    axes.vlines(x, number - 0.33, number + 0.33, color=color, lw=1.7)
    axes.annotate(f"{gain:.4g}", (1.01, number), xycoords=("axes fraction", "data"), va="center",
                  fontsize=SMALL)  # fmt: skip


def _draw_saturation(
    axes: Any, pdf: Pdf, sensor: Sensor, size: float, span: tuple[float, float]
) -> None:
    """Draw the share of the pixels that saturate per decade of time; times in units of `size`."""
    times = np.geomspace(span[0], span[1], DISPLAYED + 1)
    if not pdf.discrete and len(pdf.low) < DISPLAYED // 4:  # their edges stay sharp
        ends = np.concatenate([pdf.low, pdf.high])
        own = sensor.well / (ends[ends + sensor.dark > 0] + sensor.dark) / size
        times = np.unique(np.append(times, own[(own > span[0]) & (own < span[1])]))
    limits = np.maximum(sensor.saturation_limit(times * size), 0.0)
    limits[0] = max(limits[0], pdf.max)
    share = -np.diff(pdf.cdf(limits))
    value = share / np.diff(np.log10(times))
    axes.stairs(value, times, fill=True, color=COLORS[0], alpha=0.25)
    axes.stairs(value, times, color=COLORS[0], lw=1.0)
    axes.set_ylim(bottom=0)


def _set_plain_ticks(axis: Any, low: float, high: float) -> None:
    """Set ticks with plain numbers, more of them where there are few decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    subs = (1.0, 2.0, 5.0) if high / low < 2e3 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=20))
    axis.set_major_formatter(FuncFormatter(_plain_number))
    axis.set_minor_formatter(NullFormatter())


def _plain_number(value: float, _: int) -> str:
    if 1e-3 <= value < 1e4:
        return f"{value:g}"
    power = np.floor(np.log10(value) + 1e-9)
    factor = value / 10**power
    return (f"{factor:.0f}×" if round(factor) > 1 else "") + f"$10^{{{power:.0f}}}$"
