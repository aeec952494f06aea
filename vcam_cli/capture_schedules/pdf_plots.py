"""Plots of a pdf of photocurrents: itself, fewer segments of it, and captures on it.

Where light spans decades, photocurrents have a logarithmic axis and a pdf is drawn per decade, so
that equal areas are equal shares of the pixels on either axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.files.plots import COLORS, GRAY, LIGHT_GRAY, SMALL, plot_figure
from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf

WIDE = 0.05
"""Median over largest photocurrent below which their axis is logarithmic."""
OUTLINE_POINTS = 24
"""Points of a segment's outline on a logarithmic axis, at least and for each decade."""
DISPLAYED = 240
"""Bins of a pdf that is drawn, at most, where it has more segments or levels of its own."""
WIDEST_GAP = 4
"""Such bins between two segments or levels that are drawn as neighbors."""
LEAST_SHARE = 1 / 2000
"""Of all pixels in such a bin."""
FEW_LEVELS = 64
"""Largest number of levels that are drawn as lines of their own."""
DECADES = 6.0
"""Decades of an axis of photocurrents, at most."""
METHOD_STYLES = {
    "optimal": (COLORS[0], "o"),
    "heuristic": (COLORS[2], "D"),
    "uniform": (COLORS[1], "s"),
    "exponential": (COLORS[3], "^"),
    "geometric": (COLORS[4], "v"),
    "sqp": (COLORS[5], "P"),
    "sqp-assigned": ("#8c510a", "*"),
    "weighted": ("#000000", "X"),
    "bracket": ("#01665e", "h"),
}
"""Color and marker of each method, the same in every plot."""


@dataclass(frozen=True)
class Units:
    """What photocurrents and times are called, and the size of the time's unit [s]."""

    photocurrent: str = "photocurrent"
    time: str = "time / first capture"
    size: float = 1.0


