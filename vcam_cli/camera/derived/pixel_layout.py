"""Where in a pixel light is collected: the photodetector, the layers above it, the microlens."""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.camera.derived.process import Process, process
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.pixel import Microlens
from vcam_cli.errors import BadInput, bad
from vcam_cli.physics import photodiode, vignetting
from vcam_cli.records import dataclass

MOST_COLLECTED = 0.95
"""Share of a pixel's area whose light a microlens collects at most."""
SLACK = 1e-9
"""Relative difference of two lengths or areas that is rounding."""


@dataclass(frozen=True)
class Detector:
    """The size of a photodetector, whose sampling aperture is a rectangle."""

    width: float
    """Width [m]."""
    height: float
    """Height [m]."""
    perimeter: float
    """Perimeter of the junction [m]; a layout's is longer than the rectangle's of its area."""

    @property
    def area(self) -> float:
        """Area [m2]."""
        return self.width * self.height


@dataclass(frozen=True)
class Area:
    """A rectangle in every pixel [m]."""

    width: float
    height: float
    x: float
    """Center, right of the cell's."""
    y: float
    """Center, below the cell's."""


def detector(camera: CameraModel) -> Detector:
    """Return the photodetector's size: that of the file, else its technology's layout.

    Raises BadInput where neither gives it, and for a pixel too small for its transistors.
    """
    pixel, own = camera.pixel, camera.pixel.photodetector
    if own.width is not None and own.height is not None:
        return Detector(own.width, own.height, 2 * (own.width + own.height))
    if own.fill_factor is not None:
        side = math.sqrt(own.fill_factor)
        width, height = side * pixel.width, side * pixel.height
        return Detector(width, height, 2 * (width + height))
    return _layout(pixel.width, pixel.height, process(camera))


def _layout(width: float, height: float, made: Process) -> Detector:
    """Return what the layout leaves of a pixel, drawn as a rectangle of the pixel's shape."""
    layout, size = made.layout, made.feature_size
    if size is None or layout.border is None or layout.transistors is None:
        raise bad(
            "pixel.photodetector",
            "its size is given neither here nor by a technology's layout",
            "add fill_factor: 0.3, or width and height, or the technology's layout.border and"
            " layout.transistors",
        )
    rules = (size, layout.border, layout.transistors)
    area = float(photodiode.detector_area(width, height, *rules))
    if area <= 0:
        raise _too_small(width, height, *rules)
    side = math.sqrt(area / (width * height))
    perimeter = float(photodiode.detector_perimeter(width, height, size, layout.border))
    return Detector(side * width, side * height, perimeter)


def _too_small(
    width: float, height: float, size: float, border: float, transistors: float
) -> BadInput:
    """Return the error about a pixel without a photodetector, with the smallest that has one."""
    least = float(photodiode.smallest_square_pixel(size, border, transistors))
    nanometers = math.floor(least * 1e9) + 1  # at the size itself nothing is left
    return bad(
        "pixel.width" if width <= height else "pixel.height",
        f"a pixel of {width * 1e6:.6g} x {height * 1e6:.6g} um is too small for its transistors"
        f" in a process of {size * 1e6:.6g} um",
        f"the smallest square pixel that works is {nanometers / 1e3:.6g} um; make it larger, use a"
        " finer technology, or give photodetector.fill_factor",
    )


def detector_area(camera: CameraModel) -> Area:
    """Return the photodetector's rectangle. Raises BadInput where it leaves its pixel."""
    pixel, own, size = camera.pixel, camera.pixel.photodetector, detector(camera)
    x = _left_edge(own.x, size.width, pixel.width, "width")
    y = _left_edge(own.y, size.height, pixel.height, "height")
    center_x = x + size.width / 2 - pixel.width / 2
    center_y = y + size.height / 2 - pixel.height / 2
    return Area(size.width, size.height, center_x, center_y)


def _left_edge(given: float | None, size: float, cell: float, side: str) -> float:
    """Return where the photodetector begins in its cell [m]: in the middle by default."""
    start = given if given is not None else (cell - size) / 2
    if start < -SLACK * cell or start + size > cell * (1 + SLACK):
        raise bad(
            f"pixel.photodetector.{side}",
            f"the photodetector reaches from {start * 1e6:.6g} to {(start + size) * 1e6:.6g} um"
            f" in a pixel of {cell * 1e6:.6g} um",
            "make it smaller, or move it with x and y (from the upper-left corner)",
        )
    return start


