"""Plots of sweeps: a metric over a parameter, a line for every case."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vcam_cli.files.atomic import write_whole
from vcam_cli.files.plots import COLORS, MARKERS, STYLE, load

WIDE_X, WIDE_Y = 20.0, 50.0
"""Ratio of the largest to the smallest value from which on an axis is logarithmic."""
MANY = 13
"""Lines from which on the legend stands beside the axes."""


@dataclass(frozen=True)
class Line:
    """A case: the mean metric at every value, and from where to where repeats and seeds went."""

    name: str
    x: tuple[float, ...]
    mean: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    optimum: tuple[float, float, float, float] | None = None
    """Parameter, its interval, and the metric there, where they were sought and found."""


def over_parameter(
    path: Path | str,
    title: str,
    x_label: str,
    y_label: str,
    lines: Sequence[Line],
    words: Sequence[str] = (),
) -> None:
    """Writes a PNG, the same bytes for the same numbers.

    words: the names of the values 0, 1, 2 ... of a parameter that is no number. Raises CannotDo.
    """
    matplotlib = load()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: Any = {**matplotlib.rcParamsDefault, **STYLE}
    with matplotlib.rc_context(style):
        outside = len(lines) >= MANY
        figure = Figure(figsize=(8.6 if outside else 6.4, 4.2), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        for number, line in enumerate(lines):
            _draw(axes, line, number)
        axes.set_title(title)
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        _scales(axes, lines, words)
        if len(lines) > 1:
            beside = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)}
            place: Any = beside if outside else {}
            axes.legend(fontsize=7.5, **place)
        with write_whole(path) as temporary:
            figure.savefig(temporary, format="png", metadata={"Software": None})


def _draw(axes: Any, line: Line, number: int) -> None:
    """A line with its spread as a band, its optimum as a cross with its interval."""
    color = COLORS[number % len(COLORS)]
    marker = MARKERS[number // len(COLORS) % len(MARKERS)]
    axes.plot(line.x, line.mean, marker=marker, ms=3.4, lw=1.1, color=color, label=line.name)
    if any(low < high for low, high in zip(line.low, line.high, strict=True)):
        axes.fill_between(line.x, line.low, line.high, color=color, alpha=0.16, lw=0)
    if line.optimum is not None:
        at, low, high, value = line.optimum
        if math.isfinite(low) and math.isfinite(high):
            axes.plot([low, high], [value, value], color=color, lw=3.2, alpha=0.45, zorder=4,
                      solid_capstyle="butt")  # fmt: skip
        axes.plot(at, value, "x", ms=8, mew=1.8, color="black", zorder=5)


def _scales(axes: Any, lines: Sequence[Line], words: Sequence[str]) -> None:
    """Logarithmic axes where values span orders of magnitude; words as ticks."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if words:
        axes.set_xticks(range(len(words)), words)
        axes.margins(x=0.1)
    elif _wide([x for line in lines for x in line.x], WIDE_X):
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    if _wide([y for line in lines for y in (*line.mean, *line.low)], WIDE_Y):
        axes.set_yscale("log")


def _wide(values: Sequence[float], ratio: float) -> bool:
    return bool(values) and min(values) > 0 and max(values) / min(values) >= ratio
