"""Pictures of a pdf of photocurrents: itself, fewer segments of it, and captures on it.

Where light spans decades, photocurrents have a logarithmic axis and a pdf is drawn a decade, so
that equal areas are equal shares of the pixels on either axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.files.atomic import write_whole
from vcam_cli.files.plots import COLORS, STYLE, load
from vcam_cli.scheduling.pdf import Pdf

WIDE = 0.05
"""Median over largest photocurrent below which their axis is logarithmic."""
CURVE = 24
"""Points of a segment's outline on a logarithmic axis, at least and for each decade."""
DISPLAYED = 240
"""Bins of a pdf that is drawn, where it has more of its own."""
FEW_LEVELS = 64
"""Up to so many levels are drawn as lines of their own."""
DECADES = 6.0
"""Of an axis of photocurrents, at most."""
GRAY = "#777777"
LOOKS = {
    "optimal": (COLORS[0], "o"),
    "heuristic": (COLORS[2], "D"),
    "uniform": (COLORS[1], "s"),
    "exponential": (COLORS[3], "^"),
    "geometric": (COLORS[4], "v"),
    "sqp": (COLORS[5], "P"),
    "weighted": ("#000000", "X"),
}
"""Of each method, the same in every plot."""


@dataclass(frozen=True)
class Units:
    """What photocurrents and times are called, and the size of the time's unit [s]."""

    photocurrent: str = "photocurrent"
    time: str = "time / first capture"
    size: float = 1.0


def pdf_and_captures(
    path: Path | str,
    title: str,
    panels: Sequence[tuple[str, Pdf]],
    captures: Sequence[tuple[str, NDArray]],
    units: Units,
) -> None:
    """The pdf, and its approximation below it; on the last one the photocurrents of captures."""

    def draw(figure: Any) -> None:
        wide = is_wide(panels[0][1])
        above = None
        for row, (name, pdf) in enumerate(panels):
            axes = figure.add_subplot(len(panels), 1, row + 1, sharex=above)
            above = above or axes
            color = COLORS[0] if row == 0 else COLORS[1]
            density(axes, pdf, wide, color)
            last = row == len(panels) - 1
            if last:
                _captures(axes, pdf, captures, wide)
                label(axes, units, wide)
            else:
                axes.tick_params(labelbottom=False)
                axes.set_ylabel(ordinate(wide))
            axes.set_title(f"{title}: {name}" if row == 0 else name)

    write(path, (6.4, 0.9 + 2.1 * len(panels)), draw)


