"""Curves with what was measured as points and what was expected as lines: PNG files.

The look is that of `plots.py`: the same colors, the same bytes for the same numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.files.plots import (
    DASHES,
    LIMIT,
    MARK,
    MARKERS,
    SMALL,
    add_scale,
    color_of,
    plot_figure,
)
from vcam_cli.records import dataclass

Look = Literal["points", "line", "dashed"]


@dataclass(frozen=True)
class Curve:
    """One curve of a panel.

    Parameters
    ----------
    name : str
        Name in the legend; an empty one leaves the curve out of it.
    x, y : (n,) arrays
        Points in the units of the axes; those that are not finite are left out.
    look : {"points", "line", "dashed"}
        How the points are drawn; dashed is a limit.
    series : int
        Number of its color, marker and dashes in `plots.py`; -1 is gray.
    """

    name: str
    x: Array
    y: Array
    look: Look = "points"
    series: int = 0


@dataclass(frozen=True)
class Mark:
    """A vertical line at x with a text beside it, in the color of a series as of `Curve`."""

    x: float
    text: str
    series: int = -1


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Parameters
    ----------
    x_label, y_label : str
        Labels of the axes.
    curves : sequence of Curve
        What is drawn.
    marks : sequence of Mark
        Vertical lines.
    log : str
        Logarithmic axes: "", "x", "y" or "xy".
    scale_above : tuple of (str, float), optional
        Label of a second horizontal scale above, and a unit of the scale below in its units.
    x_range, y_range : tuple of float, optional
        Ends of the axes; by default those of the curves.
    height : float
        Height relative to the other panels'.
    legend : str
        Place of the legend, as Matplotlib names it.
    """

    x_label: str
    y_label: str
    curves: Sequence[Curve]
    marks: Sequence[Mark] = ()
    log: str = ""
    scale_above: tuple[str, float] | None = None
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    height: float = 1.0
    legend: str = "best"


def draw(path: Path | str, title: str, panels: Sequence[Panel]) -> None:
    """Draw panels one below the other, with one x axis, as a PNG.

    Parameters
    ----------
    path : Path or str
        The file.
    title : str
        Title above the first panel.
    panels : sequence of Panel
        The panels, from the top.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    heights = [panel.height for panel in panels]
    with plot_figure(path, (6.6, 1.1 + 3.3 * sum(heights))) as figure:
        grid = figure.add_gridspec(len(panels), 1, height_ratios=heights)
        above = None
        for row, panel in enumerate(panels):
            axes = figure.add_subplot(grid[row, 0], sharex=above)
            _panel(axes, panel, last=row == len(panels) - 1)
            if above is None:
                axes.set_title(title)
                above = axes


def _panel(axes: Any, panel: Panel, last: bool) -> None:
    if "x" in panel.log:
        axes.set_xscale("log")
    if "y" in panel.log:
        axes.set_yscale("log")
    for curve in panel.curves:
        _curve(axes, curve, panel.log)
    if panel.x_range:
        axes.set_xlim(*panel.x_range)
    if panel.y_range:
        axes.set_ylim(*panel.y_range)
    for number, mark in enumerate(panel.marks):
        _mark(axes, mark, number)
    axes.set_ylabel(panel.y_label)
    if last:
        axes.set_xlabel(panel.x_label)
    else:
        axes.tick_params(labelbottom=False)
    if any(curve.name for curve in panel.curves):
        axes.legend(loc=panel.legend, fontsize=SMALL)
    if panel.scale_above:
        add_scale(axes, *panel.scale_above)


def _curve(axes: Any, curve: Curve, log: str) -> None:
    keep = np.isfinite(curve.x) & np.isfinite(curve.y)
    keep &= (curve.x > 0) | ("x" not in log)
    keep &= (curve.y > 0) | ("y" not in log)
    x, y = curve.x[keep], curve.y[keep]
    color = color_of(curve.series)
    label = curve.name or "_nolegend_"
    if curve.look == "points":
        marker = MARKERS[curve.series % len(MARKERS)]
        axes.plot(x, y, marker, ms=3, color=color, alpha=0.8, mew=0, label=label)
        return
    dashes = LIMIT if curve.look == "dashed" else DASHES[max(curve.series, 0) % len(DASHES)]
    axes.plot(x, y, color=color, lw=1.0, ls=dashes, label=label)


def _mark(axes: Any, mark: Mark, number: int) -> None:
    """Draw a vertical line with its text beside it, the texts at different heights."""
    color = color_of(mark.series)
    axes.axvline(mark.x, color=color, lw=0.8, ls=MARK)
    axes.annotate(
        mark.text,
        (mark.x, 0.02 + 0.055 * number),
        xycoords=("data", "axes fraction"),
        xytext=(-3, 0),
        textcoords="offset points",
        ha="right",
        fontsize=SMALL,
        color=color,
        bbox={"fc": "white", "ec": "none", "pad": 0.6, "alpha": 0.8},
    )
