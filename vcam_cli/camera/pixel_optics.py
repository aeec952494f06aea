"""What lies above the photodetector: layers, and a microlens that collects light for it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.pixel import Microlens
from vcam_cli.errors import bad
from vcam_cli.physics import vignetting

MOST = 0.95
"""Of a pixel's area, what a microlens collects the light of at most."""
SLACK = 1e-9
"""Relative difference of two fill factors that is rounding."""


@dataclass(frozen=True)
class Area:
    """A rectangle in every pixel: its size and its center, right of and below the cell's [m]."""

    width: float
    height: float
    x: float
    y: float


def layers(camera: Camera) -> tuple[tuple[float, float], ...]:
    """Thickness [m] and refractive index from the air down; empty where there is no stack."""
    stack = camera.pixel.stack
    if stack is None:
        return ()
    return tuple((layer.thickness, layer.index) for layer in (stack.passivation, stack.oxide))


def microlens(camera: Camera) -> Microlens | None:
    """The microlens, where the file has one and does not switch it off."""
    off = isinstance(camera.effects, dict) and camera.effects.get("microlens") == "off"
    return None if off else camera.pixel.microlens


def follows_chief_ray(camera: Camera) -> bool:
    """Whether microlenses are shifted so that the chief ray meets the photodetector's center."""
    lens = microlens(camera)
    return lens is not None and lens.shift == "optimal"


def collecting_area(camera: Camera, detector: Area) -> Area:
    """Where the light comes from that reaches the photodetector.

    Without a microlens the photodetector itself. With one, a rectangle of the pixel's shape in its
    middle: the effective fill factor of the pixel. The photodetector may lie off the center, the
    lens is made to send the light to it.

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
        share, name = min(lens.gain * bare, MOST), "gain"
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


def check_pupil(camera: Camera, distance: float) -> None:
    """Raises BadInput where the exit pupil, at a distance [m], lies within the layers."""
    thickness = sum(thick for thick, _ in layers(camera))
    if thickness >= distance:
        raise bad(
            "pixel.stack",
            f"is {thickness * 1e6:.6g} um thick, but the exit pupil is only {distance * 1e6:.6g} um"
            " away",
            "make the layers thinner, or give a larger optics.exit_pupil_distance",
        )


def sampling_scale(camera: Camera, distance: float, width: float, height: float) -> float:
    """Pitch of the collecting areas over that of the pixels.

    distance: of the exit pupil; width, height: of the array [m].

    Microlenses that follow the chief ray stand nearer to the axis by what the ray falls sideways
    in the stack, t_p tan(theta_p) + t_s tan(theta_s). That is a little less than proportional to
    the distance from the axis; the factor taken for all of the array is the one of least squares.
    What remains is at most 3 % of the largest shift up to chief rays of 25 degrees in the corner,
    6 % up to 35 degrees, for indices of 1.46 and 2: 0.12 um in a stack of 5 um.
    """
    stack = layers(camera)
    if not follows_chief_ray(camera) or not stack:
        return 1.0
    at = (np.arange(64) + 0.5) / 64
    tangent2 = (at * width / 2 / distance) ** 2 + ((at * height / 2 / distance) ** 2)[:, None]
    weight = tangent2 / tangent2.sum()
    depth = float((weight * vignetting.depth_per_tangent(tangent2, stack)).sum())
    return 1 - depth / distance
