"""Silicon: absorption of light, diffusion of charge, intrinsic carrier concentration.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.2.2.
.. [2] M. A. Green, "Self-consistent optical parameters of intrinsic silicon at 300 K including
   temperature coefficients", Solar Energy Materials and Solar Cells 92, 1305-1310, 2008,
   doi:10.1016/j.solmat.2008.06.009.
.. [3] K. Misiakos, D. Tsamakis, "Accurate measurements of the silicon intrinsic carrier density
   from 78 to 340 K", Journal of Applied Physics 74, 3293-3297, 1993, doi:10.1063/1.354551.
.. [4] D. H. Seib, "Carrier diffusion degradation of modulation transfer function in charge
   coupled imagers", IEEE Transactions on Electron Devices 21, 210-217, 1974.
.. [5] A. B. Sproul, M. A. Green, "Improved value for the silicon intrinsic carrier concentration
   from 275 to 375 K", Journal of Applied Physics 70, 846-854, 1991, doi:10.1063/1.349645.
.. [6] J. R. Janesick, "Scientific Charge-Coupled Devices", SPIE Press, 2001, section 7.1.1: dark
   current over temperature, with Varshni's band gap.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.spectra import Table, silicon_absorption

Floats = NDArray[np.float64]

PERMITTIVITY = 11.7 * 8.8541878128e-12
"""Permittivity of silicon [F/m]: relative permittivity x that of vacuum (CODATA 2018)."""
ABSORPTION_RANGE = (350e-9, 1100e-9)
"""Wavelengths for which the absorption is tabulated [m]."""
BOLTZMANN_EV = 8.617333262e-5
"""Boltzmann's constant [eV/K] (CODATA 2018)."""
TEMPERATURES = (77.0, 400.0)
"""Temperatures for which the intrinsic concentration holds [K]."""

# Below this product of depth and 1 / length an integral is smooth enough for Gauss's rule, and the
# closed form loses digits. 12 points: exp(-2 t) sinh(2 (1 - t)) is integrated to 1e-19.
_THIN_LAYER = 2.0


