"""Where photodetectors of different kinds keep their charge: n-well, pinned layer, gate.

References
----------
.. [1] S. M. Sze, K. K. Ng, "Physics of Semiconductor Devices", 3rd edition, Wiley, 2007,
   sections 2.2 (abrupt junction) and 4.2 (MOS capacitor), doi:10.1002/0470068329.
.. [2] E. R. Fossum, D. B. Hondongwa, "A review of the pinned photodiode for CCD and CMOS image
   sensors", IEEE J. Electron Devices Soc. 2(3), 33-43, 2014, doi:10.1109/JEDS.2014.2306412.
.. [3] S. Mendis, S. E. Kemeny, E. R. Fossum, "CMOS active pixel image sensor", IEEE Trans. Electron
   Devices 41(3), 452-453, 1994, doi:10.1109/16.275235 (photogate, floating diffusion).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.physics.readout import ELEMENTARY_CHARGE
from vcam_cli.physics.silicon import PERMITTIVITY
from vcam_cli.records import dataclass
from vcam_cli.spectra import BOLTZMANN

Floats = NDArray[np.float64]
HALF_GAP = 0.56
"""Half of silicon's band gap at 300 K [V]: from the middle of the gap to an n+ gate's level."""
HALVINGS = 200
"""Of the bracket around a pinning voltage: down to the last digit."""


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


def built_in_potential(
    donors: ArrayLike, acceptors: ArrayLike, intrinsic: ArrayLike, temperature: ArrayLike
) -> Floats:
    """Return the built-in potential of a junction, (k T / q) ln(N_d N_a / n_i^2) [1].

    Parameters
    ----------
    donors, acceptors : array_like
        Concentrations N_d, N_a [1/m3], positive.
    intrinsic : array_like
        Intrinsic concentration n_i [1/m3].
    temperature : array_like
        Temperature [K].

    Returns
    -------
    ndarray
        Potential [V].
    """
    thermal = BOLTZMANN * _float(temperature) / ELEMENTARY_CHARGE
    n_i = _float(intrinsic)
    potential: Floats = (
        thermal * (np.log(_float(donors) / n_i) + np.log(_float(acceptors) / n_i))
    )[()]
    return potential


def abrupt_capacitance(donors: ArrayLike, acceptors: ArrayLike, built_in: ArrayLike) -> Floats:
    """Return the capacitance per area of an abrupt junction without bias [1].

    C = sqrt(q eps N / (2 phi)), 1 / N = 1 / N_d + 1 / N_a; its grading coefficient is 1/2.

    Parameters
    ----------
    donors, acceptors : array_like
        Concentrations N_d, N_a [1/m3], positive.
    built_in : array_like
        Built-in potential phi [V], positive.

    Returns
    -------
    ndarray
        Capacitance per area [F/m2].
    """
    both = 1 / (1 / _float(donors) + 1 / _float(acceptors))
    return np.sqrt(ELEMENTARY_CHARGE * PERMITTIVITY * both / (2 * _float(built_in)))[()]


@dataclass(frozen=True)
class PinnedLayer:
    """An n layer between a grounded p+ surface and a p substrate."""

    pinning_voltage: float
    """Of the layer without any charge [V]; not positive where it is never neutral."""
    capacity: float
    """Electrons that fill it from there to 0 V [1/m2]."""
    reach: float
    """How far its depletion region goes into the substrate when it is empty [m]."""


def pinned_layer(
    thickness: float, donors: float, acceptors: float, surface_potential: float, potential: float
) -> PinnedLayer:
    """Return what a pinned layer holds, by the depletion approximation [2].

    Depletion regions grow from both junctions, x_a = sqrt(2 eps (V + phi_a) / (q N_d)) and
    x_b = sqrt(2 eps (V + phi_b) / (q N_d (1 + N_d / N_a))); the layer is empty where they meet. The
    p+ surface is taken as far more doped than the layer, so that nothing of it is depleted.

    Parameters
    ----------
    thickness : float
        Of the n layer [m].
    donors, acceptors : float
        Of the layer and of the substrate [1/m3].
    surface_potential, potential : float
        Built-in potentials of the upper and of the lower junction [V].

    Returns
    -------
    PinnedLayer
        Pinning voltage, capacity, and reach into the substrate.
    """
    unit = 2 * PERMITTIVITY / (ELEMENTARY_CHARGE * donors)
    lower = 1 + donors / acceptors

    def depleted(voltage: float) -> tuple[float, float]:
        above, below = max(voltage + surface_potential, 0.0), max(voltage + potential, 0.0)
        return float(np.sqrt(unit * above)), float(np.sqrt(unit * below / lower))

    low = -min(surface_potential, potential)
    high = thickness**2 / unit
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if sum(depleted(middle)) < thickness:
            low = middle
        else:
            high = middle
    capacity = donors * (thickness - sum(depleted(0.0)))
    reach = depleted(high)[1] * donors / acceptors
    return PinnedLayer(high, max(capacity, 0.0), reach)


@dataclass(frozen=True)
class GateWell:
    """The potential well below a gate."""

    capacity: float
    """Electrons that fill it up to inversion [1/m2]."""
    depletion_width: float
    """Mean of its widths when it is empty and when it is full [m]."""


def gate_well(
    gate: float, oxide: float, acceptors: float, intrinsic: float, temperature: float
) -> GateWell:
    """Return the potential well below an n+ polysilicon gate in deep depletion [1], [3].

    With V = V_gate - V_FB, V = psi + sqrt(2 eps q N_a psi) / C_ox while it is empty, and
    psi = 2 phi_F when it is full; V_FB = -(E_g / 2 q + phi_F), no charge in the oxide. The
    electrons are the gate's charge then, C_ox (V - 2 phi_F), less that of the depletion region.

    Parameters
    ----------
    gate : float
        Voltage of the gate to the substrate [V].
    oxide : float
        Capacitance of the oxide [F/m2].
    acceptors, intrinsic : float
        Concentrations N_a, n_i [1/m3].
    temperature : float
        Temperature [K].

    Returns
    -------
    GateWell
        Capacity and width; a capacity of 0 where the gate is below its threshold.
    """
    fermi = BOLTZMANN * temperature / ELEMENTARY_CHARGE * float(np.log(acceptors / intrinsic))
    voltage = gate + HALF_GAP + fermi
    bulk = float(np.sqrt(2 * PERMITTIVITY * ELEMENTARY_CHARGE * acceptors)) / oxide
    # psi + bulk sqrt(psi) = V, a quadratic in the root, without a difference that cancels.
    root = 2 * voltage / (bulk + float(np.sqrt(bulk**2 + 4 * voltage)))
    full = 2 * fermi
    widths = [
        float(np.sqrt(2 * PERMITTIVITY * psi / (ELEMENTARY_CHARGE * acceptors)))
        for psi in (root**2, full)
    ]
    held = oxide * (voltage - full - bulk * float(np.sqrt(full))) / ELEMENTARY_CHARGE
    return GateWell(max(held, 0.0), sum(widths) / 2)
