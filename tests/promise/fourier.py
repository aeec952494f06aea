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
from dataclasses import dataclass

import numpy as np
from reference import Setup, electrons_per_light, one_minus_m
from reference_collect import centers


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


def cutoff(setup: Setup) -> float:
    """The highest frequency that the lens passes at any wavelength [cycles/m]."""
    return 1 / (float(setup.wavelength.min()) * working_f_number(setup))


def otf(frequency: np.ndarray, ring: float) -> np.ndarray:
    """Of diffraction at a circular pupil; ring: wavelength x N (1 - m) [m]."""
    nu = np.minimum(frequency * ring, 1.0)
    return (2 / math.pi) * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))


def transfer(setup: Setup, fx: np.ndarray, fy: np.ndarray) -> np.ndarray:
    """Electrons of a pixel for light of amplitude 1 at frequencies of one shape S: (C, *S)."""
    level = electrons_per_light(setup)[0]  # (C, J) per m2 of the photodetector
    radius, place = np.hypot(fx, fy).ravel(), None
    if level.shape[1] > 1:
        radius, place = np.unique(radius, return_inverse=True)
    passed = np.zeros((len(level), len(radius)))
    for column, wavelength in zip(level.T, setup.wavelength, strict=True):
        passed += np.multiply.outer(column, otf(radius, wavelength * working_f_number(setup)))
    if place is not None:
        passed = passed[:, place]
    _, _, width, height = setup.aperture
    aperture = width * height * np.sinc(fx * width) * np.sinc(fy * height)
    return np.asarray(passed.reshape(-1, *aperture.shape) * aperture)


def mean_electrons(setup: Setup, series: Series) -> np.ndarray:
    """Mean photo-electrons of every pixel: (rows, columns)."""
    fx, fy = np.meshgrid(series.fx, series.fy)
    light = series.coefficients * transfer(setup, fx, fy)  # (C, L, K)
    rows, columns = setup.color.shape
    x = centers(columns, setup.pitch_x) + setup.aperture[0]
    y = centers(rows, setup.pitch_y) + setup.aperture[1]
    down = np.exp(2j * math.pi * np.outer(y, series.fy))
    across = np.exp(2j * math.pi * np.outer(series.fx, x))
    planes = (down @ light @ across).real
    return np.take_along_axis(planes, setup.color[None], axis=0)[0]
