"""Where everything lies: lens, image, pixels, photodetectors.

All the lengths that follow from a camera file, solved and checked together. Coordinates on the
sensor: origin at the center of the array, x to the right, y down, meters, as in the upright
picture (the lens's inversion is undone).
"""

from __future__ import annotations

import math
import operator

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.lattice import lattice
from vcam_cli.camera.derived.lens import lens, scene_distance
from vcam_cli.camera.derived.pixel_layout import (
    Area,
    check_pupil,
    collecting_area,
    detector_area,
    sampling_scale,
)
from vcam_cli.camera.derived.traced import traced_view
from vcam_cli.camera.lens_distortion import DistortionFile
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.scene.scene import Extent
from vcam_cli.errors import Collector, bad
from vcam_cli.physics import depth_of_field, diffraction, radiometry
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Geometry:
    """Solved geometry of a camera. Lengths in [m], angles in [rad]."""

    focal_length: float
    f_number: float
    aperture_diameter: float
    object_distance: float
    """From the lens to the scene."""
    focus_distance: float
    """From the lens to what is in focus."""
    magnification: float
    """Of what is in focus, negative."""
    scene_scale: float
    """Size of the scene's image over that of the scene; 0 of a scene at infinity."""
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
    """Center of the photodetector, below its cell's center."""
    collecting_width: float
    """Width of the area whose light reaches the photodetector: its own without a microlens."""
    collecting_height: float
    """Height of that area."""
    collecting_x: float
    """Center of the collecting area, right of its cell's center, in a pixel on the axis."""
    collecting_y: float
    """Center of the collecting area, below its cell's center, in a pixel on the axis."""
    sampling_scale: float
    """Pitch of the collecting areas over that of the pixels."""
    exit_pupil_distance: float
    scene_width_on_sensor: float | None
    """Width of the scene's image where the file states the scene's extent."""
    pupil_magnification: float = 1.0
    """Diameter of the exit pupil over that of the entrance pupil, P."""
    traced_area: float | None = None
    """Area of a traced lens's pupil on the axis, in direction cosines [sr]."""
    opening_share: float = 1.0
    """Area of the aperture over that of the circle that the f-number counts."""

    @property
    def collecting_pitch(self) -> tuple[float, float]:
        """Pitch of the collecting areas along x and y [m]."""
        return self.pitch_x * self.sampling_scale, self.pitch_y * self.sampling_scale

    @property
    def image_distance(self) -> float:
        """Distance from the lens to the sensor."""
        return float(radiometry.image_distance(self.focal_length, self.magnification))

    @property
    def focus_shift(self) -> float:
        """Shift of the image plane that defocuses as much as the scene's distance does.

        Of a point at d before a lens focused at s it is v^2 (1/d - 1/s): with the image distance v
        and the aperture A its wavefront and its blur, of the diameter A v |1/d - 1/s|, are exact.
        With pupils of different size, that of the entrance lies f (1/P - 1) behind the plane from
        which distances count, and v is f (1 - m/P) once.
        """
        if self.object_distance == self.focus_distance:
            return 0.0
        v, behind = self.image_distance, self.focal_length * (1 / self.pupil_magnification - 1)
        cone = float(radiometry.image_distance(self.focal_length, self.cone_magnification))
        defocus = 1 / self.object_distance - 1 / self.focus_distance
        return v * cone * defocus / (1 + behind / self.object_distance)

    @property
    def cone_magnification(self) -> float:
        """Magnification over that of the pupils, m / P: that of the cone at the sensor."""
        return self.magnification / self.pupil_magnification

    @property
    def working_f_number(self) -> float:
        """N (1 - m/P), the f-number that the image sees."""
        return self.f_number * (1 - self.cone_magnification)

    @property
    def numerical_aperture(self) -> float:
        """Sine of the half-angle of the image-side cone, eq 2.17."""
        return float(radiometry.numerical_aperture(self.f_number, self.cone_magnification))

    @property
    def has_lens(self) -> bool:
        """Whether there is a lens before the sensor."""
        return math.isfinite(self.f_number)

    @property
    def irradiance_per_radiance(self) -> float:
        """Irradiance on the axis over the scene's radiance, eq 2.18 [sr].

        Without a lens the sensor lies in the place of the scene's diffuser: pi. An aperture that is
        no circle passes as much less as its area is smaller.
        """
        if not self.has_lens:
            return math.pi
        if self.traced_area is not None:
            return self.traced_area
        whole = radiometry.irradiance_per_radiance(self.f_number, self.cone_magnification)
        return float(whole) * self.opening_share

    @property
    def detector_area(self) -> float:
        """Area of the photodetector [m2]."""
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

    @property
    def fill_of_pitch(self) -> float:
        """Collecting area over the area of a cell, pitch by pitch."""
        return self.collecting_width * self.collecting_height / (self.pitch_x * self.pitch_y)

    def report(self, oversampling: float) -> dict[str, float | int]:
        """Return the numbers of `run.json`'s `geometry`.

        Parameters
        ----------
        oversampling : float
            Samples of the scene per pixel; 0 where it is not sampled.

        Returns
        -------
        dict
            Name -> number in SI; a unit other than SI is in the name.
        """
        w, h, si = self.sensor_width, self.sensor_height, self.image_distance
        finite = math.isfinite(self.object_distance)
        sample = self.pitch_x / (oversampling or 1)
        return {
            "focal_length": self.focal_length,
            "f_number": self.f_number,
            "working_f_number": self.working_f_number,
            "magnification": -self.scene_scale,
            "object_distance": self.object_distance,
            "focus_distance": self.focus_distance,
            "image_distance": si,
            "focal_pixels_x": si / self.pitch_x,
            "focal_pixels_y": si / self.pitch_y,
            "exit_pupil_distance": self.exit_pupil_distance,
            "numerical_aperture": self.numerical_aperture,
            "aperture_diameter": self.aperture_diameter,
            "clear_aperture_area": math.pi / 4 * self.aperture_diameter**2,
            "field_of_view_horizontal": float(radiometry.field_of_view(w, si)),
            "field_of_view_vertical": float(radiometry.field_of_view(h, si)),
            "field_of_view_diagonal": float(radiometry.field_of_view(math.hypot(w, h), si)),
            "scene_width": w / self.scene_scale if finite else math.inf,
            "scene_height": h / self.scene_scale if finite else math.inf,
            "scene_diagonal": math.hypot(w, h) / self.scene_scale if finite else math.inf,
            **self._sharpness(),
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
                diffraction.cutoff_frequency(550e-9, self.f_number, self.cone_magnification)
            ),
            "sample_pitch_sensor": sample,
            "sample_pitch_scene": sample / self.scene_scale if finite else math.inf,
            "sample_pitch_angle": sample / si,
            "scene_rows": round(h / sample),
            "scene_columns": round(w / sample),
            "highest_frequency": 0.5 / sample if oversampling else math.inf,
        }

    def _sharpness(self) -> dict[str, float]:
        """Return what is sharp to a pixel's pitch, along which it is larger [m]."""
        if not self.has_lens:
            return {}
        circle = max(self.pitch_x, self.pitch_y)
        lens = self.focal_length, self.f_number, circle
        near, far = depth_of_field.depth_of_field(self.focus_distance, *lens)
        return {
            "circle_of_confusion": circle,
            "hyperfocal_distance": depth_of_field.hyperfocal_distance(*lens),
            "depth_of_field_near": near,
            "depth_of_field_far": far,
        }


