"""Plots of a study: panels of curves and of images, side by side in one PNG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.files.plots import COLORS, DASHES, MARK, MARKERS, SMALL, SMALLEST, plot_figure
from vcam_cli.files.tables import Cell
from vcam_cli.records import dataclass
from vcam_cli.sweeps.sweep_result import CaseOptimum

SIZES = {1: (6.4, 4.2), 2: (9.6, 3.9), 3: (12.6, 3.7)}
"""Number of columns -> inches of one row."""
WIDE_X, WIDE_Y = 20.0, 50.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""
FLAT_Y = 4.0
"""The same ratio, up to which a linear axis does not begin at zero."""
MANY = 10
"""Entries above which the legend stands beside the axes."""


@dataclass(frozen=True)
class Curve:
    """Values over values or words; what is not a number is a gap."""

    name: str
    """Its entry in the legend; "" for none."""
    x: Sequence[Cell] | Array
    y: Array
    color: int = 0
    dash: int | None = 0
    """None for points without a line."""
    has_points: bool = False
    low: Array | None = None
    high: Array | None = None
    """From where to where each value may be."""
    optimum: CaseOptimum | None = None
    """A cross, with its interval; or a triangle for an optimum at the end of the range."""


@dataclass(frozen=True)
class Panel:
    """Axes with curves, or with an image."""

    x_label: str
    y_label: str
    curves: tuple[Curve, ...] = ()
    title: str = ""
    marks: tuple[tuple[float, int], ...] = ()
    """Places on the horizontal axis that dotted lines mark, and their colors."""
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float | None] | None = None
    image: Array | None = None
    """(rows, columns, 1 or 3) sRGB codes, or a map (rows, columns) of numbers, from the top."""
    scale: float = 0.0
    """The largest number of a map."""
    is_square: bool = False
    """Whether both axes have one scale."""


@dataclass(frozen=True)
class FigureContent:
    """A table, and the panels that show it."""

    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]
    panels: tuple[Panel, ...]
    panels_in_row: int = 3


def draw(path: Path | str, title: str, content: FigureContent) -> None:
    """Write a PNG of panels, the same bytes for the same numbers. Raises CannotDo."""
    panels, columns = content.panels, min(content.panels_in_row, len(content.panels))
    width, height = SIZES.get(columns, (4.2 * columns, 3.7))
    rows = math.ceil(len(panels) / columns)
    legends = [[curve.name for curve in panel.curves if curve.name] for panel in panels]
    is_beside = max(map(len, legends)) >= MANY
    place: Any = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)} if is_beside else {}
    with plot_figure(path, (width + (2.2 if is_beside else 0), height * rows)) as figure:
        for number, (panel, names) in enumerate(zip(panels, legends, strict=True)):
            axes = figure.add_subplot(rows, columns, number + 1)
            letter = f"({chr(ord('a') + number)}) " if len(panels) > 1 else ""
            axes.set_title((letter + panel.title).rstrip() or title)
            axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
            _draw_panel(figure, axes, panel)
            if len(names) > 1 and (number == 0 or names != legends[0]):
                axes.legend(fontsize=SMALL, **place)
        if len(panels) > 1:
            figure.suptitle(title, fontsize=9.5)


def _draw_panel(figure: Any, axes: Any, panel: Panel) -> None:
    for place, color in panel.marks:
        axes.axvline(place, color=COLORS[color % len(COLORS)], lw=1, ls=MARK, zorder=1)
    for curve in panel.curves:
        _draw_curve(axes, curve)
    _name_missing_optima(axes, panel.curves)
    if panel.image is not None:
        _draw_image(figure, axes, panel)
    if panel.is_square:
        axes.set_aspect("equal")
    if panel.x_limits is not None:
        axes.set_xlim(*panel.x_limits)
    elif _spread([x for curve in panel.curves for x in curve.x]) >= WIDE_X:
        from matplotlib.ticker import LogLocator, NullFormatter

        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
    if panel.y_limits is not None:
        axes.set_ylim(*panel.y_limits)
    else:
        parts = [part for c in panel.curves for part in (c.y, c.low, c.high) if part is not None]
        spread = _spread(np.concatenate([np.zeros(0), *map(np.ravel, parts)]))
        if spread >= WIDE_Y:
            axes.set_yscale("log")
        elif spread >= FLAT_Y:
            axes.set_ylim(0, None)


def _spread(values: Any) -> float:
    """Return the largest over the smallest of positive numbers, 0 for other values."""
    if not len(values) or isinstance(values[0], str):
        return 0.0
    low, high = np.nanmin(values), np.nanmax(values)
    return float(high / low) if low > 0 else 0.0


def _draw_curve(axes: Any, curve: Curve) -> None:
    """Draw a line, its spread as a band, its optimum as a cross with its interval."""
    color = COLORS[curve.color % len(COLORS)]
    style = {"color": color, "lw": 1.2, "ls": "none"}
    if curve.dash is not None:
        style["ls"] = DASHES[curve.dash % len(DASHES)]
    if curve.has_points:
        style |= {"marker": _marker(curve.color), "ms": 3.4}
    axes.plot(curve.x, curve.y, label=curve.name or "_", zorder=3, **style)
    if curve.low is not None and curve.dash is None:
        axes.vlines(curve.x, curve.low, curve.high, color=color, lw=2.4, alpha=0.4)
    elif curve.low is not None:
        axes.fill_between(curve.x, curve.low, curve.high, color=color, alpha=0.16, lw=0)
    if curve.optimum is not None:
        _draw_optimum(axes, curve.optimum, color)


def _marker(series: int) -> str:
    """Return the marker of a series: no two series share it and the color."""
    return MARKERS[(series + series // len(COLORS)) % len(MARKERS)]


def _draw_optimum(axes: Any, best: CaseOptimum, color: str) -> None:
    """Draw the cross and the interval of an optimum; without one, mark the best end."""
    if best.edge:
        marker = "<" if best.edge == "low" else ">"
        axes.plot(best.end, best.value, marker, ms=8, mfc="none", mec="black", mew=1.2, zorder=5)
        return
    ends, values = [best.low, best.high], [best.value, best.value]
    axes.plot(ends, values, color=color, lw=3.2, alpha=0.45, zorder=4, solid_capstyle="butt")
    axes.plot(best.optimum, best.value, "x", ms=8, mew=1.8, color="black", zorder=5)


def _name_missing_optima(axes: Any, curves: Sequence[Curve]) -> None:
    """Write once at each end, below the lowest mark, that curves have no optimum there."""
    missing = [c.optimum for c in curves if c.optimum is not None and c.optimum.edge]
    for end in {best.end for best in missing}:
        lowest = min((best for best in missing if best.end == end), key=lambda best: best.value)
        side = "left" if lowest.edge == "low" else "right"
        aside = {"xytext": (0, -9), "textcoords": "offset points", "va": "top", "ha": side}
        axes.annotate("no optimum", (end, lowest.value), fontsize=SMALLEST, **aside)
    if missing:
        axes.margins(y=0.12)  # room for the words


def _draw_image(figure: Any, axes: Any, panel: Panel) -> None:
    """Draw an image, or a map with the bar of its colors."""
    image = axes.imshow(
        panel.image, cmap="inferno" if panel.scale else "gray", vmin=0, vmax=panel.scale or 255,
        interpolation="antialiased", extent=(*(panel.x_limits or ()), *(panel.y_limits or ())),
        aspect="auto",
    )  # fmt: skip
    axes.grid(visible=False)
    if panel.scale:
        figure.colorbar(image, ax=axes, label="ΔE", fraction=0.05, pad=0.02)
