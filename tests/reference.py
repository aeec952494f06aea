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
- Other lenses (reference_light) and silicon (reference_silicon) blur squares on a patch: cells on
  which all displacements and waves of the picture are summed with their shares, by Fourier sums.
- What lies above a pixel (reference_pixel) is integrated over the exit pupil ray by ray.
- Relative illumination multiplies the light before it is blurred, at its own place (squares), or
  varies inside the photodetector (waves).

Accuracy: 1e-9 without diffraction and for waves without diffraction, 1e-7 for waves with
diffraction, about 1e-4 of full signal for squares with diffraction (tests/test_reference.py).

Axes: x to the right, y down, the origin at the center of the array, lengths in meters. Pictures
are upright: row 0 is the top of the scene.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from reference_arrays import Pixels
from reference_collect import Collector, Product, Rectangle, Squares, Waves, centers
from reference_light import Aberrated, Field, Measured, Rays, Wavefront, airy_modulation, encircled
from reference_pixel import Pupil, Stack, microlens_shift, vignetting
from reference_silicon import Diffusion, absorption
from scipy.special import j1

PLANCK, LIGHT, CHARGE, BOLTZMANN = 6.62607015e-34, 299792458.0, 1.602176634e-19, 1.380649e-23
GOLDEN = math.pi * (3 - math.sqrt(5))  # the angle that spreads points most evenly


@dataclass(frozen=True)
class Setup:
    """All the reference needs to know of one camera and its scene; SI units."""

    scene: Squares | Waves | tuple[Rectangle | Product, ...]  # a tuple: its parts added up
    wavelength: np.ndarray  # (J,) [m]
    weight: np.ndarray  # (J,) quadrature weights [m]; 1 for spectral lines
    radiance: np.ndarray  # (K, J) S_k [W/(sr m2 m)]; [W/(sr m2)] for lines
    response: np.ndarray  # (C, J) electrons per photon on the photodetector: tau x filter x QE
    color: np.ndarray  # (rows, columns) which of the C colors a pixel has; see reference_arrays
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
    lens: Aberrated | Field | Measured | Rays | None = None  # None: perfect
    cell: float = 0.25e-6  # of the patch on which squares are blurred by any but a perfect lens [m]
    silicon: Diffusion | None = None
    illumination: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())  # heights [m], values
    stray: float = 0.0
    pupil: float | None = None  # its distance [m]; None: the image distance
    stack: Stack | None = None
    tunnel: tuple[float, float] = (0.0, 0.0)  # width, height [m]
    internal: bool = False  # the response is that of light inside the silicon
    microlens: str = "none"  # "optimal" follows the chief ray, "centered" does not
    lag: tuple[float, int] | None = None  # charge left behind at a transfer, transfers a pixel
    pixels: Pixels | None = None  # where they are, if not in rows and columns a pitch apart

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the sensor [m]."""
        if self.pixels is not None:
            return self.pixels.width, self.pixels.height
        rows, columns = self.color.shape
        return columns * self.pitch_x, rows * self.pitch_y

    @property
    def centers(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the pixels: x, y, each (rows, columns) [m]."""
        if self.pixels is not None:
            return self.pixels.x, self.pixels.y
        rows, columns = self.color.shape
        x, y = np.meshgrid(centers(columns, self.pitch_x), centers(rows, self.pitch_y))
        return x, y


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


def working_number(setup: Setup) -> float:
    """N (1 - m / P): image-side cone through an exit pupil P times as large as the entrance one.

    The exit pupil is (P - m) f from the sensor.
    """
    m = 1 - one_minus_m(setup.focal_length, setup.distance)
    larger = 1.0 if setup.pupil is None else setup.pupil / setup.focal_length + m
    return setup.f_number * (1 - m / larger)


