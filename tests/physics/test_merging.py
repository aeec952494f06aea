"""Merging of readings: unbiased where one of them saturates, least variance elsewhere."""

import numpy as np
import pytest

from vcam_cli.physics.merging import Reading, merged

COUNT = 400_000
TOP, FINE, COARSE = 1000.0, 30.0, 200.0


def readings(mean: float, rng: np.random.Generator) -> list[Reading]:
    """A coarse reading, and a fine one that is clipped at its top."""
    coarse = mean + COARSE * rng.standard_normal(COUNT)
    fine = np.minimum(mean + FINE * rng.standard_normal(COUNT), TOP)
    return [Reading(coarse, COARSE**2, 1e9, COARSE), Reading(fine, FINE**2, TOP, FINE)]


@pytest.mark.parametrize("rule", ["snr", "switch"])
@pytest.mark.parametrize("sigmas", [-6, -2, -1, 0, 1, 3])
def test_the_mean_goes_straight_through_the_switch(rule, sigmas) -> None:
    """Whoever takes fine readings below their top alone finds 2 % too little at 0 sigmas."""
    mean = TOP + sigmas * FINE
    found = merged(readings(mean, np.random.default_rng(sigmas + 10)), rule)
    assert found.values.mean() == pytest.approx(mean, abs=5 * COARSE / COUNT**0.5)


def test_far_below_its_top_the_merge_has_the_least_variance() -> None:
    """1 / (1 / a^2 + 1 / b^2), as no other weights of the two give."""
    found = merged(readings(500.0, np.random.default_rng(1)), "snr")
    least = 1 / (1 / FINE**2 + 1 / COARSE**2)
    np.testing.assert_allclose(found.variance, least)
    assert found.values.var() == pytest.approx(least, rel=5 * (2 / COUNT) ** 0.5)
    alone = merged(readings(500.0, np.random.default_rng(1)), "switch")
    assert alone.values.var() == pytest.approx(FINE**2, rel=5 * (2 / COUNT) ** 0.5)


def test_above_its_top_the_coarse_reading_is_left() -> None:
    both = readings(TOP + 20 * FINE, np.random.default_rng(2))
    np.testing.assert_array_equal(merged(both, "snr").values, both[0].values)
