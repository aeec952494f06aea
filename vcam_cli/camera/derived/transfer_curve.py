"""From electrons to volts at the end of the pixel, where that is no straight line.

The charge takes the photodiode from its reset voltage downward, evenly or, where the capacitance is
the junction's, ever more slowly; the follower passes a part of that. What reaches the column is the
output after the reset less the output now.

References
----------
T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University, 2003,
section 2.4.1 and Fig 2.18.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.camera.derived import sense_node
from vcam_cli.camera.derived.process import Need, process
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.transfer_curve import Follower, Points
from vcam_cli.errors import bad, data_file_problems
from vcam_cli.physics import follower as physics
from vcam_cli.records import dataclass
from vcam_cli.spectra.text import read_rows

POINTS = 1025
"""Voltages at which a curve is known: between them a line is good to 1e-7 of the swing."""
SMALLEST_SWING = 1e-9
"""Swing over the reset voltage, at least: what is smaller is lost to rounding."""
HEADER = ("input_v", "output_v")
PATH = "pixel.readout.transfer_curve"
SLACK = 1e-9
"""By how much a measured curve may miss the end of the swing, relative: rounding."""


@dataclass(frozen=True)
class Curve:
    """Volts over electrons, straight between its points and beyond them, rising throughout."""

    electrons: tuple[float, ...]
    """Charges, from none to a full well [e]."""
    volts: tuple[float, ...]
    """Output, from 0, in front of the readout's gain [V]."""
    corrected: bool
    """Whether the processing takes it out."""

    def volts_of(self, electrons: float | Array) -> NDArray[np.float64]:
        """Return the output of charges, of any shape [V]."""
        return _straight_beyond(electrons, self.electrons, self.volts)

    def electrons_of(self, volts: float | Array) -> NDArray[np.float64]:
        """Return the charges of outputs, of any shape [e]."""
        return _straight_beyond(volts, self.volts, self.electrons)

    @property
    def slope(self) -> float:
        """Volts per electron in the dark [V/e]."""
        return self.volts[1] / self.electrons[1]

    @property
    def nonlinearity(self) -> float:
        """Largest distance from the line through both ends, relative to the whole output."""
        line = np.array(self.electrons) / self.electrons[-1]
        return float(np.abs(np.array(self.volts) / self.volts[-1] - line).max())


def _straight_beyond(
    value: float | Array, x: tuple[float, ...], y: tuple[float, ...]
) -> NDArray[np.float64]:
    """Return the line through the points at some values, which goes on beyond both ends."""
    at = np.asarray(value, np.float64)
    first, last = (y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])
    below, above = np.minimum(at - x[0], 0.0), np.maximum(at - x[-1], 0.0)
    return np.interp(at, x, y) + first * below + last * above


def transfer_curve(camera: CameraModel, swing: float, full_well: float) -> Curve | None:
    """Return the curve of a camera's readout; None where it is a straight line.

    Parameters
    ----------
    camera : CameraModel
        The camera.
    swing : float
        Fall of the photodiode's voltage at the full well [V].
    full_well : float
        Electrons that a pixel holds [e].

    Raises
    ------
    BadInput
        For numbers that are missing, a file that is no curve, and a curve that does not rise.
    """
    given = camera.pixel.readout.transfer_curve
    if given is None:
        return None
    fall = np.linspace(0, swing, POINTS)
    reset = _reset_voltage(camera, swing)
    if swing < SMALLEST_SWING * abs(reset):
        message = f"a swing of {swing:.4g} V is negligible against a reset voltage of {reset:.4g} V"
        raise bad(PATH, message, "give a larger full well or voltage swing")
    electrons = fall / swing * full_well
    if given.capacitance == "junction":
        charge = _junction_charge(camera, reset - fall, reset)
        electrons = charge / charge[-1] * full_well
    output = reset - fall if given.follower is None else _output(given.follower, reset - fall)
    volts = output[0] - output
    if not (np.diff(volts) > 0).all():
        worst = int(np.argmin(np.diff(volts) > 0))
        raise bad(
            PATH,
            f"the follower's output does not fall with {reset - fall[worst]:.4g} V on the"
            f" photodiode, which goes from {reset:.4g} to {reset - swing:.4g} V",
            "lower voltage_swing, threshold or overdrive, or raise reset_voltage",
        )
    return Curve(tuple(electrons.tolist()), tuple(volts.tolist()), given.corrected)


