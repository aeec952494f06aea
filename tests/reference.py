"""The slow camera: the mean signal of a small array by spatial sums, for checking the engine.

It shares no code with the package. Every pixel's charge is what the physics says it is,

    electrons = time sum_k integral dlambda  E_k(lambda) lambda / (h c) response(lambda)
                integral over the photodetector dA  (Airy_lambda * (relative illumination B_k)),

with the scene radiance sum_k B_k(x, y) S_k(lambda) and E_k = pi S_k / (1 + 4 (N (1 - m))^2).
The tools are the plainest that reach the accuracy wanted, in float64 throughout:

- Wavelength: Gauss's rule with three points inside every nanometer (exact for products of up to
  five tables with knots on whole nanometers); spectral lines are a sum over the lines.
- A scene is *squares of light* (every image sample is a uniform square; a chart may be painted on
  squares far smaller than the pixel), or rectangles and products across(x) down(y), or waves.
- The light that a photodetector collects from squares is the sum of the overlaps of rectangles,
  read off the running sum of the squares; exact.
- Blur is the definition of convolution, one displacement after another: the Airy pattern sends a
  known share of the light by the displacement (dx, dy), which is the same as moving the
  photodetector by (-dx, -dy). Displacements lie on circles; the share inside each radius is known
  (1 - J0^2 - J1^2), so no light is lost however far the pattern reaches.
- The modulation of a wave is the Hankel integral of the Airy pattern, not the closed-form OTF.
- Relative illumination multiplies the light before it is blurred, at its own place (squares), or
  varies inside the photodetector (waves).

Accuracy: 1e-9 without diffraction and for waves without diffraction, 1e-7 for waves with
diffraction, about 1e-4 of full signal for squares with diffraction (tests/test_reference.py).

Axes: x to the right, y down, the origin at the center of the array, lengths in meters. Pictures
are upright: row 0 is the top of the scene.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import itj0y0, j0, j1

PLANCK, LIGHT, CHARGE, BOLTZMANN = 6.62607015e-34, 299792458.0, 1.602176634e-19, 1.380649e-23
GOLDEN = math.pi * (3 - math.sqrt(5))  # the angle that spreads points most evenly


@dataclass(frozen=True)
class Squares:
    """Squares of light, each uniform, centerd on the array: B_k = planes[k], shape (K, ny, nx)."""

    planes: np.ndarray
    width: float  # of one square [m]
    height: float  # [m]
    outside: str = "mirror"  # what lies beyond them: "mirror" or "black"


@dataclass(frozen=True)
class Rectangle:
    """B = 1 inside a rectangle of the sensor plane [m], 0 elsewhere."""

    left: float
    right: float
    top: float
    bottom: float

    @property
    def far(self) -> float:
        """What it amounts to far away: a rectangle without end is the same everywhere."""
        return float(math.isinf(self.left))

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Area common to the rectangle and those centerd at every (y, x): (m, n) [m2]."""
        wide = np.minimum(x + width / 2, self.right) - np.maximum(x - width / 2, self.left)
        tall = np.minimum(y + height / 2, self.bottom) - np.maximum(y - height / 2, self.top)
        return np.maximum(tall, 0)[:, None] * np.maximum(wide, 0)


@dataclass(frozen=True)
class Product:
    """B = across(x) down(y), smooth in a photodetector; 0 on average far away."""

    across: Callable[[np.ndarray], np.ndarray]
    down: Callable[[np.ndarray], np.ndarray]
    far = 0.0

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Integral over the rectangles centered at every (y, x), eight Gauss points a side."""
        node, weight = np.polynomial.legendre.leggauss(8)
        wide = self.across(x[:, None] + node * width / 2) @ weight
        tall = self.down(y[:, None] + node * height / 2) @ weight
        return np.outer(tall, wide) * width * height / 4


@dataclass(frozen=True)
class Waves:
    """B = sum_n amplitude cos(2 pi (fx x + fy y) + phase); frequencies [cycles/m], one spectrum."""

    amplitude: tuple[float, ...]
    fx: tuple[float, ...]
    fy: tuple[float, ...]
    phase: tuple[float, ...]


@dataclass(frozen=True)
class Setup:
    """All the reference needs to know of one camera and its scene; SI units."""

    scene: Squares | Waves | tuple[Rectangle | Product, ...]  # a tuple: its parts added up
    wavelength: np.ndarray  # (J,) [m]
    weight: np.ndarray  # (J,) quadrature weights [m]; 1 for spectral lines
    radiance: np.ndarray  # (K, J) S_k [W/(sr m2 m)]; [W/(sr m2)] for lines
    response: np.ndarray  # (C, J) electrons per photon on the photodetector: tau x filter x QE
    color: np.ndarray  # (rows, columns) which of the C colors a pixel has
    pitch_x: float
    pitch_y: float
    aperture: tuple[float, float, float, float]  # center x, y from the cell's center; width, height
    f_number: float
    focal_length: float
    time: float
    distance: float = math.inf
    off_axis: str = "none"
    diffraction: bool = True
    dark_rate: float = 0.0  # dark current of one pixel [e/s]


# --- spectra -------------------------------------------------------------------------------------


def nanometer_rule(start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths and weights [m]: Gauss's three points in every nanometer from start to stop."""
    edges = np.linspace(start, stop, max(1, round((stop - start) / 1e-9)) + 1)
    point, weight = np.polynomial.legendre.leggauss(3)
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    return (middle[:, None] + half[:, None] * point).ravel(), np.outer(half, weight).ravel()


