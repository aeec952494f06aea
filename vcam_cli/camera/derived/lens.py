"""The lens's focal length, f-number and magnification, from whichever numbers the file gives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.lattice import lattice
from vcam_cli.camera.optics import LEAST_F_NUMBER, MOST_F_NUMBER
from vcam_cli.camera.sensor.pixel import AGREE
from vcam_cli.errors import bad
from vcam_cli.physics import radiometry

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

    def scale_at(self, distance: float) -> float:
        """Return the size of an image over that of what is seen, by the lens's central ray.

        It is 0 at infinity, and the magnification's size for what is in focus.
        """
        if distance == self.focus_distance or math.isinf(self.f_number):
            return -self.magnification
        return (1 - self.magnification) * self.focal_length / distance


def scene_distance(camera: Camera) -> float:
    """Return the distance from the lens to the scene [m]; of many distances that in focus."""
    own = camera.scene.has_distances
    return focus_distance(camera) if own else camera.scene.distance


def focus_distance(camera: Camera) -> float:
    """Return the distance from the lens to what is in focus [m]."""
    given = camera.optics.focus_distance
    return camera.scene.distance if given is None else given


def lens(camera: Camera) -> Lens:
    """Return the lens of a camera; without one, the narrowest cone from infinitely far away.

    Raises BadInput for a lens that is not determined, numbers that disagree, and a scene at or
    inside the focal length.
    """
    optics, distance = camera.optics, scene_distance(camera)
    if not optics.is_lens:
        return Lens(math.inf, math.inf, 0.0, math.inf)
    f, focus = _focal_length(camera), focus_distance(camera)
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
    found: dict[str, float] = {}
    if optics.f_number is not None:
        found["f_number"] = optics.f_number
    if optics.numerical_aperture is not None:
        sine = optics.numerical_aperture
        found["numerical_aperture"] = float(radiometry.f_number_of_numerical_aperture(sine, m))
    if optics.aperture_diameter is not None:
        found["aperture_diameter"] = f / optics.aperture_diameter
        _require_f_number(found["aperture_diameter"], f, optics.aperture_diameter)
    if not found:
        raise bad(
            "optics",
            "the lens is not determined: its f-number is missing",
            "give f_number, aperture_diameter or numerical_aperture beside the focal length",
        )
    return Lens(f, _common_value(found, "", lambda number: f"f/{number:.5g}"), m, focus)


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


def _focal_length(camera: Camera) -> float:
    """Return the focal length, from every pair that determines it."""
    optics, distance = camera.optics, focus_distance(camera)
    found: dict[str, float] = {}
    if optics.focal_length is not None:
        found["focal_length"] = optics.focal_length
    if optics.field_of_view is not None:
        pixels = lattice(camera)
        diagonal = math.hypot(pixels.width, pixels.height)
        angle = optics.field_of_view
        found["field_of_view"] = float(
            radiometry.focal_length_of_field_of_view(angle, diagonal, distance)
        )
    if optics.aperture_diameter is not None:
        if optics.f_number is not None:
            found["aperture_diameter"] = optics.aperture_diameter * optics.f_number
        elif optics.numerical_aperture is not None:
            tangent = math.tan(math.asin(optics.numerical_aperture))
            image_distance = optics.aperture_diameter / 2 / tangent
            found["aperture_diameter"] = image_distance / (1 + image_distance / distance)
    if not found:
        raise bad("optics", "the lens is not determined: its focal length is missing", _GIVE_TWO)
    return _common_value(found, "a focal length of ", lambda length: f"{length * 1e3:.6g} mm")


def _common_value(values: Mapping[str, float], what: str, text: Callable[[float], str]) -> float:
    """Return the first of several values for one thing. Raises BadInput where they disagree."""
    first, value = next(iter(values.items()))
    for name, other in values.items():
        if abs(other - value) > AGREE * value:
            message = f"means {what}{text(other)}, but {first} says {text(value)}"
            raise bad(f"optics.{name}", message, _GIVE_TWO)
    return value
