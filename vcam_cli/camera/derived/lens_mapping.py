"""Where a camera's lens images a direction: its projection and distortion, solved and checked."""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.derived.lens_models import PATH, distortion_table, stated_mappings
from vcam_cli.camera.derived.traced import traced_view
from vcam_cli.camera.lens_distortion import DistortionFile, OpenCvDistortion
from vcam_cli.camera.model import CameraModel
from vcam_cli.errors import bad
from vcam_cli.physics.distortion import Chain, DistortionTable, Mapping

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
    optics, found = camera.optics, stated_mappings(camera.optics)
    if isinstance(optics.distortion, DistortionFile):
        table = distortion_table(optics.distortion.file)
        scaled = tuple(height / geometry.image_distance for height in table.heights)
        found.append(DistortionTable(scaled, table.distortions))
    if view := traced_view(camera, geometry.object_distance):
        from vcam_cli.camera.derived.prescription import distortion as traced_distortion

        corner = math.hypot(geometry.sensor_width, geometry.sensor_height) / 2
        own = traced_distortion(view, corner)
        scaled = tuple(height / geometry.image_distance for height in own.heights)
        found.append(DistortionTable(scaled, own.values))
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
    if mapping is not None or optics.lateral_color is not None:
        _check_distances(camera)
    if mapping is None:
        return
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


def _check_distances(camera: CameraModel) -> None:
    """Refuse distances that are not simulated through a lens that distorts (BadInput).

    Lateral color counts: it magnifies.
    """
    optics, scene = camera.optics, camera.scene
    if not scene.has_distances:
        return
    keys = {"distortion": optics.distortion, "lateral_color": optics.lateral_color}
    key = next((name for name, given in keys.items() if given is not None), "projection")
    flat = "or use a flat scene: a chart, an image or a hyperspectral file"
    if optics.prescription:
        raise bad(
            ("optics", "prescription"),
            "images flat scenes: the aberrations of layers and of depth at other distances are not"
            " traced",
            f"give focal_length, f_number and distortion instead, {flat}",
        )
    if scene.has_depth:
        raise bad(
            ("optics", key),
            "a map of depth is not simulated through a lens that displaces light: it is cut into"
            " layers on its rectangular samples, which the lens would bend",
            f"remove it, describe the scene by layers, {flat}",
        )
    if scene.moves:
        raise bad(
            ("optics", key),
            "layers in motion are not simulated through a lens that displaces light",
            f"remove it or the motion, {flat}",
        )


def border(geometry: Geometry) -> tuple[Array, Array]:
    """Return places x, y all around the border of an array [m]."""
    half_x, half_y = geometry.sensor_width / 2, geometry.sensor_height / 2
    along = np.linspace(-1, 1, BORDER)
    ends = np.ones(BORDER)
    x = np.concatenate([along, along, ends, -ends]) * half_x
    y = np.concatenate([ends, -ends, along, along]) * half_y
    return x, y


def fields_of_view(camera: CameraModel, geometry: Geometry) -> dict[str, float]:
    """Return what a lens that distorts sees, in the places of the pinhole's numbers.

    Parameters
    ----------
    camera : CameraModel
        Camera as its file describes it.
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    dict
        Fields of view [rad] and sizes of the seen scene [m] by their names in `Geometry.report`;
        empty for a lens that does not distort.
    """
    mapping = lens_mapping(camera, geometry) if camera.optics.is_lens else None
    if mapping is None:
        return {}
    half = geometry.sensor_width / 2, geometry.sensor_height / 2
    ends = {"horizontal": (half[0], 0.0), "vertical": (0.0, half[1]), "diagonal": half}
    names = {"horizontal": "scene_width", "vertical": "scene_height", "diagonal": "scene_diagonal"}
    found = {}
    for name, (x, y) in ends.items():
        both = np.array([x, -x]), np.array([y, -y])
        u, v = mapping.undistort(*(side / geometry.image_distance for side in both))
        away = np.hypot(u, v)
        found[f"field_of_view_{name}"] = float(np.arctan(away).sum())
        if math.isfinite(geometry.object_distance):
            scale = geometry.image_distance / geometry.scene_scale
            found[names[name]] = float(away.sum() * scale)
    return found
