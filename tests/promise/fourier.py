"""The mean signal of a camera whose chart is known by its Fourier series: no sampling, no margin.

A lens without aberrations passes no frequency beyond its cut-off 1 / (wavelength N (1 - m)), so
the sum over the harmonics below it is finite and exact. It shares no code with the package: levels
of light are those of tests/reference.py, the OTF and the sums are written out here.

    setup = periodic_cameras.setup(camera, light)        # numbers of the camera, SI units
    series = lattice_truth.point_grid(spacing, diameter, cutoff(setup))
    truth = mean_electrons(setup, series)                # (rows, columns) [electrons]
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pupil_otf
from reference import Setup, electrons_per_light, one_minus_m
from reference_collect import Squares, centers
from reference_light import Aberrated, Measured
from reference_silicon import absorption


@dataclass(frozen=True)
class Series:
    """Light B(x, y) = sum_kl Re(coefficients[l, k] exp(2 pi i (fx[k] x + fy[l] y))).

    B is 1 for the perfect white; x to the right, y down, from the center of the array.
    """

    fx: np.ndarray
    """(K,) at least 0 [cycles/m]"""
    fy: np.ndarray
    """(L,) of both signs [cycles/m]"""
    coefficients: np.ndarray
    """(L, K); those of fx > 0 stand for their conjugates at -fx, too, and are twice as large."""


def working_f_number(setup: Setup) -> float:
    """N (1 - m)."""
    return setup.f_number * one_minus_m(setup.focal_length, setup.distance)


def cutoff(setup: Setup, along: tuple[float, float] | None = None) -> float:
    """The highest frequency that the lens passes, at any wavelength [cycles/m].

    along: in that direction, else in any. A measured spread passes what its samples can hold, up to
    half a period a sample along each axis.
    """
    if isinstance(setup.lens, Measured):
        most = math.sqrt(0.5) if along is None else 0.5 / max(map(abs, along))
        return most / setup.lens.pitch
    return 1 / (float(setup.wavelength.min()) * working_f_number(setup))


def otf(frequency: np.ndarray, ring: float) -> np.ndarray:
    """Of diffraction at a circular pupil; ring: wavelength x N (1 - m) [m]."""
    nu = np.minimum(frequency * ring, 1.0)
    return (2 / math.pi) * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))


def transfer(setup: Setup, fx: np.ndarray, fy: np.ndarray, component: int = 0) -> np.ndarray:
    """Electrons of a pixel for light of amplitude 1 at frequencies of one shape S: (C, *S)."""
    level = electrons_per_light(setup)[component]  # (C, J) per m2 of the photodetector
    seen = level.any(axis=0)
    one, wavelengths = level[:, seen], setup.wavelength[seen]
    if setup.lens is None:
        passed = _radial(setup, one, wavelengths, np.hypot(fx, fy).ravel())
    else:
        passed = np.zeros((len(level), fx.size), complex)
        for column, wavelength in zip(one.T, wavelengths, strict=True):
            own = _aberrated(setup, fx.ravel(), fy.ravel(), wavelength)
            own = own * _silicon(setup, np.hypot(fx, fy).ravel(), wavelength)
            passed += np.multiply.outer(column, own)
    _, _, width, height = setup.aperture
    aperture = width * height * np.sinc(fx * width) * np.sinc(fy * height)
    return np.asarray(passed.reshape(-1, *aperture.shape) * aperture)


def _aberrated(setup: Setup, fx: np.ndarray, fy: np.ndarray, wavelength: float) -> np.ndarray:
    """Transfer of a lens with a wavefront or with a measured spread, (F,)."""
    if isinstance(setup.lens, Aberrated):
        front = setup.lens.front
        return pupil_otf.transfer(front, fx, fy, wavelength, working_f_number(setup))
    assert isinstance(setup.lens, Measured)
    (x, y), most = setup.lens.places(), 0.5 / setup.lens.pitch
    along, down = (
        np.exp(-2j * math.pi * np.outer(f, at)) * (abs(f) < most)[:, None]
        for f, at in ((fx, x), (fy, y))
    )
    return ((down @ setup.lens.shares(wavelength)) * along).sum(axis=1)


def _radial(
    setup: Setup, level: np.ndarray, wavelengths: np.ndarray, radius: np.ndarray
) -> np.ndarray:
    """The same of a perfect lens and the silicon, before the aperture: (C, F)."""
    place = None
    if level.shape[1] > 1 or setup.silicon is not None:
        radius, place = np.unique(radius, return_inverse=True)
    passed = np.zeros((len(level), len(radius)))
    for column, wavelength in zip(level.T, wavelengths, strict=True):
        own = otf(radius, wavelength * working_f_number(setup))
        passed += np.multiply.outer(column, own * _silicon(setup, radius, wavelength))
    return passed if place is None else passed[:, place]


def _silicon(setup: Setup, radius: np.ndarray, wavelength: float) -> np.ndarray | float:
    """What the diffusion of charge leaves, (F,)."""
    if setup.silicon is None:
        return 1.0
    return setup.silicon.modulation(radius, absorption(np.array([wavelength])))[0]


@dataclass(frozen=True)
class Motion:
    """Straight motion of the image during the exposure, one row after the other or all at once."""

    path: tuple[float, float]
    """What the image goes during the exposure, right and down [m]."""
    late: np.ndarray
    """When each row is exposed after the array's middle, over the exposure time: (rows,)."""


