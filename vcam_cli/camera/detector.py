"""How large the photodetector is: as the file says, or what the layout leaves of the pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.once import once
from vcam_cli.camera.process import Process, process
from vcam_cli.errors import BadInput, bad
from vcam_cli.physics import photodiode


@dataclass(frozen=True)
class Detector:
    """The size of a photodetector; its sampling aperture is a rectangle."""

    width: float
    """[m]"""
    height: float
    """[m]"""
    perimeter: float
    """Of its junction [m]; a layout's is longer than that of the rectangle of the same area."""

    @property
    def area(self) -> float:
        """[m2]"""
        return self.width * self.height


@once
def detector(camera: Camera) -> Detector:
    """The photodetector of `camera`: the size that the file gives, else its technology's layout.

    Raises BadInput where neither says, and for a pixel too small for its transistors.
    """
    pixel, own = camera.pixel, camera.pixel.photodetector
    if own.width is not None and own.height is not None:
        return Detector(own.width, own.height, 2 * (own.width + own.height))
    if own.fill_factor is not None:
        side = math.sqrt(own.fill_factor)
        width, height = side * pixel.width, side * pixel.height
        return Detector(width, height, 2 * (width + height))
    return _laid_out(pixel.width, pixel.height, process(camera))


def _laid_out(width: float, height: float, made: Process | None) -> Detector:
    """What the layout leaves of a pixel, drawn as a rectangle of the pixel's shape."""
    layout = None if made is None else made.layout
    size = None if made is None else made.feature_size
    if layout is None or size is None or layout.border is None or layout.transistors is None:
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
    """The error about a pixel without a photodetector, with the smallest that has one."""
    least = float(photodiode.smallest_square_pixel(size, border, transistors))
    nanometers = math.floor(least * 1e9) + 1  # at the size itself nothing is left
    return bad(
        "pixel.width" if width <= height else "pixel.height",
        f"a pixel of {width * 1e6:.6g} x {height * 1e6:.6g} um is too small for its transistors"
        f" in a process of {size * 1e6:.6g} um",
        f"the smallest square pixel that works is {nanometers / 1e3:.6g} um; make it larger, use a"
        " finer technology, or give photodetector.fill_factor",
    )
