"""Polynomials between the entries of a table, against the polynomial that made them."""

import numpy as np
import pytest

from vcam_cli.physics.interpolation import between_entries, lagrange


@pytest.mark.parametrize("points", [2, 4, 6])
@pytest.mark.parametrize("axis", [0, 1, -1])
def test_a_polynomial_is_found_again(points, axis):
    """One of degree points - 1 is the one through any of its values, at the ends, too."""
    rng = np.random.default_rng(points)
    factors = rng.standard_normal((points, 3, 2)) + 1j * rng.standard_normal((points, 3, 2))

    def values(place: np.ndarray) -> np.ndarray:
        powers = (place / 8)[:, None] ** np.arange(points)
        return np.moveaxis(np.tensordot(powers, factors, 1), 0, axis)

    place = np.array([0.0, 0.3, 3.5, 4.0, 7.9, 8.0])
    found = between_entries(values(np.arange(9.0)), place, points, axis)
    np.testing.assert_allclose(found, values(place), rtol=1e-11, atol=1e-12)


def test_the_nearest_entries_are_used():
    table = np.zeros(9)
    table[7:] = 1e6
    assert not between_entries(table, np.array([4.5]), 4, 0).any()


def test_weights_sum_to_1():
    at = np.linspace(-1, 5, 50)
    weights = lagrange(np.array([0.0, 1.0, 3.0, 4.0]), at)
    assert weights.shape == (50, 4)
    np.testing.assert_allclose(weights.sum(axis=1), 1, rtol=1e-12)
