"""The lens of a camera that is given by its prescription: read, scaled, stopped down, focused."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from vcam_cli.camera.color_errors import WavelengthTable
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.optics import Prescription as Given
from vcam_cli.config import shipped
from vcam_cli.errors import BadInput, Problem, bad, nearest
from vcam_cli.lenses import files
from vcam_cli.lenses.aperture import Aperture, pupil_diameter
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.glasses import ModelGlass
from vcam_cli.lenses.paraxial import Paraxial
from vcam_cli.lenses.prescription import Prescription
from vcam_cli.lenses.pupils import pupils
from vcam_cli.lenses.wavefronts import FieldWavefronts, NoImage, trace_field
from vcam_cli.records import dataclass

PATH = ("optics", "prescription")
FALLOFF_HEIGHTS = 25
"""Image heights whose pupils are traced; between them cubics without overshoot are good to 1e-4."""
TABLE_HEIGHTS = 129
"""Heights of the tables that are handed on, straight in between."""
COLOR_HEIGHTS, COLOR_WAVELENGTHS = 12, 13
"""Image heights and wavelengths from which the magnification by wavelength follows."""
FOCUS_RAYS = 24
SAME = 1e-9
"""Part of a wavelength that is a rounding error."""


@dataclass(frozen=True)
class TracedLens:
    """A lens before a scene, focused: what a camera's file says of it."""

    lens: Prescription
    focus_distance: float
    """From the front principal plane to what is in focus [m]."""
    plane: str
    """How the image plane is found: `best` or `file`."""

    @cached_property
    def paraxial(self) -> Paraxial:
        """First-order data."""
        return View(self.lens).paraxial

    @property
    def f_number(self) -> float:
        """Focal length over the entrance pupil's diameter."""
        return self.paraxial.focal_length / self.lens.pupil_diameter

    def vertex_distance(self, distance: float) -> float:
        """Return the distance from an object to the first vertex, from that to the lens [m]."""
        return distance + self.paraxial.front_principal

    def view(self, distance: float, defocus: float = 0.0) -> View:
        """Return the lens before an object, its image plane in focus.

        Parameters
        ----------
        distance : float
            From the object to the lens's front principal plane [m].
        defocus : float
            Shift of the image plane away from the lens, the sensor staying in front of it [m].
        """
        moved = self.lens.moved(self._shift - defocus)
        return View(moved, self.vertex_distance(distance))

    @cached_property
    def _shift(self) -> float:
        """How far the sensor lies behind the file's image plane [m]."""
        last = self.lens.surfaces[-1].thickness
        image = self.paraxial.image(self.focus_distance)
        if self.plane == "file":
            return image - self.paraxial.back_focus
        shift = image - last
        for _ in range(3):  # linear but for the squares of the aberrations
            shift += _to_flattest(self._focused(shift))
        return shift

    def _focused(self, shift: float) -> View:
        return View(self.lens.moved(shift), self.vertex_distance(self.focus_distance))


def _to_flattest(view: View) -> float:
    """Return how far behind the image plane the axial wavefront is flattest [m].

    A plane d further back changes the path by d (1 - n), n the ray's cosine there.
    """
    node, weight = np.polynomial.legendre.leggauss(FOCUS_RAYS)
    axis, waves = np.zeros(1), np.array([view.lens.primary])
    px = np.sqrt((node + 1) / 2)
    u, v = view.aim(axis, waves, px, np.zeros(px.shape))
    found = view.wavefront(axis, waves, u, v, np.zeros((1, 1)))
    good = found.alive[0, 0]
    path, sine = found.path[0, 0][good], found.x[0, 0][good]
    share = weight[good] / weight[good].sum()
    change = sine**2 / (1 + np.sqrt(1 - sine**2))
    change -= share @ change
    return float((share * change) @ path / ((share * change) @ change))


def read_lens(camera: CameraModel, given: Given) -> TracedLens:
    """Return the lens of a camera with a prescription.

    Raises BadInput for a lens that cannot be had, CannotDo where its file may not be read.
    """
    lens = _read(given)
    _require_wavelengths(lens, camera.scene.wavelengths.start, camera.scene.wavelengths.stop)
    focus = camera.optics.focus_distance
    if focus is None:
        focus = camera.scene.distance
    return TracedLens(lens, focus, given.image_plane)


def _require_wavelengths(lens: Prescription, start: float, stop: float) -> None:
    """Raise BadInput where a glass is not known at all simulated wavelengths [m]."""
    for surface in lens.surfaces:
        low, high = surface.glass.range
        if start < low * (1 - SAME) or stop > high * (1 + SAME):
            raise bad(
                "scene.wavelengths",
                f"{surface.glass.name}, a glass of {lens.name}, is known from {low * 1e9:.4g} to"
                f" {high * 1e9:.4g} nm, and {start * 1e9:.4g} to {stop * 1e9:.4g} nm are simulated",
                f"write scene.wavelengths: {{start: {max(low, start) * 1e9:.4g} nm,"
                f" stop: {min(high, stop) * 1e9:.4g} nm}}",
            )