def layers(camera: CameraModel) -> tuple[tuple[float, float], ...]:
    """Return thickness [m] and refractive index of the layers from the air down, if any."""
    stack = camera.pixel.stack
    if stack is None:
        return ()
    return tuple((layer.thickness, layer.index) for layer in (stack.passivation, stack.oxide))


def microlens(camera: CameraModel) -> Microlens | None:
    """Return the microlens, where the file has one and does not switch it off."""
    off = isinstance(camera.effects, dict) and camera.effects.get("microlens") == "off"
    return None if off else camera.pixel.microlens


def follows_chief_ray(camera: CameraModel) -> bool:
    """Return whether microlenses are shifted so that the chief ray meets the photodetector."""
    lens = microlens(camera)
    return lens is not None and lens.shift == "optimal"


def collecting_area(camera: CameraModel, detector: Area) -> Area:
    """Return where the light comes from that reaches the photodetector.

    Without a microlens that is the photodetector itself. With one, it is a rectangle of the pixel's
    shape in its middle: the effective fill factor of the pixel. The photodetector may lie off the
    center, the lens is made to send the light to it.

    Raises BadInput for a microlens that would collect less than the photodetector without it.
    """
    lens, pixel = microlens(camera), camera.pixel
    if lens is None:
        return detector
    bare = detector.width * detector.height / (pixel.width * pixel.height)
    if lens.efficiency is not None:
        share, name = lens.efficiency, "efficiency"
    else:
        assert lens.gain is not None
        share, name = min(lens.gain * bare, MOST_COLLECTED), "gain"
    if share < bare * (1 - SLACK):
        remedy = "remove the microlens, or make the photodetector smaller"
        raise bad(
            f"pixel.microlens.{name}",
            f"the microlens would collect the light of {share:.4g} of the pixel's area, less than"
            f" the photodetector's own {bare:.4g}",
            f"{remedy}, or give an efficiency of at least {bare:.4g}",
        )
    side = math.sqrt(share)
    return Area(side * pixel.width, side * pixel.height, 0.0, 0.0)


def check_pupil(camera: CameraModel, distance: float) -> None:
    """Raise BadInput where the exit pupil, at a distance [m], lies within the layers."""
    thickness = sum(thick for thick, _ in layers(camera))
    if thickness >= distance:
        raise bad(
            "pixel.stack",
            f"is {thickness * 1e6:.6g} um thick, but the exit pupil is only {distance * 1e6:.6g} um"
            " away",
            "make the layers thinner, or give a larger optics.exit_pupil_distance",
        )


def sampling_scale(camera: CameraModel, distance: float, width: float, height: float) -> float:
    """Return the pitch of the collecting areas over that of the pixels.

    Microlenses that follow the chief ray stand nearer to the axis by what the ray falls sideways
    in the stack, t_p tan(theta_p) + t_s tan(theta_s). That is a little less than proportional to
    the distance from the axis; the factor taken for all of the array is the one of least squares.
    What remains is at most 3 % of the largest shift up to chief rays of 25 degrees in the corner,
    6 % up to 35 degrees, for indices of 1.46 and 2: 0.12 um in a stack of 5 um.

    Parameters
    ----------
    camera : CameraModel
        The camera.
    distance : float
        Distance of the exit pupil from the sensor [m].
    width, height : float
        Size of the array [m].

    Returns
    -------
    float
        The factor, at most 1; 1 without a stack or microlenses that are shifted.
    """
    stack = layers(camera)
    if not follows_chief_ray(camera) or not stack or math.isinf(distance):
        return 1.0
    field = (np.arange(64) + 0.5) / 64
    across, down = field * width / 2 / distance, field * height / 2 / distance
    tangent2 = across**2 + (down**2)[:, None]
    weight = tangent2 / tangent2.sum()
    depth = float((weight * vignetting.depth_per_tangent(tangent2, stack)).sum())
    return 1 - depth / distance
