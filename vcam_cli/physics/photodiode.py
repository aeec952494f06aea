"""A photodiode from its process: quantum efficiency, dark current, capacitance, size.

Depths are counted from the surface of the silicon: x1 the upper edge of the depletion region, x2
its lower edge, x3 the depth at which electrons are lost to the bottom.

References
----------
[1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University,
    2003, section 2.2.2.
[2] S. M. Sze, K. K. Ng, "Physics of Semiconductor Devices", 3rd edition, Wiley, 2007, sections 2.2
    and 2.3. doi:10.1002/0470068329
[3] R. S. Muller, T. I. Kamins, M. Chan, "Device Electronics for Integrated Circuits", 3rd edition,
    Wiley, 2003, section 4.3 (capacitance of a graded junction).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.physics.readout import ELEMENTARY_CHARGE
from vcam_cli.physics.silicon import PERMITTIVITY

Floats = NDArray[np.float64]

# (-1)^(n + 1) / (n + 1)!: the next term after these 18 is below 1e-17 at t = 1.
_PSI = tuple((-1) ** (n + 1) / math.factorial(n + 1) for n in range(1, 19))


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


def quantum_efficiency(
    absorption: ArrayLike, x1: ArrayLike, x2: ArrayLike, x3: ArrayLike
) -> Floats:
    """Internal quantum efficiency of an n-diffusion or n-well in a p-substrate, eq 2.30 of [1].

    Carriers born between x1 and x2 are all collected; above, at depth x, a part x / x1 (the rest
    recombines at the surface); below, a part (x3 - x) / (x3 - x2):

        eta = (1/a) [ (1 - e^(-a x1)) / x1 - (e^(-a x2) - e^(-a x3)) / (x3 - x2) ]

    Parameters
    ----------
    absorption : a [1/m], not negative
    x1, x2, x3 : depths [m], 0 <= x1 <= x2 <= x3; ValueError otherwise. All four broadcast.

    Returns
    -------
    electrons per photon that enters the silicon, in 0..1. As printed it cancels for small a and for
    x3 near x2; here the relative error stays below 1e-14, limits included.
    """
    a, x1, x2, x3 = _depths(absorption, x1, x2, x3)
    shallow = -np.expm1(-a * x2) - _psi(a * x1)
    deep = _phi(a * x1) - np.exp(-a * x2)
    return (np.where(a * x1 < 1, shallow, deep) + _from_below(a, x2, x3))[()]


def quantum_efficiency_pinned(
    absorption: ArrayLike, x1: ArrayLike, x2: ArrayLike, x3: ArrayLike
) -> Floats:
    """Internal quantum efficiency of a pinned photodiode: eq 2.30 of [1] with a lost surface layer.

    Carriers born in the pinning layer, above x1, recombine there; the rest is as in
    `quantum_efficiency`:

        eta = e^(-a x1) - (e^(-a x2) - e^(-a x3)) / (a (x3 - x2))

    Parameters, errors and result as of `quantum_efficiency`; never more than that.
    """
    a, x1, x2, x3 = _depths(absorption, x1, x2, x3)
    return (-np.exp(-a * x1) * np.expm1(-a * (x2 - x1)) + _from_below(a, x2, x3))[()]


def quantum_efficiency_photogate(
    absorption: ArrayLike, film: ArrayLike, x2: ArrayLike, x3: ArrayLike
) -> Floats:
    """Internal quantum efficiency of a photogate: a film absorbs first, and there is no n region.

    eta = e^(-a d) [1 - (e^(-a x2) - e^(-a x3)) / (a (x3 - x2))]: eq 2.30 of [1] for x1 -> 0, behind
    a gate of polysilicon, taken to absorb as crystalline silicon does.

    Parameters
    ----------
    absorption : a [1/m], not negative
    film : thickness d of the gate [m], not negative
    x2, x3 : depths [m] below the gate, 0 <= x2 <= x3; ValueError otherwise. All four broadcast.
    """
    gate = _float(film)
    if not (gate >= 0).all():
        raise ValueError("the thickness of a gate cannot be negative")
    a = _float(absorption)
    return (np.exp(-a * gate) * quantum_efficiency_pinned(a, 0.0, x2, x3))[()]


def _depths(*given: ArrayLike) -> list[Floats]:
    """The absorption and depths x1 <= x2 <= x3 as arrays of one shape."""
    a, x1, x2, x3 = np.broadcast_arrays(*(_float(value) for value in given))
    if not (a >= 0).all():
        raise ValueError("an absorption coefficient cannot be negative")
    if not ((x1 >= 0) & (x1 <= x2) & (x2 <= x3)).all():
        raise ValueError("depths must rise: 0 <= x1 <= x2 <= x3")
    return [a, x1, x2, x3]


def _from_below(a: Floats, x2: Floats, x3: Floats) -> Floats:
    """Electrons per photon that are born in the neutral region and collected."""
    return np.asarray(np.exp(-a * x2) * _psi(a * (x3 - x2)))


def _phi(t: Floats) -> Floats:
    """(1 - e^-t) / t, which is 1 at 0."""
    return np.where(t > 0, -np.expm1(-t) / np.where(t > 0, t, 1), 1.0)


def _psi(t: Floats) -> Floats:
    """1 - (1 - e^-t) / t, by its series below 1, where the difference would cancel."""
    small = np.minimum(t, 1.0)
    series = np.zeros_like(small)
    for coefficient in reversed(_PSI):
        series = small * (coefficient + series)
    return np.where(t < 1, series, 1 - _phi(t))


def dark_current_density(
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
) -> Floats:
    """Dark current density of a junction, eq 2.31 of [1] [A/m2].

    Diffusion from the two neutral regions, and generation in the depletion region:

        j = q D_p n_i^2 / (N_d x1) + q D_n n_i^2 / (N_a (x3 - x2))
            + (q n_i / 2) (x_n / tau_p + x_p / tau_n)

    Parameters
    ----------
    intrinsic : carrier concentration n_i [1/m3] (see `silicon.intrinsic_concentration`)
    hole_diffusivity, electron_diffusivity : D_p, D_n [m2/s]
    donors, acceptors : concentrations N_d, N_a [1/m3], positive
    surface_width, neutral_width : of the neutral n and p regions, x1 and x3 - x2 [m], positive
    x_n, x_p : parts of the depletion region on either side of the junction [m]
    hole_lifetime, electron_lifetime : tau_p, tau_n [s], positive

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
    # n_i once outside: its square underflows in deep cold, where generation alone is left.
    return (ELEMENTARY_CHARGE * n_i * (n_i * (holes + electrons) + generation))[()]


