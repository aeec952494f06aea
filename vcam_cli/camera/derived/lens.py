"""The lens's focal length, f-number and magnification, from whichever numbers the file gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from vcam_cli.camera.derived.lattice import lattice
from vcam_cli.camera.derived.lens_models import distortion_table, half_extent
from vcam_cli.camera.derived.traced import traced_lens
from vcam_cli.camera.lens_distortion import DistortionFile
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.optics import LEAST_F_NUMBER, MOST_F_NUMBER, Optics
from vcam_cli.camera.sensor.pixel import AGREE
from vcam_cli.errors import bad
from vcam_cli.physics import radiometry
from vcam_cli.records import dataclass

_GIVE_TWO = "give two of f_number, focal_length and aperture_diameter"


@dataclass(frozen=True)
class Lens:
    """A thin lens in front of a scene."""

    focal_length: float
    """Focal length [m]."""
    f_number: float
    """Focal length over diameter of the entrance pupil."""
    magnification: float
    """Magnification of what is in focus, negative; 0 at infinity."""
    focus_distance: float
    """From the lens to what is in focus [m]."""
    pupil_magnification: float = 1.0
    """Diameter of the exit pupil over that of the entrance pupil."""

    def scale_at(self, distance: float) -> float:
        """Return the size of an image over that of its object, by the lens's central ray.

        It is 0 at infinity, and the magnification's size for what is in focus.
        """
        if distance == self.focus_distance or math.isinf(self.f_number):
            return -self.magnification
        return (1 - self.magnification) * self.focal_length / distance


def scene_distance(camera: CameraModel) -> float:
    """Return the distance from the lens to the scene [m]; of many distances that in focus."""
    own = camera.scene.has_distances
    return focus_distance(camera) if own else camera.scene.distance


def focus_distance(camera: CameraModel) -> float:
    """Return the distance from the lens to what is in focus [m]."""
    given = camera.optics.focus_distance
    return camera.scene.distance if given is None else given


def lens(camera: CameraModel) -> Lens:
    """Return the lens of a camera; without one, the narrowest cone from infinitely far away.

    Raises BadInput for a lens that is not determined, numbers that disagree, and a scene at or
    inside the focal length.
    """
    optics, distance = camera.optics, scene_distance(camera)
    if not optics.is_lens:
        return Lens(math.inf, math.inf, 0.0, math.inf)
    traced = traced_lens(camera)
    f = traced.paraxial.focal_length if traced else _focal_length(camera)
    focus = focus_distance(camera)
    if distance <= f:
        raise bad(
            "scene.distance",
            f"a scene {distance:.6g} m from the lens lies within its focal length of {f:.6g} m"
            " and forms no real image",
            "put the scene further away, or use a shorter focal length",
        )
    if focus <= f:
        raise bad(
            "optics.focus_distance",
            f"{focus:.6g} m lies within the focal length of {f:.6g} m, where nothing can be"
            " in focus",
            "focus further away, or use a shorter focal length",
        )
    m = float(radiometry.magnification(f, focus))
    if traced:
        return Lens(f, traced.f_number, m, focus, traced.paraxial.pupil_magnification)
    pupils = _pupil_magnification(camera, f, m)
    found: dict[str, float] = {}
    if optics.f_number is not None:
        found["f_number"] = optics.f_number
    if optics.numerical_aperture is not None:
        sine = optics.numerical_aperture
        of_cone = radiometry.f_number_of_numerical_aperture(sine, m / pupils)
        found["numerical_aperture"] = float(of_cone)
    if optics.aperture_diameter is not None:
        found["aperture_diameter"] = f / optics.aperture_diameter
        _require_f_number(found["aperture_diameter"], f, optics.aperture_diameter)
    if not found:
        raise bad(
            "optics",
            "the lens is not determined: its f-number is missing",
            "give f_number, aperture_diameter or numerical_aperture beside the focal length",
        )
    number = _common_value(found, "", lambda number: f"f/{number:.5g}")
    return Lens(f, number, m, focus, pupils)


def _pupil_magnification(camera: CameraModel, focal_length: float, magnification: float) -> float:
    """Return the pupil magnification P by which the exit pupil is (P - m) f from the sensor.

    Raises BadInput for a pupil through which no light meets the sensor.
    """
    distance = camera.optics.exit_pupil_distance
    if distance is None:
        return 1.0
    found = distance / focal_length + magnification
    if found <= 0:
        least = -magnification * focal_length
        raise bad(
            "optics.exit_pupil_distance",
            f"{distance * 1e3:.4g} mm is not beyond the image of an infinitely far pupil,"
            f" {least * 1e3:.4g} mm before the sensor (focal length times magnification)",
            "give a larger distance, or focus further away",
        )
    return found


def _require_f_number(number: float, focal_length: float, diameter: float) -> None:
    """Raise BadInput where no lens in air has the f-number that follows from an aperture."""
    if LEAST_F_NUMBER * (1 - AGREE) <= number <= MOST_F_NUMBER:
        return
    limit = "less than" if number < LEAST_F_NUMBER else "more than"
    raise bad(
        "optics.aperture_diameter",
        f"{diameter * 1e3:.4g} mm at a focal length of {focal_length * 1e3:.4g} mm is"
        f" f/{number:.4g}, {limit} a lens in air can have (f/{LEAST_F_NUMBER:g} to"
        f" f/{MOST_F_NUMBER:g})",
        "look for a wrong unit in the aperture or the focal length",
    )


def _focal_length(camera: CameraModel) -> float:
    """Return the focal length, from every pair that determines it."""
    optics, distance = camera.optics, focus_distance(camera)
    found: dict[str, float] = {}
    if optics.focal_length is not None:
        found["focal_length"] = optics.focal_length
    if optics.field_of_view is not None:
        pixels = lattice(camera)
        found["field_of_view"] = _seen_by(optics, pixels.width, pixels.height, distance)
    if optics.aperture_diameter is not None:
        if optics.f_number is not None:
            found["aperture_diameter"] = optics.aperture_diameter * optics.f_number
        elif optics.numerical_aperture is not None:
            tangent = math.tan(math.asin(optics.numerical_aperture))
            cone = optics.aperture_diameter / 2 / tangent  # f (1 - m/P)
            pupil = optics.exit_pupil_distance
            found["aperture_diameter"] = _focal_length_of_cone(cone, distance, pupil)
    if not found:
        raise bad("optics", "the lens is not determined: its focal length is missing", _GIVE_TWO)
    return _common_value(found, "a focal length of ", lambda length: f"{length * 1e3:.6g} mm")


def _seen_by(optics: Optics, width: float, height: float, distance: float) -> float:
    """Return the focal length with which a lens sees its field of view, by its projection."""
    given = optics.field_of_view
    assert given is not None
    angle, extent = given.angle_and_extent(width, height)
    along_x = given.vertical is None, given.horizontal is None
    way = width * along_x[0], height * along_x[1]
    if isinstance(optics.distortion, DistortionFile):  # in millimeters of the distorted image
        table = distortion_table(optics.distortion.file)
        at = np.array([extent / 2])
        extent = 2 * float(table.undistort(at, np.zeros(1))[0][0])
    half = half_extent(optics, angle / 2, *way)
    if not half > 0:
        raise bad(
            "optics.field_of_view",
            f"no height of the image has the field angle {math.degrees(angle / 2):.4g} deg",
            "check the coefficients of distortion, or give focal_length",
        )
    pinhole = 2 * math.atan(half)
    return float(radiometry.focal_length_of_field_of_view(pinhole, extent, distance))


def _focal_length_of_cone(cone: float, distance: float, pupil: float | None) -> float:
    """Return f of f (1 - m/P), where m = -f / (distance - f) and P = pupil / f + m, or 1."""
    if pupil is None:
        return cone / (1 + cone / distance)
    half = pupil * (1 + cone / distance)  # of a quadratic equation, in the form that stays exact
    root = math.sqrt(half**2 - 4 * (pupil - cone) * cone * pupil / distance)
    return 2 * cone * pupil / (half + root)


def _common_value(values: Mapping[str, float], what: str, text: Callable[[float], str]) -> float:
    """Return the first of several values for one thing. Raises BadInput where they disagree."""
    first, value = next(iter(values.items()))
    for name, other in values.items():
        if abs(other - value) > AGREE * value:
            message = f"means {what}{text(other)}, but {first} says {text(value)}"
            raise bad(f"optics.{name}", message, _GIVE_TWO)
    return value