def relative_illumination(setup: Setup, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """E(phi) / E(0) at sensor places; eq 2.22 as it is printed, in extended precision, or cos^4."""
    image_distance = one_minus_m(setup.focal_length, setup.distance) * setup.focal_length
    b = (np.asarray(x, np.longdouble) ** 2 + np.asarray(y, np.longdouble) ** 2) / image_distance**2
    if setup.off_axis == "none":
        return np.ones(b.shape)
    if setup.off_axis == "file":
        return np.interp(np.sqrt(np.asarray(b, float)) * image_distance, *setup.illumination)
    if setup.off_axis == "cos4":
        return np.asarray((1 + b) ** -2, float)
    working = np.longdouble(working_number(setup))
    a = 1 / (4 * working**2)  # tan^2 theta: sin^2 theta = 1 / (1 + 4 (N (1 - m))^2)

    def disk(b: np.ndarray) -> np.ndarray:
        return (1 - (1 - a + b) / np.sqrt(b**2 + 2 * b * (1 - a) + (1 + a) ** 2)) / 2

    return np.asarray(disk(b) / disk(np.zeros(1, np.longdouble)), float)


def displacements(setup: Setup, step: float, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the Airy patterns send the light: displacements (n, 2) [m] and shares (n, J).

    Circles near the center (several in each bright ring, points about `step` apart); beyond fifteen
    rings single points on a spiral, each standing for the same share of what is left there. The
    last row of shares, one more than there are displacements, is what goes further than `reach`.
    """
    ring = setup.wavelength * working_number(setup)
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


def electrons_per_light(setup: Setup) -> np.ndarray:
    """(K, C, J): electrons per m2 of photodetector for B_k = 1 on axis, at each wavelength."""
    working = working_number(setup)
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
        more = max(0, math.ceil((setup.size[2 - axis] / 2 + reach) / side - count / 2)) + 1
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


DISPLACEMENTS = 64
"""Displacements of the light by diffraction that are summed together."""


def electrons_of_areas(setup: Setup) -> np.ndarray:
    """Mean photo-electrons of every pixel, of whatever is not waves: (rows, columns)."""
    off_x, off_y, width, height = setup.aperture
    ring = setup.wavelength.max() * working_number(setup)
    reach = max(*setup.size, 60 * ring) if setup.diffraction else 0.0
    places, shares = np.zeros((1, 2)), np.eye(2, 1) * np.ones(len(setup.wavelength))
    if setup.diffraction:
        places, shares = displacements(setup, min(width, height) / 4, reach)
    amount = electrons_per_light(setup) @ shares.T  # (K, C, n): electrons per m2 sent by each
    x, y = places_of(setup)
    electrons = np.zeros(setup.color.shape)
    room = reach + abs(off_x) + abs(off_y) + width + height
    for sent, collector in zip(amount, collectors(setup, room), strict=True):
        for start in range(0, len(places), DISPLACEMENTS):
            some = slice(start, start + DISPLACEMENTS)
            dx, dy = places[some].T
            if setup.pixels is not None:
                each = -1, *[1] * x.ndim
                at = x - dx.reshape(each), y - dy.reshape(each)
                light = collector.at(*at, width, height)
            else:
                light = collector.inside(x[0] - dx[:, None], y[:, 0] - dy[:, None], width, height)
            share = sent[:, :-1][:, some].T[:, setup.color]
            electrons += np.einsum("n...,n...->...", share, light)
        electrons += sent[:, -1][setup.color] * collector.far * width * height
    return electrons


@dataclass(frozen=True)
class Patch:
    """The mirrored picture as it repeats, on square cells that squares of light are cut into."""

    planes: np.ndarray  # (K, ny, nx), the picture in the first quarter
    step_x: float
    step_y: float

    @property
    def x(self) -> np.ndarray:
        """Displacements from -half to half the period, 0 in the first place [m]."""
        return np.fft.fftfreq(self.planes.shape[2], 1 / self.planes.shape[2]) * self.step_x

    @property
    def y(self) -> np.ndarray:
        return np.fft.fftfreq(self.planes.shape[1], 1 / self.planes.shape[1]) * self.step_y

    @property
    def frequency(self) -> tuple[np.ndarray, np.ndarray]:
        ny, nx = self.planes.shape[1:]
        return np.fft.fftfreq(nx, self.step_x), np.fft.fftfreq(ny, self.step_y)

    def collector(self, plane: np.ndarray, more: int = 4) -> Collector:
        """Of one plane of this size, good to `more` cells beyond the picture."""
        ny, nx = plane.shape
        rows, columns = np.arange(-more, ny // 2 + more) % ny, np.arange(-more, nx // 2 + more) % nx
        left, top = -(nx / 4 + more) * self.step_x, -(ny / 4 + more) * self.step_y
        return Collector(plane[np.ix_(rows, columns)], "", left, top, self.step_x, self.step_y)


def patch_of(setup: Setup) -> Patch:
    """The scene's squares, cut into cells, times the relative illumination."""
    scene = setup.scene
    assert isinstance(scene, Squares)
    assert scene.outside == "mirror"
    cut_x, cut_y = (math.ceil(s / setup.cell - 1e-6) for s in (scene.width, scene.height))
    fine = scene.planes.repeat(cut_y, axis=1).repeat(cut_x, axis=2)
    step_x, step_y = scene.width / cut_x, scene.height / cut_y
    x, y = centers(fine.shape[2], step_x), centers(fine.shape[1], step_y)
    fine = fine * relative_illumination(setup, x, y[:, None])
    fine = np.concatenate([fine, fine[:, ::-1]], axis=1)
    return Patch(np.concatenate([fine, fine[:, :, ::-1]], axis=2), step_x, step_y)


def lens_shares(setup: Setup, patch: Patch, lens: Aberrated, wavelength: float) -> np.ndarray:
    """What a lens sends by every displacement on the patch: (ny, nx), of sum 1.

    What goes further than half the period is spread evenly over it.
    """
    working = working_number(setup)
    shares = lens.spread(patch.x, patch.y, wavelength, working)
    return shares + (1 - shares.sum()) / shares.size


def lens_on_patch(setup: Setup, patch: Patch, wavelength: float) -> tuple[np.ndarray, ...]:
    """Transform of what the lens does: at the patch's frequencies (ny, nx), and far beyond them."""
    (fx, fy), lens, one = patch.frequency, setup.lens, np.ones((1, 1))
    if isinstance(lens, Measured):  # displacements by whole cells are the same beyond
        x, y = lens.places()
        down = np.exp(-2j * np.pi * np.outer(fy, y))
        found = down @ lens.shares(wavelength) @ np.exp(-2j * np.pi * np.outer(x, fx))
        return found, found
    if isinstance(lens, Field):  # place by place, in electrons_of_field
        return one, 0 * one
    if lens is None and not setup.diffraction:
        return one, one
    ring = wavelength * working_number(setup)
    found = np.fft.fft2(lens_shares(setup, patch, lens or Aberrated(Wavefront()), wavelength))
    return found * (np.hypot(fx, fy[:, None]) < 1 / ring), 0 * one


def patch_transfers(setup: Setup, patch: Patch) -> Iterator[np.ndarray]:
    """What lens and silicon do to the light on the patch's cells, at each wavelength: (ny, nx).

    Cells are squares and not points. Of what the patch holds at a frequency f the part
    sinc(f cell)^2 (once for the light's squares, once for the photodetector's) is of that
    frequency, and the rest of those around the multiples of 1 / cell, far beyond it.
    """
    fx, fy = patch.frequency
    own = np.outer(np.sinc(fy * patch.step_y), np.sinc(fx * patch.step_x)) ** 2
    radius, place = np.unique(np.hypot(fx, fy[:, None]), return_inverse=True)
    silicon = np.ones((len(setup.wavelength), len(radius) + 1))
    if setup.silicon is not None:
        at = np.append(radius, 1 / patch.step_x)
        silicon = setup.silicon.modulation(at, absorption(setup.wavelength))
    for passed, wavelength in zip(silicon, setup.wavelength, strict=True):
        near, far = lens_on_patch(setup, patch, wavelength)
        yield own * near * passed[place.reshape(own.shape)] + (1 - own) * far * passed[-1]


def places_of(setup: Setup) -> tuple[np.ndarray, np.ndarray]:
    """Centers of the areas that collect the pixels' light: x, y, each (rows, columns) [m]."""
    cx, cy = setup.centers
    x, y = cx + setup.aperture[0], cy + setup.aperture[1]
    if setup.microlens == "optimal" and setup.stack is not None:
        dx, dy = microlens_shift(setup.stack, cx, cy, pupil_of(setup).distance)
        return x + dx, y + dy
    return x, y


def electrons_of_patch(setup: Setup) -> np.ndarray:
    """Mean photo-electrons of every pixel, of squares and any lens and silicon."""
    patch, light = patch_of(setup), electrons_per_light(setup)
    spectra = np.fft.fft2(patch.planes)
    passed = np.zeros((*light.shape[:2], *spectra.shape[1:]), complex)
    for j, one in enumerate(patch_transfers(setup, patch)):
        passed += light[:, :, j, None, None] * one
    planes = np.fft.ifft2((spectra[:, None] * passed).sum(axis=0)).real  # (C, ny, nx)
    x, y = places_of(setup)
    each = np.array([patch.collector(p).at(x, y, *setup.aperture[2:]) for p in planes])
    color = setup.color.reshape(-1, *x.shape)
    return np.take_along_axis(each, color, axis=0).reshape(setup.color.shape)


def electrons_of_field(setup: Setup, chosen: np.ndarray) -> np.ndarray:
    """The same with a lens that changes over the field: the chosen pixels (rows, columns) of bool.

    The rest is nan. At every chosen pixel the light of all displacements, each with the share that
    the lens sends by it at this pixel's place, after the silicon (blurs may change places).
    """
    patch, light = patch_of(setup), electrons_per_light(setup)
    spectra = np.fft.fft2(patch.planes)
    x, y = places_of(setup)
    found = np.where(chosen, 0.0, np.nan)
    for j, one in enumerate(patch_transfers(setup, patch)):
        planes = np.fft.ifft2(spectra * one).real
        mixed = np.tensordot(light[:, :, j].T, planes, 1)  # (C, ny, nx)
        whole = [patch.collector(plane, more=max(plane.shape) // 2 + 20) for plane in mixed]
        for i, k in zip(*np.nonzero(chosen), strict=True):
            lens = Aberrated(setup.lens.at(x[i, k], y[i, k]))
            shares = lens_shares(setup, patch, lens, setup.wavelength[j])
            u, v = np.meshgrid(x[i, k] - patch.x, y[i, k] - patch.y)
            area = whole[setup.color[i, k]].at(u, v, *setup.aperture[2:])
            found[i, k] += (shares * area).sum()
    return found


def passed_by(setup: Setup, fx: float, fy: float) -> np.ndarray:
    """What lens and silicon leave of a wave, at each wavelength: (J,)."""
    f = math.hypot(fx, fy)
    working = working_number(setup)
    passed = np.ones(len(setup.wavelength), complex)
    if setup.lens is not None:
        passed *= [setup.lens.transfer(fx, fy, w, working) for w in setup.wavelength]
    elif setup.diffraction and f:
        passed *= [airy_modulation(f * w * working) for w in setup.wavelength]
    if setup.silicon is not None:
        alpha = absorption(setup.wavelength)
        passed *= setup.silicon.modulation(np.array([f]), alpha)[:, 0]
    return passed


def electrons_of_waves(setup: Setup, waves: Waves) -> np.ndarray:
    """Mean photo-electrons of every pixel, scene of waves, 12 x 12 Gauss points a photodetector."""
    width, height = setup.aperture[2:]
    light = electrons_per_light(setup)[0]
    passed = np.array([passed_by(setup, fx, fy) for fx, fy in zip(waves.fx, waves.fy, strict=True)])
    level = np.asarray(waves.amplitude)[:, None] * (passed @ light.T)  # (waves, C)
    node, weight = np.polynomial.legendre.leggauss(12)
    x, y = places_of(setup)
    electrons = np.zeros(setup.color.shape)
    for p, wp in zip(node, weight, strict=True):
        for q, wq in zip(node, weight, strict=True):
            u, v = x + q * width / 2, y + p * height / 2
            area = width * height * wp * wq / 4 * relative_illumination(setup, u, v)
            for n, (fx, fy, phase) in enumerate(zip(waves.fx, waves.fy, waves.phase, strict=True)):
                swing = np.exp(1j * (2 * np.pi * (fx * u + fy * v) + phase))
                electrons += (level[n][setup.color] * area * swing).real
    return electrons


def pupil_of(setup: Setup) -> Pupil:
    image = one_minus_m(setup.focal_length, setup.distance) * setup.focal_length
    working = working_number(setup)
    return Pupil(image if setup.pupil is None else setup.pupil, working)


def unveiled(setup: Setup) -> np.ndarray:
    """What the light brings each pixel that goes where it should, before the layers above it."""
    plain = setup.lens is None and setup.silicon is None and setup.microlens == "none"
    if isinstance(setup.scene, Waves):
        return electrons_of_waves(setup, setup.scene)
    return electrons_of_areas(setup) if plain else electrons_of_patch(setup)


def photo_electrons(setup: Setup) -> np.ndarray:
    """The same with stray light: a color's mean over its pixels, or over the sensor."""
    photo = unveiled(setup)
    if not setup.stray:
        return photo
    whole, color, even = photo, setup.color, np.zeros_like(photo)
    if setup.pixels is not None and not setup.pixels.even:
        grid = setup.pixels.everywhere()
        whole, color = unveiled(replace(setup, pixels=grid, color=grid.color)), grid.color
    for each in np.unique(color):
        even[setup.color == each] = whole[color == each].mean()
    return (1 - setup.stray) * photo + setup.stray * even


def pixel_gains(setup: Setup) -> np.ndarray | float:
    """Part of its light that each pixel keeps of what comes through the layers above it."""
    if setup.stack is None:
        return 1.0
    return vignetting(
        setup.stack, pupil_of(setup), *setup.centers, setup.tunnel,
        internal=setup.internal, follows=setup.microlens == "optimal",
    )  # fmt: skip


def mean_electrons(setup: Setup) -> np.ndarray:
    """Mean electrons of every pixel, light and dark current, before saturation: (rows, columns)."""
    kept = photo_electrons(setup) * pixel_gains(setup)
    return kept + setup.dark_rate * setup.time
