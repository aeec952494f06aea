"""A lens's measured relative illumination, read from its file."""

import numpy as np

from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.derived.traced import traced_view
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.optics import FalloffFile
from vcam_cli.errors import Path, bad, data_file_problems
from vcam_cli.records import dataclass
from vcam_cli.spectra.text import read_rows

HEADER = ("image_height_mm", "value")
SECTION = ("optics", "off_axis")
PATH = (*SECTION, "file")
REMEDY = "write the columns image_height_mm,value, heights rising from 0"
SLACK = 1e-9
"""By how much the last height may miss the corner, relative: rounding."""


@dataclass(frozen=True)
class Falloff:
    """Relative illumination over the distance from the axis, straight between its points."""

    heights: tuple[float, ...]
    """Distances from the axis, rising from 0 [m]."""
    values: tuple[float, ...]
    """Illumination relative to the axis: the first is 1."""
    is_traced: bool = False
    """Whether it is that of a traced lens, not a measured one."""


def falloff(camera: CameraModel, geometry: Geometry) -> Falloff | None:
    """Return the table that `optics.off_axis` names, or a traced lens's; None without either.

    Raises BadInput for a file that cannot be read, is no such table, or ends before the corner of
    the array.
    """
    given = camera.optics.off_axis
    if isinstance(given, FalloffFile):
        return _read(given, geometry, PATH)
    if given == "exact" and (view := traced_view(camera, geometry.object_distance)):
        from vcam_cli.camera.derived.prescription import illumination

        corner = float(np.hypot(geometry.sensor_width, geometry.sensor_height)) / 2
        traced = illumination(view, corner)
        return Falloff(traced.heights, traced.values, is_traced=True)
    return None


def falloffs_by_color(camera: CameraModel, geometry: Geometry) -> dict[str, Falloff]:
    """Return the tables of the filter colors; empty where the file has none of each color.

    Raises BadInput where colors are not those of the array, and as `falloff` does.
    """
    given = camera.optics.off_axis
    if isinstance(given, str | FalloffFile):
        return {}
    colors = camera.array.colors or tuple(camera.array.filters)
    for color in given:
        if color not in colors:
            message = f"{color} is no color of the array, which has {', '.join(colors)}"
            raise bad((*SECTION, color), message, f"remove {color}")
    if missing := [color for color in colors if color not in given]:
        message = f"has no table for {', '.join(missing)}"
        raise bad(SECTION, message, f"add {missing[0]}: {{file: relative-illumination.csv}}")
    return {c: _read(own, geometry, (*SECTION, c, "file")) for c, own in given.items()}


def _read(given: FalloffFile, geometry: Geometry, path: Path) -> Falloff:
    """Return the table of a file that a key names. Raises BadInput."""
    heights, values = _table(given.file, path)
    corner = float(np.hypot(geometry.sensor_width, geometry.sensor_height)) / 2
    if heights[-1] < corner * (1 - SLACK):
        raise bad(
            path,
            f"ends at an image height of {heights[-1] * 1e3:.6g} mm, but the corner of the array"
            f" is {corner * 1e3:.6g} mm from the axis",
            f"add rows up to {corner * 1e3:.6g} mm, or make the array smaller",
        )
    return Falloff(tuple(heights), tuple(values / values[0]))


def check(camera: CameraModel) -> None:
    """Raise BadInput where the relative illumination is not to be had."""
    given = camera.optics.off_axis
    if isinstance(given, FalloffFile):
        falloff(camera, geometry(camera))
    elif not isinstance(given, str):
        falloffs_by_color(camera, geometry(camera))


def _table(file: str, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return heights [m] and values of the file. Raises BadInput."""
    with data_file_problems(file, path, REMEDY):
        header, rows = read_rows(file)
        if tuple(header) != HEADER:
            raise ValueError(f"{file}: the header is {','.join(header)!r}")
        if len(rows) == 0:
            raise ValueError(f"{file}: has no rows below its header")
        heights, values = rows.T
        if mistake := _mistake(heights, values):
            raise ValueError(f"{file}: {mistake}")
    return heights / 1e3, values


def _mistake(heights: np.ndarray, values: np.ndarray) -> str | None:
    """Return what is wrong: heights that do not rise from 0, values that are no light."""
    falling = np.flatnonzero(np.diff(heights) <= 0)
    if heights[0] != 0:
        return f"begins at {heights[0]:g} mm, and the value on the axis is missing"
    if falling.size:
        before, after = heights[falling[0]], heights[falling[0] + 1]
        return f"{after:g} mm follows {before:g} mm"
    if (values < 0).any():
        worst = int(np.argmax(values < 0))
        return f"{values[worst]:g} at {heights[worst]:g} mm; light is not negative"
    return "is 0 on the axis, and values are relative to it" if values[0] == 0 else None
