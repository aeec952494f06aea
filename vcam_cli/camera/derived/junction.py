"""The depths of a pixel's junction, from its process.

The kinds of photodetector differ only here and in what follows from it: an n-well is deeper and
less doped (`process`); a photogate has a film above it and no n region; the surface layer of a
pinned diode collects nothing and keeps its surface dark.
"""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.process import Need, Process, process
from vcam_cli.camera.derived.sense_node import area_capacitance
from vcam_cli.errors import bad
from vcam_cli.physics import junction


@dataclass(frozen=True)
class Depths:
    """Depths of the junction, from the surface of the silicon [m]."""

    x1: float
    """Upper edge of the depletion region."""
    x2: float
    """Lower edge of the depletion region."""
    x3: float
    """Depth at which electrons are lost to the bottom."""


def depths(camera: Camera, need: Need) -> Depths:
    """Return the depths of a camera's junction; a photogate's begin at the surface of the silicon.

    Raises BadInput where numbers are missing.
    """
    made, gated = process(camera), camera.pixel.photodetector.kind == "photogate"
    keys = ("junction.depletion_width", "junction.substrate_depth", "junction.depth")
    given, neutral, *depth = made.require(need, *keys[: 2 if gated else 3])
    width = depletion_width(camera, made, given, need)
    x1 = sum(depth)
    return Depths(x1, x1 + width, x1 + width + neutral)


def depletion_width(camera: Camera, made: Process, given: float | str, need: Need) -> float:
    """Return the width of the depletion region [m].

    It is the number given, or permittivity over the junction's mean capacitance per area. Raises
    BadInput where numbers are missing.
    """
    if isinstance(given, float):
        return given
    per_area = area_capacitance(camera, made, need)
    if per_area <= 0:
        raise bad(
            need.path,
            "a junction without capacitance per area has a depletion region without end",
            "give junction.depletion_width, or the technology's capacitance.area",
        )
    return float(junction.depletion_width(per_area))
