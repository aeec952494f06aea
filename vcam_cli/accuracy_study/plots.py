"""Error over time: what accuracy costs, and beside it what each effect contributes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vcam_cli.files.plots import (
    COLORS,
    DASHES,
    GRAY,
    LIGHT_GRAY,
    LIMIT,
    MARKERS,
    SMALL,
    SMALLEST,
    plot_figure,
)
from vcam_cli.records import dataclass

FLOOR = 1e-9
"""What is smaller is drawn here: an error of 0 has no place on a logarithmic axis."""
BESIDE = ((-14, -14, "right", "top"), (-4, 22, "center", "bottom"), (14, 12, "left", "bottom"))
"""Where the names of settings stand beside their circles [points], in turns."""


@dataclass(frozen=True)
class Curve:
    """Settings of one knob: (seconds, error, setting) each."""

    name: str
    points: tuple[tuple[float, float, str], ...]


@dataclass(frozen=True)
class Pair:
    """A quantity that was expected, and what was found."""

    name: str
    expected: float | None
    found: float


def pareto(
    path: Path | str,
    title: str,
    presets: Sequence[tuple[float, float, str]],
    curves: Sequence[Curve],
    tolerance: float,
    panels: Sequence[tuple[str, Sequence[Pair]]],
    everything: Sequence[tuple[float, float, str]] = (),
) -> None:
    """Plot error over time, and beside it what each effect contributes, expected and found.

    presets: (seconds, error, name); tolerance: drawn as a line; panels: (label of the axis, pairs),
    one below the other; everything: presets with every effect on. Errors relative to full signal.
    Raises CannotDo where it cannot be written.
    """
    rows = [max(2, len(pairs)) for _, pairs in panels] or [1]
    height = max(4.4, 1.5 + 0.24 * sum(rows))
    with plot_figure(path, (9.6, height), dpi=200) as figure:
        grid = figure.add_gridspec(len(rows), 2, width_ratios=(1.5, 1), height_ratios=rows)
        left = figure.add_subplot(grid[:, 0])
        _error_over_time(left, presets, everything, curves, tolerance)
        _everything(left, presets, everything)
        left.set_title(title)
        for row, (label, pairs) in enumerate(panels):
            _pairs(figure.add_subplot(grid[row, 1]), label, pairs, legend=row == 0)


def _error_over_time(
    axes: Any,
    presets: Sequence[tuple[float, float, str]],
    everything: Sequence[tuple[float, float, str]],
    curves: Sequence[Curve],
    tolerance: float,
) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    drawn = (presets, everything, *(c.points for c in curves))
    every = [point for points in drawn for point in points]
    seconds = [point[0] for point in every]
    errors = [point[1] for point in every if point[1] > FLOOR] or [FLOOR]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(min(seconds) / 1.5, max(seconds) * 1.6)
    axes.set_ylim(min(errors) / 3, max([*errors, tolerance]) * 4)
    shown = [curve for curve in curves if any(error > FLOOR for _, error, _ in curve.points)]
    for number, curve in enumerate(shown):
        _curve(axes, curve, COLORS[number % len(COLORS)], MARKERS[number % len(MARKERS)], number)
    _presets(axes, presets)
    axes.axhline(tolerance, color=GRAY, lw=0.9, ls=LIMIT, zorder=1)
    axes.annotate(
        f"tolerance: {100 * tolerance:.3g} %",
        (1, tolerance),
        xycoords=("axes fraction", "data"),
        xytext=(-2, 3),
        textcoords="offset points",
        ha="right",
        color=GRAY,
    )
    _plain_seconds(axes.xaxis)
    axes.yaxis.set_minor_locator(LogLocator(subs="auto"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("time per frame [s]")
    axes.set_ylabel("rms error of the mean raw frame / full signal")
    if shown:
        below = {"loc": "upper left", "bbox_to_anchor": (0, -0.13), "ncols": 4, "fontsize": SMALL}
        axes.legend(**below, borderaxespad=0, title="error of one setting at a time; the coarsest"
                    " and finest values are labeled", title_fontsize=SMALL)  # fmt: skip


def _curve(axes: Any, curve: Curve, color: str, marker: str, number: int) -> None:
    """Draw a line from a knob's coarsest setting to its finest that has an error, both named."""
    shown = [point for point in curve.points if point[1] > FLOOR]
    x = [point[0] for point in shown]
    y = [point[1] for point in shown]
    fill = color if number < len(COLORS) else "white"
    dashes = DASHES[number % len(DASHES)]
    axes.plot(x, y, marker=marker, ms=3.8, lw=0.9, ls=dashes, color=color, mfc=fill,
              label=curve.name)  # fmt: skip
    for at in sorted({0, len(x) - 1} & set(range(len(x)))):
        axes.annotate(shown[at][2], (x[at], y[at]), xytext=(4, 2), color=color,
                      textcoords="offset points", fontsize=SMALLEST)  # fmt: skip


