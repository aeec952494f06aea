"""Where everything lies: lens, image, pixels, photodetectors.

All the lengths that follow from a camera file, solved once and checked once. Coordinates on the
sensor: origin at the center of the array, x to the right, y down, meters, as in the upright
picture (the lens's inversion is undone).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.detector import detector
from vcam_cli.camera.lattice import lattice
from vcam_cli.camera.once import once
from vcam_cli.camera.pixel_optics import Area, check_pupil, collecting_area, sampling_scale
from vcam_cli.camera.scene import Extent
from vcam_cli.errors import BadInput, Collector, bad
from vcam_cli.physics import diffraction, radiometry

AGREE = 1e-3
"""Relative difference up to which redundant numbers of a file count as equal."""


@dataclass(frozen=True)
class Geometry:
    """Solved geometry of a camera. Lengths in [m], angles in [rad]."""

    focal_length: float
    f_number: float
    aperture_diameter: float
    object_distance: float
    magnification: float
    rows: int
    columns: int
    pixel_width: float
    pixel_height: float
    pitch_x: float
    pitch_y: float
    sensor_width: float
    sensor_height: float
    detector_width: float
    detector_height: float
    detector_x: float
    """Center of the photodetector, right of its cell's center."""
    detector_y: float
    collecting_width: float
    """Of the area whose light reaches the photodetector: its own without a microlens."""
    collecting_height: float
    collecting_x: float
    """Center of the collecting area, right of its cell's center, in a pixel on the axis."""
    collecting_y: float
    sampling_scale: float
    """Pitch of the collecting areas over that of the pixels."""
    exit_pupil_distance: float
    scene_width_on_sensor: float | None
    """Width of the scene's image where the file states the scene's extent."""

    @property
    def image_distance(self) -> float:
        return float(radiometry.image_distance(self.focal_length, self.magnification))

    @property
    def working_f_number(self) -> float:
        """N (1 - m): the f-number that the image sees."""
        return self.f_number * (1 - self.magnification)

    @property
    def numerical_aperture(self) -> float:
        """Sine of the half-angle of the image-side cone, eq 2.17."""
        return float(radiometry.numerical_aperture(self.f_number, self.magnification))

    @property
    def detector_area(self) -> float:
        return self.detector_width * self.detector_height

    @property
    def fill_factor(self) -> float:
        """Photodetector area over width x height of the pixel (gaps not counted)."""
        return self.detector_area / (self.pixel_width * self.pixel_height)

    @property
    def effective_fill_factor(self) -> float:
        """Collecting area over width x height of the pixel."""
        area = self.collecting_width * self.collecting_height
        return area / (self.pixel_width * self.pixel_height)

    def report(self, oversampling: float) -> dict[str, float | int]:
        """The numbers of `run.json`'s `geometry`; a unit other than SI is in the name."""
        w, h, si = self.sensor_width, self.sensor_height, self.image_distance
        d = math.hypot(w, h)
        finite = math.isfinite(self.object_distance)
        sample_x = self.pitch_x / (oversampling or 1)
        return {
            "focal_length": self.focal_length,
            "f_number": self.f_number,
            "working_f_number": self.working_f_number,
            "magnification": self.magnification,
            "object_distance": self.object_distance,
            "image_distance": si,
            "exit_pupil_distance": self.exit_pupil_distance,
            "numerical_aperture": self.numerical_aperture,
            "aperture_diameter": self.aperture_diameter,
            "clear_aperture_area": math.pi / 4 * self.aperture_diameter**2,
            "field_of_view_horizontal": float(radiometry.field_of_view(w, si)),
            "field_of_view_vertical": float(radiometry.field_of_view(h, si)),
            "field_of_view_diagonal": float(radiometry.field_of_view(d, si)),
            "scene_width": w / -self.magnification if finite else math.inf,
            "scene_height": h / -self.magnification if finite else math.inf,
            "rows": self.rows,
            "columns": self.columns,
            "sensor_width": w,
            "sensor_height": h,
            "pixel_pitch_x": self.pitch_x,
            "pixel_pitch_y": self.pitch_y,
            "photodetector_area": self.detector_area,
            "fill_factor": self.fill_factor,
            "effective_fill_factor": self.effective_fill_factor,
            "nyquist_frequency": 0.5 / self.pitch_x,
            "diffraction_cutoff_550nm": float(
                diffraction.cutoff_frequency(550e-9, self.f_number, self.magnification)
            ),
            "sample_pitch_sensor": sample_x,
            "sample_pitch_scene": sample_x / -self.magnification if finite else math.inf,
            "sample_pitch_angle": sample_x / si,
        }


