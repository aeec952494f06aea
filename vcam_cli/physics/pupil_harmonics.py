"""The OTF of a wavefront of few waves, as harmonics of the direction and a series in |f|.

In polar coordinates what a wavefront leaves of a perfect lens's transfer is smooth:

    even m: Re(A_m(h) exp(i m theta)),   odd m: i Im(A_m(h) exp(i m theta)),   h = |f| / cut-off,

summed over m from 0, A_m analytic in h and in 1 / wavelength. So few values tell all of it: Gauss's
sums over the overlap of two pupils, at Chebyshev nodes of h and of 1 / wavelength, in some
directions. A lens that is turned by an angle has A_m exp(-i m angle).

Compared with `pupil_grid` a band of wavelengths costs a fiftieth as much for a tenth of a wave rms
and as much for a wave; a grid's edge is nowhere to be seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.physics import zernike
from vcam_cli.physics.interpolation import lagrange
from vcam_cli.physics.zernike import Floats, Terms
from vcam_cli.records import dataclass

MOST_SLOPE = 8.0
"""Slope of a wavefront up to which it is computed so [wavelengths per pupil radius]: from there on
points of pupil, frequency, direction and wavelength cost more than a grid."""
LEFT = 2.5e-6
"""Size of the highest harmonics of a wavefront, above the rounding of 32 bits."""
LEFT_OF_GRIDS = 1e-4
"""The same of a transfer that is looked up in a grid, which is no better than that."""
FEWEST, MOST = 16, 256
"""Directions in half a turn."""


@dataclass(frozen=True, eq=False)
class PupilHarmonics:
    """Aberrated over perfect OTF of a wavefront by direction, frequency and wavelength."""

    wavenumbers: Array
    """(n,) nodes of 1 / wavelength [1/m]."""
    series: Array
    """Complex Chebyshev coefficients (n, degrees, m) of every harmonic over h from 0 to 1."""

    @property
    def nbytes(self) -> int:
        """Memory that the coefficients take [bytes]."""
        return self.series.nbytes

    def amplitudes(self, h: Array, wavelengths: Array) -> Array:
        """Return the harmonics of wavelengths among or between the nodes'.

        Parameters
        ----------
        h : ndarray
            Frequencies (J, n) over the cut-off of each wavelength [dimensionless].
        wavelengths : ndarray
            Wavelengths (J,) [m].

        Returns
        -------
        ndarray of complex
            A_m (J, n, m) [dimensionless]; 0 from the cut-off on.
        """
        series = np.tensordot(lagrange(self.wavenumbers, 1 / wavelengths), self.series, axes=1)
        inside = h < 1
        degree = series.shape[1] - 1
        at = np.polynomial.chebyshev.chebvander(2 * np.where(inside, h, 0.0) - 1, degree)
        parts = np.ascontiguousarray(series).view(np.float64)  # a real product takes a third
        return ((at * inside[..., None]) @ parts).view(np.complex128)


def pupil_harmonics(terms: Terms, wavelengths: Array, slope: float) -> PupilHarmonics:
    """Return the harmonics of a wavefront.

    Parameters
    ----------
    terms : Terms
        Noll indices and coefficients [m] of the wavefront, without tilt.
    wavelengths : ndarray
        Wavelengths (J,) between whose ends it will be evaluated [m].
    slope : float
        Largest slope of the wavefront [m per pupil radius].

    Returns
    -------
    PupilHarmonics
        Good to 1e-5.
    """
    nodes = _wavenumbers(np.sort(1 / np.asarray(wavelengths)), slope)
    radians = 2 * np.pi * slope * float(nodes[-1])
    found = direction_harmonics(lambda angles: _values(terms, nodes, radians, angles), LEFT)
    return PupilHarmonics(nodes, _chebyshev(found))


def direction_harmonics(values: Callable[[Floats], Array], left: float = LEFT_OF_GRIDS) -> Array:
    """Return the harmonics of a transfer function in polar coordinates.

    Parameters
    ----------
    values : callable
        From directions (d,), evenly over half a turn [rad], to the transfer there (..., d).
        Opposite directions have conjugate values.
    left : float, optional
        Size of the highest harmonics: directions are added until they are smaller.

    Returns
    -------
    ndarray of complex
        A_m (..., m), m from 0: the transfer is the sum of Re(A_m exp(i m theta)) for even m and of
        i Im(A_m exp(i m theta)) for odd m.
    """
    count = FEWEST
    half = values(np.pi * np.arange(count) / count)
    while True:
        around = np.concatenate([half, half.conj()], axis=-1)
        found = np.fft.fft(around, axis=-1)[..., :count] / (2 * count)
        found[..., 1:] *= 2
        largest = np.abs(found).reshape(-1, count).max(axis=0)
        if largest[count * 3 // 4 :].max() <= left or count >= MOST:
            return found[..., : 1 + int(np.flatnonzero(largest > left / 10).max(initial=0))]
        between = values(np.pi * (np.arange(count) + 0.5) / count)
        half = np.stack([half, between], axis=-1).reshape(*half.shape[:-1], 2 * count)
        count *= 2


def in_directions(harmonics: Array, angles: Floats) -> Array:
    """Return a transfer function in some directions from its harmonics.

    Parameters
    ----------
    harmonics : ndarray of complex
        A_m (..., m) as those of `direction_harmonics`.
    angles : ndarray
        Directions (n,) [rad].

    Returns
    -------
    ndarray of complex
        Transfer (..., n) [dimensionless].
    """
    waves = np.exp(1j * np.multiply.outer(np.arange(harmonics.shape[-1]), angles))
    even, odd = (harmonics[..., k::2] @ waves[k::2] for k in (0, 1))
    return np.asarray(even.real + 1j * odd.imag)


def _wavenumbers(wanted: Floats, slope: float) -> Floats:
    """Return Chebyshev nodes over the range of 1 / wavelength, or those wanted where it is few."""
    half = (wanted[-1] - wanted[0]) / 2
    count = 4 + math.ceil(1.5 * 2 * np.pi * slope * half)
    if len(wanted) <= count:
        return wanted
    nodes: Floats = wanted[0] + half * (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count))
    return nodes


def _values(terms: Terms, wavenumbers: Floats, radians: float, angles: Floats) -> Array:
    """Return the ratio (n, h, directions) at Chebyshev nodes of h, in angles over half a turn."""
    count = 14 + math.ceil(1.2 * radians)
    h = (np.cos((np.arange(count) + 0.5) * (np.pi / count)) + 1) / 2
    x, y, weight = _half_overlaps(h, 8 + math.ceil(0.45 * radians))
    symmetric = all(zernike.noll_orders(index)[1] >= 0 for index, _ in terms)
    directions = len(angles)
    if symmetric:  # H(pi - theta) is the conjugate of H(theta)
        angles = angles[angles <= np.pi / 2]
    turned = [dict(zernike.rotate(terms, -angle)) for angle in angles.tolist()]
    values = np.empty((len(wavenumbers), count, directions), np.complex64)
    paths = []
    for odd in (0, 1):
        indices = sorted({i for t in turned for i in t if zernike.noll_orders(i)[1] % 2 == odd})
        basis = [
            zernike.wavefront(((i, 1.0),), x - h[:, None], y)
            - zernike.wavefront(((i, 1.0),), x + h[:, None], y)
            for i in indices
        ]
        shares = np.array([[t.get(i, 0.0) for i in indices] for t in turned])
        paths.append((shares.reshape(len(angles), -1), np.array(basis).reshape(-1, x.size)))
    for j in range(len(angles)):
        even, odd_path = ((s[j] @ b).reshape(x.shape) for s, b in paths)
        for value, wavenumber in zip(values, 2 * np.pi * wavenumbers, strict=True):
            # Of opposite points one path changes its sign, the other does not.
            light = np.cos((wavenumber * even).astype(np.float32)) * weight
            phase = (wavenumber * odd_path).astype(np.float32)
            value[:, j] = (light * np.cos(phase)).sum(axis=1)
            value[:, j] += 1j * (light * np.sin(phase)).sum(axis=1)
    rest = directions - len(angles)
    if rest:
        first = 1 if angles[0] == 0 else 0
        values[..., len(angles) :] = values[..., first : first + rest][..., ::-1].conj()
    return values


def _half_overlaps(h: Floats, points: int) -> tuple[Floats, Floats, Array]:
    """Return points x > 0, y, and weights (h, any number) of overlaps of unit disks 2 h apart.

    x = cos a - h, y = t sin a with a = 0 .. acos(h), t = -1 .. 1: dx dy = sin^2 a da dt.
    """
    node, weight = np.polynomial.legendre.leggauss(points)
    a = np.arccos(h)[:, None, None] * ((node + 1) / 2)[:, None]
    x = np.broadcast_to(np.cos(a) - h[:, None, None], (len(h), points, points))
    y = np.sin(a) * node
    part = np.sin(a) ** 2 * weight[:, None] * weight
    part /= part.sum(axis=(1, 2), keepdims=True)
    flat = len(h), points**2
    return x.reshape(flat), y.reshape(flat), part.reshape(flat).astype(np.float32)


def _chebyshev(values: Array) -> Array:
    """Return Chebyshev coefficients (n, h, ...) of values at the nodes."""
    count = values.shape[1]
    angle = (np.arange(count) + 0.5) * (np.pi / count)
    matrix = 2 / count * np.cos(np.outer(np.arange(count), angle))
    matrix[0] /= 2
    coefficients: Array = np.einsum("dh,nhm->ndm", matrix, values)
    return coefficients