def _presets(axes: Any, presets: Sequence[tuple[float, float, str]]) -> None:
    """Open circles; of three beside each other the names fan out."""
    for i, (at, error, name) in enumerate(sorted(presets)):
        x, y, side, edge = BESIDE[i % len(BESIDE)]
        height = max(error, FLOOR)
        axes.plot(at, height, "o", ms=8, mfc="white", mec="black", mew=1.4, zorder=5)
        axes.annotate(
            name,
            (at, height),
            xytext=(x, y),
            textcoords="offset points",
            ha=side,
            va=edge,
            fontweight="bold",
            arrowprops={"arrowstyle": "-", "lw": 0.6, "color": GRAY, "shrinkA": 0, "shrinkB": 4},
            zorder=6,
        )


def _everything(
    axes: Any,
    presets: Sequence[tuple[float, float, str]],
    everything: Sequence[tuple[float, float, str]],
) -> None:
    """Draw squares for presets with every effect on, each tied to the planned setting."""
    planned = {name: (x, max(y, FLOOR)) for x, y, name in presets}
    for x, error, name in everything:
        y = max(error, FLOOR)
        if name in planned:
            (at, height) = planned[name]
            axes.plot([at, x], [height, y], "-", color=GRAY, lw=0.8, zorder=3)
        axes.plot(x, y, "s", ms=5, mfc="white", mec=GRAY, mew=1.1, zorder=4)
    if everything:
        x, error, _ = max(everything)
        place = {"xytext": (0, -7), "textcoords": "offset points", "ha": "center", "va": "top"}
        axes.annotate("all effects on", (x, max(error, FLOOR)), color=GRAY, fontsize=SMALL, **place)


def _plain_seconds(axis: Any) -> None:
    """Ticks at 1, 2 and 5, written as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _pairs(axes: Any, label: str, pairs: Sequence[Pair], legend: bool) -> None:
    """Draw what was expected and what was measured, one line each, logarithmic."""
    for row, pair in enumerate(pairs):
        found = max(pair.found, FLOOR)
        if pair.expected is not None:
            expected = max(pair.expected, FLOOR)
            axes.plot([found, expected], [row, row], color=LIGHT_GRAY, lw=1.6, zorder=1)
            axes.plot(expected, row, "o", ms=7, mfc="none", mec=COLORS[1], mew=1.2)
        axes.plot(found, row, "o", ms=3.6, color=COLORS[0], zorder=3)
    axes.set_xscale("log")
    values = [v for p in pairs for v in (p.found, p.expected or 0) if v > FLOOR] or [1.0]
    axes.set_xlim(min(values) / 3, max(values) * 3)
    axes.set_ylim(len(pairs) - 0.5, -0.5)
    axes.set_yticks(range(len(pairs)), [p.name.replace("_", " ") for p in pairs])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(label)
    if legend:
        axes.set_title("contribution of each effect")
        axes.plot([], [], "o", ms=7, mfc="none", mec=COLORS[1], mew=1.2, label="expected")
        axes.plot([], [], "o", ms=3.6, color=COLORS[0], label="measured")
        axes.legend(loc="lower left", bbox_to_anchor=(0.62, 1.0), ncols=2, fontsize=SMALL,
                    borderaxespad=0.2, handletextpad=0.1, columnspacing=0.8)  # fmt: skip
