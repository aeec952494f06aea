"""The node on which charge becomes a voltage: its swing, its range of bias, its capacitance.

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, section 2.2.2.
[2] MOSIS SCMOS design rules, revision 8, rules 6.1 and 6.2 (a contact is 2 lambda wide, and its
    active area 1.5 lambda wider on each side; lambda is half the feature size).
"""

from __future__ import annotations

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.detector import detector
from vcam_cli.camera.once import once
from vcam_cli.camera.process import process, require
from vcam_cli.errors import bad
from vcam_cli.physics import photodiode, readout

_CAPACITANCE = "pixel.photodetector.capacitance"
_SWING = "pixel.readout"

GATE_WIDTH = 2.5
"""Of the follower, in feature sizes: the narrowest that takes a contact, 5 lambda [2]."""
OXIDE_THICKNESS = 1 / 44
"""Of the follower's gate, in feature sizes: 7.9, 5.7 and 4.1 nm at 0.35, 0.25 and 0.18 um, where
MOSIS runs have 7.7 (T69H), 5.6 to 5.8 and 4.1 to 4.2 nm."""
OXIDE_PERMITTIVITY = 3.9 * 8.8541878128e-12
"""Of silicon dioxide [F/m]."""


def voltage_swing(camera: Camera) -> float | None:
    """The swing that the file gives, or its technology [V]; None where there is none.

    A technology gives it as a number or by its thresholds, eq 2.33 of [1]. A passive pixel has no
    follower and swings over the whole supply. Raises BadInput for a swing that is not positive.
    """
    pixel = camera.pixel
    if pixel.readout.voltage_swing is not None or pixel.technology is None:
        return pixel.readout.voltage_swing
    if pixel.architecture == "pps":
        return float(require(camera, _SWING, "the swing of a passive pixel", "supply")[0])
    made = process(camera)
    assert made is not None
    if made.voltage_swing is not None:
        return made.voltage_swing
    names = ("reset", "follower_gate_source", "bias", "bias_gate")
    if all(getattr(made.thresholds, name) is None for name in names):
        return float(require(camera, _SWING, "the full well", "voltage_swing")[0])
    keys = ("supply", *(f"thresholds.{name}" for name in names))
    swing = float(readout.voltage_swing(*require(camera, _SWING, "the swing", *keys)))
    if swing <= 0:
        raise bad(
            "pixel.technology.thresholds",
            f"they leave a swing of {swing:.6g} V of a supply of {made.supply:.6g} V",
            "lower them, raise the supply, or give pixel.readout.voltage_swing",
        )
    return swing


def bias_range(camera: Camera, at: str, what: str) -> tuple[float, float]:
    """Reverse bias of the photodiode, full and empty [V]: reset voltage less the swing, and it.

    `what` needs it, `at` is where the file asks for it. Raises BadInput where numbers are missing
    or the diode would be forward biased.
    """
    reset = _reset_voltage(camera, at, what)
    swing = voltage_swing(camera)
    own = camera.pixel.readout
    if swing is None and own.conversion_gain is not None and own.full_well is not None:
        swing = own.conversion_gain * own.full_well
    if swing is None:
        raise bad(at, f"{what} needs the voltage swing", "add pixel.readout.voltage_swing: 1.38 V")
    if swing > reset * (1 + 1e-9):
        raise bad(
            "pixel.readout.voltage_swing" if own.voltage_swing else "pixel.technology",
            f"a swing of {swing:.6g} V from a reset voltage of {reset:.6g} V would bias the"
            " photodiode forward",
            "give a smaller voltage_swing, or a higher pixel.technology.reset_voltage",
        )
    return max(reset - swing, 0.0), reset


def _reset_voltage(camera: Camera, at: str, what: str) -> float:
    """To which the photodiode is reset [V]: supply less a threshold; a passive pixel loses none."""
    if camera.pixel.architecture == "pps":
        return float(require(camera, at, what, "supply")[0])
    made = process(camera)
    if made is None or made.reset_voltage is not None or made.thresholds.reset is None:
        (reset,) = require(camera, at, what, "reset_voltage")
        if made is not None and made.supply is not None and reset > made.supply:
            raise bad(
                "pixel.technology",
                f"a reset voltage of {reset:.6g} V lies above its supply of {made.supply:.6g} V",
                "lower pixel.technology.reset_voltage, or raise pixel.technology.supply",
            )
        return float(reset)
    supply, threshold = require(camera, at, what, "supply", "thresholds.reset")
    if threshold >= supply:
        raise bad(
            "pixel.technology.thresholds.reset",
            f"a threshold of {threshold:.6g} V passes nothing of a supply of {supply:.6g} V",
            "lower it, or raise the supply",
        )
    return float(supply - threshold)


@once
def capacitance(camera: Camera) -> float | None:
    """Capacitance of the photodiode's node [F].

    The file's number; else, where the file says `junction` or leaves the conversion gain to its
    technology, the junction's area and sidewall averaged over the swing, and the follower's gate.
    None where the conversion gain says it.
    """
    own, given = camera.pixel.readout, camera.pixel.photodetector.capacitance
    if isinstance(given, float):
        return given
    known = own.conversion_gain is not None or None not in (own.voltage_swing, own.full_well)
    if given is None and (known or camera.pixel.technology is None):
        return None
    size = detector(camera)
    what = "the capacitance of the junction"
    names = "sidewall sidewall_built_in sidewall_grading area built_in grading"
    keys = (f"capacitance.{name}" for name in names.split())
    zero, built_in, grading, *_ = require(camera, _CAPACITANCE, what, *keys)
    per_area = area_capacitance(camera, _CAPACITANCE, what)
    biases = bias_range(camera, _CAPACITANCE, what)
    per_length = float(photodiode.mean_junction_capacitance(zero, *biases, built_in, grading))
    whole = size.area * per_area + size.perimeter * per_length + _follower_gate(camera)
    if whole <= 0:
        raise bad(_CAPACITANCE, f"{what} is zero", "give the technology's capacitance.area")
    return whole


def area_capacitance(camera: Camera, at: str, what: str) -> float:
    """Capacitance of the junction per area, averaged over the swing [F/m2].

    `what` needs it, `at` is where the file asks for it.
    """
    keys = ("capacitance.area", "capacitance.built_in", "capacitance.grading")
    zero, built_in, grading = require(camera, at, what, *keys)
    biases = bias_range(camera, at, what)
    return float(photodiode.mean_junction_capacitance(zero, *biases, built_in, grading))


def _follower_gate(camera: Camera) -> float:
    """Capacitance of the follower's gate [F]: W L C_ox, unless the technology gives it."""
    made = process(camera)
    if made is None or camera.pixel.architecture == "pps":
        return 0.0
    given = made.capacitance.follower_gate
    if isinstance(given, float):
        return given
    (size,) = require(camera, _CAPACITANCE, "the follower's gate", "feature_size")
    return float(GATE_WIDTH * size**2 * OXIDE_PERMITTIVITY / (OXIDE_THICKNESS * size))
