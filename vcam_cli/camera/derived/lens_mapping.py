"""Where a camera's lens images a direction: its projection and distortion, solved and checked."""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.derived.prescription import distortion as traced_distortion
from vcam_cli.camera.derived.prescription import sensor_view, traced_lens
from vcam_cli.camera.lens_distortion import DistortionFile, FisheyeDistortion, OpenCvDistortion
from vcam_cli.camera.model import CameraModel
from vcam_cli.errors import bad, data_file_problems
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
WIDEST = math.radians(85)
"""Field angle up to which a flat scene is imaged: 11 focal lengths from the axis [rad]."""
BORDER = 129
"""Places along each side of the array at which a mapping is checked."""


def lens_mapping(camera: CameraModel, geometry: Geometry) -> Mapping | None:
    """Return the mapping of directions to the image; None of a lens that does not distort.

    Places in the image are in units of the image distance, by which OpenCV's camera matrix has its
    focal length.

    Raises
    ------
    BadInput
        For a file that cannot be read or is no such table.
    """
    optics, found = camera.optics, list[Mapping]()
    if optics.projection != "rectilinear" and not isinstance(optics.distortion, FisheyeDistortion):
        found.append(Projection(optics.projection))
    match optics.distortion:
        case OpenCvDistortion() as given:
            mapping = BrownConrady(**given.model_dump(exclude={"model"}))
            found += [] if mapping.is_identity else [mapping]
        case FisheyeDistortion() as given:
            found.append(Fisheye(**given.model_dump(exclude={"model"})))
        case DistortionFile(file=file):
            heights, distortions = _table(file)
            scaled = tuple((heights / geometry.image_distance).tolist())
            found.append(DistortionTable(scaled, tuple(distortions.tolist())))
    if traced := traced_lens(camera):
        view = sensor_view(traced, geometry.object_distance, optics.defocus)
        corner = math.hypot(geometry.sensor_width, geometry.sensor_height) / 2
        table = traced_distortion(view, corner)
        scaled = tuple(height / geometry.image_distance for height in table.heights)
        found.append(DistortionTable(scaled, table.values))
    if not found:
        return None
    return found[0] if len(found) == 1 else Chain(tuple(found))


def check(camera: CameraModel) -> None:
    """Refuse a lens whose image folds on the array, or that sees beyond a flat scene (BadInput)."""
    optics = camera.optics
    if not optics.is_lens:
        return
    solved = geometry(camera)
    mapping = lens_mapping(camera, solved)
    if mapping is None:
        return
    if camera.scene.has_distances:
        key = "projection" if optics.distortion is None else "distortion"
        key = "prescription" if optics.prescription else key
        raise bad(
            ("optics", key),
            "scenes with depth or layers are not simulated through a lens that distorts",
            "remove it, or use a flat scene: a chart, an image or a hyperspectral file",
        )
    x, y = (side / solved.image_distance for side in border(solved))
    u, v = mapping.undistort(x, y)
    angles = np.arctan(np.hypot(u, v))
    seen = angles <= WIDEST  # NaN is not
    if seen.all():
        return
    height = float(np.hypot(x, y)[~seen].min()) * solved.image_distance
    corner = float(np.hypot(x, y).max()) * solved.image_distance
    at = f"{height * 1e3:.4g} mm from the axis (the corner is at {corner * 1e3:.4g} mm)"
    if np.isnan(angles[~seen]).all() and isinstance(optics.distortion, OpenCvDistortion):
        raise bad(
            PATH,
            f"folds the image {at}: the same direction would be seen twice",
            "check the signs and order of the coefficients (OpenCV's is k1, k2, p1, p2, k3, ...),"
            " make the array smaller, or lengthen the focal length",
        )
    raise bad(
        ("optics", "projection" if optics.distortion is None else "distortion"),
        f"sees more than {math.degrees(WIDEST):.0f} degrees off the axis {at}, where a flat scene"
        " does not reach",
        "make the array smaller, or lengthen the focal length",
    )


def border(geometry: Geometry) -> tuple[Array, Array]:
    """Return places x, y all around the border of an array [m]."""
    half_x, half_y = geometry.sensor_width / 2, geometry.sensor_height / 2
    along = np.linspace(-1, 1, BORDER)
    ends = np.ones(BORDER)
    x = np.concatenate([along, along, ends, -ends]) * half_x
    y = np.concatenate([ends, -ends, along, along]) * half_y
    return x, y


def _table(file: str) -> tuple[np.ndarray, np.ndarray]:
    """Return heights [m] and distortions of a file. Raises BadInput."""
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
        table = DistortionTable(tuple(heights.tolist()), tuple((percent / 100).tolist()))
        if not table.is_monotonic:
            raise ValueError(f"{file}: folds the image, ideal heights fall where real ones rise")
    return heights / 1e3, percent / 100