@once
def geometry(camera: Camera) -> Geometry:
    """Solves the geometry of `camera`.

    Raises BadInput, with every contradiction found: an object at or inside the focal length,
    optics that disagree, a photodetector that leaves its pixel, a microlens that loses light, an
    exit pupil within the stack, a die smaller than a pixel.
    """
    problems = Collector()
    lens = _attempt(problems, _lens, camera)
    areas = _attempt(problems, _areas, camera)
    pixels = _attempt(problems, lattice, camera)
    problems.raise_if_any()
    assert lens and areas and pixels
    focal_length, f_number, magnification = lens
    pixel, (detector, collecting) = camera.pixel, areas
    pupil = camera.optics.exit_pupil_distance
    if pupil is None:
        pupil = float(radiometry.image_distance(focal_length, magnification))
    check_pupil(camera, pupil)
    return Geometry(
        focal_length=focal_length,
        f_number=f_number,
        aperture_diameter=focal_length / f_number,
        object_distance=camera.scene.distance,
        magnification=magnification,
        rows=pixels.rows,
        columns=pixels.columns,
        pixel_width=pixel.width,
        pixel_height=pixel.height,
        pitch_x=pixels.pitch_x,
        pitch_y=pixels.pitch_y,
        sensor_width=pixels.width,
        sensor_height=pixels.height,
        detector_width=detector.width,
        detector_height=detector.height,
        detector_x=detector.x,
        detector_y=detector.y,
        collecting_width=collecting.width,
        collecting_height=collecting.height,
        collecting_x=collecting.x,
        collecting_y=collecting.y,
        sampling_scale=sampling_scale(camera, pupil, pixels.width, pixels.height),
        exit_pupil_distance=pupil,
        scene_width_on_sensor=_scene_width(camera, magnification),
    )


def pixel_centers(geometry: Geometry, detector: bool = False) -> tuple[NDArray, NDArray]:
    """Centers of the columns (columns,) and rows (rows,) on the sensor [m].

    detector: centers of the areas whose light is collected (the photodetectors where there is no
    microlens) instead of the pixels' cells.
    """
    g = geometry
    x = (np.arange(g.columns) + 0.5 - g.columns / 2) * g.pitch_x
    y = (np.arange(g.rows) + 0.5 - g.rows / 2) * g.pitch_y
    if not detector:
        return x, y
    return x * g.sampling_scale + g.collecting_x, y * g.sampling_scale + g.collecting_y


def check(camera: Camera) -> None:
    """Raises BadInput when the camera's geometry contradicts itself."""
    geometry(camera)


def _attempt(problems: Collector, part, camera: Camera):
    try:
        return part(camera)
    except BadInput as error:
        problems.extend(error)
        return None


def _lens(camera: Camera) -> tuple[float, float, float]:
    """Focal length, f-number, magnification from whichever the file gives."""
    optics, distance = camera.optics, camera.scene.distance
    f = _focal_length(camera)
    if distance <= f:
        raise bad(
            "scene.distance",
            f"a scene {distance:.6g} m from the lens lies within its focal length of {f:.6g} m"
            " and forms no real image",
            "put the scene further away, or use a shorter focal length",
        )
    m = float(radiometry.magnification(f, distance))
    candidates = {
        "f_number": optics.f_number,
        "numerical_aperture": _f_number_of(optics.numerical_aperture, m),
        "aperture_diameter": f / optics.aperture_diameter if optics.aperture_diameter else None,
    }
    given = {k: v for k, v in candidates.items() if v is not None}
    if not given:
        raise bad(
            "optics",
            "the lens is not determined: its f-number is missing",
            "give f_number, aperture_diameter or numerical_aperture beside the focal length",
        )
    n = next(iter(given.values()))
    for name, value in given.items():
        if abs(value - n) > AGREE * n:
            raise bad(
                f"optics.{name}",
                f"means f/{value:.5g}, but {next(iter(given))} says f/{n:.5g}",
                "give two of f_number, focal_length and aperture_diameter",
            )
    return f, n, m


