"""A lens's measured relative illumination, read from its file."""

from dataclasses import dataclass

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import Geometry, geometry
from vcam_cli.camera.optics import FalloffFile
from vcam_cli.errors import bad
from vcam_cli.spectra.text import read_rows

HEADER = ("image_height_mm", "value")
PATH = ("optics", "off_axis", "file")
SLACK = 1e-9
"""By how much the last height may miss the corner, relative: rounding."""


@dataclass(frozen=True)
class Falloff:
    """Relative illumination over the distance from the axis, straight between its points."""

    heights: tuple[float, ...]
    """Rising, from 0 [m]."""
    values: tuple[float, ...]
    """Relative to the axis: the first is 1."""


def falloff(camera: Camera, geometry: Geometry) -> Falloff | None:
    """The table that `optics.off_axis` names; None where it names no file.

    Raises BadInput for a file that cannot be read, is no such table, or ends before the corner.
    """
    given = camera.optics.off_axis
    if not isinstance(given, FalloffFile):
        return None
    heights, values = _table(given.file)
    corner = float(np.hypot(geometry.sensor_width, geometry.sensor_height)) / 2
    if heights[-1] < corner * (1 - SLACK):
        raise bad(
            PATH,
            f"ends at an image height of {heights[-1] * 1e3:.6g} mm, but the corner of the array"
            f" is {corner * 1e3:.6g} mm from the axis",
            f"add rows up to {corner * 1e3:.6g} mm, or make the array smaller",
        )
    return Falloff(tuple(heights), tuple(values / values[0]))


def check(camera: Camera) -> None:
    """Raises BadInput where the relative illumination is not to be had."""
    if isinstance(camera.optics.off_axis, FalloffFile):
        falloff(camera, geometry(camera))


def _table(file: str) -> tuple[np.ndarray, np.ndarray]:
    """Heights [m] and values of the file. Raises BadInput."""
    write = "write the columns image_height_mm,value, heights rising from 0"
    try:
        header, rows = read_rows(file)
    except ValueError as error:
        raise bad(PATH, str(error), write) from None
    except OSError as error:
        raise bad(PATH, f"{file} cannot be read: {error.strerror}", "check the file name") from None
    if tuple(header) != HEADER:
        raise bad(PATH, f"{file}: the header is {','.join(header)!r}", write)
    if len(rows) == 0:
        raise bad(PATH, f"{file}: has no rows below its header", write)
    heights, values = rows.T
    _require(file, heights, values, write)
    return heights / 1e3, values


def _require(file: str, heights: np.ndarray, values: np.ndarray, write: str) -> None:
    """Raises BadInput for heights that do not rise from 0, and values that are no light."""
    falling = np.flatnonzero(np.diff(heights) <= 0)
    if heights[0] != 0:
        message = f"begins at {heights[0]:g} mm, and the value on the axis is missing"
    elif falling.size:
        before, after = heights[falling[0]], heights[falling[0] + 1]
        message = f"{after:g} mm follows {before:g} mm"
    elif (values < 0).any():
        worst = int(np.argmax(values < 0))
        message = f"{values[worst]:g} at {heights[worst]:g} mm; light is not negative"
    elif values[0] == 0:
        message = "is 0 on the axis, and values are relative to it"
    else:
        return
    raise bad(PATH, f"{file}: {message}", write)
