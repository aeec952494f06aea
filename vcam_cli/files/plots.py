"""The style of all plots: PNG, SVG and PDF files of the same bytes for the same numbers.

A series has a number. Its color, its marker and its dashes follow from it, so that curves stay
apart in gray and for readers who are color blind. Labels of axes have units in brackets.

Matplotlib is imported where a plot is drawn and nowhere else: it takes longer to load than most
commands take to run. Figures are made without pyplot, so that no state outlives them.
"""

import importlib
import importlib.util
import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from vcam_cli.files.atomic import write_whole

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Colors of series, by Okabe and Ito: color-blind readers can tell them apart."""
MARKERS = ("o", "s", "D", "^", "v", "P")
"""Markers of series."""
DASHES: tuple[Any, ...] = (
    "-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (4, 1, 1, 1)), (0, (7, 3)), (0, (3, 1, 1, 1, 1, 1)),
)  # fmt: skip
"""Dashes of series."""
CHANNELS = {"R": 1, "G": 2, "B": 0, "Y": 0}
"""Color of a filter -> number of its series; other filters have the numbers from 3."""
INK, GRAY, LIGHT_GRAY = "#444444", "#777777", "#c9c9c9"
"""Colors of axes, of limits and sums, and of what is drawn behind."""
LIMIT: Any = (0, (4, 3))
"""Dashes of a limit, in gray."""
MARK: Any = (0, (1, 2))
"""Dots of a line that marks a place on an axis."""
SMALL, SMALLEST = 7.5, 6.5
"""Sizes of legends, and of labels beside points [pt]."""
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.minor.size": 1.8,
    "ytick.minor.size": 1.8,
    "legend.frameon": False,
    "svg.hashsalt": "vcam",  # else names in the file would change from run to run
}


def color_of(series: int) -> str:
    """Return the color of a series; gray for a negative number."""
    return GRAY if series < 0 else COLORS[series % len(COLORS)]


def channel_series(names: Sequence[str]) -> list[int]:
    """Return the number of the series of each color of filters."""
    others = iter(range(3, 3 + len(names)))
    return [CHANNELS[name] if name in CHANNELS else next(others) for name in names]


def add_scale(axes: Any, label: str, factor: float) -> None:
    """Add a second horizontal scale above the axes: that below times a factor.

    Parameters
    ----------
    axes : Axes
        Axes of Matplotlib.
    label : str
        Label of the scale, with its unit.
    factor : float
        Unit of the scale below in units of the one above.
    """
    above = axes.secondary_xaxis("top", functions=(lambda x: x * factor, lambda x: x / factor))
    above.set_xlabel(label)
    above.tick_params(labelsize=SMALL)


def load() -> ModuleType:
    """Return Matplotlib as it ships: with no settings of the current folder or of the user.

    While it is imported it reads a file `matplotlibrc` of the current folder, whoever put it there,
    before the one that MATPLOTLIBRC names; so the former is hidden from it.
    """
    spec = importlib.util.find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    shipped = str(Path(spec.origin).parent / "mpl-data" / "matplotlibrc")
    exists, told = os.path.exists, os.environ.get("MATPLOTLIBRC")
    os.path.exists = lambda path: path != "matplotlibrc" and exists(path)
    os.environ["MATPLOTLIBRC"] = shipped
    try:
        return importlib.import_module("matplotlib")
    finally:
        os.path.exists = exists
        os.environ.pop("MATPLOTLIBRC")
        if told is not None:
            os.environ["MATPLOTLIBRC"] = told


_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
}
"""Format -> metadata omitted from its files, since they would change from run to run."""


def save(figure: Any, path: Path | str) -> None:
    """Write a Matplotlib figure as a file that is whole or not there; its name says the format."""
    form = Path(path).suffix.removeprefix(".")
    with write_whole(path) as temporary:
        figure.savefig(temporary, format=form, metadata=_METADATA[form])


def in_formats(
    writers: Mapping[str, Callable[[Path], None]], formats: Sequence[str]
) -> dict[str, Callable[[Path], None]]:
    """Return writers of files by name, with those of all PNG plots in further formats beside.

    Parameters
    ----------
    writers : mapping
        Name of a file -> function that writes it under a path; that of a plot takes the format
        from the path.
    formats : sequence of str
        "svg", "pdf".
    """
    found = dict(writers)
    for name, write in writers.items():
        if name.endswith(".png"):
            found |= {f"{name.removesuffix('png')}{form}": write for form in formats}
    return found


@contextmanager
def plot_figure(
    path: Path | str,
    size: tuple[float, float],
    dpi: int = 150,
    layout: Literal["constrained"] | None = "constrained",
) -> Iterator[Any]:
    """Yield a Matplotlib figure of the common style, and write it when the block ends.

    Parameters
    ----------
    path : Path or str
        The file: PNG, SVG or PDF by its name.
    size : tuple of float
        Width and height [inch].
    dpi : int
        Pixels per inch.
    layout : str, optional
        How Matplotlib places the axes; None for axes with places of their own.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    matplotlib = load()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: Any = {**matplotlib.rcParamsDefault, **STYLE}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size, dpi=dpi, layout=layout)
        FigureCanvasAgg(figure)
        yield figure
        save(figure, path)


PAGE_INK, FAINT = "#123456", "#654321"
"""Placeholders of the colors of text and grids in a drawing, which follow the reader's page."""
PAGE_COLORS = (
    "<style>svg { color: #1c1e21 } @media (prefers-color-scheme: dark) { svg { color: #e4e6e9 } }"
    "</style>"
)


def svg(draw: Callable[[Any], None], size: tuple[float, float]) -> bytes:
    """Return a drawing as SVG: no background, ink that is light where the reader's page is dark.

    Parameters
    ----------
    draw : callable
        Gets a Matplotlib figure of the common style, and draws into it.
    size : tuple of float
        Width and height [inch].
    """
    matplotlib = load()
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    names = ("text.color", "axes.labelcolor", "axes.titlecolor", "axes.edgecolor", "xtick.color",
             "ytick.color")  # fmt: skip
    style: Any = {**matplotlib.rcParamsDefault, **STYLE, **dict.fromkeys(names, PAGE_INK)}
    style["grid.color"] = FAINT
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        buffer = io.StringIO()
        metadata = {"Date": None, "Creator": None}
        figure.savefig(buffer, format="svg", transparent=True, metadata=metadata)
    text = buffer.getvalue().replace(PAGE_INK, "currentColor")
    text = text.replace(f"stroke: {FAINT}", "stroke: currentColor; stroke-opacity: 0.2")
    start = text.index("<svg")
    head = text.index(">", start) + 1
    return (text[start:head] + PAGE_COLORS + text[head:]).encode()