def _focal_length(camera: Camera) -> float:
    """The focal length, from every pair that determines it; they must agree."""
    optics, distance = camera.optics, camera.scene.distance
    found: dict[str, float] = {}
    if optics.focal_length is not None:
        found["focal_length"] = optics.focal_length
    if optics.field_of_view is not None:
        half = _half_diagonal(camera)
        found["field_of_view"] = float(
            radiometry.focal_length_of_field_of_view(optics.field_of_view, 2 * half, distance)
        )
    if optics.aperture_diameter is not None:
        if optics.f_number is not None:
            found["aperture_diameter"] = optics.aperture_diameter * optics.f_number
        elif optics.numerical_aperture is not None:
            tangent = math.tan(math.asin(optics.numerical_aperture))
            found["aperture_diameter"] = _from_image_distance(
                optics.aperture_diameter / 2 / tangent, distance
            )
    if not found:
        raise bad(
            "optics",
            "the lens is not determined: its focal length is missing",
            "give two of f_number, focal_length and aperture_diameter",
        )
    first, f = next(iter(found.items()))
    for name, value in found.items():
        if abs(value - f) > AGREE * f:
            raise bad(
                f"optics.{name}",
                f"means a focal length of {value * 1e3:.6g} mm, but {first} says {f * 1e3:.6g} mm",
                "give two of f_number, focal_length and aperture_diameter",
            )
    return f


def _from_image_distance(image_distance: float, object_distance: float) -> float:
    """Thin lens: 1/f = 1/s_o + 1/s_i."""
    return image_distance / (1 + image_distance / object_distance)


def _f_number_of(numerical_aperture: float | None, m: float) -> float | None:
    if numerical_aperture is None:
        return None
    return float(radiometry.f_number_of_numerical_aperture(numerical_aperture, m))


def _half_diagonal(camera: Camera) -> float:
    found = lattice(camera)
    return 0.5 * math.hypot(found.width, found.height)


def _areas(camera: Camera) -> tuple[Area, Area]:
    """The photodetector, and the area whose light it receives."""
    found = _detector(camera)
    return found, collecting_area(camera, found)


def _detector(camera: Camera) -> Area:
    """The photodetector in its pixel."""
    pixel, pd = camera.pixel, camera.pixel.photodetector
    laid_out = detector(camera)
    w, h = laid_out.width, laid_out.height
    x = pd.x if pd.x is not None else (pixel.width - w) / 2
    y = pd.y if pd.y is not None else (pixel.height - h) / 2
    slack = 1e-9
    for size, start, full, side_name in (
        (w, x, pixel.width, "width"),
        (h, y, pixel.height, "height"),
    ):
        if start < -slack * full or start + size > full * (1 + slack):
            raise bad(
                f"pixel.photodetector.{side_name}",
                f"the photodetector reaches from {start * 1e6:.6g} to {(start + size) * 1e6:.6g} um"
                f" in a pixel of {full * 1e6:.6g} um",
                "make it smaller, or move it with x and y (from the upper-left corner)",
            )
    return Area(w, h, x + w / 2 - pixel.width / 2, y + h / 2 - pixel.height / 2)


def _scene_width(camera: Camera, m: float) -> float | None:
    extent = camera.scene.extent
    if not isinstance(extent, Extent):
        return None
    if m == 0:
        raise bad(
            "scene.extent",
            "a scene at infinity has no width in meters",
            "use extent: sensor, or give scene.distance",
        )
    return extent.width * -m
