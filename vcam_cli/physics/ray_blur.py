"""Geometrical optics: the blur of an aberrated lens by rays alone, without diffraction.

A ray through the pupil at u lands t = 2 N_w grad W(u) beside the ideal image point, and every part
of the pupil sends as much light: the transfer is the mean of exp(-2 pi i f.t) over the pupil,
whatever the wavelength. Light waves approach it where the wavefront is many wavelengths.

References
----------
.. [1] H. H. Hopkins, "Geometrical-optical treatment of frequency response", Proceedings of the
   Physical Society B 70, 1162-1172, 1957, doi:10.1088/0370-1301/70/12/307.
.. [2] J. W. Goodman, "Introduction to Fourier Optics", 3rd edition, Roberts, 2005,
   section 6.4.4 (defocus).
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.arrays import Array
from vcam_cli.physics import pupil_harmonics, zernike
from vcam_cli.physics.zernike import Floats, Terms

MAX_CYCLES = 40.0
"""Frequency times blur radius up to which sums over the pupil are made [cycles].

The transfer, about 1 in 100 there and falling, counts as 0 beyond.
"""
CELLS_PER_CYCLE = 16
"""Cells that rays are gathered in, for a period of the highest frequency."""
DIRECTIONS = 12
"""Directions in half a turn in which the largest transfer is sought."""
MAX_CYCLES_SYMMETRIC = 3000.0
"""Limit as `MAX_CYCLES` for a symmetric wavefront, for which a sum along the radius is enough."""


def blur_radius(terms: Terms, working_f_number: float) -> float:
    """Return how far the outermost ray lands from the middle of the blur, tilt aside.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].

    Returns
    -------
    float
        Largest transverse ray aberration [m].
    """
    return 2 * working_f_number * zernike.max_slope(zernike.split_tilt(terms)[0])


def otf_symmetric(frequency: ArrayLike, working_f_number: float, terms: Terms) -> Floats:
    """Return the geometrical OTF of a wavefront that is symmetric about the axis [1].

    For defocus alone it is 2 J1(z) / z, z = pi f shift / N_w [2], which is 2 pi f times the radius
    of the blur.

    Parameters
    ----------
    frequency : array_like
        Spatial frequency on the sensor [cycles/m], of any shape and either sign.
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].
    terms : Terms
        Noll indices and coefficients [m] of a rotationally symmetric wavefront.

    Returns
    -------
    ndarray
        OTF in -1..1 [dimensionless], in the shape of `frequency`; 1 at frequency 0.

    Raises
    ------
    ValueError
        The wavefront is not symmetric.
    """
    from scipy.special import j0, j1

    f = np.abs(np.asarray(frequency, dtype=np.float64))
    slope = np.polynomial.legendre.legder(zernike.legendre_coefficients(zernike.combine(terms)))
    if len(slope) == 1:
        radius = 8 * working_f_number * abs(float(slope[0]))
        z = np.clip(2 * np.pi * f * radius, 1e-100, 1e12)
        return np.where(z < 1e-8, 1.0, 2 * j1(z) / z)[()]
    farthest = blur_radius(terms, working_f_number)
    within = f * farthest <= MAX_CYCLES_SYMMETRIC
    radians = 2 * np.pi * farthest * float(f[within].max(initial=0.0))
    node, weight = _gauss(24 + math.ceil(0.3 * radians * 2 * len(slope)))
    ray = 8 * working_f_number * node * np.polynomial.legendre.legval(2 * node**2 - 1, slope)
    weight = weight * node / (weight @ node)
    flat = np.where(within, f, 0.0).ravel()
    mean = [j0(2 * np.pi * np.outer(part, ray)) @ weight for part in _chunks(flat)]
    found = np.concatenate(mean).reshape(f.shape)
    return np.where(within, np.where(f == 0, 1.0, found), 0.0)[()]


def otf(
    fx: ArrayLike, fy: ArrayLike, working_f_number: float, terms: Terms
) -> NDArray[np.complex128]:
    """Return the geometrical OTF of any wavefront at all pairs of frequencies [1].

    Parameters
    ----------
    fx, fy : array_like
        Spatial frequencies on the sensor (n,) to the right and (m,) down [cycles/m].
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    ndarray of complex
        OTF (m, n) [dimensionless]; 1 at frequency 0. H(-f) is the conjugate of H(f).
    """
    fx, fy = np.asarray(fx, dtype=np.float64), np.asarray(fy, dtype=np.float64)
    rest, tilt = zernike.split_tilt(terms)
    length = np.hypot(fx[None, :], fy[:, None])
    if zernike.is_symmetric(rest):
        found = otf_symmetric(length, working_f_number, rest).astype(np.complex128)
    else:
        limit = MAX_CYCLES / blur_radius(rest, working_f_number)
        within = length <= limit
        highest = float(length[within].max(initial=0.0))
        low_x, low_y = (np.where(np.abs(f) <= limit, f, 0.0) for f in (fx, fy))
        mean = _mean_over_pupil(low_x, low_y, highest, working_f_number, rest)
        found = np.where(within, mean, 0)
        found[length == 0] = 1
    move_x, move_y = (2 * working_f_number * slope for slope in tilt)
    if move_x or move_y:
        found *= np.exp(-2j * np.pi * (fx[None, :] * move_x + fy[:, None] * move_y))
    return found


def largest(frequency: Floats, working_f_number: float, terms: Terms) -> Floats:
    """Return the largest modulus of the geometrical OTF in some directions.

    Parameters
    ----------
    frequency : ndarray
        Spatial frequencies (n,), evenly from 0 [cycles/m].
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    ndarray
        Modulus (n,) [dimensionless].
    """
    values = _by_direction(frequency, working_f_number, terms)
    return np.asarray(np.abs(values(np.pi * np.arange(DIRECTIONS) / DIRECTIONS)).max(axis=1))


def otf_harmonics(frequency: Floats, working_f_number: float, terms: Terms) -> Array:
    """Return the geometrical OTF by harmonics of the direction [1].

    Parameters
    ----------
    frequency : ndarray
        Spatial frequencies (n,), evenly from 0 [cycles/m].
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    ndarray of complex
        A_m (n, m) as `direction_harmonics` has them [dimensionless], of what `otf` is.
    """
    return pupil_harmonics.direction_harmonics(_by_direction(frequency, working_f_number, terms))


def _by_direction(
    frequency: Floats, working_f_number: float, terms: Terms
) -> Callable[[Floats], Array]:
    """Return the function from directions (d,) [rad] to the geometrical OTF (n, d) there."""
    rest, tilt = zernike.split_tilt(terms)
    if zernike.is_symmetric(rest):
        mean = otf_symmetric(frequency, working_f_number, rest)[:, None]
        return lambda angles: mean * _tilt_factor(frequency, angles, working_f_number, tilt)
    radius = blur_radius(rest, working_f_number)
    within = frequency <= MAX_CYCLES / radius
    highest, step = float(frequency[within].max(initial=0.0)), float(frequency[1])
    right, down, share = _rays(highest, working_f_number, rest)
    # A wave of any of the frequencies repeats after 1 / step: so may the cells.
    from scipy.fft import next_fast_len

    cells = next_fast_len(math.ceil(CELLS_PER_CYCLE * max(highest, 1 / radius) / step))
    spread = np.sinc(frequency[within] / (cells * step)) ** 4

    def values(angles: Floats) -> Array:
        found = _tilt_factor(frequency, angles, working_f_number, tilt) * within[:, None]
        for k, angle in enumerate(angles.tolist()):
            place = (math.cos(angle) * right + math.sin(angle) * down) * (cells * step)
            index = np.floor(place).astype(int)
            light = np.zeros(cells)
            for j, part in enumerate(_spline_weights(place - index)):
                light += np.bincount((index + j - 1) % cells, share * part, minlength=cells)
            found[within, k] *= np.fft.fft(light)[: len(spread)] / spread
        return found

    return values


def _tilt_factor(
    frequency: Floats, angles: Floats, working_f_number: float, tilt: tuple[float, float]
) -> NDArray[np.complex128]:
    """Return the factor (n, d) of an image that tilt moves."""
    along = 2 * working_f_number * (tilt[0] * np.cos(angles) + tilt[1] * np.sin(angles))
    return np.asarray(np.exp(-2j * np.pi * np.outer(frequency, along)))


def _mean_over_pupil(
    fx: Floats, fy: Floats, highest: float, working_f_number: float, terms: Terms
) -> NDArray[np.complex128]:
    """Return the mean of exp(-2 pi i f.t), by Gauss's rule along the radius and evenly around.

    The rays are gathered in cells, spread by cubic splines, whose transform is divided out again:
    the transform of cells is a product of small matrices, and errs by (f cell)^4.
    """
    rays = _rays(highest, working_f_number, terms)
    cell = 1 / (CELLS_PER_CYCLE * max(highest, 1 / blur_radius(terms, working_f_number)))
    places, light = _binned_rays(*rays, cell)
    across, down = (
        np.exp(-2j * np.pi * np.outer(f, at)) / (np.sinc(f * cell)[:, None] ** 4)
        for f, at in zip((fx, fy), places, strict=True)
    )
    transfer: NDArray[np.complex128] = down @ light @ across.T
    return transfer


def _rays(highest: float, working_f_number: float, terms: Terms) -> tuple[Floats, Floats, Floats]:
    """Return where rays land, right and down [m], and the part of the light in each."""
    steps = max(zernike.noll_orders(index)[0] for index, _ in terms) - 1
    radians = 2 * np.pi * highest * blur_radius(terms, working_f_number) * steps
    node, weight = _gauss(20 + 2 * steps + math.ceil(0.3 * radians))
    around = 32 + 4 * steps + math.ceil(1.3 * radians)
    theta = 2 * np.pi * (np.arange(around) + 0.5) / around
    x, y = np.outer(node, np.cos(theta)).ravel(), np.outer(node, np.sin(theta)).ravel()
    slope_x, slope_y = zernike.gradient(terms, x, y)
    share = np.repeat(weight * node / (around * (weight @ node)), around)
    return 2 * working_f_number * slope_x, 2 * working_f_number * slope_y, share


def _binned_rays(
    right: Floats, down: Floats, share: Floats, cell: float
) -> tuple[tuple[Floats, Floats], Floats]:
    """Return the cells across and down [m], and the light that cubic splines give them."""
    first = [math.floor(at.min() / cell) - 1 for at in (right, down)]
    counts = [
        math.floor(at.max() / cell) + 3 - k for at, k in zip((right, down), first, strict=True)
    ]
    place_x, place_y = right / cell - first[0], down / cell - first[1]
    column, row = place_x.astype(int), place_y.astype(int)
    light = np.zeros(counts[0] * counts[1])
    for j, part_y in enumerate(_spline_weights(place_y - row)):
        for i, part_x in enumerate(_spline_weights(place_x - column)):
            cells = (row + j - 1) * counts[0] + column + i - 1
            light += np.bincount(cells, share * part_x * part_y, minlength=len(light))
    at_x, at_y = (cell * (np.arange(n) + k) for n, k in zip(counts, first, strict=True))
    return (at_x, at_y), light.reshape(counts[1], counts[0])


def _spline_weights(t: Floats) -> list[Floats]:
    """Return the cubic B-spline at four neighbors of a place `t` cells after the second of them."""
    s = 1 - t
    return [
        s**3 / 6,
        (3 * t**3 - 6 * t**2 + 4) / 6,
        (3 * s**3 - 6 * s**2 + 4) / 6,
        t**3 / 6,
    ]


def _gauss(points: int) -> tuple[Floats, Floats]:
    """Return Gauss-Legendre nodes and weights on 0 .. 1."""
    from scipy.special import roots_legendre

    node, weight = roots_legendre(points)
    return (node + 1) / 2, weight / 2


def _chunks(f: Floats) -> list[Floats]:
    """Return frequencies in pieces that keep the tables of the sums small."""
    return np.array_split(f, max(1, math.ceil(len(f) / 512)))