@cache
def _gauss() -> tuple[Floats, Floats]:
    """Return nodes and weights on 0 to 1; most commands need none."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    return (nodes + 1) / 2, weights / 2


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


@cache
def _log_absorption() -> Table:
    table = silicon_absorption()
    return Table(table.wavelength, np.log(table.value), table.outside)


def absorption(wavelength: ArrayLike) -> Floats:
    """Return the absorption coefficient of crystalline silicon at 300 K [2].

    Between the table's wavelengths, 10 nm apart, its logarithm is a straight line.

    Parameters
    ----------
    wavelength : array_like
        Wavelength [m], within `ABSORPTION_RANGE`.

    Returns
    -------
    ndarray
        Absorption coefficient [1/m].

    Raises
    ------
    ValueError
        A wavelength outside the range.
    """
    asked = _float(wavelength)
    low, high = ABSORPTION_RANGE
    table = _log_absorption()
    if asked.size and not table.covers(float(asked.min()), float(asked.max())):
        raise ValueError(
            f"silicon's absorption is known from {low * 1e9:.0f} to {high * 1e9:.0f} nm, not at "
            f"{float(asked.min()) * 1e9:.6g} to {float(asked.max()) * 1e9:.6g} nm"
        )
    return np.exp(table.evaluate(asked))[()]


def band_gap(temperature: ArrayLike) -> Floats:
    """Return the band gap of silicon [6].

    Parameters
    ----------
    temperature : array_like
        Temperature [K].

    Returns
    -------
    ndarray
        Band gap [eV].
    """
    kelvin = _float(temperature)
    return (1.1557 - 7.021e-4 * kelvin**2 / (1108 + kelvin))[()]


def dark_current_ratio(temperature: ArrayLike, reference: ArrayLike) -> Floats:
    """Return the dark current at a temperature over that at another one [6].

    Generation in the depletion region: T^1.5 exp(-E_g / (2 k T)).

    Parameters
    ----------
    temperature, reference : array_like
        Temperatures [K], above 0.

    Returns
    -------
    ndarray
        Ratio [dimensionless].
    """
    warm, cold = _float(temperature), _float(reference)
    exponent = band_gap(cold) / cold - band_gap(warm) / warm
    return ((warm / cold) ** 1.5 * np.exp(exponent / (2 * BOLTZMANN_EV)))[()]


def intrinsic_concentration(temperature: ArrayLike) -> Floats:
    """Return the intrinsic carrier concentration of silicon [3].

    n_i = 5.29e19 (T / 300)^2.54 exp(-6726 / T) 1/cm3, measured from 78 to 340 K. It is 1 to 3.5 %
    below the model of [5] from 275 to 400 K.

    Parameters
    ----------
    temperature : array_like
        Temperature T [K], within `TEMPERATURES`.

    Returns
    -------
    ndarray
        Concentration n_i [1/m3].

    Raises
    ------
    ValueError
        A temperature outside the range.
    """
    t = _float(temperature)
    low, high = TEMPERATURES
    if not ((t >= low) & (t <= high)).all():
        raise ValueError(f"the intrinsic concentration is known from {low:g} to {high:g} K")
    return (5.29e25 * (t / 300) ** 2.54 * np.exp(-6726 / t))[()]


def collection_efficiency(
    frequency: ArrayLike,
    absorption: ArrayLike,
    diffusion_length: ArrayLike,
    depletion_width: ArrayLike,
    neutral_depth: ArrayLike,
) -> Floats:
    """Return the electrons collected per photon of a sinusoid, D(f) of eq 2.28 in [1], [4].

    All that is absorbed in the depletion region is collected; what is absorbed in the neutral
    region below it diffuses, and is lost where it recombines or reaches the bottom:

        D = 1 - e^(-a L) + e^(-a L) integral_0^L_d a e^(-a z) sinh((L_d - z) / L_f) dz
                           / sinh(L_d / L_f),       1 / L_f^2 = 1 / L_n^2 + (2 pi f)^2

    The thesis prints its closed form with L and L_d exchanged against its own prose; it is singular
    at a L_f = 1, overflows for L_d >> L_f and cancels for small a. None of this holds here: the
    relative error is below 1e-14 wherever the inputs are finite.

    Parameters
    ----------
    frequency : array_like
        Spatial frequency f [cycles/m], of either sign.
    absorption : array_like
        Absorption coefficient a [1/m], not negative.
    diffusion_length : array_like
        Diffusion length of electrons in the neutral region L_n [m], positive; may be infinite.
    depletion_width : array_like
        Depth L of the depletion region [m], not negative.
    neutral_depth : array_like
        Depth L_d of the neutral region [m], not negative. All five broadcast.

    Returns
    -------
    ndarray
        Electrons per photon [dimensionless], in 0..1.

    Raises
    ------
    ValueError
        A diffusion length that is not positive, a negative depth or absorption.
    """
    lengths = (_float(depletion_width), _float(neutral_depth), _float(absorption))
    if not (_float(diffusion_length) > 0).all() or not all((x >= 0).all() for x in lengths):
        raise ValueError("silicon needs a positive diffusion length, and no negative depths")
    inverse = np.hypot(1 / _float(diffusion_length), 2 * np.pi * _float(frequency))  # 1 / L_f
    depleted, neutral, a, k = np.broadcast_arrays(*lengths, inverse)
    thin = (k * neutral < _THIN_LAYER) & (a * neutral < _THIN_LAYER)
    below = np.empty(thin.shape)
    below[thin] = _neutral_region_by_quadrature(a[thin], k[thin], neutral[thin])
    below[~thin] = _neutral_region_closed_form(a[~thin], k[~thin], neutral[~thin])
    collected: Floats = (-np.expm1(-a * depleted) + np.exp(-a * depleted) * below)[()]
    return collected


def _neutral_region_by_quadrature(a: Floats, k: Floats, depth: Floats) -> Floats:
    """Return the part of the light entering the neutral region that is collected, by quadrature."""
    r, t = (k * depth)[:, None], (a * depth)[:, None]
    r = np.maximum(r, 1e-150)  # where nothing recombines the ratio is 1 - node
    nodes, weights = _gauss()
    values = np.exp(-t * nodes) * np.sinh(r * (1 - nodes)) / np.sinh(r)
    return np.asarray(t[:, 0] * (values @ weights))


def _neutral_region_closed_form(a: Floats, k: Floats, depth: Floats) -> Floats:
    """Return the same part in closed form: a / (a + k) less what the bottom takes.

    a (1 - e^-r 2 r e^-min(r, t) w / (1 - e^-2r)) / (a + k), where r = L_d / L_f, t = a L_d,
    w = (1 - e^-|r - t|) / |r - t|, which is 1 at r = t.
    """
    r, t = np.minimum(k * depth, 1e3), a * depth  # e^-1000 is zero
    gap = np.abs(r - t)
    w = np.where(gap > 0, -np.expm1(-gap) / np.where(gap > 0, gap, 1), 1.0)
    twice = np.where(r > 0, 2 * r / -np.expm1(-2 * np.where(r > 0, r, 1)), 1.0)
    return np.asarray(a / (a + k) * (1 - twice * np.exp(-(r + np.minimum(r, t))) * w))


def diffusion_mtf(
    frequency: ArrayLike,
    absorption: ArrayLike,
    diffusion_length: ArrayLike,
    depletion_width: ArrayLike,
    neutral_depth: ArrayLike,
) -> Floats:
    """Return the modulation transfer function of charge diffusion, D(f) / D(0), eq 2.27 of [1].

    Parameters
    ----------
    frequency, absorption, diffusion_length, depletion_width, neutral_depth
        As those of `collection_efficiency`; the absorption is positive.

    Returns
    -------
    ndarray
        MTF in 0..1 [dimensionless]; 1 at frequency 0, and at high frequency the part of what is
        collected that was absorbed in the depletion region.

    Raises
    ------
    ValueError
        A diffusion length that is not positive, a negative depth or absorption.
    """
    silicon = (absorption, diffusion_length, depletion_width, neutral_depth)
    ratio = collection_efficiency(frequency, *silicon) / collection_efficiency(0.0, *silicon)
    return np.where(_float(frequency) == 0, 1.0, np.minimum(ratio, 1.0))[()]  # roundings aside