def depletion_width(capacitance_per_area: ArrayLike) -> Floats:
    """Width of a depletion region [m] from its capacitance [F/m2], positive: eps / C, [2]."""
    return (PERMITTIVITY / _float(capacitance_per_area))[()]


def depletion_split(
    width: ArrayLike, donors: ArrayLike, acceptors: ArrayLike
) -> tuple[Floats, Floats]:
    """Parts x_n, x_p of a depletion region [m] on either side of an abrupt junction, [2].

    The charges are equal, N_d x_n = N_a x_p, and x_n + x_p is the width.

    Parameters
    ----------
    width : [m]
    donors, acceptors : concentrations N_d, N_a [1/m3], positive
    """
    w, n_d, n_a = _float(width), _float(donors), _float(acceptors)
    return (w / (1 + n_d / n_a))[()], (w / (1 + n_a / n_d))[()]


def junction_capacitance(
    zero_bias: ArrayLike, bias: ArrayLike, built_in: ArrayLike, grading: ArrayLike
) -> Floats:
    """Capacitance of a reverse-biased junction, C_j0 (1 + V / phi)^-m, [3].

    Parameters
    ----------
    zero_bias : C_j0, in any unit of capacitance, per area, per length or whole
    bias : reverse bias V [V], above -phi; ValueError otherwise
    built_in : potential phi [V], positive; ValueError otherwise
    grading : coefficient m, 1/2 for an abrupt junction, 1/3 for a linearly graded one

    Returns
    -------
    In the unit of zero_bias
    """
    v, phi = _bias(bias, built_in)
    return (_float(zero_bias) * (1 + v / phi) ** -_float(grading))[()]


