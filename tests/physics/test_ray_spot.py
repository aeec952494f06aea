"""Corners of light through round spots of rays, against sums over their points."""

import numpy as np
import pytest

from vcam_cli.physics.ray_spot import RaySpot


def points(power: int) -> tuple[np.ndarray, np.ndarray]:
    """300,000 points, each of as much of the spot's light."""
    k = np.arange(300_000) + 0.5
    share = k / len(k)
    radius = np.sqrt(share if power == 0 else 1 - np.sqrt(1 - share))
    angle = np.pi * (1 + np.sqrt(5)) * k
    return radius * np.cos(angle), radius * np.sin(angle)


@pytest.mark.parametrize("power", [0, 1])
def test_ramps_and_corners_are_means_over_the_spot(power):
    u, v = points(power)
    spot = RaySpot(1.0, power)
    for a, b in np.random.default_rng(power).uniform(-1, 1, (20, 2)):
        ramp, other = np.maximum(a + u, 0), np.maximum(b + v, 0)
        assert float(spot.ramp(np.array(a))) == pytest.approx(ramp.mean(), abs=1e-5)
        found = float(spot.corner(np.array(a), np.array(b)))
        assert found == pytest.approx((ramp * other).mean(), abs=1e-5)


@pytest.mark.parametrize("power", [0, 1])
def test_corners_are_the_sum_of_few_products(power):
    spot = RaySpot(1.0, power)
    signs, values = spot.products()
    at = np.linspace(0, 1, values.shape[1])
    a, b = np.random.default_rng(power).uniform(-1, 1, (2, 5000))
    both = [np.interp(np.abs(x), at, value) for value in values for x in (a, b)]
    summed = sum(s * p * q for s, p, q in zip(signs, both[::2], both[1::2], strict=True))
    exact = spot.corner(a, b) - spot.ramp(a) * spot.ramp(b)
    assert len(signs) <= 10
    np.testing.assert_allclose(summed, exact, atol=1e-6)
    beyond = np.array([-3.0, -1.0, 1.0, 2.5])
    np.testing.assert_allclose(spot.ramp(beyond), [0, 0, 1, 2.5], atol=1e-15)
