"""Wavefronts of a lens as sums of Zernike polynomials.

Pupil coordinates: x to the right and y down as on the sensor, in radii of the pupil, so that the
pupil is the unit disk; rho and theta are its polar coordinates, theta from x towards y. A
wavefront W [m] is what a ray's optical path is longer than that of the ideal spherical wave: the
pupil function is exp(+2 pi i W / wavelength). A ray lands 2 N_w grad W beside the ideal image
point, N_w = N (1 - m): a positive coefficient of Z_2 moves the image to the right by
4 N_w c, one of Z_3 down.

References
----------
.. [1] R. J. Noll, "Zernike polynomials and atmospheric turbulence", Journal of the Optical
   Society of America 66, 207-211, 1976, doi:10.1364/JOSA.66.000207.
.. [2] W. T. Welford, "Aberrations of Optical Systems", Adam Hilger, 1986, section 7.2 (wavefront
   and transverse ray aberrations).
.. [3] V. N. Mahajan, "Strehl ratio for primary aberrations in terms of their aberration
   variance", Journal of the Optical Society of America 73, 860-861, 1983,
   doi:10.1364/JOSA.73.000860.
"""

import math
from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Terms = tuple[tuple[int, float], ...]
"""Noll index and coefficient [m] of each polynomial of a wavefront."""

PISTON, TILT_X, TILT_Y, DEFOCUS = 1, 2, 3, 4