def plot_pdf_and_captures(
    path: Path | str,
    title: str,
    panels: Sequence[tuple[str, Pdf]],
    captures: Sequence[tuple[str, Array]],
    units: Units,
) -> None:
    """Plot a pdf and its approximation below it, on the last one the captures of some methods.

    Parameters
    ----------
    path : Path or str
        The PNG.
    title : str
        Title of the figure.
    panels : sequence of (str, Pdf)
        Name and pdf of each panel, from the top.
    captures : sequence of (str, array)
        Methods and the photocurrents (N,) that fill the well in their captures.
    units : Units
        Units of the axes.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    wide = is_wide(panels[0][1])
    with plot_figure(path, (6.4, 0.9 + 2.1 * len(panels))) as figure:
        above = None
        for row, (name, pdf) in enumerate(panels):
            axes = figure.add_subplot(len(panels), 1, row + 1, sharex=above)
            above = above or axes
            draw_density(axes, pdf, wide, COLORS[min(row, 1)])
            if row == len(panels) - 1:
                _draw_captures(axes, captures)
                label_axes(axes, units, wide)
            else:
                axes.tick_params(labelbottom=False)
                axes.set_ylabel(density_label(wide))
            axes.set_title(f"{title}: {name}" if row == 0 else name)


def plot_binning(
    path: Path | str, title: str, steps: Sequence[tuple[str, Pdf]], units: Units
) -> None:
    """Plot a histogram on its way to few segments, the original in gray behind each step.

    Parameters
    ----------
    path, title, units
        As those of `plot_pdf_and_captures`.
    steps : sequence of (str, Pdf)
        Name and pdf of each step, the original first.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    original = steps[0][1]
    wide = is_wide(original)
    columns = 2 if len(steps) > 3 else 1
    rows = -(-len(steps) // columns)
    with plot_figure(path, (7.2 if columns == 2 else 5.6, 0.8 + 1.6 * rows)) as figure:
        above = None
        for number, (name, pdf) in enumerate(steps):
            axes = figure.add_subplot(rows, columns, number + 1, sharex=above, sharey=above)
            above = above or axes
            if number:
                draw_density(axes, original, wide, LIGHT_GRAY)
            draw_density(axes, pdf, wide, COLORS[1] if number else GRAY)
            axes.set_title(f"{title}: {name}" if number == 0 else name)
            if number % columns:
                axes.tick_params(labelleft=False)
            else:
                axes.set_ylabel(density_label(wide))
            if number == 0:
                axes.set_ylim(0, _largest_density(steps, wide))
            if number + columns >= len(steps):
                axes.set_xlabel(units.photocurrent)
            else:
                axes.tick_params(labelbottom=False)


def is_wide(pdf: Pdf) -> bool:
    """Return whether the photocurrents of a pdf want a logarithmic axis."""
    below = pdf.cdf(pdf.high)
    middle = int(np.searchsorted(below, 0.5))
    share = 1 - (below[middle] - 0.5) / pdf.probability[middle]
    median = pdf.low[middle] + share * (pdf.high[middle] - pdf.low[middle])
    return bool(median < WIDE * pdf.max)


def density_label(wide: bool) -> str:
    """Return what a density is called."""
    return "pixels per decade" if wide else "density"


def label_axes(axes: Any, units: Units, wide: bool) -> None:
    """Label both axes of a density."""
    axes.set_xlabel(units.photocurrent)
    axes.set_ylabel(density_label(wide))


def draw_density(axes: Any, pdf: Pdf, wide: bool, color: str) -> None:
    """Draw a pdf as a filled outline; few levels as lines."""
    if wide:
        axes.set_xscale("log")
    if pdf.discrete and len(pdf.low) <= FEW_LEVELS:
        lit = (pdf.low > 0) if wide else np.full(len(pdf.low), True)
        axes.vlines(pdf.low[lit], 0, pdf.probability[lit], color=color, lw=1.6)
    else:
        x, y = outline(pdf, _axis_start(pdf, wide), wide)
        axes.fill_between(x, y, color=color, alpha=0.25, lw=0)
        axes.plot(x, y, color=color, lw=1.0)
    axes.set_ylim(bottom=0)


def outline(pdf: Pdf, low: float, wide: bool) -> tuple[Floats, Floats]:
    """Return the outline of a pdf from `low` on.

    Segments are drawn as they are; many of them, and levels, are gathered in bins of one display.

    Parameters
    ----------
    pdf : Pdf
        The pdf.
    low : float
        The darkest photocurrent that is drawn.
    wide : bool
        Whether densities are those per decade, for a logarithmic axis.

    Returns
    -------
    photocurrents, densities : (n,) arrays
        Points of the outline.
    """
    if pdf.discrete or len(pdf.low) > DISPLAYED:
        return _binned_outline(pdf, low, wide)
    x_parts, y_parts = [], []
    for start, end, height in zip(pdf.low, pdf.high, pdf.density, strict=True):
        start = max(float(start), low)
        if end <= start:
            continue
        decades = np.log10(end) - np.log10(start) if wide and start else 0.0
        points = int(OUTLINE_POINTS * max(1.0, decades)) if wide and start else 2
        x = np.geomspace(start, end, points) if wide else np.array([start, end])
        y = height * x * np.log(10) if wide else np.full(2, height)
        x_parts.append(np.concatenate([[start], x, [end]]))
        y_parts.append(np.concatenate([[0.0], y, [0.0]]))
    return np.concatenate(x_parts), np.concatenate(y_parts)


def _binned_outline(pdf: Pdf, low: float, wide: bool) -> tuple[Floats, Floats]:
    """Return the outline of bins that are whole segments, or whole neighborhoods of levels.

    Bins of the display's own would hold now one level and now two, or none: a comb that is not in
    the light. So a bin ends where a neighborhood does, is as wide as the display can show, and
    holds a share that does not depend on random gaps between levels.
    """
    edges, share = _neighborhoods(pdf, low, wide)
    bins = _display_bins(edges, share, wide)
    total = np.add.reduceat(share, bins[:-1])
    edges = edges[bins]
    width = np.diff(np.log10(edges)) if wide else np.diff(edges)
    share = total
    y = np.repeat(share / width, 2)
    return np.repeat(edges, 2), np.concatenate([[0.0], y, [0.0]])


def _neighborhoods(pdf: Pdf, low: float, wide: bool) -> tuple[Floats, Floats]:
    """Return the (K + 1,) ends of what is nearest to each segment or level; shares (K,).

    Neighbors share what lies between them, such as codes that a stretched picture does not have;
    wide gaps are left empty. What lies below `low` counts with the first.
    """
    scale, back = (np.log10, lambda place: 10**place) if wide else (np.asarray, np.asarray)
    occurs = pdf.probability > 0
    start, end = (scale(np.maximum(ends[occurs], low)) for ends in (pdf.low, pdf.high))
    bin_width = (scale(pdf.max) - scale(low)) / DISPLAYED
    margin = np.minimum((start[1:] - end[:-1]) / 2, WIDEST_GAP * bin_width / 2)
    ends = np.empty(2 * len(start))
    ends[::2] = np.concatenate([[scale(low)], start[1:] - margin])
    ends[1::2] = np.concatenate([end[:-1] + margin, [scale(pdf.max)]])
    share = np.zeros(len(ends) - 1)
    share[::2] = pdf.probability[occurs]
    shown = np.diff(ends) > 0
    first = int(np.argmax(shown))
    share[first] = share[: first + 1].sum()
    kept = np.flatnonzero(shown)
    edges = np.concatenate([ends[kept], ends[-1:]])
    return back(edges), share[kept]


def _display_bins(edges: Floats, share: Floats, wide: bool) -> Indices:
    """Return the numbers of the edges that bound bins: (n + 1,) from 0 to K.

    Each is at least one of `DISPLAYED` wide and holds `LEAST_SHARE` of the pixels, but for the last
    before a wide gap, which is a bin of its own.
    """
    place = np.log10(edges) if wide else edges
    least = (place[-1] - place[0]) / DISPLAYED
    below = np.concatenate([[0.0], np.cumsum(share)])
    gaps = np.append(np.flatnonzero(share == 0), len(share))
    bins = [0]
    while bins[-1] < len(share):
        start = bins[-1]
        if share[start] == 0:
            bins.append(start + 1)
            continue
        by_width = np.searchsorted(place, place[start] + least * (1 - 1e-9))
        by_share = np.searchsorted(below, below[start] + LEAST_SHARE)
        next_gap = gaps[np.searchsorted(gaps, start)]
        bins.append(int(min(max(by_width, by_share, start + 1), next_gap)))
    return np.array(bins)


def _axis_start(pdf: Pdf, wide: bool) -> float:
    """Return where an axis of photocurrents begins."""
    return max(pdf.min, pdf.max / 10**DECADES) if wide else 0.0


def _largest_density(steps: Sequence[tuple[str, Pdf]], wide: bool) -> float:
    """Return the end of the axis: above all steps, and what is not rare in the original."""
    low = _axis_start(steps[0][1], wide)
    heights = [outline(pdf, low, wide)[1] for _, pdf in steps if not pdf.discrete]
    most = max((float(h.max()) for h in heights[1:]), default=0.0)
    usual = float(np.quantile(heights[0], 0.98)) if heights else 0.0
    return 1.08 * max(most, usual) or 1.0


def _draw_captures(axes: Any, captures: Sequence[tuple[str, Array]]) -> None:
    """Draw the photocurrents that fill the well at each capture: lines, one height a method."""
    top = axes.get_ylim()[1]
    for number, (method, photocurrents) in enumerate(captures):
        color, marker = METHOD_STYLES[method]
        inside = photocurrents[photocurrents > 0]
        height = top * (1.05 + 0.13 * number)
        if number == 0:
            axes.vlines(inside, 0, height, color=color, lw=0.7, ls=(0, (2, 2)))
        axes.plot(inside, np.full(inside.shape, height), marker, ms=4.6, mfc="white", mew=1.2,
                  color=color)  # fmt: skip
        axes.annotate(method, (1.01, height), xycoords=("axes fraction", "data"), va="center",
                      fontsize=SMALL, color=color)  # fmt: skip
    if captures:
        axes.set_ylim(0, top * (1.08 + 0.13 * len(captures)))
