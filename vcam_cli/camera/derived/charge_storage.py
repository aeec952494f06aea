"""What a kind of photodetector has of its own: its depletion region, and how much it holds.

    kind          collects down to                  capacitance that makes the voltage  holds
    ------------  --------------------------------  ----------------------------------  ------------
    ndiff-psub    depletion of the n+ junction      its junction's, as measured         its swing
    nwell-psub    depletion of the well's junction  the well's, from its doping         its swing
    photogate     deep depletion below the gate     floating diffusion                  gate's well
    pinned        n layer and depletion below it    floating diffusion                  its layer

Charge of a photogate or a pinned photodetector is moved to a floating diffusion to be read: what it
holds is the less of its own capacity and the diffusion's.
"""

from __future__ import annotations

from vcam_cli.camera.derived.pixel_layout import detector
from vcam_cli.camera.derived.process import Need, Process, process
from vcam_cli.camera.model import CameraModel
from vcam_cli.errors import bad
from vcam_cli.physics import charge_storage as physics
from vcam_cli.physics.silicon import intrinsic_concentration

TRANSFERRED = ("photogate", "pinned")
"""Kinds whose charge is moved to a floating diffusion."""
ROOM = 300.0
"""Temperature of potentials and capacities [K]; they change by a few percent in a hundred."""
OXIDE_THICKNESS = 1 / 44
"""Oxide of a gate, in feature sizes: 7.9, 5.7 and 4.1 nm at 0.35, 0.25 and 0.18 um,
where MOSIS runs have 7.7 (T69H), 5.6 to 5.8 and 4.1 to 4.2 nm."""
OXIDE_PERMITTIVITY = 3.9 * 8.8541878128e-12
"""Permittivity of silicon dioxide [F/m]."""


def well_capacitance(made: Process, need: Need) -> tuple[float, float, float]:
    """Return capacitance per area [F/m2], built-in potential [V] and depth [m] of the n-well.

    Raises BadInput where its doping is missing.
    """
    keys = ("junction.donors", "junction.acceptors", "junction.depth")
    donors, acceptors, depth = made.require(need, *keys)
    potential = _built_in(donors, acceptors)
    return float(physics.abrupt_capacitance(donors, acceptors, potential)), potential, depth


def pinned_layer(made: Process, need: Need) -> physics.PinnedLayer:
    """Return what the n layer of a pinned photodetector holds. Raises BadInput."""
    names = "layer surface_acceptors"
    layer, surface = made.require(need, *(f"pinned.{name}" for name in names.split()))
    donors, acceptors = made.require(need, "junction.donors", "junction.acceptors")
    potentials = _built_in(donors, surface), _built_in(donors, acceptors)
    found = physics.pinned_layer(layer, donors, acceptors, *potentials)
    if found.capacity <= 0:
        message = "is so thin that it holds no charge at 0 V"
        raise bad("pixel.technology.pinned.layer", message, "make it thicker, or dope it more")
    return found


def gate_well(made: Process, need: Need) -> physics.GateWell:
    """Return the well below a photogate, which is switched to the supply. Raises BadInput."""
    supply, acceptors, size = made.require(need, "supply", "junction.acceptors", "feature_size")
    oxide = OXIDE_PERMITTIVITY / (OXIDE_THICKNESS * size)
    n_i = float(intrinsic_concentration(ROOM))
    found = physics.gate_well(supply, oxide, acceptors, n_i, ROOM)
    if found.capacity <= 0:
        message = f"{supply:.4g} V on the gate make no well below it"
        raise bad("pixel.technology.supply", message, "raise the supply, or lower the acceptors")
    return found


def capacity(camera: CameraModel) -> float | None:
    """Return the electrons that the photodetector itself holds; None where its swing decides.

    Raises BadInput where numbers of its structure are missing.
    """
    kind = camera.pixel.photodetector.kind
    if kind not in TRANSFERRED or camera.pixel.technology is None:
        return None
    made, need = process(camera), Need("pixel.photodetector.kind", f"the full well of a {kind}")
    per_area = (pinned_layer if kind == "pinned" else gate_well)(made, need).capacity
    return per_area * detector(camera).area


def _built_in(donors: float, acceptors: float) -> float:
    n_i = float(intrinsic_concentration(ROOM))
    return float(physics.built_in_potential(donors, acceptors, n_i, ROOM))