def _reset_voltage(camera: CameraModel, swing: float) -> float:
    """Return the photodiode's voltage at the start [V]; the swing where nothing depends on it."""
    given = camera.pixel.readout.transfer_curve
    assert given is not None
    voltage = given.reset_voltage
    if voltage is None:
        bent = given.follower is not None and given.follower.gain is None
        if not bent and given.capacitance == "constant":
            return swing
        need = Need(f"{PATH}.reset_voltage", "the transfer curve")
        voltage = sense_node.reset_voltage(camera, process(camera), need)
    if voltage < swing * (1 - SLACK):
        raise bad(
            f"{PATH}.reset_voltage",
            f"a swing of {swing:.6g} V from {voltage:.6g} V would bias the photodiode forward",
            "raise it, or give a smaller pixel.readout.voltage_swing",
        )
    return max(voltage, swing)


def _junction_charge(camera: CameraModel, voltage: Array, reset: float) -> NDArray[np.float64]:
    """Return the charge of the technology's photodiode and the follower's gate [C]."""
    need = Need(f"{PATH}.capacitance", "the capacitance of the junction")
    parts, fixed = sense_node.junction_capacitances(camera, process(camera), need)
    charge = fixed * (reset - voltage)
    for part in parts:
        charge = charge + physics.discharge(voltage, reset, *part)
    return np.asarray(charge)


def _output(given: Follower, voltage: Array) -> NDArray[np.float64]:
    """Return the follower's output at falling voltages of its gate [V]."""
    if given.gain is not None:
        return given.gain * voltage
    if given.threshold is not None:
        numbers = given.threshold, given.body_effect, given.surface_potential, given.overdrive
        output = physics.follower_output(voltage, *numbers)
        if np.isnan(output).any():
            least = given.threshold + given.overdrive
            raise bad(
                f"{PATH}.follower.threshold",
                f"the follower needs {least:.4g} V on the photodiode, which falls to"
                f" {voltage[-1]:.4g} V at the full well",
                "lower threshold or overdrive, or give a smaller pixel.readout.voltage_swing",
            )
        return output
    return _measured(_points(given), voltage)


def _points(given: Follower) -> Points:
    """Return the measured points, of the file or the table. Raises BadInput."""
    if given.table is not None:
        return given.table
    assert given.file is not None
    path = (*PATH.split("."), "follower", "file")
    with data_file_problems(given.file, path, "write the columns input_v,output_v"):
        header, rows = read_rows(given.file)
        if tuple(header) != HEADER or len(rows) < 2:
            raise ValueError(f"{given.file}: is no table of {','.join(HEADER)}")
    return tuple(map(tuple, rows.tolist()))


def _measured(points: Points, voltage: Array) -> NDArray[np.float64]:
    """Return the output by lines between measured points. Raises BadInput where they end."""
    x, y = np.array(sorted(points)).T
    path = f"{PATH}.follower"
    if not (np.diff(x) > 0).all() or not (np.diff(y) > 0).all():
        raise bad(path, "its output does not rise with its input", "give a curve that rises")
    low, high, slack = voltage[-1], voltage[0], SLACK * voltage[0]
    if x[0] > low + slack or x[-1] < high - slack:
        message = (
            f"is measured from {x[0]:.4g} to {x[-1]:.4g} V, but the photodiode goes from {high:.4g}"
            f" to {low:.4g} V"
        )
        raise bad(path, message, "measure it over all of the swing, or give another reset_voltage")
    output: NDArray[np.float64] = np.interp(voltage, x, y)
    return output
