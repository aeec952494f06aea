"""Figures of a study: panels of curves, and of pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.files.atomic import write_whole
from vcam_cli.files.plots import COLORS, MARKERS, STYLE, load
from vcam_cli.files.sweep_plots import WIDE_X, WIDE_Y
from vcam_cli.quality import error_map

DASHES = ("-", (0, (5, 2.5)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
SIZES = {1: (5.4, 3.9), 2: (9.6, 3.7), 3: (12.6, 3.7), 4: (9.6, 7.0)}
"""Number of panels -> inches."""
BESIDE = 9
"""Entries from which on the legend stands beside the axes."""
OF_UNITS = {"um": "µm", "um2": "µm²", "uV/e": "µV/e", "nA/cm2": "nA/cm²", "cd/m2": "cd/m²"}


@dataclass(frozen=True)
class Curve:
    """Values over values; what is not a number is a gap."""

    name: str
    """In the legend; "" for none."""
    x: NDArray
    y: NDArray
    color: int = 0
    dash: int = 0
    points: bool = False
    """Whether its points are marked."""
    line: bool = True
    error: NDArray | None = None
    """(2, n) from where to where each value may be."""
    label: str = ""
    """Beside its last point."""


@dataclass(frozen=True)
class Panel:
    """Axes with curves."""

    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    from_zero: bool = False
    """Whether the vertical axis begins at 0."""
    ends: tuple[float, float] | None = None
    """Of the horizontal axis."""
    top: tuple[str, float] | None = None
    """A second horizontal axis above: its label, and what 1 is on it."""
    marks: tuple[tuple[float, int], ...] = ()
    """Places on the horizontal axis, and their colors."""
    words: tuple[str, ...] = ()
    """Names of the values 0, 1, 2 ... of a parameter that is no number."""
    keys: tuple[str, ...] = ()
    """What the kinds of dashes mean."""


@dataclass(frozen=True)
class Area:
    """Axes of pictures, to the right and up."""

    x_label: str
    y_label: str
    left: float
    right: float
    bottom: float
    top: float


@dataclass(frozen=True)
class Comparison:
    """A picture and what it should be. Pictures are sRGB codes, their first row at the top."""

    area: Area
    perfect: NDArray
    """(rows, columns) or (rows, columns, 3) uint8"""
    image: NDArray
    delta_e: NDArray
    """(rows, columns)"""
    lines: tuple[Curve, ...]
    """Of equal Delta E."""


def unit(name: str) -> str:
    """A unit as a figure writes it."""
    return OF_UNITS.get(name, name)


def labelled(what: str, of: str) -> str:
    """The label of an axis."""
    return f"{what} [{unit(of)}]" if of else what


def draw_panels(path: Path | str, title: str, panels: Sequence[Panel]) -> None:
    """Writes a PNG of panels of curves, the same bytes for the same numbers. Raises CannotDo."""
    columns = len(panels) if len(panels) <= 3 else 2 if len(panels) == 4 else 3
    rows = math.ceil(len(panels) / columns)
    width, height = SIZES.get(len(panels), (12.6, 3.5 * rows))
    named = max(sum(bool(c.name) for c in panel.curves) for panel in panels)
    beside = named >= BESIDE
    with _figure(path, width + (2.2 if beside else 0), height) as figure:
        for number, panel in enumerate(panels):
            axes = figure.add_subplot(rows, columns, number + 1)
            if len(panels) > 1:
                axes.set_title(f"({chr(ord('a') + number)})")
            _panel(axes, panel)
            if number == 0 or not _alike(panels[0], panel):
                _legend(axes, panel, beside and (number + 1) % columns == 0)
        _title(figure, title, len(panels) == 1)


def _title(figure: Any, title: str, alone: bool) -> None:
    if alone:
        figure.axes[0].set_title(title)
    else:
        figure.suptitle(title, fontsize=9.5)


def _alike(one: Panel, other: Panel) -> bool:
    """Whether a legend serves both."""
    return [c.name for c in one.curves] == [c.name for c in other.curves] and one.keys == other.keys


@contextmanager
def _figure(path: Path | str, width: float, height: float) -> Any:
    matplotlib = load()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: Any = {**matplotlib.rcParamsDefault, **STYLE}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(width, height), dpi=200, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        with write_whole(path) as temporary:
            figure.savefig(temporary, format="png", metadata={"Software": None})


def _panel(axes: Any, panel: Panel) -> None:
    for place, color in panel.marks:
        axes.axvline(place, color=COLORS[color % len(COLORS)], lw=0.9, ls=DASHES[2], zorder=1)
    for curve in panel.curves:
        _curve(axes, curve)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    _scales(axes, panel)
    if panel.top is not None:
        label, one = panel.top
        above = axes.secondary_xaxis("top", functions=(lambda x: x / one, lambda x: x * one))
        above.set_xlabel(label)
        axes.spines["top"].set_visible(True)


def _curve(axes: Any, curve: Curve) -> None:
    color = COLORS[curve.color % len(COLORS)]
    look: dict[str, Any] = {"color": color, "lw": 1.3, "ls": DASHES[curve.dash % len(DASHES)]}
    if not curve.line:
        look["ls"] = "none"
    if curve.points:
        look |= {"marker": MARKERS[curve.color // len(COLORS) % len(MARKERS)], "ms": 3.4}
    axes.plot(curve.x, curve.y, label=curve.name or "_", zorder=3, **look)
    if curve.error is not None:
        for x, (low, high) in zip(curve.x, curve.error.T, strict=True):
            axes.plot([x, x], [low, high], color=color, lw=2.4, alpha=0.4, zorder=2)
    if curve.label and len(curve.x):
        axes.annotate(
            curve.label, (curve.x[-1], curve.y[-1]), xytext=(-5, 4),
            textcoords="offset points", ha="right", va="bottom", fontsize=7.5,
        )  # fmt: skip


def _scales(axes: Any, panel: Panel) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    errors = [np.ravel(c.error) for c in panel.curves if c.error is not None]
    y = np.concatenate([*(np.ravel(c.y) for c in panel.curves), *errors, np.zeros(0)])
    y = y[np.isfinite(y)]
    x = np.concatenate([np.ravel(c.x) for c in panel.curves] or [np.zeros(0)])
    if panel.words:
        axes.set_xticks(range(len(panel.words)), panel.words)
    elif panel.ends is None and len(x) and x.min() > 0 and x.max() / x.min() >= WIDE_X:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    if panel.from_zero:
        axes.set_ylim(0, max(1e-12, 1.06 * float(y.max())) if len(y) else 1)
    elif len(y) and y.min() > 0 and y.max() / y.min() >= WIDE_Y:
        axes.set_yscale("log")
    if panel.ends is not None:
        axes.set_xlim(*panel.ends)


def _legend(axes: Any, panel: Panel, beside: bool) -> None:
    from matplotlib.lines import Line2D

    handles, names = axes.get_legend_handles_labels()
    for dash, key in enumerate(panel.keys):
        handles.append(Line2D([], [], color="#555555", lw=1.3, ls=DASHES[dash % len(DASHES)]))
        names.append(key)
    if not names or (len(panel.curves) == 1 and not panel.keys):
        return
    place: Any = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)} if beside else {}
    axes.legend(handles, names, fontsize=7.5, **place)


def draw_comparison(path: Path | str, title: str, found: Comparison) -> None:
    """Writes a PNG of perfect image, image, map and lines of Delta E. Raises CannotDo."""
    area = found.area
    across, up = abs(area.right - area.left), abs(area.top - area.bottom)
    square = area.y_label.partition("[")[2] == area.x_label.partition("[")[2]
    aspect = up / across if square and across > 0 else 1.0
    upper = error_map.top(found.delta_e)
    with _figure(path, 8.4, 7.4 * min(1.3, 0.12 + 0.88 * aspect)) as figure:
        grid = figure.subplots(2, 2)
        box = {
            "extent": (area.left, area.right, area.bottom, area.top),
            "aspect": "equal" if square else "auto",
            "interpolation": "antialiased",
        }
        for axes, name, codes in (
            (grid[0, 0], "(a) perfect image", found.perfect),
            (grid[0, 1], "(b) camera's image", found.image),
        ):
            axes.imshow(codes, cmap="gray", vmin=0, vmax=255, **box)
            axes.set_title(name)
        axes = grid[1, 1]
        axes.imshow(error_map.picture(found.delta_e, upper), **box)
        axes.set_title("(d) S-CIELAB ΔE")
        _colors(figure, axes, upper)
        axes = grid[1, 0]
        for curve in found.lines:
            _curve(axes, curve)
        axes.set(xlim=(area.left, area.right), ylim=(area.bottom, area.top), aspect=box["aspect"])
        axes.set_title("(c) lines of equal ΔE")
        handles, names = axes.get_legend_handles_labels()
        if names:
            axes.legend(handles[::-1], names[::-1], fontsize=7.5, title="ΔE", title_fontsize=7.5)
        for axes in grid.ravel():
            axes.set_xlabel(area.x_label)
            axes.set_ylabel(area.y_label)
        for axes in (grid[0, 0], grid[0, 1], grid[1, 1]):
            axes.grid(visible=False)
        figure.suptitle(title, fontsize=9.5)


def _colors(figure: Any, axes: Any, upper: float) -> None:
    """The bar of the map's colors."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colors = error_map.picture(np.linspace(0, 1, 256)[None, :], 1.0)[0] / 255
    scale = ScalarMappable(Normalize(0, upper), ListedColormap(colors))
    figure.colorbar(scale, ax=axes, label="ΔE", fraction=0.05, pad=0.02)
