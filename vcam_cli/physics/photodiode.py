"""A photodiode from its process: quantum efficiency and size.

Depths are counted from the surface of the silicon: x1 the upper edge of the depletion region, x2
its lower edge, x3 the depth at which electrons are lost to the bottom.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.2.2.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

# (-1)^(n + 1) / (n + 1)!: the next term after these 18 is below 1e-17 at t = 1.
_PSI = tuple((-1) ** (n + 1) / math.factorial(n + 1) for n in range(1, 19))


def _float(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)


def quantum_efficiency(
    absorption: ArrayLike, x1: ArrayLike, x2: ArrayLike, x3: ArrayLike
) -> Floats:
    """Return the internal quantum efficiency of an n-diffusion or n-well, eq 2.30 of [1].

    Carriers born between x1 and x2 are all collected; above, at depth x, a part x / x1 (the rest
    recombines at the surface); below, a part (x3 - x) / (x3 - x2):

        eta = (1/a) [ (1 - e^(-a x1)) / x1 - (e^(-a x2) - e^(-a x3)) / (x3 - x2) ]

    As printed that cancels for small a and for x3 near x2; here the relative error stays below
    1e-14, limits included.

    Parameters
    ----------
    absorption : array_like
        Absorption coefficient a [1/m], not negative.
    x1, x2, x3 : array_like
        Depths [m], 0 <= x1 <= x2 <= x3. All four broadcast.

    Returns
    -------
    ndarray
        Electrons per photon that enters the silicon [dimensionless], in 0..1.

    Raises
    ------
    ValueError
        A negative absorption, or depths that do not rise.
    """
    a, x1, x2, x3 = _checked_depths(absorption, x1, x2, x3)
    shallow = -np.expm1(-a * x2) - _psi(a * x1)
    deep = _phi(a * x1) - np.exp(-a * x2)
    return (np.where(a * x1 < 1, shallow, deep) + _neutral_region_efficiency(a, x2, x3))[()]


def collected_parts(
    absorption: ArrayLike, x1: ArrayLike, x2: ArrayLike, x3: ArrayLike
) -> tuple[Floats, Floats, Floats]:
    """Return the three terms of eq 2.30 of [1], by the region where the charge is born.

    Parameters
    ----------
    absorption, x1, x2, x3
        As those of `quantum_efficiency`.

    Returns
    -------
    n_region, depletion_region, p_region : ndarray
        Electrons per photon that enters the silicon; they add up to `quantum_efficiency`.

    Raises
    ------
    ValueError
        A negative absorption, or depths that do not rise.
    """
    a, x1, x2, x3 = _checked_depths(absorption, x1, x2, x3)
    above = -np.expm1(-a * x1) - _psi(a * x1)
    within = -np.exp(-a * x1) * np.expm1(-a * (x2 - x1))
    return above[()], within[()], _neutral_region_efficiency(a, x2, x3)[()]


def quantum_efficiency_pinned(
    absorption: ArrayLike, x1: ArrayLike, x2: ArrayLike, x3: ArrayLike
) -> Floats:
    """Return the internal quantum efficiency of a pinned photodiode, after eq 2.30 of [1].

    Carriers born in the pinning layer, above x1, recombine there; the rest is as in
    `quantum_efficiency`:

        eta = e^(-a x1) - (e^(-a x2) - e^(-a x3)) / (a (x3 - x2))

    Parameters
    ----------
    absorption, x1, x2, x3
        As those of `quantum_efficiency`.

    Returns
    -------
    ndarray
        Electrons per photon that enters the silicon [dimensionless], in 0..1; never more than
        without the pinning layer.

    Raises
    ------
    ValueError
        A negative absorption, or depths that do not rise.
    """
    a, x1, x2, x3 = _checked_depths(absorption, x1, x2, x3)
    return (-np.exp(-a * x1) * np.expm1(-a * (x2 - x1)) + _neutral_region_efficiency(a, x2, x3))[()]


def quantum_efficiency_photogate(
    absorption: ArrayLike, film: ArrayLike, x2: ArrayLike, x3: ArrayLike
) -> Floats:
    """Return the internal quantum efficiency of a photogate: a film absorbs first.

    eta = e^(-a d) [1 - (e^(-a x2) - e^(-a x3)) / (a (x3 - x2))]: eq 2.30 of [1] for x1 -> 0, behind
    a gate of polysilicon, taken to absorb as crystalline silicon does; there is no n region.

    Parameters
    ----------
    absorption : array_like
        Absorption coefficient a [1/m], not negative.
    film : array_like
        Thickness d of the gate [m], not negative.
    x2, x3 : array_like
        Depths below the gate [m], 0 <= x2 <= x3. All four broadcast.

    Returns
    -------
    ndarray
        Electrons per photon that enters the gate [dimensionless], in 0..1.

    Raises
    ------
    ValueError
        A negative absorption or thickness, or depths that do not rise.
    """
    gate = _float(film)
    if not (gate >= 0).all():
        raise ValueError("the thickness of a gate cannot be negative")
    a = _float(absorption)
    return (np.exp(-a * gate) * quantum_efficiency_pinned(a, 0.0, x2, x3))[()]


def _checked_depths(*given: ArrayLike) -> list[Floats]:
    """Return the absorption and depths x1 <= x2 <= x3 as arrays of one shape."""
    a, x1, x2, x3 = np.broadcast_arrays(*(_float(value) for value in given))
    if not (a >= 0).all():
        raise ValueError("an absorption coefficient cannot be negative")
    if not ((x1 >= 0) & (x1 <= x2) & (x2 <= x3)).all():
        raise ValueError("depths must rise: 0 <= x1 <= x2 <= x3")
    return [a, x1, x2, x3]


def _neutral_region_efficiency(a: Floats, x2: Floats, x3: Floats) -> Floats:
    """Return the electrons per photon that are born in the neutral region and collected."""
    return np.asarray(np.exp(-a * x2) * _psi(a * (x3 - x2)))


def _phi(t: Floats) -> Floats:
    """Return (1 - e^-t) / t, which is 1 at 0."""
    return np.where(t > 0, -np.expm1(-t) / np.where(t > 0, t, 1), 1.0)


def _psi(t: Floats) -> Floats:
    """Return 1 - (1 - e^-t) / t, by its series below 1, where the difference would cancel."""
    small = np.minimum(t, 1.0)
    series = np.zeros_like(small)
    for coefficient in reversed(_PSI):
        series = small * (coefficient + series)
    return np.where(t < 1, series, 1 - _phi(t))


def detector_area(
    width: ArrayLike,
    height: ArrayLike,
    feature_size: ArrayLike,
    border: ArrayLike,
    transistors: ArrayLike,
) -> Floats:
    """Return the area of a pixel that is left for its photodetector, (w - b L) (h - b L) - t L^2.

    Spacing takes a border, the transistors an area.

    Parameters
    ----------
    width, height : array_like
        Sides of the pixel w and h [m].
    feature_size : array_like
        Feature size of the process L [m].
    border : array_like
        Width b that spacing takes in all [feature sizes].
    transistors : array_like
        Area t of the transistors [squared feature sizes].

    Returns
    -------
    ndarray
        Area of the photodetector [m2], 0 where nothing is left.
    """
    inner_width, inner_height = _net_size(width, height, feature_size, border)
    taken = _float(transistors) * _float(feature_size) ** 2
    return np.maximum(inner_width * inner_height - taken, 0.0)[()]


def detector_perimeter(
    width: ArrayLike, height: ArrayLike, feature_size: ArrayLike, border: ArrayLike
) -> Floats:
    """Return the perimeter of the photodetector, 2 (w - b L) + 2 (h - b L).

    The transistors take a corner, which leaves the perimeter as it is.

    Parameters
    ----------
    width, height : array_like
        Sides of the pixel w and h [m].
    feature_size : array_like
        Feature size of the process L [m].
    border : array_like
        Width b that spacing takes in all [feature sizes].

    Returns
    -------
    ndarray
        Perimeter [m].
    """
    inner_width, inner_height = _net_size(width, height, feature_size, border)
    return (2 * (inner_width + inner_height))[()]


def _net_size(
    width: ArrayLike, height: ArrayLike, feature_size: ArrayLike, border: ArrayLike
) -> tuple[Floats, Floats]:
    """Return width and height of a pixel without its border [m]."""
    lost = _float(border) * _float(feature_size)
    return np.maximum(_float(width) - lost, 0.0), np.maximum(_float(height) - lost, 0.0)


def smallest_square_pixel(
    feature_size: ArrayLike, border: ArrayLike, transistors: ArrayLike
) -> Floats:
    """Return the width of a square pixel up to which no photodetector fits, L (b + sqrt(t)).

    Parameters
    ----------
    feature_size : array_like
        Feature size of the process L [m].
    border : array_like
        Width b that spacing takes in all [feature sizes].
    transistors : array_like
        Area t of the transistors [squared feature sizes].

    Returns
    -------
    ndarray
        Width of the pixel [m].
    """
    return (_float(feature_size) * (_float(border) + np.sqrt(_float(transistors))))[()]