def _read(given: Given) -> Prescription:
    """Return the lens of a file, scaled and stopped down. Raises BadInput."""
    glasses = tuple((n, ModelGlass(n, g.nd, g.vd)) for n, g in given.glasses)
    if given.use is not None:
        if given.use not in shipped.names("lenses"):
            near = nearest(given.use, shipped.names("lenses"))
            listed = ", ".join(shipped.names("lenses"))
            remedy = f"did you mean {near!r}?" if near else f"shipped: {listed}"
            remedy += "; a file is {file: lens.zmx}"
            raise bad(PATH, f"{given.use!r} is not a lens that ships", remedy)
        file = shipped.find("lenses", given.use)
    else:
        file = Path(str(given.file))
    try:
        stat = os.stat(file)
        stamp = stat.st_mtime_ns, stat.st_size
    except OSError:
        stamp = 0, 0
    try:
        lens = _read_lens(str(file), stamp, glasses)
    except BadInput as error:
        # the problem lies in the lens's file, whose line the message has
        raise BadInput(
            Problem(PATH, f"{p.where or file}: {p.message}", p.remedy) for p in error.problems
        ) from None
    lens = lens.scaled(given.scale)
    if given.f_number is not None:
        diameter = pupil_diameter(lens, Aperture("f_number", given.f_number))
        lens = replace(lens, pupil_diameter=diameter)
    return lens


@lru_cache(maxsize=16)
def _read_lens(
    file: str, stamp: tuple[int, int], glasses: tuple[tuple[str, ModelGlass], ...]
) -> Prescription:
    """Return the lens of a file in one state of it."""
    return files.read(Path(file), dict(glasses))


@lru_cache(maxsize=64)
def sensor_view(lens: TracedLens, distance: float, defocus: float) -> View:
    """Return the lens before an object at a distance; kept, since it is used often."""
    return lens.view(distance, defocus)


@lru_cache(maxsize=32)
def wavefronts(
    view: View, heights: tuple[float, ...], shortest: float, longest: float
) -> FieldWavefronts:
    """Return the traced wavefronts of image points. Raises BadInput where no image is formed."""
    try:
        return trace_field(view, np.array(heights), shortest, longest)
    except NoImage as error:
        raise no_image(view, heights[-1], str(error)) from None


def no_image(view: View, corner: float, reason: str) -> BadInput:
    """Return what is said of a lens that does not reach the corner of the array [m]."""
    lens = view.lens
    far = float(view.heights(np.array([lens.field]), np.array([lens.primary]))[0, 0])
    reach = f"; its design covers {far * 1e3:.4g} mm" if lens.field and math.isfinite(far) else ""
    return bad(
        PATH,
        f"{lens.name} forms no image at the corner of the array, {corner * 1e3:.4g} mm off axis:"
        f" {reason}{reach}",
        "use a smaller array, or a larger scale",
    )


@dataclass(frozen=True)
class FieldTable:
    """What a lens does over the image, at heights that rise from 0 to the corner."""

    heights: tuple[float, ...]
    """[m]"""
    values: tuple[float, ...]
    """What the table is of."""


@lru_cache(maxsize=32)
def illumination(view: View, corner: float) -> FieldTable:
    """Return the relative illumination up to the corner [m]. Raises BadInput."""
    from scipy.interpolate import PchipInterpolator

    heights = np.linspace(0, corner, FALLOFF_HEIGHTS)
    area = pupils(view, heights, np.array([view.lens.primary])).area[:, 0]
    if not area.all():
        dark = float(heights[area == 0].min())
        reason = f"its apertures let no light through {dark * 1e3:.4g} mm off axis"
        raise no_image(view, corner, reason)
    fine = np.linspace(0, corner, TABLE_HEIGHTS)
    values = PchipInterpolator(heights, area / area[0])(fine)
    return FieldTable(tuple(fine.tolist()), tuple(values.tolist()))


@lru_cache(maxsize=64)
def axial_area(view: View) -> float:
    """Return the pupil's area on the axis, in direction cosines: E = L times it [sr]."""
    return float(pupils(view, np.zeros(1), np.array([view.lens.primary]), 8).area[0, 0])


@lru_cache(maxsize=32)
def distortion(view: View, corner: float) -> FieldTable:
    """Return real over ideal image height, less 1, up to the corner [m]. Raises BadInput.

    Ideal is the scale near the center: what a camera calibrator sees.
    """
    heights = np.linspace(0, corner, TABLE_HEIGHTS)
    angles = view.angle_of(heights[1:])
    if np.isnan(angles).any():
        raise no_image(view, corner, "rays through the center of its stop fail")
    ideal = view.image_scale * np.tan(angles)
    values = np.append(0.0, heights[1:] / ideal - 1)
    return FieldTable(tuple(heights.tolist()), tuple(values.tolist()))


@lru_cache(maxsize=32)
def lateral_color(view: View, corner: float, shortest: float, longest: float) -> WavelengthTable:
    """Return the magnification by wavelength, over that of the primary one, less 1.

    The best one over the disk up to the corner [m]: the residual changes with the field, and moves
    the blurs.
    """
    heights = corner * np.sqrt((np.arange(COLOR_HEIGHTS) + 0.5) / COLOR_HEIGHTS)
    waves = np.linspace(shortest, longest, COLOR_WAVELENGTHS)
    found = view.heights(view.angle_of(heights), waves)
    if np.isnan(found).any():
        raise no_image(view, corner, "rays of some wavelengths fail")
    change = (heights @ (found - heights[:, None])) / (heights @ heights)
    nanometers = (waves * 1e9).tolist()
    return WavelengthTable(tuple(zip(nanometers, change.tolist(), strict=True)))
