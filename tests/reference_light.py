"""The lens of the slow camera: wavefronts, and spread functions by the diffraction integral.

Zernike's polynomials in Noll's order (J. Opt. Soc. Am. 66, 1976, 207), of unit rms over the pupil,
on the pupil's place (u, v) in units of its radius, u to the right and v down as on the sensor.
A wavefront W(u, v) [m] makes the amplitude at the place (x, y) of the sensor

    A(x, y) = 1/pi  integral_disk exp(2 pi i W / lambda) exp(-i pi (x u + y v) / ring) du dv,

with ring = lambda N (1 - m), and the spread function h = |A|^2 pi / (4 ring^2), of integral 1. A
tilt W = a u thus sends the light to x = 2 N (1 - m) a. Its transform, of the sign
H(f) = integral h exp(-2 pi i f.x), is the overlap of two pupils,
H(f) = 1/pi integral P(p - s/2) conj P(p + s/2) dp, s = 2 ring f.

Both integrals are Gauss's rule on chords of the disk whose heights are sines of an angle: there is
no square root at the rim, and so no error but that of the number of points.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import itj0y0, j0, j1

Terms = tuple[tuple[int, float], ...]
"""((Noll's number, coefficient [m]), ...)"""


def noll(number: int) -> tuple[int, int]:
    """Radial order n and signed azimuthal order m: cosines are even numbers, sines odd ones."""
    n = 0
    while number > (n + 1) * (n + 2) // 2:
        n += 1
    place = number - n * (n + 1) // 2
    m = 2 * (place // 2) if n % 2 == 0 else 2 * ((place + 1) // 2) - 1
    return n, m if number % 2 == 0 else -m


def zernike(number: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Noll's polynomial at (u, v) in the unit disk, of unit rms over it."""
    n, signed = noll(number)
    m = abs(signed)
    r, angle = np.hypot(u, v), np.arctan2(v, u)
    radial = np.zeros(np.broadcast(u, v).shape)
    for k in range((n - m) // 2 + 1):
        factor = (-1) ** k * math.factorial(n - k) / math.factorial(k)
        factor /= math.factorial((n + m) // 2 - k) * math.factorial((n - m) // 2 - k)
        radial += factor * r ** (n - 2 * k)
    if m == 0:
        return math.sqrt(n + 1) * radial
    wave = np.cos(m * angle) if signed > 0 else np.sin(m * angle)
    return math.sqrt(2 * (n + 1)) * radial * wave


@dataclass(frozen=True)
class Wavefront:
    """Zernike terms, turned by `turned` [rad, from x toward y], and a shift of the image plane."""

    terms: Terms = ()
    defocus: float = 0.0  # [m], away from the lens
    turned: float = 0.0

    def path(self, u: np.ndarray, v: np.ndarray, f_number: float) -> np.ndarray:
        """W(u, v) [m]; the plane's shift is the parabola defocus / 8 N^2 at the rim."""
        c, s = math.cos(self.turned), math.sin(self.turned)
        a, b = c * u + s * v, c * v - s * u
        total = self.defocus / (8 * f_number**2) * (u**2 + v**2)
        for number, coefficient in self.terms:
            total = total + coefficient * zernike(number, a, b)
        return total


def chords(count: int, half: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss points of two unit disks' overlap, centers `half` left and right of 0: u, v, weight.

    Each (count, count), a row a chord. half = 0: the disk itself.
    """
    node, weight = np.polynomial.legendre.leggauss(count)
    most = math.acos(half)
    angle = most * node
    reach = np.cos(angle) - half
    u = reach[:, None] * node
    v = np.sin(angle)[:, None] * np.ones(count)
    return u, v, np.outer(most * weight * np.cos(angle) * reach, weight)


def spread(
    front: Wavefront,
    x: np.ndarray,
    y: np.ndarray,
    wavelength: float,
    f_number: float,
) -> np.ndarray:
    """h at all pairs of x (n,) and y (m,) [m]: (m, n) [1/m2]; f_number is N (1 - m)."""
    ring = wavelength * f_number
    reach = np.pi * max(np.abs(x).max(), np.abs(y).max()) / ring
    # Gauss's rule takes half a point a radian; the angle of a chord is pi / 2 times its point
    count = math.ceil(0.8 * reach + np.sqrt(reach)) + 20 + bend(front, wavelength, f_number)
    u, v, weight = chords(count)
    pupil = weight * np.exp(2j * np.pi / wavelength * front.path(u, v, f_number))
    across = np.empty((count, len(x)), complex)
    for row in range(count):
        across[row] = pupil[row] @ np.exp(-1j * np.pi / ring * np.outer(u[row], x))
    amplitude = np.exp(-1j * np.pi / ring * np.outer(y, v[:, 0])) @ across / np.pi
    return np.abs(amplitude) ** 2 * np.pi / (4 * ring**2)


def bend(front: Wavefront, wavelength: float, f_number: float) -> int:
    """Points more that the wavefront asks for: a few for every wave that it is bent."""
    u, v, _ = chords(40)
    path = front.path(u, v, f_number)
    return math.ceil(8 * (path.max() - path.min()) / wavelength)


def transfer(front: Wavefront, fx: float, fy: float, wavelength: float, f_number: float) -> complex:
    """H at one frequency [cycles/m] by the overlap of two pupils."""
    half = wavelength * f_number * math.hypot(fx, fy)  # |s| / 2
    if half >= 1:
        return 0.0
    count = 40 + bend(front, wavelength, f_number)
    p, q, weight = chords(count, half)
    c, s = (fx, fy) / np.hypot(fx, fy) if half else (1.0, 0.0)
    before = front.path(c * (p - half) - s * q, s * (p - half) + c * q, f_number)
    after = front.path(c * (p + half) - s * q, s * (p + half) + c * q, f_number)
    return complex((weight * np.exp(2j * np.pi / wavelength * (before - after))).sum() / np.pi)


# --- the perfect lens ----------------------------------------------------------------------------


def encircled(z: np.ndarray) -> np.ndarray:
    """Share of an Airy pattern's light inside z = pi r / (lambda N (1 - m)) (Rayleigh)."""
    return 1 - j0(z) ** 2 - j1(z) ** 2


def airy_modulation(nu: float, reach: float = 1000 * np.pi) -> float:
    """Modulation of the wave nu = f lambda N (1 - m) by the Airy pattern: its Hankel integral.

    integral_0^inf 2 J1(z)^2 / z J0(2 nu z) dz; beyond `reach` J1^2 is taken as its mean 1/(pi z).
    """
    node, weight = np.polynomial.legendre.leggauss(8)
    edges = np.arange(0, reach + 1, np.pi / 2)
    z = (edges[:-1, None] + np.pi / 4 * (node + 1)).ravel()
    weights = np.tile(np.pi / 4 * weight, len(edges) - 1)
    inside = float(weights @ (2 * j1(z) ** 2 / z * j0(2 * nu * z)))
    if nu == 0:
        return inside + 2 / (np.pi * edges[-1])
    a = 2 * nu * edges[-1]  # integral_a^inf J0(u)/u^2 du = J0(a)/a - 1 + integral_0^a J0 - J1(a)
    return inside + 4 * nu / np.pi * float(j0(a) / a - 1 + itj0y0(a)[0] - j1(a))


# --- lenses --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Aberrated:
    """A lens of one wavefront everywhere."""

    front: Wavefront

    def spread(self, x, y, wavelength: float, f_number: float) -> np.ndarray:
        """Share of the light that each place of a lattice gets: (m, n)."""
        cell = (x[1] - x[0]) * (y[1] - y[0])
        return spread(self.front, x, y, wavelength, f_number) * abs(cell)

    def transfer(self, fx: float, fy: float, wavelength: float, f_number: float) -> complex:
        return transfer(self.front, fx, fy, wavelength, f_number)


@dataclass(frozen=True)
class Field:
    """A lens whose wavefront is told at some places, 0 center .. 1 corner, along +x.

    Between them the coefficients are straight lines of the distance from the center; elsewhere
    than along +x the wavefront is turned about the axis.
    """

    places: Sequence[float]
    terms: Sequence[Terms]
    corner: float  # distance of place 1 from the center [m]
    defocus: float = 0.0

    def at(self, x: float, y: float) -> Wavefront:
        r = math.hypot(x, y) / self.corner
        numbers = sorted({number for terms in self.terms for number, _ in terms})
        told = [[dict(terms).get(number, 0.0) for terms in self.terms] for number in numbers]
        here = [float(np.interp(r, self.places, values)) for values in told]
        return Wavefront(tuple(zip(numbers, here, strict=True)), self.defocus, math.atan2(y, x))


@dataclass(frozen=True)
class Measured:
    """A lens by the samples of its spread function, the middle one at the ideal image point.

    Told at some wavelengths; between them it is a mean, beyond them the nearest.
    """

    samples: np.ndarray  # (wavelengths, rows, columns), of any sum
    pitch: float  # [m]
    wavelengths: tuple[float, ...] = (550e-9,)

    def places(self) -> tuple[np.ndarray, np.ndarray]:
        rows, columns = self.samples.shape[1:]
        x = (np.arange(columns) - (columns - 1) / 2) * self.pitch
        return x, (np.arange(rows) - (rows - 1) / 2) * self.pitch

    def shares(self, wavelength: float) -> np.ndarray:
        """Of the light, by the samples' displacements: (rows, columns)."""
        each = self.samples / self.samples.sum(axis=(1, 2), keepdims=True)
        units = np.eye(len(each))
        return sum(
            np.interp(wavelength, self.wavelengths, unit) * one
            for unit, one in zip(units, each, strict=True)
        )

    def transfer(self, fx: float, fy: float, wavelength: float, f_number: float) -> complex:
        """Each sample sends its share by its own displacement."""
        x, y = self.places()
        turn = np.exp(-2j * np.pi * (fy * y[:, None] + fx * x))
        return complex((turn * self.shares(wavelength)).sum())


@dataclass(frozen=True)
class Rays:
    """A lens without diffraction: a ray from each point of the pupil lands 2 N grad W aside."""

    front: Wavefront

    def transfer(self, fx: float, fy: float, wavelength: float, f_number: float) -> complex:
        u, v, weight = chords(120)
        step = 1e-4
        slope_x, slope_y = (
            (self.front.path(u + a, v + b, f_number) - self.front.path(u - a, v - b, f_number))
            / (2 * step)
            for a, b in ((step, 0.0), (0.0, step))
        )
        aside = 2 * f_number * (fx * slope_x + fy * slope_y)
        return complex((weight * np.exp(-2j * np.pi * aside)).sum() / np.pi)
