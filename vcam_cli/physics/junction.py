"""A p-n junction: dark current, depletion region, capacitance.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.2.2.
.. [2] S. M. Sze, K. K. Ng, "Physics of Semiconductor Devices", 3rd edition, Wiley, 2007,
   sections 2.2 and 2.3, doi:10.1002/0470068329.
.. [3] R. S. Muller, T. I. Kamins, M. Chan, "Device Electronics for Integrated Circuits",
   3rd edition, Wiley, 2003, section 4.3 (capacitance of a graded junction).
.. [4] G. A. M. Hurkx, D. B. M. Klaassen, M. P. G. Knuvers, "A new recombination model for device
   simulation including tunneling", IEEE Trans. Electron Devices 39(2), 331-338, 1992,
   doi:10.1109/16.121690.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.physics.readout import ELEMENTARY_CHARGE
from vcam_cli.physics.silicon import PERMITTIVITY
from vcam_cli.spectra import BOLTZMANN, PLANCK

Floats = NDArray[np.float64]

ELECTRON_MASS = 9.1093837015e-31
"""[kg], CODATA 2018."""


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


def dark_current_parts(
    intrinsic: ArrayLike,
    hole_diffusivity: ArrayLike,
    electron_diffusivity: ArrayLike,
    donors: ArrayLike,
    acceptors: ArrayLike,
    surface_width: ArrayLike,
    neutral_width: ArrayLike,
    x_n: ArrayLike,
    x_p: ArrayLike,
    hole_lifetime: ArrayLike,
    electron_lifetime: ArrayLike,
) -> tuple[Floats, Floats, Floats]:
    """Return the three terms of the dark current density of a junction, eq 2.31 of [1].

    Diffusion from the n region, generation in the depletion region, diffusion from the p region:

        j = q D_p n_i^2 / (N_d x1) + (q n_i / 2) (x_n / tau_p + x_p / tau_n)
            + q D_n n_i^2 / (N_a (x3 - x2))

    Parameters
    ----------
    intrinsic : array_like
        Intrinsic concentration n_i [1/m3] (`silicon.intrinsic_concentration`).
    hole_diffusivity, electron_diffusivity : array_like
        Diffusivities D_p, D_n [m2/s].
    donors, acceptors : array_like
        Concentrations N_d, N_a [1/m3], positive.
    surface_width, neutral_width : array_like
        Widths of the neutral n and p regions, x1 and x3 - x2 [m], positive.
    x_n, x_p : array_like
        Widths of the depletion region on either side of the junction [m].
    hole_lifetime, electron_lifetime : array_like
        Lifetimes tau_p, tau_n [s], positive. All broadcast.

    Returns
    -------
    holes, generation, electrons : ndarray
        Current densities [A/m2]: diffusion from the n region, generation in the depletion region,
        diffusion from the p region.

    Raises
    ------
    ValueError
        A width, concentration or lifetime that is not positive.
    """
    below = (donors, acceptors, surface_width, neutral_width, hole_lifetime, electron_lifetime)
    n_d, n_a, width_n, width_p, tau_p, tau_n = (_float(value) for value in below)
    if not all((value > 0).all() for value in (n_d, n_a, width_n, width_p, tau_p, tau_n)):
        raise ValueError("widths, concentrations and lifetimes of a junction must be positive")
    n_i = _float(intrinsic)
    holes = _float(hole_diffusivity) / (n_d * width_n)
    electrons = _float(electron_diffusivity) / (n_a * width_p)
    generation = 0.5 * (_float(x_n) / tau_p + _float(x_p) / tau_n)
    # n_i never squared by itself: that underflows in deep cold, where generation alone is left.
    unit = ELEMENTARY_CHARGE * n_i
    return unit * (n_i * holes), unit * generation, unit * (n_i * electrons)


def depletion_width(capacitance_per_area: ArrayLike) -> Floats:
    """Return the width of a depletion region from its capacitance, eps / C [2].

    Parameters
    ----------
    capacitance_per_area : array_like
        Capacitance C [F/m2], positive.

    Returns
    -------
    ndarray
        Width [m].
    """
    return (PERMITTIVITY / _float(capacitance_per_area))[()]


def field_enhancement(field: ArrayLike, temperature: ArrayLike) -> Floats:
    """Return by how much tunneling by traps raises the generation in a field, 1 + Gamma of [4].

    Gamma = 2 sqrt(3 pi) (F / F_G) exp((F / F_G)^2), F_G = sqrt(24 m (k T)^3) / (q hbar), with an
    effective mass of 0.25 electron masses. It holds below some 9e7 V/m, where band-to-band
    tunneling takes over.

    Parameters
    ----------
    field : array_like
        Electric field F [V/m].
    temperature : array_like
        Temperature T [K].

    Returns
    -------
    ndarray
        Factor on the generation current, at least 1.
    """
    thermal = BOLTZMANN * _float(temperature)
    mass, hbar = 0.25 * ELECTRON_MASS, PLANCK / (2 * np.pi)
    unit = np.sqrt(24 * mass * thermal) * thermal / (ELEMENTARY_CHARGE * hbar)
    ratio = np.abs(_float(field)) / unit
    enhancement: Floats = (1 + 2 * np.sqrt(3 * np.pi) * ratio * np.exp(ratio**2))[()]
    return enhancement


def depletion_split(
    width: ArrayLike, donors: ArrayLike, acceptors: ArrayLike
) -> tuple[Floats, Floats]:
    """Return the widths x_n, x_p of a depletion region on either side of an abrupt junction [2].

    The charges are equal, N_d x_n = N_a x_p, and x_n + x_p is the width.

    Parameters
    ----------
    width : array_like
        Width of the depletion region [m].
    donors, acceptors : array_like
        Concentrations N_d, N_a [1/m3], positive.

    Returns
    -------
    x_n, x_p : ndarray
        Widths on the n and on the p side [m].
    """
    w, n_d, n_a = _float(width), _float(donors), _float(acceptors)
    return (w / (1 + n_d / n_a))[()], (w / (1 + n_a / n_d))[()]


def capacitance(
    zero_bias: ArrayLike, bias: ArrayLike, built_in: ArrayLike, grading: ArrayLike
) -> Floats:
    """Return the capacitance of a reverse-biased junction, C_j0 (1 + V / phi)^-m [3].

    Parameters
    ----------
    zero_bias : array_like
        Capacitance C_j0 without bias, in any unit: per area, per length or whole.
    bias : array_like
        Reverse bias V [V], above -phi.
    built_in : array_like
        Built-in potential phi [V], positive.
    grading : array_like
        Grading coefficient m [dimensionless]: 1/2 for an abrupt junction, 1/3 for a linearly
        graded one.

    Returns
    -------
    ndarray
        Capacitance in the unit of `zero_bias`.

    Raises
    ------
    ValueError
        A bias not above -phi, or a potential that is not positive.
    """
    v, phi = _checked_bias(bias, built_in)
    return (_float(zero_bias) * (1 + v / phi) ** -_float(grading))[()]


def mean_capacitance(
    zero_bias: ArrayLike, low: ArrayLike, high: ArrayLike, built_in: ArrayLike, grading: ArrayLike
) -> Floats:
    """Return the mean of `capacitance` over a range of reverse bias.

    The integral of (1 + V / phi)^-m in closed form. With d = (high - low) / (phi + low) and
    s = ln(1 + d) the mean is C(low) (s / d) (e^((1 - m) s) - 1) / ((1 - m) s): no digits are lost
    for narrow ranges or m near 1, where the quotients go to 1.

    Parameters
    ----------
    zero_bias : array_like
        Capacitance C_j0 without bias, in any unit: per area, per length or whole.
    low, high : array_like
        Range of reverse bias [V], above -phi, low <= high.
    built_in : array_like
        Built-in potential phi [V], positive.
    grading : array_like
        Grading coefficient m [dimensionless].

    Returns
    -------
    ndarray
        Mean capacitance in the unit of `zero_bias`.

    Raises
    ------
    ValueError
        A range that falls or does not lie above -phi, or a potential that is not positive.
    """
    v, phi = _checked_bias(low, built_in)
    width = _float(high) - v
    if not (width >= 0).all():
        raise ValueError("a range of bias must not fall")
    d = width / (phi + v)
    s = np.log1p(d)
    shape = _quotient(s, d) * _quotient(
        np.expm1((1 - _float(grading)) * s), (1 - _float(grading)) * s
    )
    return (capacitance(zero_bias, v, phi, grading) * shape)[()]


def _checked_bias(bias: ArrayLike, built_in: ArrayLike) -> tuple[Floats, Floats]:
    """Return bias and built-in potential as arrays; ValueError where the formulas do not hold."""
    v, phi = _float(bias), _float(built_in)
    if not (phi > 0).all():
        raise ValueError("a built-in potential must be positive")
    if not (v > -phi).all():
        raise ValueError("a forward bias must stay below the built-in potential")
    return v, phi


def _quotient(above: Floats, below: Floats) -> Floats:
    """Return above / below, 1 where both vanish."""
    return np.where(below != 0, above / np.where(below != 0, below, 1), 1.0)
