"""The mapping that a lens's file states: its projection, its coefficients or its table."""

from __future__ import annotations

import numpy as np

from vcam_cli.camera.lens_distortion import FisheyeDistortion, OpenCvDistortion
from vcam_cli.camera.optics import Optics
from vcam_cli.errors import data_file_problems
from vcam_cli.physics.distortion import (
    BrownConrady,
    Chain,
    DistortionTable,
    Fisheye,
    Mapping,
    Projection,
)
from vcam_cli.spectra.text import read_rows

PATH = ("optics", "distortion")
HEADER = ("image_height_mm", "distortion_percent")
REMEDY = "write the columns image_height_mm,distortion_percent, heights rising from 0"


def stated_mappings(optics: Optics) -> list[Mapping]:
    """Return projection and coefficients, next to the scene first.

    Places in the image are in units of the image distance, by which OpenCV's camera matrix has its
    focal length. A table, which is in millimeters, is not among them.
    """
    found: list[Mapping] = []
    if optics.projection != "rectilinear" and not isinstance(optics.distortion, FisheyeDistortion):
        found.append(Projection(optics.projection))
    match optics.distortion:
        case OpenCvDistortion() as given:
            mapping = BrownConrady(**given.model_dump(exclude={"model"}))
            found += [] if mapping.is_identity else [mapping]
        case FisheyeDistortion() as given:
            found.append(Fisheye(**given.model_dump(exclude={"model"})))
    return found


def half_extent(optics: Optics, angle: float, half_width: float, half_height: float) -> float:
    """Return the height at which a lens images half of a field of view, in image distances.

    Parameters
    ----------
    optics : Optics
        The lens.
    angle : float
        Half of the field of view [rad].
    half_width, half_height : float
        Way from the axis along which it is, in any unit.

    Returns
    -------
    float
        Height over the image distance; the angle's tangent for a lens that does not distort.
    """
    stated = stated_mappings(optics)
    length = np.hypot(half_width, half_height)
    tangent = np.tan(angle)
    x, y = (np.array([tangent * side / length]) for side in (half_width, half_height))
    x, y = Chain(tuple(stated)).distort(x, y)
    return float(np.hypot(x, y)[0])


def distortion_table(file: str) -> DistortionTable:
    """Return the table of a file, heights in meters. Raises BadInput."""
    path = (*PATH, "file")
    with data_file_problems(file, path, REMEDY):
        header, rows = read_rows(file)
        if tuple(header) != HEADER:
            raise ValueError(f"{file}: the header is {','.join(header)!r}")
        if len(rows) < 2:
            raise ValueError(f"{file}: has fewer than two rows below its header")
        heights, percent = rows.T
        if heights[0] < 0 or (np.diff(heights) <= 0).any():
            raise ValueError(f"{file}: image heights do not rise from 0")
        meters = tuple((heights / 1e3).tolist())
        table = DistortionTable(meters, tuple((percent / 100).tolist()))
        if not table.is_monotonic:
            raise ValueError(f"{file}: folds the image, ideal heights fall where real ones rise")
    return table
