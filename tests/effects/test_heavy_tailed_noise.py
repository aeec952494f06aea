"""Heavy-tailed read noise: moments and tails of Tukey's lambda distribution in closed form."""

import math
from functools import partial

import numpy as np
import pytest
from making import QUIET, camera, radiance_for
from scipy.special import beta
from scipy.stats import tukeylambda

from vcam_cli import simulate
from vcam_cli.effects.noise.heavy_tailed_noise import (
    HeavyTailedNoise,
    tukey_lambda,
    tukey_lambda_spread,
)
from vcam_cli.effects.signal_chain import Site
from vcam_cli.rng import stream

N = 1_000_000


def draws(shape: float, dtype=np.float64) -> np.ndarray:
    site = Site(1, N, partial(stream, 3), partial(stream, 3), dtype)
    return HeavyTailedNoise(2.0, shape).apply(np.zeros((1, N), dtype), site)[0]


def kurtosis(shape: float) -> float:
    """Fourth moment over the squared second: of (u^s - (1 - u)^s) / s by beta functions."""
    second = 2 * (1 / (1 + 2 * shape) - beta(1 + shape, 1 + shape))
    fourth = 2 / (1 + 4 * shape) - 8 * beta(1 + 3 * shape, 1 + shape)
    fourth += 6 * beta(1 + 2 * shape, 1 + 2 * shape)
    return fourth / second**2


@pytest.mark.parametrize("shape", [0.14, 0.05, -0.05, -0.1])
def test_moments(shape):
    """Standard errors of variance and fourth moment from the sample itself."""
    x = draws(shape) / 2
    assert x.mean() == pytest.approx(0, abs=5 / math.sqrt(N))
    assert x.var() == pytest.approx(1, abs=5 * np.std(x**2) / math.sqrt(N))
    assert np.mean(x**4) == pytest.approx(kurtosis(shape), abs=5 * np.std(x**4) / math.sqrt(N))


@pytest.mark.parametrize("shape", [-0.3, -0.1, 0.0, 0.1])
def test_share_beyond_each_quantile(shape):
    """Where the fourth moment is infinite, too: what lies beyond Q(u) is 1 - u."""
    found = draws(shape) / 2
    square = (
        2 / shape**2 * (1 / (1 + 2 * shape) - beta(1 + shape, 1 + shape))
        if shape
        else (math.pi**2 / 3)
    )
    for u in (0.6, 0.99, 0.999):
        edge = (u**shape - (1 - u) ** shape) / shape if shape else math.log(u / (1 - u))
        share = np.mean(found > edge / math.sqrt(square))
        assert share == pytest.approx(1 - u, abs=5 * math.sqrt(u * (1 - u) / N))


def test_small_shapes_reach_the_logistic():
    u = np.array([1e-12, 0.2, 0.5, 0.9])
    np.testing.assert_allclose(tukey_lambda(u, 1e-9), np.log(u / (1 - u)), rtol=1e-7, atol=1e-15)


@pytest.mark.parametrize("shape", [-0.4, -0.11, -0.0999, -1e-9, 0.0, 1e-5, 0.0999, 0.11, 0.5])
def test_the_spread_is_that_of_tukeys_distribution(shape):
    """On both sides of where it is a series; the library's own formulas err by 1e-14."""
    assert tukey_lambda_spread(shape) == pytest.approx(tukeylambda.std(shape), rel=3e-14)


def test_tails_in_a_frame_stand_out_of_normal_ones(tmp_path):
    """Beyond five sigma: 6e-7 of normal numbers, some 4e-4 of these."""
    size = {"array.rows": 300, "array.columns": 400, "scene.radiance": radiance_for(500)}
    noise = {"pixel.readout.heavy_tailed_noise": {"rms": "4 e", "shape": -0.2}}
    states = {"effects": QUIET | {"heavy_tailed_noise": "on"}}
    result = simulate(camera(tmp_path, size | noise | states))
    apart = np.abs(result.electrons - result.mean_electrons) / 4
    scale = math.sqrt(2 / 0.04 * (1 / 0.6 - beta(0.8, 0.8)))
    tail = np.linspace(0.9, 1, 2_000_001)[:-1]
    quantile = (tail**-0.2 - (1 - tail) ** -0.2) / -0.2 / scale
    expected = 2 * (1 - tail[np.searchsorted(quantile, 5)])
    found = np.mean(apart > 5)
    assert expected > 1e-4
    assert found == pytest.approx(expected, abs=5 * math.sqrt(expected / apart.size))