def noll_orders(index: int) -> tuple[int, int]:
    """Return the radial and the azimuthal order of a Noll index [1].

    Parameters
    ----------
    index : int
        Noll's index j, from 1.

    Returns
    -------
    n, m : int
        Radial order, and azimuthal order; m < 0 for the sine terms.

    Raises
    ------
    ValueError
        An index below 1.
    """
    if index < 1:
        raise ValueError(f"{index} is no Noll index; the first is 1")
    n = (math.isqrt(8 * index - 7) - 1) // 2
    place = index - n * (n + 1) // 2  # 1 .. n + 1 among those of order n
    m = 2 * (place // 2) if n % 2 == 0 else 2 * ((place - 1) // 2) + 1
    return n, m if index % 2 == 0 else -m


def polynomial(index: int, rho: ArrayLike, theta: ArrayLike) -> Floats:
    """Return the Zernike polynomial Z_j [1]: orthonormal, its rms over the pupil is 1.

    Parameters
    ----------
    index : int
        Noll's index j, from 1.
    rho : array_like
        Radius [pupil radii].
    theta : array_like
        Angle from x towards y [rad]. Both broadcast.

    Returns
    -------
    ndarray
        Z_j [dimensionless].
    """
    n, m = noll_orders(index)
    radius = np.asarray(rho, dtype=np.float64)
    return (_norm(n, m) * _radial(n, abs(m), radius) * _azimuthal(m, np.asarray(theta)))[()]


def wavefront(terms: Terms, x: ArrayLike, y: ArrayLike) -> Floats:
    """Return a wavefront at places in the pupil.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.
    x, y : array_like
        Pupil coordinates [pupil radii]; they broadcast.

    Returns
    -------
    ndarray
        W [m].
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    rho, theta = np.hypot(x, y), np.arctan2(y, x)
    total = np.zeros(rho.shape)
    for index, coefficient in terms:
        total = total + coefficient * polynomial(index, rho, theta)
    return total[()]


def gradient(terms: Terms, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
    """Return the slope of a wavefront at places in the pupil.

    A ray from there lands 2 N_w times this beside the ideal image point [m], [2].

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.
    x, y : array_like
        Pupil coordinates [pupil radii]; they broadcast.

    Returns
    -------
    slope_x, slope_y : ndarray
        dW/dx and dW/dy [m per pupil radius].
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    rho, theta = np.hypot(x, y), np.arctan2(y, x)
    along, around = np.zeros(rho.shape), np.zeros(rho.shape)
    for index, coefficient in terms:
        n, m = noll_orders(index)
        scale, k = coefficient * _norm(n, m), abs(m)
        along = along + scale * _radial_slope(n, k, rho) * _azimuthal(m, theta)
        if m:
            turned = np.cos(k * theta) if m < 0 else -np.sin(k * theta)
            around = around + scale * k * _radial_over_rho(n, k, rho) * turned
    cos, sin = np.cos(theta), np.sin(theta)
    return (along * cos - around * sin)[()], (along * sin + around * cos)[()]


def defocus(shift: float, working_f_number: float) -> Terms:
    """Return the wavefront of a shifted image plane, W = shift / (8 N_w^2) rho^2.

    The constant part is left out. Paraxial, as the cut-off 1 / (wavelength N_w) is.

    Parameters
    ----------
    shift : float
        Shift of the image plane [m]; positive away from the lens, so that the sensor lies in front
        of the focus.
    working_f_number : float
        Working f-number N_w = N (1 - m) [dimensionless].

    Returns
    -------
    Terms
        Noll indices and coefficients [m].
    """
    edge = shift / (8 * working_f_number**2)
    return ((DEFOCUS, edge / (2 * math.sqrt(3))),) if edge else ()


def combine(*parts: Terms) -> Terms:
    """Return the sum of wavefronts, by rising index.

    Parameters
    ----------
    *parts : Terms
        Noll indices and coefficients [m] of each wavefront.

    Returns
    -------
    Terms
        Noll indices and coefficients [m]; terms that are zero, and piston, are left out.
    """
    found: dict[int, float] = {}
    for index, coefficient in (term for part in parts for term in part):
        found[index] = found.get(index, 0.0) + coefficient
    return tuple((i, c) for i, c in sorted(found.items()) if c and i != PISTON)


def is_symmetric(terms: Terms) -> bool:
    """Return whether a wavefront is symmetric about the axis: W depends on rho only.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    bool
        True where no term depends on theta.
    """
    return all(noll_orders(index)[1] == 0 for index, coefficient in terms if coefficient)


def split_tilt(terms: Terms) -> tuple[Terms, tuple[float, float]]:
    """Return a wavefront without its tilt, and the tilt.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    rest : Terms
        The terms that change the image's shape.
    tilt : tuple of float
        Slopes to the right and down [m per pupil radius], which move the image.
    """
    rest = tuple(term for term in combine(terms) if term[0] not in (TILT_X, TILT_Y))
    tilt = dict(combine(terms))
    return rest, (2 * tilt.get(TILT_X, 0.0), 2 * tilt.get(TILT_Y, 0.0))


def rms(terms: Terms) -> float:
    """Return the rms of a wavefront over the pupil about its mean, by orthonormality [1].

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    float
        Rms wavefront error [m].
    """
    return math.sqrt(sum(c**2 for _, c in combine(terms)))


def strehl(terms: Terms, wavelength: float) -> float:
    """Return the Strehl ratio, exp(-(2 pi rms / wavelength)^2), after Marechal and Mahajan [3].

    Good to 0.02 above 0.3. Tilt moves the image and does not count.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.
    wavelength : float
        Wavelength [m].

    Returns
    -------
    float
        Strehl ratio [dimensionless], in 0..1.
    """
    return math.exp(-((2 * math.pi * rms(split_tilt(terms)[0]) / wavelength) ** 2))


@lru_cache(maxsize=1024)
def max_slope(terms: Terms) -> float:
    """Return the largest slope |grad W| over the pupil, to about 1 %.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    float
        Slope [m per pupil radius].
    """
    if not terms:
        return 0.0
    order = max(noll_orders(index)[0] for index, _ in terms)
    rho = np.linspace(0, 1, 12 * order + 13)[:, None]
    theta = np.linspace(0, 2 * np.pi, 16 * order + 32, endpoint=False)
    slope = np.hypot(*gradient(terms, rho * np.cos(theta), rho * np.sin(theta)))
    return float(slope.max())


def legendre_coefficients(terms: Terms) -> Floats:
    """Return a symmetric wavefront in Legendre polynomials: R_n^0(rho) = P_{n/2}(2 rho^2 - 1).

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of a rotationally symmetric wavefront.

    Returns
    -------
    ndarray
        Coefficients (n,) of the Legendre polynomials of 2 rho^2 - 1 [m].

    Raises
    ------
    ValueError
        W depends on theta.
    """
    if not is_symmetric(terms):
        raise ValueError("the wavefront is not symmetric")
    found = np.zeros(1 + max((noll_orders(index)[0] // 2 for index, _ in terms), default=0))
    for index, coefficient in terms:
        n = noll_orders(index)[0]
        found[n // 2] += _norm(n, 0) * coefficient
    return found


def rotate(terms: Iterable[tuple[int, float]], angle: float) -> Terms:
    """Return a wavefront rotated by an angle from x towards y.

    Parameters
    ----------
    terms : iterable of (int, float)
        Noll indices and coefficients [m] of the wavefront.
    angle : float
        Angle [rad].

    Returns
    -------
    Terms
        Noll indices and coefficients [m] of the rotated wavefront.
    """
    found: dict[int, float] = {}
    for index, coefficient in terms:
        n, m = noll_orders(index)
        found[index] = found.get(index, 0.0) + coefficient * math.cos(m * angle)
        if m:
            partner = _conjugate_index(index, n, m)
            sign = 1.0 if m > 0 else -1.0
            part = sign * coefficient * math.sin(abs(m) * angle)
            found[partner] = found.get(partner, 0.0) + part
    return tuple(sorted(found.items()))


def _conjugate_index(index: int, n: int, m: int) -> int:
    """Return the Noll index of the same order with sine for cosine."""
    return next(i for i in (index - 1, index + 1) if noll_orders(i) == (n, -m))


def _norm(n: int, m: int) -> float:
    return math.sqrt((n + 1) * (2 if m else 1))


def _azimuthal(m: int, theta: Floats) -> Floats:
    return np.sin(-m * theta) if m < 0 else np.cos(m * theta)


def _radial(n: int, m: int, rho: Floats) -> Floats:
    """Return R_n^m(rho), by Jacobi polynomials: the sum of powers would cancel at high orders."""
    from scipy.special import eval_jacobi

    k = (n - m) // 2
    polynomial: Floats = (-1) ** k * rho**m * eval_jacobi(k, m, 0, 1 - 2 * rho**2)
    return polynomial


def _radial_slope(n: int, m: int, rho: Floats) -> Floats:
    """Return dR_n^m / d rho."""
    from scipy.special import eval_jacobi

    k = (n - m) // 2
    t = 1 - 2 * rho**2
    slope = m * _power(rho, m - 1) * eval_jacobi(k, m, 0, t)
    if k:
        inner = (k + m + 1) / 2 * eval_jacobi(k - 1, m + 1, 1, t)
        slope = slope - 4 * rho ** (m + 1) * inner
    derivative: Floats = (-1) ** k * slope
    return derivative


def _radial_over_rho(n: int, m: int, rho: Floats) -> Floats:
    """Return R_n^m / rho for m > 0, finite at the center."""
    from scipy.special import eval_jacobi

    k = (n - m) // 2
    quotient: Floats = (-1) ** k * _power(rho, m - 1) * eval_jacobi(k, m, 0, 1 - 2 * rho**2)
    return quotient


def _power(rho: Floats, exponent: int) -> Floats:
    return rho ** max(exponent, 0)
