"""The node on which charge becomes a voltage: its swing, its range of bias, its capacitance.

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, section 2.2.2.
[2] MOSIS SCMOS design rules, revision 8, rules 6.1 and 6.2 (a contact is 2 lambda wide, and its
    active area 1.5 lambda wider on each side; lambda is half the feature size).
"""

from __future__ import annotations

from vcam_cli.camera.derived.charge_storage import (
    OXIDE_PERMITTIVITY,
    OXIDE_THICKNESS,
    TRANSFERRED,
    well_capacitance,
)
from vcam_cli.camera.derived.pixel_layout import detector
from vcam_cli.camera.derived.process import Need, Process, process
from vcam_cli.camera.model import CameraModel
from vcam_cli.errors import bad
from vcam_cli.physics import junction, readout

GATE_WIDTH = 2.5
"""Width of the follower, in feature sizes: the narrowest that takes a contact, 5 lambda [2]."""
DIFFUSION_WIDTH = 2.5
"""Side of a floating diffusion, in feature sizes: the smallest that takes a contact, likewise."""


def voltage_swing(camera: CameraModel) -> float | None:
    """Return the voltage swing that the file gives, or its technology [V]; None for none.

    A technology gives it as a number or by its thresholds, eq 2.33 of [1]. A passive pixel has no
    follower and swings over the whole supply. Raises BadInput for a swing that is not positive.
    """
    own = camera.pixel.readout.voltage_swing
    return own if own is not None else _technology_swing(camera, process(camera))


def _technology_swing(camera: CameraModel, made: Process) -> float | None:
    if camera.pixel.technology is None:
        return None
    path = "pixel.readout"
    if camera.pixel.architecture == "pps":
        return made.require(Need(path, "the swing of a passive pixel"), "supply")[0]
    if made.voltage_swing is not None:
        return made.voltage_swing
    names = ("reset", "follower_gate_source", "bias", "bias_gate")
    if all(getattr(made.thresholds, name) is None for name in names):
        return made.require(Need(path, "the full well"), "voltage_swing")[0]
    keys = ("supply", *(f"thresholds.{name}" for name in names))
    swing = float(readout.voltage_swing(*made.require(Need(path, "the swing"), *keys)))
    if swing <= 0:
        raise bad(
            "pixel.technology.thresholds",
            f"they leave a swing of {swing:.6g} V of a supply of {made.supply:.6g} V",
            "lower them, raise the supply, or give pixel.readout.voltage_swing",
        )
    return swing


def bias_range(camera: CameraModel, made: Process, need: Need) -> tuple[float, float]:
    """Return the reverse bias of the photodiode [V], full and empty.

    They are the reset voltage less the swing, and the reset voltage. Raises BadInput where numbers
    are missing, or the diode would be biased forward.
    """
    reset = reset_voltage(camera, made, need)
    own = camera.pixel.readout
    swing = own.voltage_swing
    if swing is None:
        swing = _technology_swing(camera, made)
    if swing is None and own.conversion_gain is not None and own.full_well is not None:
        swing = own.conversion_gain * own.full_well
    if swing is None:
        message = f"{need.what} needs the voltage swing"
        raise bad(need.path, message, "add pixel.readout.voltage_swing: 1.38 V")
    if swing > reset * (1 + 1e-9):
        raise bad(
            "pixel.readout.voltage_swing" if own.voltage_swing else "pixel.technology",
            f"a swing of {swing:.6g} V from a reset voltage of {reset:.6g} V would bias the"
            " photodiode forward",
            "give a smaller voltage_swing, or a higher pixel.technology.reset_voltage",
        )
    return max(reset - swing, 0.0), reset


def reset_voltage(camera: CameraModel, made: Process, need: Need) -> float:
    """Return the reset voltage [V]: supply less a threshold; a passive pixel loses none.

    Raises BadInput where numbers are missing or contradict each other.
    """
    if camera.pixel.architecture == "pps":
        return made.require(need, "supply")[0]
    if made.reset_voltage is not None or made.thresholds.reset is None:
        (reset,) = made.require(need, "reset_voltage")
        if made.supply is not None and reset > made.supply:
            raise bad(
                "pixel.technology",
                f"a reset voltage of {reset:.6g} V lies above its supply of {made.supply:.6g} V",
                "lower pixel.technology.reset_voltage, or raise pixel.technology.supply",
            )
        return reset
    supply, threshold = made.require(need, "supply", "thresholds.reset")
    if threshold >= supply:
        raise bad(
            "pixel.technology.thresholds.reset",
            f"a threshold of {threshold:.6g} V blocks a supply of {supply:.6g} V",
            "lower it, or raise the supply",
        )
    return supply - threshold