def binning(path: Path | str, title: str, steps: Sequence[tuple[str, Pdf]], units: Units) -> None:
    """A histogram on its way to few segments, the original in gray behind each step."""

    def draw(figure: Any) -> None:
        wide = is_wide(steps[0][1])
        columns = 2 if len(steps) > 3 else 1
        rows = -(-len(steps) // columns)
        above = None
        for number, (name, pdf) in enumerate(steps):
            axes = figure.add_subplot(rows, columns, number + 1, sharex=above, sharey=above)
            above = above or axes
            if number:
                density(axes, steps[0][1], wide, "#c9c9c9")
            density(axes, pdf, wide, COLORS[1] if number else GRAY)
            axes.set_title(f"{title}: {name}" if number == 0 else name)
            if number % columns:
                axes.tick_params(labelleft=False)
            else:
                axes.set_ylabel(ordinate(wide))
            if number == 0:
                axes.set_ylim(0, _reach(steps, wide))
            if number + columns >= len(steps):
                axes.set_xlabel(units.photocurrent)
            else:
                axes.tick_params(labelbottom=False)

    columns = 2 if len(steps) > 3 else 1
    height = 0.8 + 1.6 * -(-len(steps) // columns)
    write(path, (7.2 if columns == 2 else 5.6, height), draw)


def _reach(steps: Sequence[tuple[str, Pdf]], wide: bool) -> float:
    """Where the axis of densities ends: above all steps, and what is not rare in the original."""
    low = lowest(steps[0][1], wide)
    heights = [outline(pdf, low, wide)[1] for _, pdf in steps if not pdf.discrete]
    most = max((float(h.max()) for h in heights[1:]), default=0.0)
    usual = float(np.quantile(heights[0], 0.98)) if heights else 0.0
    return 1.08 * max(most, usual) or 1.0


def write(path: Path | str, size: tuple[float, float], draw: Callable[[Any], None]) -> None:
    """A figure as a PNG, the same bytes for the same numbers. Raises CannotDo."""
    matplotlib = load()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: Any = {**matplotlib.rcParamsDefault, **STYLE}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size, dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure)
        with write_whole(path) as temporary:
            figure.savefig(temporary, format="png", metadata={"Software": None})


def is_wide(pdf: Pdf) -> bool:
    """Whether photocurrents of a pdf want a logarithmic axis."""
    below = pdf.below(pdf.high)
    middle = int(np.searchsorted(below, 0.5))
    share = 1 - (below[middle] - 0.5) / pdf.probability[middle]
    median = pdf.low[middle] + share * (pdf.high[middle] - pdf.low[middle])
    return bool(median < WIDE * pdf.max)


def ordinate(wide: bool) -> str:
    """What a density is called."""
    return "pixels, a decade" if wide else "density"


def label(axes: Any, units: Units, wide: bool) -> None:
    """Names both axes."""
    axes.set_xlabel(units.photocurrent)
    axes.set_ylabel(ordinate(wide))


def lowest(pdf: Pdf, wide: bool) -> float:
    """Where an axis of photocurrents begins."""
    return max(pdf.min, pdf.max / 10**DECADES) if wide else 0.0


def density(axes: Any, pdf: Pdf, wide: bool, color: str) -> None:
    """A pdf as a filled outline; few levels as lines."""
    low = lowest(pdf, wide)
    if wide:
        axes.set_xscale("log")
    if pdf.discrete and len(pdf.low) <= FEW_LEVELS:
        seen = (pdf.low > 0) if wide else np.full(len(pdf.low), True)
        axes.vlines(pdf.low[seen], 0, pdf.probability[seen], color=color, lw=1.6)
        axes.set_ylim(bottom=0)
        return
    x, y = outline(pdf, low, wide)
    axes.fill_between(x, y, color=color, alpha=0.25, lw=0)
    axes.plot(x, y, color=color, lw=1.0)
    axes.set_ylim(bottom=0)


def outline(pdf: Pdf, low: float, wide: bool) -> tuple[NDArray, NDArray]:
    """(n,) photocurrents and (n,) densities of the outline of a pdf; wide: a decade.

    Segments are drawn as they are; many of them, and levels, are gathered in bins of one display.
    """
    if pdf.discrete or len(pdf.low) > DISPLAYED:
        edges = (
            np.geomspace(low, pdf.max, DISPLAYED + 1)
            if wide
            else np.linspace(low, pdf.max, DISPLAYED + 1)
        )
        share = np.diff(pdf.below(edges))
        share[0] += pdf.below(edges[0]) if wide else 0.0
        width = np.diff(np.log10(edges)) if wide else np.diff(edges)
        x, y = np.repeat(edges, 2), np.repeat(share / width, 2)
        return x, np.concatenate([[0.0], y, [0.0]])
    x_parts, y_parts = [], []
    for start, end, height in zip(pdf.low, pdf.high, pdf.density, strict=True):
        start = max(float(start), low)
        if end <= start:
            continue
        points = int(CURVE * max(1.0, np.log10(end) - np.log10(start))) if wide and start else 2
        x = np.geomspace(start, end, points) if wide else np.array([start, end])
        y = height * x * np.log(10) if wide else np.full(2, height)
        x_parts.append(np.concatenate([[start], x, [end]]))
        y_parts.append(np.concatenate([[0.0], y, [0.0]]))
    return np.concatenate(x_parts), np.concatenate(y_parts)


def _captures(axes: Any, pdf: Pdf, captures: Sequence[tuple[str, NDArray]], wide: bool) -> None:
    """Photocurrents that fill the well at each capture: lines, one height a method."""
    top = axes.get_ylim()[1]
    for number, (method, photocurrents) in enumerate(captures):
        color, marker = LOOKS[method]
        inside = photocurrents[photocurrents > 0]
        height = top * (1.05 + 0.13 * number)
        if number == 0:
            axes.vlines(inside, 0, height, color=color, lw=0.7, ls=(0, (2, 2)))
        axes.plot(inside, np.full(inside.shape, height), marker, ms=4.6, mfc="white", mew=1.2,
                  color=color)  # fmt: skip
        axes.annotate(method, (1.01, height), xycoords=("axes fraction", "data"), va="center",
                      fontsize=7.5, color=color)  # fmt: skip
    if captures:
        axes.set_ylim(0, top * (1.08 + 0.13 * len(captures)))
