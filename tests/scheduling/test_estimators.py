"""Estimates of the photocurrent, against dense covariance matrices and simulated samples."""

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.scheduling import estimators

TIMES = np.array([1e-3, 4e-3, 9e-3, 30e-3])


def covariance(rate, times, read, reset):
    return rate * np.minimum.outer(times, times) + read * np.eye(len(times)) + reset


@examples(60)
@given(
    st.lists(st.floats(1e-4, 1.0), min_size=1, max_size=7, unique=True),
    st.floats(1e2, 1e6),
    st.floats(0, 1e4),
    st.floats(0.5, 1e3),
    st.floats(0, 1e3),
)
def test_variance_is_that_of_the_dense_matrix(times, current, dark, read, reset):
    times = np.sort(times)
    dense = covariance(current + dark, times, read, reset)
    expected = 1 / (times @ np.linalg.solve(dense, times))
    found = estimators.weighted_variance(current, times, dark, read, reset)
    # the dense matrix's condition number reaches 1e7
    assert found == pytest.approx(expected, rel=1e-7)


def test_without_read_noise_the_last_sample_is_all():
    found = estimators.weighted_variance(2e4, TIMES, 100.0, 0.0, 0.0)
    assert found == pytest.approx((2e4 + 100) / TIMES[-1], rel=1e-12)


def test_the_estimate_is_the_dense_one():
    rng = np.random.default_rng(1)
    current, dark, read, reset = 3e4, 500.0, 900.0, 400.0
    dense = covariance(current + dark, TIMES, read, reset)
    samples = (current + dark) * TIMES + rng.multivariate_normal(np.zeros(4), dense, 5)
    none = np.zeros((4, 5), bool)
    found = estimators.weighted_estimate(samples.T, TIMES, none, dark, read, reset)
    guess = samples[:, -1] / TIMES[-1] - dark
    t = TIMES
    for _ in range(50):  # to the fixed point
        guess = np.array([
            (t @ np.linalg.solve(c, sample - dark * t)) / (t @ np.linalg.solve(c, t))
            for sample, c in (
                (s, covariance(max(g, 0) + dark, TIMES, read, reset))
                for s, g in zip(samples, guess, strict=True)
            )
        ])  # fmt: skip
    # three passes leave the weights within 1e-4 of their own fixed point
    np.testing.assert_allclose(found, guess, rtol=1e-4)


def test_simulated_samples_have_that_variance():
    rng = np.random.default_rng(2)
    count, current, dark, read, reset = 40_000, 2e4, 1e3, 400.0, 225.0
    steps = rng.poisson((current + dark) * np.diff(TIMES, prepend=0)[:, None], (4, count))
    samples = steps.cumsum(axis=0) + rng.normal(0, reset**0.5, count)
    samples = samples + rng.normal(0, read**0.5, (4, count))
    none = np.zeros((4, count), bool)
    expected = float(estimators.weighted_variance(current, TIMES, dark, read, reset))
    found = estimators.weighted_estimate(samples, TIMES, none, dark, read, reset)
    # five standard errors: of the mean, and of the variance, sqrt(2 / n) = 0.7 %
    assert found.mean() == pytest.approx(current, abs=5 * (expected / count) ** 0.5)
    assert found.var() == pytest.approx(expected, rel=5 * (2 / count) ** 0.5)
    last = estimators.last_sample_before_saturation(samples, TIMES, none, dark)
    assert found.var() < last.var()


def test_saturated_samples_are_left_out():
    current = np.array([1e3, 4e5, 4.9e6, 1e9])
    samples = np.minimum(current * TIMES[:, None], 5000.0)
    full = samples >= 5000
    assert estimators.last_usable_sample(full).tolist() == [3, 2, 0, -1]
    found = estimators.last_sample_before_saturation(samples, TIMES, full)
    np.testing.assert_allclose(found[:3], current[:3], rtol=1e-12)
    assert found[3] == pytest.approx(5000 / TIMES[0])
    best = estimators.weighted_estimate(samples, TIMES, full, 0.0, 25.0, 100.0)
    np.testing.assert_allclose(best[:3], current[:3], rtol=1e-12)
    assert np.isfinite(best).all()


def test_a_sample_after_saturation_does_not_count_again():
    """Noise may bring a full pixel's reading back below the threshold."""
    full = np.array([[False], [True], [False], [True]])
    assert estimators.last_usable_sample(full).tolist() == [0]


def test_nothing_at_all_is_nothing():
    none = np.zeros((4, 3), bool)
    found = estimators.weighted_estimate(np.zeros((4, 3)), TIMES, none, 0.0, 25.0, 0.0)
    assert np.array_equal(found, np.zeros(3))
