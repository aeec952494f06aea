"""The depths of a pixel's junction, from its process.

An n-well is deeper and less doped (`process`), and so its depletion region is wider; a photogate
has a film above it and no n region; the surface layer of a pinned diode collects nothing and keeps
its surface dark, and all of the layer below it is depleted (`charge_storage`).
"""

from __future__ import annotations

from vcam_cli.camera.derived.charge_storage import gate_well, pinned_layer
from vcam_cli.camera.derived.process import Need, Process, process
from vcam_cli.camera.derived.sense_node import area_capacitance
from vcam_cli.camera.model import CameraModel
from vcam_cli.errors import bad
from vcam_cli.physics import junction
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Depths:
    """Depths of the junction, from the surface of the silicon [m]."""

    x1: float
    """Upper edge of the depletion region."""
    x2: float
    """Lower edge of the depletion region."""
    x3: float
    """Depth at which electrons are lost to the bottom."""


def depths(camera: CameraModel, need: Need) -> Depths:
    """Return the depths of a camera's junction; a photogate's begin at the surface of the silicon.

    Raises BadInput where numbers are missing.
    """
    made, gated = process(camera), camera.pixel.photodetector.kind == "photogate"
    keys = ("junction.depletion_width", "junction.substrate_depth", "junction.depth")
    given, neutral, *depth = made.require(need, *keys[: 2 if gated else 3])
    width = depletion_width(camera, made, given, need)
    x1 = sum(depth)
    return Depths(x1, x1 + width, x1 + width + neutral)


def depletion_width(camera: CameraModel, made: Process, given: float | str, need: Need) -> float:
    """Return the width of the depletion region [m].

    It is the number given; else of a diffusion or a well permittivity over the junction's mean
    capacitance per area, of the others what their structure depletes. Raises BadInput where numbers
    are missing.
    """
    if isinstance(given, float):
        return given
    kind = camera.pixel.photodetector.kind
    if kind == "pinned":
        (layer,) = made.require(need, "pinned.layer")
        return float(layer) + pinned_layer(made, need).reach
    if kind == "photogate":
        return gate_well(made, need).depletion_width
    per_area = area_capacitance(camera, made, need)
    if per_area <= 0:
        raise bad(
            need.path,
            "a junction without capacitance per area has a depletion region without end",
            "give junction.depletion_width, or the technology's capacitance.area",
        )
    return float(junction.depletion_width(per_area))
