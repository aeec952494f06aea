"""Plots, as PNG files of the same bytes for the same numbers.

Matplotlib is imported where a plot is drawn and nowhere else: it takes longer to load than most
commands take to run. Figures are made without pyplot, so that no state outlives them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vcam_cli.files.atomic import write_whole

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Of Okabe and Ito: told apart by everybody."""
MARKERS = ("o", "s", "D", "^", "v", "P")
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.edgecolor": "#444444",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.minor.size": 1.8,
    "ytick.minor.size": 1.8,
    "legend.frameon": False,
}
FLOOR = 1e-10
"""What is smaller is drawn here: an error of 0 has no place on a logarithmic axis."""


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
) -> None:
    """Error over time, and beside it what each effect contributes, expected and found.

    presets: (seconds, error, name); tolerance: drawn as a line; panels: (label of the axis, pairs),
    one below the other. Errors relative to full signal. Raises CannotDo where it cannot be written.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: Any = {**matplotlib.rcParamsDefault, **STYLE}
    with matplotlib.rc_context(style):
        rows = [max(2, len(pairs)) for _, pairs in panels]
        height = max(3.9, 1.5 + 0.24 * sum(rows))
        figure = Figure(figsize=(9.2, height), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(len(rows), 2, width_ratios=(1.35, 1), height_ratios=rows)
        left = figure.add_subplot(grid[:, 0])
        _error_over_time(left, presets, curves, tolerance)
        left.set_title(title)
        for row, (label, pairs) in enumerate(panels):
            _pairs(figure.add_subplot(grid[row, 1]), label, pairs, legend=row == 0)
        with write_whole(path) as temporary:
            figure.savefig(temporary, format="png", metadata={"Software": None})


def _error_over_time(
    axes: Any,
    presets: Sequence[tuple[float, float, str]],
    curves: Sequence[Curve],
    tolerance: float,
) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    errors = [e for points in (presets, *(c.points for c in curves)) for _, e, _ in points]
    seconds = [s for points in (presets, *(c.points for c in curves)) for s, _, _ in points]
    looks = zip(COLORS, MARKERS, strict=True)
    for curve, (color, marker) in zip(curves, looks, strict=False):
        x = [p[0] for p in curve.points]
        y = [max(p[1], FLOOR) for p in curve.points]
        axes.plot(x, y, marker=marker, ms=3.8, lw=0.9, color=color, alpha=0.85, label=curve.name)
    for i, (at, error, name) in enumerate(sorted(presets)):
        height = max(error, FLOOR)
        axes.plot(at, height, "o", ms=8, mfc="white", mec="black", mew=1.4, zorder=5)
        left = at > (min(seconds) * max(seconds)) ** 0.5
        axes.annotate(
            name,
            (at, height),
            xytext=(-7 if left else 7, -8 if i % 2 else 8),
            textcoords="offset points",
            ha="right" if left else "left",
            va="top" if i % 2 else "bottom",
            fontweight="bold",
            zorder=6,
        )
    axes.axhline(tolerance, color="#888888", lw=0.9, ls=(0, (4, 3)))
    axes.annotate(
        f"asked for: {tolerance:.3g}",
        (1, tolerance),
        xycoords=("axes fraction", "data"),
        xytext=(0, 3),
        textcoords="offset points",
        ha="right",
        color="#666666",
    )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(min(seconds) / 1.4, max(seconds) * 1.4)
    axes.set_ylim(max(min(errors), FLOOR) / 3, max([*errors, tolerance]) * 3)
    _plain_seconds(axes.xaxis)
    axes.yaxis.set_minor_locator(LogLocator(subs="auto"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("time of a frame [s]")
    axes.set_ylabel("rms error of the mean raw, relative to full signal")
    if curves:
        axes.legend(loc="best", fontsize=7.5, title="one knob changed", title_fontsize=7.5)


def _plain_seconds(axis: Any) -> None:
    """Ticks at 1, 2 and 5, written as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _pairs(axes: Any, label: str, pairs: Sequence[Pair], legend: bool) -> None:
    """Expected and found, one line each, logarithmic."""
    for row, pair in enumerate(pairs):
        found = max(pair.found, FLOOR)
        if pair.expected is not None:
            expected = max(pair.expected, FLOOR)
            axes.plot([found, expected], [row, row], color="#bbbbbb", lw=1.6, zorder=1)
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
        axes.legend(loc="lower left", bbox_to_anchor=(0.62, 1.0), ncols=2, fontsize=7.5,
                    borderaxespad=0.2, handletextpad=0.1, columnspacing=0.8)  # fmt: skip
