"""Plot of the charge of a pixel over time, as Fig 4.1 of Chen 2003: which sample is used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.capture_schedules.methods import MethodResult, Task
from vcam_cli.capture_schedules.pdf_plots import Units
from vcam_cli.capture_schedules.schedule_result import ScheduleResult
from vcam_cli.files.plots import COLORS, DASHES, GRAY, LIMIT, MARKERS, SMALL, plot_figure
from vcam_cli.scheduling.pdf import Floats, Pdf

LIGHTS = ((0.95, "bright"), (0.25, "dark"))
"""Share of the scene's pixels that are darker, and name, of the photocurrents drawn."""
WIDE = 50.0
"""Ratio of last and first capture beyond which the time axis is logarithmic."""
POINTS = 400


def quantile(pdf: Pdf, share: float) -> float:
    """Return a photocurrent that so large a share of the pixels does not exceed."""
    below = np.cumsum(pdf.probability)
    found = min(int(np.searchsorted(below, share)), below.size - 1)
    inside = (share - below[found]) / pdf.probability[found] + 1 if pdf.probability[found] else 1
    return float(pdf.low[found] + inside * (pdf.high[found] - pdf.low[found]))


def used_sample(times: Floats, photocurrent: float, task: Task) -> int:
    """Return the number of the last sample before saturation, from 0; -1 where all are full."""
    unsaturated = np.flatnonzero(task.sensor.saturation_limit(times) >= photocurrent)
    return int(unsaturated[-1]) if unsaturated.size else -1


def plot_charge(result: ScheduleResult, shown: MethodResult, units: Units, path: Path) -> None:
    """Plot the charge of a bright and of a dark pixel, sampled by a schedule.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    task, times = result.task, np.unique(shown.schedule.times)
    size = task.first if result.study.model.sensor is None else units.size
    wide = times[-1] > WIDE * times[0]
    start = times[0] / 3 if wide else 0.0
    line = np.geomspace(start, times[-1], POINTS) if wide else np.linspace(0, times[-1], POINTS)
    with plot_figure(path, (5.8, 3.6)) as figure:
        axes = figure.add_subplot()
        axes.axhline(1.0, color=GRAY, lw=0.9, ls=LIMIT)
        axes.vlines(times / size, 0, 1.0, color=GRAY, lw=0.5, alpha=0.6)
        for series, (share, name) in enumerate(LIGHTS):
            light = quantile(task.pdf, share)
            _draw_light(axes, task, name, light, (line, times, size), series)
        if wide:
            axes.set_xscale("log")
        axes.set_ylim(0, 1.12)
        axes.set_xlim(start / size, times[-1] * 1.03 / size)
        axes.set_title(f"{result.study.model.name}: {shown.count} captures, {shown.method}")
        axes.set_xlabel(units.time)
        axes.set_ylabel("charge / full well")
        axes.legend(fontsize=SMALL, loc="lower right", framealpha=1)


def _draw_light(
    axes: Any, task: Task, name: str, photocurrent: float, when: tuple[Floats, Floats, float],
    series: int,
) -> None:  # fmt: skip
    """Draw the charge over time (line, samples, unit of time); the sample used is filled."""
    line, times, size = when
    color, marker = COLORS[series], MARKERS[series]
    sensor = task.sensor

    def charge(at: Floats) -> Floats:
        return np.minimum((photocurrent + sensor.dark) * at / sensor.well, 1.0)

    used = used_sample(times, photocurrent, task)
    axes.plot(line / size, charge(line), color=color, lw=1.3, ls=DASHES[series],
              label=f"{name} pixel")  # fmt: skip
    axes.plot(times / size, charge(times), marker, ms=5, mfc="white", color=color)
    if used >= 0:
        label = f"last sample before saturation: {used + 1} of {times.size}"
        axes.plot(times[used] / size, charge(times)[used], marker, ms=7, color=color, label=label)
