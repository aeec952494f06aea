"""Plots of capture schedules: captures over time, and what they gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.files.pdf_plots import DISPLAYED, GRAY, LOOKS, Units, density, is_wide, label, write
from vcam_cli.files.plots import COLORS
from vcam_cli.scheduling.objective import Sensor
from vcam_cli.scheduling.pdf import Pdf


@dataclass(frozen=True)
class Curve:
    """A method: a number over the number of captures or segments, and its own upper bound."""

    method: str
    x: tuple[int, ...]
    y: tuple[float, ...]
    bound: tuple[float, ...] = ()
    name: str = ""

    @property
    def label(self) -> str:
        return self.name or self.method


@dataclass(frozen=True)
class Row:
    """The captures of a method."""

    method: str
    times: NDArray
    gain: float


def gain_over_captures(
    path: Path | str, title: str, curves: Sequence[Curve], bound: float, pdf: Pdf, units: Units
) -> None:
    """Gain against the number of captures, method by method, beside the pdf. Raises CannotDo."""

    def draw(figure: Any) -> None:
        grid = figure.add_gridspec(1, 2, width_ratios=(2.1, 1))
        axes = figure.add_subplot(grid[0, 0])
        _curves(axes, curves, bound)
        axes.set_title(title)
        axes.set_xlabel("number of captures")
        axes.set_ylabel("mean SNR / that of a single capture")
        beside = figure.add_subplot(grid[0, 1])
        density(beside, pdf, is_wide(pdf), COLORS[0])
        beside.set_title("pixels")
        label(beside, units, is_wide(pdf))
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4,
                      fontsize=7.5)  # fmt: skip

    write(path, (7.6, 4.1), draw)


def gain_over_segments(
    path: Path | str, title: str, curves: Sequence[Curve], limits: Sequence[Curve]
) -> None:
    """Gain against the number of segments; `limits` are those of the pdf itself, as lines."""

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for curve in curves:
            color, marker = LOOKS[curve.method]
            axes.plot(curve.x, curve.y, marker=marker, ms=4, lw=1.2, color=color,
                      label=curve.label)  # fmt: skip
        for limit in limits:
            axes.axhline(limit.y[0], color=GRAY, lw=0.9, ls=(0, (4, 3)), label=limit.label)
        _whole(axes.xaxis, [x for curve in curves for x in curve.x])
        axes.set_title(title)
        axes.set_xlabel("segments of the approximated pdf")
        axes.set_ylabel("mean SNR / that of a single capture")
        axes.legend(fontsize=7.5)

    write(path, (5.6, 3.7), draw)


def captures_over_time(
    path: Path | str, title: str, pdf: Pdf, sensor: Sensor, rows: Sequence[Row], units: Units
) -> None:
    """Capture times as ticks, a row a method; above, when the scene's pixels saturate."""

    def draw(figure: Any) -> None:
        grid = figure.add_gridspec(2, 1, height_ratios=(1.2, 0.3 * len(rows) + 0.2))
        top = figure.add_subplot(grid[0, 0])
        axes = figure.add_subplot(grid[1, 0], sharex=top)
        first = min(row.times[0] for row in rows) / units.size
        last = max(row.times[-1] for row in rows) / units.size
        reach = (last / first) ** 0.12 if last > first else 2.0
        axes.set_xscale("log")
        axes.set_xlim(first / min(reach, 1.6), last * max(reach, 1.3))
        _saturation(top, pdf, sensor, units.size, (first, last * max(reach, 1.3)))
        for number, row in enumerate(rows):
            color, _ = LOOKS[row.method]
            x = np.unique(row.times) / units.size
            axes.hlines(number, x[0], x[-1], color=color, lw=0.6, alpha=0.5)
            axes.vlines(x, number - 0.33, number + 0.33, color=color, lw=1.7)
            axes.annotate(f"{row.gain:.4g}", (1.01, number), xycoords=("axes fraction", "data"),
                          va="center", fontsize=7.5)  # fmt: skip
        axes.annotate("gain", (1.01, -0.75), xycoords=("axes fraction", "data"), va="center",
                      fontsize=7.5, color="#444444", annotation_clip=False)  # fmt: skip
        axes.set_ylim(len(rows) - 0.45, -0.55)
        axes.set_yticks(range(len(rows)), [row.method for row in rows])
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        _plain_ticks(axes.xaxis, *axes.get_xlim())
        axes.set_xlabel(units.time)
        top.set_title(title)
        top.set_ylabel("pixels that\nsaturate, a decade")
        top.tick_params(labelbottom=False)

    write(path, (6.8, 2.3 + 0.32 * len(rows)), draw)


def _curves(axes: Any, curves: Sequence[Curve], bound: float) -> None:
    for curve in curves:
        color, marker = LOOKS[curve.method]
        axes.plot(curve.x, curve.y, marker=marker, ms=3.8, lw=1.1, color=color, label=curve.label)
        if curve.bound:
            axes.plot(curve.x, curve.bound, color=color, lw=0.9, ls=(0, (1, 2)),
                      label=f"upper bound, {curve.label}")  # fmt: skip
    axes.axhline(bound, color=GRAY, lw=0.9, ls=(0, (4, 3)), label="upper bound")
    _whole(axes.xaxis, [x for curve in curves for x in curve.x])


def _whole(axis: Any, values: Sequence[int]) -> None:
    """Ticks at whole numbers only."""
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(nbins=10, integer=True, min_n_ticks=1))
    if len(set(values)) == 1:
        axis.axes.set_xlim(values[0] - 1, values[0] + 1)


def _plain_ticks(axis: Any, low: float, high: float) -> None:
    """Numbers as people write them, more of them where there are few decades."""
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


def _saturation(
    axes: Any, pdf: Pdf, sensor: Sensor, size: float, span: tuple[float, float]
) -> None:
    """Share of the pixels that saturate at a time, a decade of time; times in units of `size`."""
    times = np.geomspace(span[0], span[1], DISPLAYED + 1)
    if not pdf.discrete and len(pdf.low) < DISPLAYED // 4:  # their edges stay sharp
        ends = np.concatenate([pdf.low, pdf.high])
        own = sensor.well / (ends[ends + sensor.dark > 0] + sensor.dark) / size
        times = np.unique(np.append(times, own[(own > span[0]) & (own < span[1])]))
    limits = np.maximum(sensor.limit(times * size), 0.0)
    limits[0] = max(limits[0], pdf.max)
    share = -np.diff(pdf.below(limits))
    value = share / np.diff(np.log10(times))
    axes.stairs(value, times, fill=True, color=COLORS[0], alpha=0.25)
    axes.stairs(value, times, color=COLORS[0], lw=1.0)
    axes.set_ylim(bottom=0)
