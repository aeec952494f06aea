"""The source follower of a pixel, and the charge of a junction that discharges.

References
----------
.. [1] Y. Tsividis, C. McAndrew, "Operation and Modeling of the MOS Transistor", 3rd edition, Oxford
   University Press, 2011, sections 2.6 and 4.7 (body effect).
.. [2] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.4.1 and Fig 2.18.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.physics.junction import mean_capacitance

Floats = NDArray[np.float64]


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


def follower_output(
    gate: ArrayLike,
    threshold: ArrayLike,
    body_effect: ArrayLike,
    surface_potential: ArrayLike,
    overdrive: ArrayLike,
) -> Floats:
    """Return the output of a source follower whose current is held by an ideal source.

    V_out = V_gate - V_T0 - gamma (sqrt(phi + V_out) - sqrt(phi)) - V_ov, the body effect of [1].
    With s = sqrt(phi + V_out) that is a quadratic equation in s; its slope is
    1 / (1 + gamma / (2 s)), less than 1. Channel-length modulation is left out.

    Parameters
    ----------
    gate : array_like
        Voltage of the gate, which is that of the photodiode, to the bulk [V].
    threshold : array_like
        Threshold V_T0 at no voltage between source and bulk [V].
    body_effect : array_like
        Body-effect coefficient gamma [V^0.5], not negative.
    surface_potential : array_like
        phi, twice the Fermi potential of the bulk [V], positive.
    overdrive : array_like
        V_ov, gate-source voltage above the threshold [V].

    Returns
    -------
    ndarray
        Output V_out [V]; nan where no output at or above the bulk carries the current.
    """
    gamma, phi = _float(body_effect), _float(surface_potential)
    above = _float(gate) - _float(threshold) - _float(overdrive)
    root = np.sqrt(phi)
    # s^2 + gamma s = above + gamma root + phi; V_out = s^2 - phi = (s - root)(s + root), and
    # s - root = above / (...) loses no digits for small outputs.
    discriminant = gamma**2 + 4 * (above + gamma * root + phi)
    s = (np.sqrt(np.maximum(discriminant, 0.0)) - gamma) / 2
    output = above * (s + root) / (s + root + gamma)
    return np.where(above >= 0, output, np.nan)[()]


def discharge(
    voltage: ArrayLike,
    reset: ArrayLike,
    zero_bias: ArrayLike,
    built_in: ArrayLike,
    grading: ArrayLike,
) -> Floats:
    """Return the charge that takes a junction from its reset voltage down to another one.

    The integral of C_j0 (1 + V / phi)^-m from V to V_reset, in closed form.

    Parameters
    ----------
    voltage : array_like
        Reverse bias V that is left [V].
    reset : array_like
        Reverse bias at the start [V], at least V.
    zero_bias : array_like
        Capacitance C_j0 without bias [F].
    built_in : array_like
        Built-in potential phi [V], positive.
    grading : array_like
        Grading coefficient m [dimensionless].

    Returns
    -------
    ndarray
        Charge [C].
    """
    span = _float(reset) - _float(voltage)
    return (mean_capacitance(zero_bias, voltage, reset, built_in, grading) * span)[()]
