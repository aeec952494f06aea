"""Light between parallel edges, against line spreads that are known in space."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from optical_paths import PITCH, aperture, on_chart, path, rms, sensor, signal
from scipy.special import sici, struve

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.point_spread import PointSpread
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.image_formation.settings import STANDARD
from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.charts.slanted_edge import SlantedEdge
from vcam_cli.scenes.charts.step_wedge import step_wedge

WAVELENGTH, F_NUMBER = 550e-9, 4.0
STEP = 1e-8
"""Distances at which the spread of a line is known [m]."""
LENS = Diffraction(F_NUMBER, 0.0)
DARK, BRIGHT = 0.2, 0.8
"""Light on both sides of an edge of contrast 0.6."""


def edge_spread(u: np.ndarray) -> np.ndarray:
    """Light behind a perfect lens at distances from an edge whose bright side is u > 0.

    The line spread function of a round pupil is H1(2 v) / v^2, v = pi u / (wavelength N), H1 a
    Struve function (R. Barakat and A. Houston, J. Opt. Soc. Am. 54, 768, 1964); far out H1
    is 2 / pi in the mean.
    """
    tail = light_beyond()
    at = np.interp(np.abs(u), np.arange(len(tail)) * STEP, tail)
    return np.where(u >= 0, 1 - at, at)


@cache
def light_beyond() -> np.ndarray:
    """Part of a line's light beyond distances in steps, on one side."""
    far = 4e-4
    v = np.pi * np.arange(STEP / 2, far, STEP) / (WAVELENGTH * F_NUMBER)
    line = struve(1, 2 * v) / v**2 * STEP
    half = line.sum() + 2 / np.pi * (WAVELENGTH * F_NUMBER / np.pi) ** 2 / far
    return np.concatenate([[half], half - np.cumsum(line)]) / (2 * half)


def pixel_means(g, angle: float, parts: int = 24) -> np.ndarray:
    """Means of an edge's light over collecting areas (rows, columns), by midpoints."""
    y, x = (
        (np.arange(count) - (count - 1) / 2)[:, None] * pitch
        + ((np.arange(parts) + 0.5) / parts - 0.5) * size
        for count, pitch, size in (
            (g.rows, g.pitch_y, g.collecting_height),
            (g.columns, g.pitch_x, g.collecting_width),
        )
    )
    u = x.ravel() * math.cos(angle) + y.ravel()[:, None] * math.sin(angle)
    fine = edge_spread(u).reshape(g.rows, parts, g.columns, parts)
    return fine.mean(axis=(1, 3))


@pytest.mark.parametrize("angle", [0.0, 0.1, -0.7, math.pi / 2])
@pytest.mark.parametrize("shape", [(12, 16), (1, 90), (90, 1), (8, 300), (1, 1)])
def test_edges_against_the_line_spread_of_a_perfect_lens(shape, angle):
    g = sensor(*shape, fill=(0.8, 0.6))
    optical_path = path(g, LENS, aperture(g), knobs=replace(STANDARD, tolerance=2e-5))
    found = signal(optical_path, on_chart(optical_path, SlantedEdge(angle, 0.6)))
    bright = pixel_means(g, angle)
    expected = [DARK + (BRIGHT - DARK) * each for each in (bright, 1 - bright)]
    # which side is bright is the chart's; midpoints of a pixel's area err by some 1e-5
    assert min(rms(found, each) for each in expected) < 4e-5


