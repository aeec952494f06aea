"""Where the pixels stand: rows and columns, staggered rows, or places of their own.

Rows and columns are a pixel and its gap apart. A honeycomb is the same square grid turned by 45
degrees: its rows lie closer, by the square root of 2, its columns wider, and every second row is
moved by half a column; pixels stay as dense as they were (M. Tamaru et al., "High-sensitivity
wide-dynamic-range CCD with honeycomb structure", Proc. SPIE 5301, 2004).
"""

from __future__ import annotations

import math
import os
from functools import lru_cache
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.array import CLEAR, Positions
from vcam_cli.errors import bad, data_file_problems
from vcam_cli.records import dataclass
from vcam_cli.spectra.text import parse_numbers, read_table

PATH = ("array", "pattern", "positions")
HEADER = ("x_um", "y_um", "color")
REMEDY = "write the columns x_um,y_um,color"
FEW_PIXELS = 16
"""Fewer pixels than these are no array that has a middle."""
MOST_PIXELS = 4_000_000
"""Most pixels of a file."""


@dataclass(frozen=True)
class Lattice:
    """Rows and columns of the raw frame, and the lengths [m] between and around them."""

    rows: int
    columns: int
    pitch_x: float
    """Distance of the columns of a row; of scattered pixels their own width and gap."""
    pitch_y: float
    """Distance of the rows."""
    width: float
    """Width of the sensitive area, which is centered on the axis."""
    height: float
    """Height of the sensitive area."""


@dataclass(frozen=True, eq=False)
class Places:
    """Pixels at places of their own."""

    x: Array
    """Places right of the axis [m], (N,)."""
    y: Array
    """Places below the axis [m], (N,)."""
    colors: tuple[str, ...]


def lattice(camera: CameraModel) -> Lattice:
    """Return the lattice of a camera's pixels; pixels at places of their own are one row.

    Raises BadInput for a die smaller than a pixel, an invalid file of positions, and one of an
    array beside the picture.
    """
    array, pixel = camera.array, camera.pixel
    pitch_x, pitch_y = pixel.width + pixel.gap_x, pixel.height + pixel.gap_y
    if isinstance(array.pattern, Positions):
        found = places(camera)
        _require_axis_inside(found, pitch_x, pitch_y)
        width = 2 * float(np.abs(found.x).max()) + pitch_x
        height = 2 * float(np.abs(found.y).max()) + pitch_y
        return Lattice(1, len(found.x), pitch_x, pitch_y, width, height)
    if array.pattern == "honeycomb":
        pitch_x, pitch_y = pitch_x * math.sqrt(2), pitch_y / math.sqrt(2)
    rows, columns = array.rows, array.columns
    if array.die is not None:
        rows = round(array.die.height / pitch_y)
        columns = round(array.die.width / pitch_x)
        if rows < 1 or columns < 1:
            message = "the die is smaller than one pixel"
            raise bad("array.die", message, "give a larger die, or rows and columns")
    assert rows is not None and columns is not None
    return Lattice(rows, columns, pitch_x, pitch_y, columns * pitch_x, rows * pitch_y)


def _require_axis_inside(found: Places, pitch_x: float, pitch_y: float) -> None:
    """Refuse pixels that lie beside the optical axis, around which the picture is (BadInput).

    Mostly their origin is a corner of the array. A row or a column may begin at the axis, and a few
    pixels may be anywhere.
    """
    if len(found.x) < FEW_PIXELS:
        return
    beside = []
    for at, pitch in ((found.x, pitch_x), (found.y, pitch_y)):
        low, high = float(at.min()), float(at.max())
        if high - low < 2 * pitch:
            return
        beside.append(low > -pitch if low + high > 0 else high < pitch)
    if all(beside):
        middle = [(float(at.min()) + float(at.max())) / 2e-6 for at in (found.x, found.y)]
        raise bad(
            PATH,
            "the optical axis, the origin of x_um and y_um, lies outside the array",
            f"write origin: corner beside positions, or subtract {middle[0]:.6g} from x_um and"
            f" {middle[1]:.6g} from y_um",
        )


def places(camera: CameraModel) -> Places:
    """Return the pixels of a camera whose pattern is a file of positions. Raises BadInput."""
    assert isinstance(camera.array.pattern, Positions)
    file, origin = camera.array.pattern.positions, camera.array.pattern.origin
    with data_file_problems(file, PATH, REMEDY):
        changed = os.stat(file).st_mtime_ns
        return _read(file, changed, tuple(camera.array.filters), origin)


@lru_cache(maxsize=4)
def _read(file: str, changed: int, filters: tuple[str, ...], origin: str) -> Places:
    """Return the pixels of the file as it is now; `changed` tells one version from another.

    From a corner, the middle between the outermost pixels is that of the array.
    """
    with data_file_problems(file, PATH, REMEDY):
        header, rows = read_table(file, MOST_PIXELS)
        if tuple(header) != HEADER:
            raise ValueError(f"{file}: the header is {','.join(header)!r}")
        if not rows:
            raise ValueError(f"{file}: has no pixels below its header")
        x_y = np.array([parse_numbers(Path(file), n, cells[:2]) for n, cells in rows]) * 1e-6
    colors = tuple(cells[2].strip() for _, cells in rows)
    unknown = [c for c in dict.fromkeys(colors) if c not in filters and c not in CLEAR]
    if unknown:
        raise bad(
            PATH,
            f"{file}: has pixels of color {unknown[0]!r}, which has no filter",
            f"add {unknown[0]}: and its spectrum to array.filters",
        )
    if origin == "corner":
        x_y -= (x_y.min(axis=0) + x_y.max(axis=0)) / 2
    return Places(x_y[:, 0], x_y[:, 1], colors)