def mean_junction_capacitance(
    zero_bias: ArrayLike, low: ArrayLike, high: ArrayLike, built_in: ArrayLike, grading: ArrayLike
) -> Floats:
    """Mean of `junction_capacitance` over a range of reverse bias.

    The integral of (1 + V / phi)^-m in closed form. With d = (high - low) / (phi + low) and
    s = ln(1 + d) the mean is C(low) (s / d) (e^((1 - m) s) - 1) / ((1 - m) s): no digits are lost
    for narrow ranges or m near 1, where the quotients go to 1.

    Parameters
    ----------
    zero_bias, built_in, grading : as of `junction_capacitance`
    low, high : the range [V], above -phi, low <= high; ValueError otherwise

    Returns
    -------
    In the unit of zero_bias
    """
    v, phi = _bias(low, built_in)
    width = _float(high) - v
    if not (width >= 0).all():
        raise ValueError("a range of bias must not fall")
    d = width / (phi + v)
    s = np.log1p(d)
    shape = _quotient(s, d) * _quotient(
        np.expm1((1 - _float(grading)) * s), (1 - _float(grading)) * s
    )
    return (junction_capacitance(zero_bias, v, phi, grading) * shape)[()]


def _bias(bias: ArrayLike, built_in: ArrayLike) -> tuple[Floats, Floats]:
    v, phi = _float(bias), _float(built_in)
    if not (phi > 0).all():
        raise ValueError("a built-in potential must be positive")
    if not (v > -phi).all():
        raise ValueError("a forward bias must stay below the built-in potential")
    return v, phi


def _quotient(above: Floats, below: Floats) -> Floats:
    """above / below, 1 where both vanish."""
    return np.where(below != 0, above / np.where(below != 0, below, 1), 1.0)


def detector_area(
    width: ArrayLike,
    height: ArrayLike,
    feature_size: ArrayLike,
    border: ArrayLike,
    transistors: ArrayLike,
) -> Floats:
    """Area of a pixel that is left for its photodetector [m2], 0 where nothing is left.

    (w - b L) (h - b L) - t L^2: spacing takes a border, the transistors an area.

    Parameters
    ----------
    width, height : of the pixel, w and h [m]
    feature_size : of the process, L [m]
    border : b, width that spacing takes in all, in feature sizes
    transistors : t, area of the transistors, in squared feature sizes
    """
    inner_width, inner_height = _inner(width, height, feature_size, border)
    taken = _float(transistors) * _float(feature_size) ** 2
    return np.maximum(inner_width * inner_height - taken, 0.0)[()]


def detector_perimeter(
    width: ArrayLike, height: ArrayLike, feature_size: ArrayLike, border: ArrayLike
) -> Floats:
    """Perimeter of the photodetector that `detector_area` leaves [m]: 2 (w - b L) + 2 (h - b L).

    The transistors take a corner, which leaves the perimeter as it is. Parameters as there.
    """
    inner_width, inner_height = _inner(width, height, feature_size, border)
    return (2 * (inner_width + inner_height))[()]


def _inner(
    width: ArrayLike, height: ArrayLike, feature_size: ArrayLike, border: ArrayLike
) -> tuple[Floats, Floats]:
    lost = _float(border) * _float(feature_size)
    return np.maximum(_float(width) - lost, 0.0), np.maximum(_float(height) - lost, 0.0)


def smallest_square_pixel(
    feature_size: ArrayLike, border: ArrayLike, transistors: ArrayLike
) -> Floats:
    """Width of a square pixel [m] up to which `detector_area` leaves nothing: L (b + sqrt(t))."""
    return (_float(feature_size) * (_float(border) + np.sqrt(_float(transistors))))[()]