# --- optics --------------------------------------------------------------------------------------


def one_minus_m(focal_length: float, distance: float) -> float:
    """1 - m = so / (so - f) (eq 2.15)."""
    return 1.0 if math.isinf(distance) else distance / (distance - focal_length)


def relative_illumination(setup: Setup, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """E(phi) / E(0) at sensor places; eq 2.22 as it is printed, in extended precision, or cos^4."""
    image_distance = one_minus_m(setup.focal_length, setup.distance) * setup.focal_length
    b = (np.asarray(x, np.longdouble) ** 2 + np.asarray(y, np.longdouble) ** 2) / image_distance**2
    if setup.off_axis == "none":
        return np.ones(b.shape)
    if setup.off_axis == "cos4":
        return np.asarray((1 + b) ** -2, float)
    working = np.longdouble(setup.f_number) * one_minus_m(setup.focal_length, setup.distance)
    a = 1 / (4 * working**2)  # tan^2 theta: sin^2 theta = 1 / (1 + 4 (N (1 - m))^2)

    def disk(b: np.ndarray) -> np.ndarray:
        return (1 - (1 - a + b) / np.sqrt(b**2 + 2 * b * (1 - a) + (1 + a) ** 2)) / 2

    return np.asarray(disk(b) / disk(np.zeros(1, np.longdouble)), float)


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


def displacements(setup: Setup, step: float, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the Airy patterns send the light: displacements (n, 2) [m] and shares (n, J).

    Circles near the center (several in each bright ring, points about `step` apart); beyond fifteen
    rings single points on a spiral, each standing for the same share of what is left there. The
    last row of shares, one more than there are displacements, is what goes further than `reach`.
    """
    ring = setup.wavelength * setup.f_number * one_minus_m(setup.focal_length, setup.distance)
    core = 15 * ring.min()
    node, weight = np.polynomial.legendre.leggauss(4)
    edges = np.linspace(0, core, 31)
    radii = (edges[:-1, None] + edges[1] * (node + 1) / 2).ravel()
    width = np.tile(edges[1] / 2 * weight, 30)
    places: list[np.ndarray] = []
    shares: list[np.ndarray] = []
    for n, (r, dr) in enumerate(zip(radii, width, strict=True)):
        count = int(np.clip(math.ceil(2 * np.pi * r / step), 6, 64))
        angle = GOLDEN * n + 2 * np.pi * np.arange(count) / count
        places.append(r * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        share = 2 * j1(np.pi * r / ring) ** 2 / r * dr  # 2 J1(z)^2 / z dz
        shares.append(np.tile(share / count, (count, 1)))
    spiral = core / (1 - (np.arange(3000) + 0.5) / 3000)
    turns = GOLDEN * np.arange(3000)
    left = (1 - encircled(np.pi * core / ring)) / 3000
    near = spiral < reach
    places.append((spiral * np.stack([np.cos(turns), np.sin(turns)]))[:, near].T)
    shares += [np.tile(left, (near.sum(), 1)), left[None] * (~near).sum()]
    return np.concatenate(places), np.concatenate(shares)


# --- the light on the photodetectors -------------------------------------------------------------


def centers(count: int, pitch: float) -> np.ndarray:
    """Centers of `count` cells along an axis, the array centerd on 0 [m]."""
    return (np.arange(count) + 0.5 - count / 2) * pitch


def electrons_per_light(setup: Setup) -> np.ndarray:
    """(K, C, J): electrons per m2 of photodetector for B_k = 1 on axis, at each wavelength."""
    working = setup.f_number * one_minus_m(setup.focal_length, setup.distance)
    photons = setup.radiance * setup.wavelength / (PLANCK * LIGHT) * setup.weight
    geometry = np.pi / (1 + 4 * working**2)  # eq 2.18
    return setup.time * geometry * photons[:, None, :] * setup.response[None]


def widened(squares: Squares, setup: Setup, reach: float) -> tuple[np.ndarray, float, float]:
    """Squares far enough beyond the array, times the relative illumination: planes, corner x, y.

    Each square is first cut so that it is at most a quarter of the pixel where the illumination
    varies. Beyond the squares given the scene is mirrored or black.
    """
    cut = 1
    if setup.off_axis != "none":
        cut = math.ceil(4 * max(squares.width / setup.pitch_x, squares.height / setup.pitch_y))
    planes: np.ndarray = squares.planes.repeat(cut, axis=1).repeat(cut, axis=2)
    corners = []
    for axis, side in ((1, squares.height / cut), (2, squares.width / cut)):
        count = planes.shape[axis]
        extent = setup.color.shape[axis - 1] * (setup.pitch_y, setup.pitch_x)[axis - 1]
        more = max(0, math.ceil((extent / 2 + reach) / side - count / 2)) + 1
        index = np.arange(-more, count + more) % (2 * count)
        planes = planes.take(np.where(index < count, index, 2 * count - 1 - index), axis=axis)
        if squares.outside == "black":
            edge = [slice(None)] * 3
            for beyond in (slice(0, more), slice(more + count, None)):
                edge[axis] = beyond
                planes[tuple(edge)] = 0
        corners.append(-(count / 2 + more) * side)
    y = corners[0] + (np.arange(planes.shape[1])[:, None] + 0.5) * squares.height / cut
    x = corners[1] + (np.arange(planes.shape[2]) + 0.5) * squares.width / cut
    return planes * relative_illumination(setup, x, y), corners[1], corners[0]


class Collector:
    """Light of one plane of squares inside rectangles, by its running sum (bilinear: exact)."""

    def __init__(
        self, plane: np.ndarray, outside: str, x0: float, y0: float, width: float, height: float
    ):
        self.sum = np.pad(plane.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0))) * width * height
        self.x0, self.y0, self.width, self.height = x0, y0, width, height
        self.far = float(plane.mean()) if outside == "mirror" else 0.0  # B far away

    def up_to(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Light above and to the left of every (y, x): (m, n) [m2]."""
        u, v = (x - self.x0) / self.width, (y - self.y0) / self.height
        i, j = np.floor(v).astype(int), np.floor(u).astype(int)
        s, t = (v - i)[:, None], u - j
        above = self.sum[np.ix_(i, j)] * (1 - t) + self.sum[np.ix_(i, j + 1)] * t
        below = self.sum[np.ix_(i + 1, j)] * (1 - t) + self.sum[np.ix_(i + 1, j + 1)] * t
        return above * (1 - s) + below * s

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Integral of B over the rectangles centerd at every (y, x): (m, n) [m2]."""
        sides = np.concatenate([x - width / 2, x + width / 2])
        rows = np.concatenate([y - height / 2, y + height / 2])
        corner = self.up_to(sides, rows)
        m, n = len(y), len(x)
        return corner[m:, n:] - corner[:m, n:] - corner[m:, :n] + corner[:m, :n]


def collectors(setup: Setup, room: float) -> Sequence[Collector | Rectangle | Product]:
    """One for every component of the scene, good to `room` [m] beyond the array."""
    scene = setup.scene
    if isinstance(scene, tuple):
        assert setup.off_axis == "none"
        return scene
    assert isinstance(scene, Squares)
    planes, x0, y0 = widened(scene, setup, room)
    sides = -2 * x0 / planes.shape[2], -2 * y0 / planes.shape[1]
    return [Collector(plane, scene.outside, x0, y0, *sides) for plane in planes]


def electrons_of_areas(setup: Setup) -> np.ndarray:
    """Mean photo-electrons of every pixel, of whatever is not waves: (rows, columns)."""
    rows, columns = setup.color.shape
    off_x, off_y, width, height = setup.aperture
    ring = setup.wavelength.max() * setup.f_number * one_minus_m(setup.focal_length, setup.distance)
    size = max(rows * setup.pitch_y, columns * setup.pitch_x)
    reach = max(size, 60 * ring) if setup.diffraction else 0.0
    places, shares = np.zeros((1, 2)), np.eye(2, 1) * np.ones(len(setup.wavelength))
    if setup.diffraction:
        places, shares = displacements(setup, min(width, height) / 4, reach)
    amount = electrons_per_light(setup) @ shares.T  # (K, C, n): electrons per m2 sent by each
    x = centers(columns, setup.pitch_x) + off_x
    y = centers(rows, setup.pitch_y) + off_y
    electrons = np.zeros((rows, columns))
    room = reach + abs(off_x) + abs(off_y) + width + height
    for sent, collector in zip(amount, collectors(setup, room), strict=True):
        for n, (dx, dy) in enumerate(places):
            electrons += sent[:, n][setup.color] * collector.inside(x - dx, y - dy, width, height)
        electrons += sent[:, -1][setup.color] * collector.far * width * height
    return electrons


def electrons_of_waves(setup: Setup, waves: Waves) -> np.ndarray:
    """Mean photo-electrons of every pixel, scene of waves, 12 x 12 Gauss points a photodetector."""
    rows, columns = setup.color.shape
    off_x, off_y, width, height = setup.aperture
    light = electrons_per_light(setup)[0]
    ring = setup.wavelength * setup.f_number * one_minus_m(setup.focal_length, setup.distance)
    frequency = np.hypot(waves.fx, waves.fy)
    passed = np.ones((len(frequency), len(ring)))
    if setup.diffraction:
        passed = np.array([[airy_modulation(f * r) if f else 1.0 for r in ring] for f in frequency])
    level = np.asarray(waves.amplitude)[:, None] * (passed @ light.T)  # (waves, C)
    node, weight = np.polynomial.legendre.leggauss(12)
    x = centers(columns, setup.pitch_x) + off_x
    y = centers(rows, setup.pitch_y)[:, None] + off_y
    electrons = np.zeros((rows, columns))
    for p, wp in zip(node, weight, strict=True):
        for q, wq in zip(node, weight, strict=True):
            u, v = x + q * width / 2, y + p * height / 2
            area = width * height * wp * wq / 4 * relative_illumination(setup, u, v)
            for n, (fx, fy, phase) in enumerate(zip(waves.fx, waves.fy, waves.phase, strict=True)):
                swing = np.cos(2 * np.pi * (fx * u + fy * v) + phase)
                electrons += level[n][setup.color] * area * swing
    return electrons


def mean_electrons(setup: Setup) -> np.ndarray:
    """Mean electrons of every pixel, light and dark current, before saturation: (rows, columns)."""
    scene = setup.scene
    if isinstance(scene, Waves):
        photo = electrons_of_waves(setup, scene)
    else:
        photo = electrons_of_areas(setup)
    return photo + setup.dark_rate * setup.time


# --- read-out -------------------------------------------------------------------------------------


def noise_variance(
    setup: Setup,
    *,
    read: float = 0.0,
    reset_capacitance: float = 0.0,
    temperature: float = 300.0,
    offset_pixel: float = 0.0,
    offset_column: float = 0.0,
    gain_pixel: float = 0.0,
    gain_column: float = 0.0,
) -> dict[str, np.ndarray]:
    """Variance [e^2] of every noise source, a plane (rows, columns) each (eq 2.26)."""
    mean = mean_electrons(setup)
    one = np.ones_like(mean)
    return {
        "shot_noise": mean,
        "read_noise": read**2 * one,
        "reset_noise": BOLTZMANN * temperature * reset_capacitance / CHARGE**2 * one,
        "fpn": (offset_pixel**2 + offset_column**2) * one
        + (gain_pixel**2 + gain_column**2) * mean**2,
    }


def digital_number(
    electrons: np.ndarray,
    conversion_gain: float,
    gain: float,
    full_scale: float,
    bits: int,
    offset: float,
) -> np.ndarray:
    """Codes of the linear ADC: round, then clip to 0 .. 2^bits - 1."""
    top = 2**bits - 1
    code = offset + electrons * conversion_gain * gain / full_scale * (top - offset)
    return np.clip(np.rint(code), 0, top)