def capacitance(camera: CameraModel) -> float | None:
    """Return the capacitance of the photodiode's node [F]; None where the gain says it.

    It is the file's number; else, where the file says `junction` or leaves the conversion gain to
    its technology, the junction's area and sidewall averaged over the swing, and the follower's
    gate. Raises BadInput where numbers are missing, or nothing is left of it.
    """
    own, given = camera.pixel.readout, camera.pixel.photodetector.capacitance
    if isinstance(given, float):
        return given
    known = own.conversion_gain is not None or None not in (own.voltage_swing, own.full_well)
    if given is None and (known or camera.pixel.technology is None):
        return None
    made = process(camera)
    need = Need("pixel.photodetector.capacitance", "the capacitance of the junction")
    parts, whole = junction_capacitances(camera, made, need)
    biases = bias_range(camera, made, need)
    for zero, built_in, grading in parts:
        whole += float(junction.mean_capacitance(zero, *biases, built_in, grading))
    if whole <= 0:
        raise bad(need.path, f"{need.what} is zero", "give the technology's capacitance.area")
    return whole


def junction_capacitances(
    camera: CameraModel, made: Process, need: Need
) -> tuple[tuple[tuple[float, float, float], ...], float]:
    """Return what the capacitance of the photodiode's node is made of.

    They are the capacitance without bias [F], built-in potential [V] and grading of the junction's
    area and of its sidewall; and the capacitance of the follower's gate [F], which a passive pixel
    has none of. Charge of a photogate or a pinned photodetector is read on a floating diffusion, an
    n+ junction as small as can be. Raises BadInput where numbers are missing.
    """
    size, kind = detector(camera), camera.pixel.photodetector.kind
    surface, edge = size.area, size.perimeter
    if kind in TRANSFERRED:
        (feature,) = made.require(need, "feature_size")
        side = DIFFUSION_WIDTH * feature
        surface, edge = side**2, 4 * side
    if kind == "nwell-psub":
        well, potential, depth = well_capacitance(made, need)
        parts = (surface * well, potential, 0.5), (edge * depth * well, potential, 0.5)
        return parts, _gate_capacitance(camera, made, need)
    names = "sidewall sidewall_built_in sidewall_grading area built_in grading"
    keys = (f"capacitance.{name}" for name in names.split())
    sidewall, *of_sidewall, area, built_in, grading = made.require(need, *keys)
    parts = (
        (surface * area, built_in, grading),
        (edge * sidewall, of_sidewall[0], of_sidewall[1]),
    )
    return parts, _gate_capacitance(camera, made, need)


def area_capacitance(camera: CameraModel, made: Process, need: Need) -> float:
    """Return the capacitance of the junction per area, averaged over the swing [F/m2].

    Raises BadInput where numbers are missing.
    """
    if camera.pixel.photodetector.kind == "nwell-psub":
        zero, built_in, _ = well_capacitance(made, need)
        grading = 0.5
    else:
        keys = ("capacitance.area", "capacitance.built_in", "capacitance.grading")
        zero, built_in, grading = made.require(need, *keys)
    biases = bias_range(camera, made, need)
    return float(junction.mean_capacitance(zero, *biases, built_in, grading))


def _gate_capacitance(camera: CameraModel, made: Process, need: Need) -> float:
    """Return the capacitance of the follower's gate [F]: W L C_ox, or the technology's.

    A passive pixel has none.
    """
    if camera.pixel.architecture == "pps":
        return 0.0
    given = made.capacitance.follower_gate
    if isinstance(given, float):
        return given
    (size,) = made.require(Need(need.path, "the follower's gate"), "feature_size")
    return float(GATE_WIDTH * size**2 * OXIDE_PERMITTIVITY / (OXIDE_THICKNESS * size))