def picture(setup: Setup, squares: Squares) -> list[Series]:
    """Every channel as squares of light, mirrored at its borders: a series of two pictures' size.

    Harmonics that no channel has, such as all but one of rows that are equal, are left out.
    """
    mirrored = np.concatenate([squares.planes, squares.planes[:, ::-1]], axis=1)
    mirrored = np.concatenate([mirrored, mirrored[:, :, ::-1]], axis=2)
    found = np.fft.fft2(mirrored) / mirrored[0].size
    least = 1e-16 * abs(found).max()
    axes = []
    for axis, side in ((1, squares.height), (2, squares.width)):
        count = mirrored.shape[axis]
        most = math.floor(count * side * cutoff(setup))
        k = np.arange(0 if axis == 2 else -most, most + 1)
        k = k[(abs(found).max(axis=(0, 3 - axis)) > least)[k % count]]
        f = k / (count * side)
        turn = np.exp(-2j * math.pi * f * (0.5 - count / 4) * side) * np.sinc(f * side)
        axes.append((k % count, f, turn))
    (row, fy, down), (column, fx, across) = axes
    across = across * np.where(fx > 0, 2, 1)  # of a real picture the rest are conjugates
    return [Series(fx, fy, down[:, None] * one[np.ix_(row, column)] * across) for one in found]


def mean_electrons(setup: Setup, *components: Series, motion: Motion | None = None) -> np.ndarray:
    """Mean photo-electrons of every pixel, in the shape of their colors, (rows, columns)."""
    x, y, gather = places(setup)
    planes = np.zeros((len(setup.response), len(y), len(x)))
    for number, series in enumerate(components):
        if not series.coefficients.size:
            continue
        fx, fy = np.meshgrid(series.fx, series.fy)
        light = series.coefficients * transfer(setup, fx, fy, number)  # (C, L, K)
        down = np.exp(2j * math.pi * np.outer(y, series.fy))
        across = np.exp(2j * math.pi * np.outer(series.fx, x))
        if motion is None:
            planes = planes + (down @ light @ across).real
            continue
        gone_x, gone_y = motion.path
        light = light * np.sinc(fx * gone_x + fy * gone_y)
        down = down * np.exp(-2j * math.pi * np.outer(gone_y * motion.late, series.fy))
        aside = np.exp(-2j * math.pi * np.outer(gone_x * motion.late, series.fx))
        planes = planes + ((down @ light) * aside @ across).real
    return gather(planes)


def places(setup: Setup) -> tuple[np.ndarray, np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """x (n,) and y (m,) of a grid on which all photodetectors lie [m], and how to take them out.

    From planes (C, m, n) of all colors to the pixels, each of its own color.
    """
    off_x, off_y = setup.aperture[:2]
    if setup.pixels is None:
        rows, columns = setup.color.shape
        x, y = centers(columns, setup.pitch_x), centers(rows, setup.pitch_y)
        row, column = np.indices((rows, columns))
    else:  # equal to a thousandth of a nanometer
        (x, column), (y, row) = (
            np.unique(np.round(at, 12), return_inverse=True)
            for at in (setup.pixels.x, setup.pixels.y)
        )
        row, column = row.reshape(setup.pixels.x.shape), column.reshape(setup.pixels.x.shape)
    return x + off_x, y + off_y, lambda planes: planes[setup.color, row, column]
