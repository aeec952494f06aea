"""Shot noise from one normal a pixel, against the Poisson law itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from vcam_cli.physics.noise import CORNISH_FISHER_MEAN, gaussian_shot_noise, poisson_from_normal
from vcam_cli.rng import stream


def total_variation(mean, dtype=np.float64, count=2_000_001):
    """Distance between the Poisson law and what evenly spread quantiles of a normal become."""
    z = stats.norm.ppf((np.arange(count) + 0.5) / count).astype(dtype)
    k = poisson_from_normal(np.full(count, mean, dtype), z).astype(int)
    share = np.bincount(k) / count
    law = stats.poisson.pmf(np.arange(len(share)), mean)
    return 0.5 * (np.abs(share - law).sum() + stats.poisson.sf(len(share) - 1, mean))


@pytest.mark.parametrize(
    ("mean", "distance"),
    [
        # Exact inversion: what is left is the grid of 2e6 quantiles, about 1e-5.
        (1e-3, 2e-5),
        pytest.param(0.5, 2e-5, marks=pytest.mark.long),
        (3.0, 2e-5),
        (7.99, 2e-5),
        # Expansion: 8e-4 at 8, 5e-5 at 50 (third-order term left out falls as m^-3/2).
        (8.0, 1e-3),
        pytest.param(50.0, 1e-4, marks=pytest.mark.long),
        (2500.0, 5e-5),
    ],
)
def test_distance_from_the_poisson_law(mean, distance):
    assert total_variation(mean) < distance


def test_float32_is_as_good():
    assert total_variation(3.0, np.float32) < 5e-5
    assert total_variation(50.0, np.float32) < 2e-4


@pytest.mark.parametrize("mean", [3.0, 50.0, 2500.0])
def test_mean_and_variance_of_a_million_draws(mean):
    n = 1_000_000
    z = stream(11, "test").standard_normal(n)
    k = poisson_from_normal(np.full(n, mean), z)
    # Standard errors of the mean and of the variance (fourth moment 3 m^2 + m), 5 of them.
    assert abs(k.mean() - mean) < 5 * np.sqrt(mean / n)
    assert abs(k.var() - mean) < 5 * np.sqrt((2 * mean**2 + mean) / n)


@given(
    mean=st.floats(0, 1e12),
    z=st.floats(-8, 8),
)
def test_whole_and_never_negative(mean, z):
    k = poisson_from_normal(np.array([mean]), np.array([z]))[0]
    assert k >= 0
    assert k == np.floor(k)


@given(mean=st.floats(1e-6, 7.9), z=st.floats(-6, 6))
def test_inversion_is_the_quantile(mean, z):
    k = poisson_from_normal(np.array([mean]), np.array([z]))[0]
    # scipy's quantile of the upper tail; where a tail hits a step, either side is right.
    expected = stats.poisson.isf(stats.norm.sf(z), mean)
    near = abs(stats.poisson.sf(min(k, expected), mean) - stats.norm.sf(z)) < 1e-14
    assert k == expected or near


@pytest.mark.parametrize("mean", [0.0, 1e-6, 0.03, 1.0, 7.99])
def test_even_light_draws_what_any_light_does(mean):
    z = np.append(np.random.default_rng(3).standard_normal(100_000), [-9, 7.9, 9, 40])
    even = np.full(z.shape, mean)
    uneven = np.append(even, 5.0)
    assert (
        poisson_from_normal(even, z) == poisson_from_normal(uneven, np.append(z, 0.0))[:-1]
    ).all()


def test_no_light_no_electrons():
    z = np.linspace(-6, 6, 101)
    assert not poisson_from_normal(np.zeros(101), z).any()
    assert not poisson_from_normal(np.full(101, -1.0), z).any()


def test_one_pixel_moves_no_other():
    """Whatever one mean is, all other pixels keep their numbers."""
    z = stream(5, "test").standard_normal(1000)
    mean = np.full(1000, 20.0)
    other = mean.copy()
    other[500] = 3.0
    a, b = poisson_from_normal(mean, z), poisson_from_normal(other, z)
    assert np.array_equal(np.delete(a, 500), np.delete(b, 500))


def test_seam_between_the_two_forms_is_smooth():
    z = stream(6, "test").standard_normal(400_000)
    below = poisson_from_normal(np.full(z.shape, np.nextafter(CORNISH_FISHER_MEAN, 0)), z)
    above = poisson_from_normal(np.full(z.shape, CORNISH_FISHER_MEAN), z)
    # Equal but for the few pixels whose normal lies between the two laws' steps: as many as the
    # sum over k of their distribution functions' distance, 3e-3 where total variation is 8e-4.
    assert (below != above).mean() < 4e-3
    assert np.abs(below - above).max() <= 1


def test_gaussian_has_the_stated_moments():
    z = stream(7, "test").standard_normal(200_000)
    k = gaussian_shot_noise(np.full(z.shape, 100.0), z)
    assert abs(k.mean() - 100) < 5 * np.sqrt(100 / z.size)
    assert abs(k.var() - 100) < 5 * np.sqrt(2 * 100**2 / z.size)
