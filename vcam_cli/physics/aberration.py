"""What aberrations leave of the transfer function of a perfect lens.

The transfer function of incoherent light is the overlap of the pupil function with itself,

    H(f) = integral P(u - s/2) P*(u + s/2) d2u / area,   s = 2 wavelength N_w f,   N_w = N (1 - m),

over the unit disk, P = exp(2 pi i W / wavelength) (`zernike` has the coordinates and signs).
Divided by the same integral for W = 0 it is the mean of exp(2 pi i dW / wavelength) over the
overlap, dW = W(u - s/2) - W(u + s/2): a factor of at most 1 for the closed form of diffraction.

Two ways to it. A wavefront that is symmetric about the axis has a factor of |f| alone, which is
analytic in |f|: Gauss-Legendre sums over the overlap at Chebyshev nodes. Any other is sampled on
a grid and correlated with itself by Fourier transforms (`pupil_grid`).

References
----------
[1] H. H. Hopkins, "The frequency response of a defocused optical system", Proceedings of the Royal
    Society A 231, 91-103, 1955, doi:10.1098/rspa.1955.0158.
[2] J. W. Goodman, "Introduction to Fourier Optics", 3rd edition, Roberts, 2005, section 6.4.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.physics import pupil_grid, zernike
from vcam_cli.physics.cache import ByteCache
from vcam_cli.physics.zernike import Floats, Terms

STEEPEST = 200.0
"""Slope of the wavefront up to which it can be followed [wavelengths per pupil radius]."""

_SERIES: ByteCache[Floats] = ByteCache(20_000_000)
MOST_GRIDS = 500_000_000
"""Memory that grids of wavefronts are kept in [bytes]."""
_GRIDS: ByteCache[pupil_grid.Grid] = ByteCache(MOST_GRIDS)


def slope_in_waves(terms: Terms, wavelength: float) -> float:
    """Steepest slope of a wavefront, tilt aside [wavelengths per pupil radius]."""
    return zernike.steepest(zernike.without_tilt(terms)[0]) / wavelength


def otf_ratio_symmetric(
    frequency: ArrayLike, wavelength: float, working_f_number: float, terms: Terms
) -> Floats:
    """Aberrated over perfect OTF of a wavefront that is symmetric about the axis [1].

    Parameters
    ----------
    frequency : spatial frequency on the sensor [cycles/m], of either sign
    wavelength : [m]
    working_f_number : N (1 - m) [dimensionless]
    terms : ((Noll index, coefficient [m]), ...), rotationally symmetric

    Returns
    -------
    In -1..1 [dimensionless]; 1 at frequency 0, and 0 beyond the cut-off. Negative where contrast
    is reversed. Good to 1e-9.

    Raises
    ------
    ValueError
        The wavefront is not symmetric, or steeper than `STEEPEST`.
    """
    terms = zernike.total(terms)
    shift = np.minimum(np.abs(np.asarray(frequency)) * (wavelength * working_f_number), 1.0)
    if not terms:
        return np.where(shift < 1, 1.0, 0.0)[()]
    steep = _gentle(terms, wavelength)
    waves = zernike.legendre(terms) / wavelength
    series = _SERIES.get((terms, wavelength), lambda: _series(waves, steep))
    ratio = np.clip(np.polynomial.chebyshev.chebval(2 * shift - 1, series), -1, 1)
    return np.where(shift == 0, 1.0, np.where(shift < 1, ratio, 0.0))[()]


def otf_ratio(
    fx: ArrayLike, fy: ArrayLike, wavelength: float, working_f_number: float, terms: Terms
) -> NDArray[np.complex128]:
    """Aberrated over perfect OTF of any wavefront [2].

    Parameters
    ----------
    fx, fy : spatial frequency on the sensor, to the right and down [cycles/m]; they broadcast
    wavelength : [m]
    working_f_number : N (1 - m) [dimensionless]
    terms : ((Noll index, coefficient [m]), ...)

    Returns
    -------
    Of magnitude at most 1 [dimensionless]; 1 at frequency 0, 0 beyond the cut-off. H(-f) is the
    conjugate of H(f); tilt is the factor exp(-2 pi i f.t) of an image moved by t, exactly. Errors
    of the rest, times the transfer of diffraction, as `pupil_grid` states them.

    Raises
    ------
    ValueError
        A wavefront steeper than `STEEPEST`, tilt aside.
    """
    fx, fy = np.asarray(fx, dtype=np.float64), np.asarray(fy, dtype=np.float64)
    rest, (slope_x, slope_y) = zernike.without_tilt(terms)
    if zernike.is_symmetric(rest):
        length = np.hypot(fx, fy)
        ratio = otf_ratio_symmetric(length, wavelength, working_f_number, rest).astype(complex)
    else:
        steep = _gentle(rest, wavelength)
        grid = _GRIDS.get((rest, wavelength), lambda: pupil_grid.correlate(rest, wavelength, steep))
        scale = 2 * wavelength * working_f_number
        ratio = grid.at(scale * fx, scale * fy).reshape(np.broadcast_shapes(fx.shape, fy.shape))
    if slope_x or slope_y:
        turns = 2 * working_f_number * (fx * slope_x + fy * slope_y)
        ratio = ratio * np.where(ratio == 0, 0, np.exp(-2j * np.pi * turns))
    return ratio[()]


def keeps(terms: Terms, wavelengths: Floats) -> dict[tuple[Terms, float], int]:
    """Memory that `otf_ratio` keeps for a wavefront at wavelengths (n,) [m]: what for -> bytes.

    No more than `MOST_GRIDS` of it all.
    """
    rest, _ = zernike.without_tilt(terms)
    if zernike.is_symmetric(rest):
        return {}
    order = max(zernike.noll(index)[0] for index, _ in rest)
    return {
        (rest, w): pupil_grid.grid_bytes(slope_in_waves(rest, w), order)
        for w in wavelengths.tolist()
    }


def _gentle(terms: Terms, wavelength: float) -> float:
    """The steepest slope [wavelengths per pupil radius]; ValueError where it is too much."""
    slope = slope_in_waves(terms, wavelength)
    if slope > STEEPEST:
        raise ValueError(f"a wavefront of {slope:.3g} waves per pupil radius; at most {STEEPEST:g}")
    return slope


def _series(waves: Floats, steep: float) -> Floats:
    """Chebyshev coefficients of the ratio over |f| = 0 .. cut-off.

    waves: Legendre coefficients of W over 2 rho^2 - 1 [wavelengths]; steep: its largest slope. The
    phase of the overlap's ends changes by 4 pi steep over that range: as many radians, half as
    many terms, and some more for the series to converge.
    """
    from scipy.fft import dct

    count = 32 + 4 * len(waves) + math.ceil(1.1 * 2 * np.pi * steep)
    angle = (np.arange(count) + 0.5) * (np.pi / count)
    values = [_mean_over_overlap(waves, (math.cos(a) + 1) / 2) for a in angle]
    coefficients = dct(np.array(values), type=2) / count
    coefficients[0] /= 2
    return coefficients


def _mean_over_overlap(waves: Floats, half_shift: float) -> float:
    """Mean of cos(2 pi dW) over the overlap of two unit disks 2 h apart.

    A quarter of it is x = cos a - h, y = t sin a with a = 0 .. acos(h), t = 0 .. 1; its area
    element is sin^2 a da dt, smooth to its ends.
    """
    # dW varies smoothly: few points tell how quickly, and that how many are needed.
    few = 9 + 2 * len(waves)
    nodes = np.linspace(0, 1, few)
    phase = _phase(waves, half_shift, nodes, nodes)
    needed = [
        20 + math.ceil(0.3 * (few - 1) * np.abs(np.diff(phase, axis=k)).max()) for k in (0, 1)
    ]
    a, weight_a = _gauss(needed[1])
    t, weight_t = _gauss(needed[0])
    weight_a = weight_a * np.sin(math.acos(half_shift) * a) ** 2
    mean = weight_t @ np.cos(_phase(waves, half_shift, a, t)) @ weight_a
    return float(mean / (weight_t.sum() * weight_a.sum()))


def _phase(waves: Floats, h: float, a: Floats, t: Floats) -> Floats:
    """2 pi dW at a (n,) in parts of acos(h) and t (m,): (m, n) [rad]."""
    angle = math.acos(h) * a
    x, y2 = np.cos(angle) - h, (t[:, None] * np.sin(angle)) ** 2
    far, near = (
        np.polynomial.legendre.legval(2 * ((x + side * h) ** 2 + y2) - 1, waves) for side in (1, -1)
    )
    return 2 * np.pi * (far - near)


def _gauss(points: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights on 0 .. 1: at least `points`, of few different numbers."""
    return _nodes(math.ceil(1.12 ** math.ceil(math.log(points, 1.12))))


@lru_cache(maxsize=128)
def _nodes(points: int) -> tuple[Floats, Floats]:
    from scipy.special import roots_legendre

    node, weight = roots_legendre(points)
    return (node + 1) / 2, weight / 2