def geometry(camera: CameraModel) -> Geometry:
    """Return the solved geometry of a camera.

    Raises BadInput with every contradiction found: an object at or inside the focal length, optics
    that disagree, a photodetector that leaves its pixel, a microlens that loses light, an exit
    pupil within the stack, a die smaller than a pixel.
    """
    optics = camera.optics
    if optics.prescription is not None or isinstance(optics.distortion, DistortionFile):
        return _solved(camera)  # by files, which may have changed
    sections = camera.array, optics, camera.pixel, camera.scene
    known = _LAST.get("geometry")
    if known is None or not all(map(operator.is_, sections, known[0])):
        known = _LAST["geometry"] = sections, _solved(camera)
    return known[1]


_LAST: dict[str, tuple[tuple[object, ...], Geometry]] = {}
"""The last geometry, and the sections that it was solved from: a frame requires it 15 times."""


def _solved(camera: CameraModel) -> Geometry:
    """Return the solved geometry of a camera."""
    problems = Collector()
    optics = problems.attempt(lens, camera)
    areas = problems.attempt(_areas, camera)
    pixels = problems.attempt(lattice, camera)
    problems.raise_if_any()
    assert optics and areas and pixels
    pixel, (detector, collecting) = camera.pixel, areas
    pupil = camera.optics.exit_pupil_distance
    if pupil is None:  # one at the lens, where all that is known is that it is thin
        pupil = (optics.pupil_magnification - optics.magnification) * optics.focal_length
    check_pupil(camera, pupil)
    return Geometry(
        focal_length=optics.focal_length,
        f_number=optics.f_number,
        aperture_diameter=optics.focal_length / optics.f_number if camera.optics.is_lens else 0.0,
        object_distance=scene_distance(camera) if camera.optics.is_lens else math.inf,
        focus_distance=optics.focus_distance,
        magnification=optics.magnification,
        scene_scale=optics.scale_at(scene_distance(camera)),
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
        scene_width_on_sensor=_scene_width(camera, optics.scale_at(scene_distance(camera))),
        pupil_magnification=optics.pupil_magnification,
        traced_area=_traced_area(camera),
        opening_share=camera.optics.opening.share,
    )


