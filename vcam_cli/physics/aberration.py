"""Aberrations: what a wavefront leaves of the transfer function of a perfect lens.

The transfer function of incoherent light is the overlap of the pupil function with itself,

    H(f) = integral P(u - s/2) P*(u + s/2) d2u / area,   s = 2 wavelength N_w f,   N_w = N (1 - m),

over the unit disk, P = exp(2 pi i W / wavelength) (`zernike` has the coordinates and signs).
Divided by the same integral for W = 0 it is the mean of exp(2 pi i dW / wavelength) over the
overlap, dW = W(u - s/2) - W(u + s/2): a factor of at most 1 for the closed form of diffraction.

A wavefront that is symmetric about the axis has a factor of |f| alone, which is analytic in |f|:
Gauss-Legendre sums over the overlap at Chebyshev nodes. Any other is sampled on a grid and
correlated with itself by Fourier transforms (`pupil_grid`); one of few waves that many directions
and wavelengths are asked of has a series by direction (`pupil_harmonics`).

References
----------
.. [1] H. H. Hopkins, "The frequency response of a defocused optical system", Proceedings of the
   Royal Society A 231, 91-103, 1955, doi:10.1098/rspa.1955.0158.
.. [2] J. W. Goodman, "Introduction to Fourier Optics", 3rd edition, Roberts, 2005, section 6.4.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.physics import pupil_grid, pupil_harmonics, zernike
from vcam_cli.physics.zernike import Floats, Terms

MAX_SLOPE = 200.0
"""Largest slope of a wavefront that is computed [wavelengths per pupil radius]."""

NEGLIGIBLE = 1e-11
"""Sum of the last terms of a series that are left out."""
_SERIES_CACHE: ByteCache[Floats] = ByteCache(20_000_000)
GRID_CACHE_BYTES = 500_000_000
"""Memory that grids of wavefronts are kept in [bytes]."""
_HARMONICS_CACHE: ByteCache[pupil_harmonics.PupilHarmonics] = ByteCache(20_000_000)
_GRID_CACHE: ByteCache[pupil_grid.OtfRatioGrid] = ByteCache(GRID_CACHE_BYTES)


def slope_in_waves(terms: Terms, wavelength: float) -> float:
    """Return the largest slope of a wavefront without its tilt.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.
    wavelength : float
        Wavelength [m].

    Returns
    -------
    float
        Slope [wavelengths per pupil radius].
    """
    return zernike.max_slope(zernike.split_tilt(terms)[0]) / wavelength


def otf_ratio_symmetric(
    frequency: ArrayLike, wavelength: ArrayLike, working_f_number: float, terms: Terms
) -> Floats:
    """Return the aberrated over the perfect OTF of a wavefront symmetric about the axis [1].

    Parameters
    ----------
    frequency : array_like
        Spatial frequency on the sensor [cycles/m], of any shape and either sign.
    wavelength : array_like
        Wavelength, or wavelengths (J,) [m].
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].
    terms : Terms
        Noll indices and coefficients [m] of a rotationally symmetric wavefront.

    Returns
    -------
    ndarray
        Ratio in -1..1 [dimensionless], in the shape of `frequency`, or (J, *shape) at several
        wavelengths; 1 at frequency 0, and 0 beyond the cut-off. It is negative where contrast is
        reversed. Good to 1e-9.

    Raises
    ------
    ValueError
        The wavefront is not symmetric, or its slope exceeds `MAX_SLOPE`.
    """
    terms, length = zernike.combine(terms), np.abs(np.asarray(frequency))
    scale = working_f_number * np.asarray(wavelength, dtype=np.float64)
    shift = np.minimum(np.multiply.outer(scale, length), 1.0)
    if not terms:
        return np.where(shift < 1, 1.0, 0.0)[()]
    series = [_series(terms, float(w)) for w in np.ravel(wavelength)]
    # All wavelengths at once: a series has some fifty terms, and arrays are short.
    every = np.zeros((max(map(len, series)), len(series)))
    for column, own in zip(every.T, series, strict=True):
        column[: len(own)] = own
    every = every.reshape(-1, *scale.shape, *(1,) * length.ndim)
    ratio = np.polynomial.chebyshev.chebval(2 * shift - 1, every, tensor=False)
    ratio = np.where(shift < 1, np.clip(ratio, -1, 1), 0.0)
    return np.where(shift == 0, 1.0, ratio)[()]


def otf_ratio(
    fx: ArrayLike, fy: ArrayLike, wavelength: float, working_f_number: float, terms: Terms
) -> NDArray[np.complex128]:
    """Return the aberrated over the perfect OTF of any wavefront [2].

    Parameters
    ----------
    fx, fy : array_like
        Spatial frequency on the sensor to the right and down [cycles/m]; they broadcast.
    wavelength : float
        Wavelength [m].
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    ndarray of complex
        Ratio of magnitude at most 1 [dimensionless], in the shape to which the frequencies
        broadcast; 1 at frequency 0, 0 beyond the cut-off. H(-f) is the conjugate of H(f); tilt is
        the factor exp(-2 pi i f.t) of an image moved by t, exactly. The errors of the rest, times
        the transfer of diffraction, are as `pupil_grid` states them.

    Raises
    ------
    ValueError
        The slope of the wavefront, without its tilt, exceeds `MAX_SLOPE`.
    """
    fx, fy = np.asarray(fx, dtype=np.float64), np.asarray(fy, dtype=np.float64)
    rest, (slope_x, slope_y) = zernike.split_tilt(terms)
    if zernike.is_symmetric(rest):
        length = np.hypot(fx, fy)
        ratio = otf_ratio_symmetric(length, wavelength, working_f_number, rest).astype(complex)
    else:
        slope = _checked_slope(rest, wavelength)
        grid = _GRID_CACHE.get(
            (rest, wavelength), lambda: pupil_grid.otf_ratio_grid(rest, wavelength, slope)
        )
        scale = 2 * wavelength * working_f_number
        ratio = grid.interpolate(scale * fx, scale * fy).reshape(
            np.broadcast_shapes(fx.shape, fy.shape)
        )
    if slope_x or slope_y:
        turns = 2 * working_f_number * (fx * slope_x + fy * slope_y)
        ratio = ratio * np.where(ratio == 0, 0, np.exp(-2j * np.pi * turns))
    return ratio[()]


def otf_ratio_harmonics(
    frequency: Floats, wavelengths: Floats, working_f_number: float, terms: Terms
) -> NDArray[np.complex128]:
    """Return the aberrated over the perfect OTF by harmonics of the direction.

    Parameters
    ----------
    frequency : ndarray
        Spatial frequencies (n,) on the sensor, from 0 [cycles/m].
    wavelengths : ndarray
        Wavelengths (J,) [m].
    working_f_number : float
        Working f-number N (1 - m) [dimensionless].
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    ndarray of complex
        A_m (J, n, m) as `direction_harmonics` has them [dimensionless]: good to 1e-5 up to
        `pupil_harmonics.MOST_SLOPE`, beyond which, and with tilt, they are those of `otf_ratio`.

    Raises
    ------
    ValueError
        The slope of the wavefront, without its tilt, exceeds `MAX_SLOPE`.
    """
    rest, _ = zernike.split_tilt(terms)
    if not has_few_waves(wavelengths, terms):

        def values(angles: Floats) -> NDArray[np.complex128]:
            fx, fy = (np.multiply.outer(frequency, along(angles)) for along in (np.cos, np.sin))
            return np.array(
                [otf_ratio(fx, fy, w, working_f_number, terms) for w in wavelengths.tolist()]
            )

        return pupil_harmonics.direction_harmonics(values)
    if not rest:
        inside = np.multiply.outer(wavelengths * working_f_number, frequency) < 1
        return inside[..., None].astype(np.complex128)
    found = _HARMONICS_CACHE.get(
        (rest, wavelengths.tobytes()),
        lambda: pupil_harmonics.pupil_harmonics(rest, wavelengths, zernike.max_slope(rest)),
    )
    h = np.multiply.outer(working_f_number * wavelengths, frequency)
    return found.amplitudes(h, wavelengths)


def has_few_waves(wavelengths: Floats, terms: Terms) -> bool:
    """Return whether a wavefront has harmonics of the direction without a grid of the pupil.

    Parameters
    ----------
    wavelengths : ndarray
        Wavelengths (J,) [m].
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    bool
        Whether it has no tilt and is no steeper than `pupil_harmonics.MOST_SLOPE`.
    """
    rest, tilt = zernike.split_tilt(terms)
    steepest = pupil_harmonics.MOST_SLOPE * float(wavelengths.min())
    return not any(tilt) and zernike.max_slope(rest) <= steepest


def grid_bytes(wavelengths: Floats, terms: Terms) -> int:
    """Return the memory that grids of a wavefront take.

    Parameters
    ----------
    wavelengths : ndarray
        Wavelengths (J,) at which `otf_ratio` is evaluated [m].
    terms : Terms
        Noll indices and coefficients [m] of the wavefront.

    Returns
    -------
    int
        Bytes of the grids that are kept, and of what makes one of them; 0 where there are none.
    """
    rest, _ = zernike.split_tilt(terms)
    if zernike.is_symmetric(rest):
        return 0
    order = max(zernike.noll_orders(index)[0] for index, _ in rest)
    slope = zernike.max_slope(rest)
    sizes = [pupil_grid.grid_bytes(slope / w, order) for w in wavelengths.tolist()]
    kept = min(sum(size for size, _ in sizes), GRID_CACHE_BYTES)
    return kept + max(work for _, work in sizes)


def _checked_slope(terms: Terms, wavelength: float) -> float:
    """Return the largest slope [wavelengths per pupil radius]; ValueError above `MAX_SLOPE`."""
    slope = slope_in_waves(terms, wavelength)
    if slope > MAX_SLOPE:
        raise ValueError(
            f"a wavefront of {slope:.3g} waves per pupil radius; at most {MAX_SLOPE:g}"
        )
    return slope


def _series(terms: Terms, wavelength: float) -> Floats:
    """Return the Chebyshev coefficients of the ratio for a wavefront that is symmetric."""

    def compute() -> Floats:
        slope = _checked_slope(terms, wavelength)
        return _chebyshev_series(zernike.legendre_coefficients(terms) / wavelength, slope)

    return _SERIES_CACHE.get((terms, wavelength), compute)


def _chebyshev_series(waves: Floats, slope: float) -> Floats:
    """Return the Chebyshev coefficients of the ratio over |f| = 0 .. cut-off.

    The phase of the overlap's ends changes by 4 pi slope over that range: as many radians, half as
    many terms, and some more for the series to converge.

    Parameters
    ----------
    waves : ndarray
        Legendre coefficients of W over 2 rho^2 - 1 [wavelengths].
    slope : float
        Largest slope of W [wavelengths per pupil radius].
    """
    from scipy.fft import dct

    count = 32 + 4 * len(waves) + math.ceil(1.1 * 2 * np.pi * slope)
    angle = (np.arange(count) + 0.5) * (np.pi / count)
    half_shifts = (np.cos(angle) + 1) / 2
    values = (
        _means_of_defocus(float(waves[1]), half_shifts)
        if len(waves) == 2
        else [_mean_over_overlap(waves, h) for h in half_shifts.tolist()]
    )
    coefficients = dct(np.array(values), type=2) / count
    coefficients[0] /= 2
    beyond = np.cumsum(np.abs(coefficients[::-1]))[::-1]
    return coefficients[: max(np.count_nonzero(beyond > NEGLIGIBLE), 1)]


def _means_of_defocus(waves: float, half_shifts: Floats) -> Floats:
    """Return the same as `_mean_over_overlap` for all half shifts (n,), for defocus alone.

    Its dW is 8 waves h x: the mean is one along x, of chords of the overlap.
    """
    a, weight = _gauss(24 + math.ceil(0.3 * 16 * np.pi * abs(waves)))
    h = half_shifts[:, None]
    angle = np.arccos(h) * a
    chord = weight * np.sin(angle) ** 2
    mean = (chord * np.cos(16 * np.pi * waves * h * (np.cos(angle) - h))).sum(axis=1)
    return np.asarray(mean / chord.sum(axis=1))


def _mean_over_overlap(waves: Floats, half_shift: float) -> float:
    """Return the mean of cos(2 pi dW) over the overlap of two unit disks 2 h apart.

    A quarter of it is x = cos a - h, y = t sin a with a = 0 .. acos(h), t = 0 .. 1; its area
    element is sin^2 a da dt, smooth to its ends.
    """
    # dW varies smoothly: few points tell how quickly, and that how many are needed.
    few = 9 + 2 * len(waves)
    nodes = np.linspace(0, 1, few)
    phase = _phase_difference(waves, half_shift, nodes, nodes)
    needed = [
        20 + math.ceil(0.3 * (few - 1) * np.abs(np.diff(phase, axis=k)).max()) for k in (0, 1)
    ]
    a, weight_a = _gauss(needed[1])
    t, weight_t = _gauss(needed[0])
    weight_a = weight_a * np.sin(math.acos(half_shift) * a) ** 2
    mean = weight_t @ np.cos(_phase_difference(waves, half_shift, a, t)) @ weight_a
    return float(mean / (weight_t.sum() * weight_a.sum()))


def _phase_difference(waves: Floats, h: float, a: Floats, t: Floats) -> Floats:
    """Return 2 pi dW (m, n) [rad] at `a` (n,), in parts of acos(h), and `t` (m,)."""
    angle = math.acos(h) * a
    x, y2 = np.cos(angle) - h, (t[:, None] * np.sin(angle)) ** 2
    far, near = (
        np.polynomial.legendre.legval(2 * ((x + side * h) ** 2 + y2) - 1, waves) for side in (1, -1)
    )
    return 2 * np.pi * (far - near)


def _gauss(points: int) -> tuple[Floats, Floats]:
    """Return Gauss-Legendre nodes and weights on 0 .. 1, of `points` or a few more.

    Rounding up leaves few different numbers, so that most rules are kept already.
    """
    return _gauss_legendre(math.ceil(1.12 ** math.ceil(math.log(points, 1.12))))


@lru_cache(maxsize=128)
def _gauss_legendre(points: int) -> tuple[Floats, Floats]:
    from scipy.special import roots_legendre

    node, weight = roots_legendre(points)
    return (node + 1) / 2, weight / 2


def paraboloid_transfer(frequency: Array, radius: float) -> Array:
    """Return the transfer 8 J2(z) / z^2, z = 2 pi f r, of a paraboloid.

    Parameters
    ----------
    frequency : Array
        Spatial frequencies of any shape [cycles/m].
    radius : float
        Where the paraboloid ends; its sign does not matter [m].

    Returns
    -------
    Array
        Transfer without unit.
    """
    from scipy.special import jv

    z = 2 * np.pi * np.asarray(frequency, float) * abs(radius)
    return np.where(z > 1e-3, 8 * jv(2, z) / np.where(z > 1e-3, z, 1.0) ** 2, 1.0)
