"""The slow camera's arrays held to counting and closed forms, so that they may judge the engine."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import reference as ref
import reference_arrays as arrays
from reference_collect import Product, Rectangle
from test_reference import camera, wave

pytestmark = pytest.mark.long

SQUARES = ref.Squares(np.random.default_rng(1).uniform(size=(1, 9, 11)), 6.1e-6, 6.9e-6)


@pytest.mark.parametrize("scene", [SQUARES, wave(70e3), (Rectangle(-9e-6, 5e-6, -3e-6, 20e-6),)])
def test_pixels_told_one_by_one_are_those_of_rows_and_columns(scene):
    plain = camera(scene, aperture=(0.4e-6, -0.6e-6, 3e-6, 3.5e-6), stray=0.1)
    told = replace(plain, pixels=arrays.tiled("Y", "Y", 12, 16, 4e-6, 5e-6))
    assert ref.mean_electrons(told) == pytest.approx(ref.mean_electrons(plain), rel=1e-12)


def test_light_at_points_is_the_light_in_rows_and_columns():
    x, y = np.linspace(-2, 3, 7), np.linspace(-3, 2, 5)
    grid = np.meshgrid(x, y)
    rectangle = Rectangle(-1.0, 1.5, -2.0, 0.7)
    smooth = Product(lambda u: np.cos(u) + 2, lambda v: np.exp(v))
    for scene in (rectangle, smooth):
        assert scene.at(*grid, 0.8, 1.1) == pytest.approx(scene.inside(x, y, 0.8, 1.1), rel=1e-13)


def test_a_turned_mosaic_keeps_density_and_neighbors():
    pixels = arrays.turned(20, 12, 3e-6, 3e-6)
    x, y, color = pixels.x.ravel(), pixels.y.ravel(), pixels.color.ravel()
    area = pixels.width * pixels.height
    assert area == pytest.approx(240 * 9e-12)
    assert (x.mean(), y.mean()) == pytest.approx((0, 0), abs=1e-12)
    inner = (abs(x) < pixels.width / 2 - 5e-6) & (abs(y) < pixels.height / 2 - 5e-6)
    for i in np.flatnonzero(inner):
        away = np.hypot(x - x[i], y - y[i])
        near = np.flatnonzero(abs(away - 3e-6) < 1e-9)  # as in the mosaic before it was turned
        assert len(near) == 4
        assert away[away > 0].min() == pytest.approx(3e-6)
        found = sorted(color[near])
        assert found == ([0, 0, 2, 2] if color[i] == 1 else [1, 1, 1, 1])


def test_a_stack_takes_all_the_light_once():
    alpha = np.array([3e4, 1e6, 2e7])
    edges = [0, 0.2e-6, 0.9e-6, 4e-6]
    parts = [arrays.layer(a, b, alpha) for a, b in pairwise(edges)]
    assert sum(parts) == pytest.approx(1 - np.exp(-alpha * 4e-6), rel=1e-12)


def test_stray_light_of_scattered_pixels_is_that_of_the_whole_sensor():
    # all pixels in the dark half: the sensor gets five times their own mean
    half = ref.Squares(np.array([[[0.1, 0.9]]]), 40e-6, 60e-6)
    x, y = np.full((1, 5), -30e-6), np.linspace(-20e-6, 20e-6, 5)[None]
    pixels = arrays.Pixels(x, y, np.zeros((1, 5), int), 80e-6, 60e-6, even=False)
    setup = camera(half, pixels=pixels, color=pixels.color, diffraction=False)
    clear = ref.mean_electrons(setup)
    veiled = ref.mean_electrons(replace(setup, stray=0.5))
    # a running sum of 80 squares loses four digits
    assert veiled == pytest.approx(clear * (0.5 + 0.5 * 5), rel=1e-10)


def test_binning_counts():
    assert arrays.binned(np.arange(24.0).reshape(4, 6), 2, 3, (1, 1)) == pytest.approx(
        np.array([[24, 42], [96, 114]])
    )
    bayer = np.tile([[1.0, 2.0], [3.0, 4.0]], (4, 6))
    found = arrays.binned(bayer, 2, 3, (2, 2))
    assert found == pytest.approx(6 * np.tile([[1.0, 2.0], [3.0, 4.0]], (2, 2)))