def pixel_centers(geometry: Geometry, detector: bool = False) -> tuple[Array, Array]:
    """Return the centers of the array's columns and rows on the sensor.

    Parameters
    ----------
    geometry : Geometry
        The camera's geometry.
    detector : bool
        Whether the areas whose light is collected are meant (the photodetectors where there is no
        microlens) instead of the pixels' cells.

    Returns
    -------
    x : ndarray, (columns,)
        Right of the axis [m].
    y : ndarray, (rows,)
        Below the axis [m].
    """
    g = geometry
    x = (np.arange(g.columns) + 0.5 - g.columns / 2) * g.pitch_x
    y = (np.arange(g.rows) + 0.5 - g.rows / 2) * g.pitch_y
    if not detector:
        return x, y
    return x * g.sampling_scale + g.collecting_x, y * g.sampling_scale + g.collecting_y


def check(camera: CameraModel) -> None:
    """Raise BadInput where the camera's geometry contradicts itself."""
    geometry(camera)


def _areas(camera: CameraModel) -> tuple[Area, Area]:
    """Return the photodetector, and the area whose light it receives."""
    found = detector_area(camera)
    return found, collecting_area(camera, found)


def _traced_area(camera: CameraModel) -> float | None:
    view = traced_view(camera, scene_distance(camera))
    if view is None:
        return None
    from vcam_cli.camera.derived.prescription import axial_area

    return axial_area(view)


def _scene_width(camera: CameraModel, scale: float) -> float | None:
    extent = camera.scene.extent
    if not isinstance(extent, Extent):
        return None
    if not camera.optics.is_lens:
        message = "a bare sensor has no lens: the scene lies in its plane and covers it"
        raise bad("scene.extent", message, "use extent: sensor")
    if scale == 0:
        raise bad(
            "scene.extent",
            "a scene at infinity has no width in meters",
            "use extent: sensor, or give scene.distance",
        )
    return extent.width * scale
