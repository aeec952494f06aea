"""Pictures as they stand in a report: PNG files and drawings, inside the page."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.files import atomic, plots
from vcam_cli.files.images.png import write_png
from vcam_cli.quality import error_map
from vcam_cli.reports.page import Picture, Scale

WIDEST = 1024
"""Columns of a picture above which it is shown smaller: a page of six such has some 10 MB."""
SMALL = 320
"""Columns of a picture up to which a page shows it as large as it is, or larger."""


def png(data: bytes) -> str:
    """Return the bytes of a PNG file as a URL that holds them."""
    return "data:image/png;base64," + base64.b64encode(data).decode("ascii")


def without_mosaic(image: Array) -> str:
    """Return codes with squares of 2 x 2 pixels averaged as a URL; "" of a picture that is small.

    Pixels behind a mosaic alternate: shown smaller, they would beat with those of the screen.

    Parameters
    ----------
    image : ndarray of uint8 or uint16
        Codes (rows, columns) or (rows, columns, 1 or 3).
    """
    if not SMALL <= image.shape[1] <= WIDEST:
        return ""  # it is shown larger than it is, or averaged anyway
    small = _averaged(image, 2)
    return png(atomic.written_bytes("picture.png", lambda path: write_png(path, small)))


def drawing(draw: Callable[[Any], None], size: tuple[float, float]) -> str:
    """Return a drawing as a URL that holds it; see `plots.svg`."""
    svg = plots.svg(draw, size)
    return "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")


def codes(image: Array, is_mosaic: bool = False) -> tuple[str, str]:
    """Return a picture of sRGB codes as a URL, and how far it was shrunk, in words.

    Parameters
    ----------
    image : ndarray of uint8 or uint16
        Codes (rows, columns) or (rows, columns, 1 or 3).
    is_mosaic : bool
        Whether neighbors lie behind filters of different colors: squares that are averaged then
        have as many of each.
    """
    step = math.ceil(image.shape[1] / WIDEST)
    step += is_mosaic and step > 1 and step % 2
    small = _averaged(image, step)
    data = atomic.written_bytes("picture.png", lambda path: write_png(path, small))
    shrunk = f"Shown at 1/{step} of its size, {step} x {step} pixels averaged." if step > 1 else ""
    return png(data), shrunk


def shades(values: Array, white: float) -> NDArray[np.uint8]:
    """Return values from 0 to `white` as codes of sRGB that look evenly spaced.

    Parameters
    ----------
    values : ndarray
        Light or codes of any shape, proportional to light.
    white : float
        The value of the code 255.
    """
    share = np.clip(values / white, 0, 1)
    return np.asarray(255 * np.sqrt(share) + 0.5).astype(np.uint8)


def map_picture(
    title: str,
    values: Array,
    upper: float,
    unit: str,
    alt: str,
    note: str,
    group: str = "",
    is_mosaic: bool = False,
) -> Picture:
    """Return a map in false colors with the bar of its scale.

    Parameters
    ----------
    title, alt, note, group : str
        As of `Picture`.
    values : ndarray
        Map (rows, columns), in `unit`.
    upper : float
        Value of the lightest color; the darkest is 0.
    unit : str
        Unit of the values.
    is_mosaic : bool
        Whether neighbors lie behind filters of different colors.
    """
    colors = error_map.false_color(values, upper)
    source, shrunk = codes(colors, is_mosaic)
    far = without_mosaic(colors) if is_mosaic else ""
    most = f"{upper:.5g} {unit}".rstrip()
    scale = Scale("0", f"{most} or more", error_map.INFERNO)
    return Picture(title, source, alt, f"{note} {shrunk}".strip(), scale, group, far)


def _averaged(image: Array, step: int) -> Array:
    """Return means of squares of `step` pixels, the remainder at the ends dropped."""
    if step <= 1:
        return image
    rows, columns = (size // step for size in image.shape[:2])
    cut = image[: rows * step, : columns * step]
    blocks = cut.reshape(rows, step, columns, step, *image.shape[2:])
    return np.asarray(blocks.mean(axis=(1, 3)) + 0.5).astype(image.dtype)
