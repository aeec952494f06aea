"""Pictures of photocurrents: tone-mapped ones, details side by side, noise with its histogram.

The look is that of `plots.py`: the same bytes for the same numbers. Pictures are logarithmic in
light, as those of the thesis's Fig 4.13: noise shows in them as it is relative to the signal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.files.images.png import write_png
from vcam_cli.files.plots import COLORS, SMALL, plot_figure
from vcam_cli.records import dataclass

Square = tuple[slice, slice]
"""Rows and columns of a part of a picture."""

COLUMNS = 5
"""Details in a row."""
HISTOGRAM_BINS = 81


@dataclass(frozen=True)
class Picture:
    """A picture with its captions: values (rows, columns)."""

    title: str
    text: str
    values: Array


def tone_limits(values: Array) -> tuple[float, float]:
    """Return what is black and what white in a picture of these positive values."""
    positive = values[values > 0]
    if positive.size == 0:
        return 1.0, 2.0
    low, high = np.percentile(positive, 0.5), positive.max()
    return float(min(low, high / 2)), float(high)


def tones(values: Array, low: float, high: float) -> NDArray[np.uint8]:
    """Return 8-bit codes of positive values, log(value / low) / log(high / low).

    Values at `low` and below are black, as what is not a number.
    """
    floor = np.nextafter(low, 0)
    safe = np.where(values > floor, values, low)
    share = np.log(safe / low) / np.log(high / low)
    gray: NDArray[np.uint8] = np.rint(255 * np.clip(share, 0, 1)).astype(np.uint8)
    return gray


def write_tones(path: Path | str, values: Array, low: float, high: float) -> None:
    """Write a tone-mapped PNG of values (rows, columns).

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    decades = np.log10(high / low)
    write_png(path, tones(values, low, high), f"logarithmic, {decades:.2g} decades of light")


def plot_details(
    path: Path | str, title: str, scene: Array, square: Square, pictures: Sequence[Picture]
) -> None:
    """Plot the scene with a square on it, and that part of every picture, larger.

    Parameters
    ----------
    path : Path or str
        The PNG, SVG or PDF.
    title : str
        Title of the figure.
    scene : (rows, columns) array
        The scene free of noise.
    square : pair of slices
        The part that is shown larger.
    pictures : sequence of Picture
        Pictures in the scene's shape.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    rows = -(-len(pictures) // COLUMNS)
    across = min(COLUMNS, len(pictures))
    part = scene[square]
    low, high = tone_limits(part)
    with _titled_figure(path, title, (2.9 + 2.3 * across, 0.55 + 2.75 * rows)) as figure:
        grid = figure.add_gridspec(rows, across + 1, width_ratios=[1.25, *[1] * across])
        codes = tones(scene, *tone_limits(scene))
        _show_picture(figure.add_subplot(grid[0, 0]), codes, "scene", "", square)
        if rows > 1:
            axes = figure.add_subplot(grid[1, 0])
            _show_picture(axes, tones(part, low, high), "detail, free of noise", "")
        for number, picture in enumerate(pictures):
            axes = figure.add_subplot(grid[number // across, 1 + number % across])
            codes = tones(picture.values[square], low, high)
            _show_picture(axes, codes, picture.title, picture.text)


def plot_noise(path: Path | str, title: str, pictures: Sequence[Picture], limit: float) -> None:
    """Plot noise images, gray where undefined, above their histograms on one scale.

    Parameters
    ----------
    path : Path or str
        The PNG, SVG or PDF.
    title : str
        Title of the figure.
    pictures : sequence of Picture
        Relative errors [%].
    limit : float
        Error at which pictures are black and white, and histograms end [%].

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    edges = np.linspace(-limit, limit, HISTOGRAM_BINS + 1)
    counts = [np.histogram(np.clip(p.values, -limit, limit), edges)[0] for p in pictures]
    top = 1.06 * max(int(count[1:-1].max()) for count in counts)
    with _titled_figure(path, title, (0.5 + 2.5 * len(pictures), 4.9)) as figure:
        grid = figure.add_gridspec(2, len(pictures), height_ratios=(1.7, 1))
        for column, (picture, count) in enumerate(zip(pictures, counts, strict=True)):
            codes = np.clip(127.5 + 127.5 * picture.values / limit, 0, 255).astype(np.uint8)
            axes = figure.add_subplot(grid[0, column])
            _show_picture(axes, codes, picture.title, picture.text)
            axes = figure.add_subplot(grid[1, column])
            axes.stairs(count, edges, fill=True, color=COLORS[0])
            axes.set_xlim(-limit, limit)
            axes.set_ylim(0, top)
            axes.set_xlabel("relative error [%]")
            if column == 0:
                axes.set_ylabel("pixels")
            else:
                axes.tick_params(labelleft=False)


def _show_picture(
    axes: Any, codes: Array, title: str, text: str, square: Square | None = None
) -> None:
    from matplotlib.patches import Rectangle

    axes.imshow(codes, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    axes.set_title(title, fontsize=8.5)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.set_xlabel(text, fontsize=SMALL)
    if square is not None:
        rows, columns = square
        corner = (columns.start - 0.5, rows.start - 0.5)
        size = (columns.stop - columns.start, rows.stop - rows.start)
        axes.add_patch(Rectangle(corner, *size, fill=False, ec=COLORS[1], lw=1.2))


@contextmanager
def _titled_figure(path: Path | str, title: str, size: tuple[float, float]) -> Iterator[Any]:
    """Yield a figure with a title above all its axes."""
    with plot_figure(path, size) as figure:
        yield figure
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