@pytest.mark.parametrize("angle", [0.0, 0.1, -0.7, math.pi / 2])
@pytest.mark.parametrize("pitch", [1e-6, 3e-6])
def test_edges_against_the_sine_integrals_of_a_measured_spread(pitch, angle):
    """Each sample is a sinc function, which rings where it is coarser than the pixels.

    An edge behind one is a sine integral; means over the areas are Gauss's.
    """
    samples = np.random.default_rng(4).random((5, 7)) + 3 * np.pad([[1.0]], [(1, 3), (4, 2)])
    samples /= samples.sum()
    g = sensor(12, 16, fill=(0.8, 0.6))
    spread = PointSpread("spread", pitch, (), samples[None], b"")
    optical_path = path(g, spread, aperture(g), knobs=finely(1e-6))
    found = signal(optical_path, on_chart(optical_path, SlantedEdge(angle, 0.6), margin=4))
    node, weight = np.polynomial.legendre.leggauss(8)
    sides = (g.collecting_width, math.cos(angle)), (g.collecting_height, math.sin(angle))
    across = sum(
        np.expand_dims(node / 2 * side * part, 1 - axis) for axis, (side, part) in enumerate(sides)
    )
    share = np.outer(weight, weight) / 4
    end = 0.5 / pitch / max(abs(part) for _, part in sides)
    u = (np.arange(16) - 7.5) * PITCH * sides[0][1]
    u = u + (np.arange(12)[:, None] - 5.5) * PITCH * sides[1][1]
    bright = np.full(u.shape, 0.5)
    for (row, column), part in np.ndenumerate(samples):
        place = ((column - 3) * sides[0][1] + (row - 2) * sides[1][1]) * pitch
        seen = 2 * math.pi * end * (u[..., None, None] + across - place)
        bright += part / math.pi * (sici(seen)[0] * share).sum(axis=(2, 3))
    # which side is bright is the chart's
    expected = [DARK + (BRIGHT - DARK) * (0.5 + sign * (bright - 0.5)) for sign in (1, -1)]
    assert min(rms(found, each) for each in expected) < 2e-7


@pytest.mark.parametrize("tolerance", [0.02, 0.005, 2e-4])
def test_periods_and_tables_take_little_of_the_tolerance(tolerance):
    """Beside the same edge with a thousandth of the tolerance: 0.7 % of it at most."""
    g = sensor(24, 32, fill=(0.8, 0.6))
    found = []
    for part in (1.0, 1e-3):
        seen = path(g, Diffraction(8.0, 0.0), aperture(g), knobs=finely(part * tolerance))
        found.append(signal(seen, on_chart(seen, SlantedEdge(0.1, 0.6))))
    assert rms(*found) < 0.007 * tolerance


def finely(tolerance: float):
    """Settings whose tolerance alone limits how light is computed."""
    return replace(STANDARD, tolerance=tolerance, table_size=4097, float_width=64)


def test_steps_of_a_wedge_are_edges_that_add_up():
    """Each patch between two edges, by the line spread function of a perfect lens."""
    g = sensor(3, 61)
    optical_path = path(g, LENS, aperture(g), knobs=replace(STANDARD, tolerance=2e-5))
    wedge = step_wedge(4, 1.5, Frame(g.sensor_width, g.sensor_height))
    found = signal(optical_path, on_chart(optical_path, wedge))
    profile = wedge.profile()
    x = (np.arange(61) - 30)[:, None] * PITCH + (np.arange(48) + 0.5 - 24) / 48 * PITCH
    expected = np.full(61, profile.levels[0])
    for place, step in zip(profile.places, np.diff(profile.levels), strict=True):
        expected += step * edge_spread(x - place).mean(axis=1)
    np.testing.assert_allclose(found, np.tile(expected, (3, 1)), atol=1e-4)


def test_what_separates_acts_across_the_edge():
    """An average along rows beside that of the pixel: of images that are displaced."""
    g = sensor(4, 40)
    length, count = 3 * PITCH, 60
    still = path(g, LENS, aperture(g), knobs=replace(STANDARD, tolerance=2e-5))
    edge = on_chart(still, SlantedEdge(0.1, 0.6))
    both = replace(still, effects=(*still.effects, PixelAperture(length, 0.0)))
    places = (np.arange(count) + 0.5) / count * length - length / 2
    shifted = [
        signal(replace(still, geometry=replace(g, detector_x=p, collecting_x=p)), edge)
        for p in places
    ]
    np.testing.assert_allclose(signal(both, edge), np.mean(shifted, axis=0), atol=1e-4)
