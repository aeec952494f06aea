"""Means behind small spots of rays, against means of displaced boxes and against the spectrum."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from making import long_except
from optical_paths import of_picture, sensor
from test_filtering import GRIDS

from vcam_cli.image_formation.spot_average import spot_averages
from vcam_cli.physics.ray_spot import RaySpot

ONE = np.ones((1, 1))


def points(power: int) -> tuple[np.ndarray, np.ndarray]:
    """4000 points of a spot, each of as much of its light."""
    k = np.arange(4000) + 0.5
    share = k / len(k)
    radius = np.sqrt(share if power == 0 else 1 - np.sqrt(1 - share))
    angle = np.pi * (1 + np.sqrt(5)) * k
    return radius * np.cos(angle), radius * np.sin(angle)


def shares(axis, size: float, moved: float) -> np.ndarray:
    """What of boxes lies on each sample or on its mirror images (pixels, samples)."""
    low = axis.first + np.arange(axis.pixels) * axis.pixel_pitch - size / 2 + moved
    edges = np.arange(-axis.samples, 2 * axis.samples + 1) * axis.sample_pitch
    shared = np.minimum.outer(low + size, edges[1:]) - np.maximum.outer(low, edges[:-1])
    left, inner, right = np.split(np.clip(shared, 0, None) / size, 3, axis=1)
    return left[:, ::-1] + inner + right[:, ::-1]


SPOTS = list(
    itertools.product(["aligned", "coarse picture", "odd ratio", "off center"], [0.02, 0.4], [0, 1])
)


@pytest.mark.parametrize(
    ("grid", "radius", "power"),
    long_except(
        [each for each in SPOTS if each[1] == 0.4 and each[0] == "off center"],
        SPOTS,
        several=True,
    ),
)
def test_spots_are_means_over_displaced_boxes(grid, radius, power):
    x, y = GRIDS[grid]
    x, y = (replace(axis, pixels=min(axis.pixels, 5)) for axis in (x, y))
    plane = np.random.default_rng(3).random((y.samples, x.samples))
    size = 0.9 * x.pixel_pitch
    moves = radius * x.pixel_pitch * np.array(points(power))
    means = [shares(y, size, v) @ plane @ shares(x, size, u).T for u, v in moves.T]
    fill = (size / x.pixel_pitch, size / y.pixel_pitch)
    g = sensor(y.pixels, x.pixels, fill=fill, pitch=(x.pixel_pitch, y.pixel_pitch))
    spot = RaySpot(radius * x.pixel_pitch, power)
    scene = of_picture(plane, x.sample_pitch)
    found = spot_averages(scene, ONE, g, (x, y), spot, 1)[0]
    np.testing.assert_allclose(found, np.mean(means, axis=0), atol=1e-3 * radius)
