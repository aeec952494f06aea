"""Density estimators: closed forms, other people's code, and known densities."""

import numpy as np
import pytest
from scipy import optimize, stats

from vcam_cli.scheduling import density_estimators
from vcam_cli.scheduling.density_estimators import ESTIMATORS, kernel, nearest_neighbor
from vcam_cli.scheduling.density_estimators import penalized_likelihood as penalized

PLACE = np.arange(200) + 0.5
TWO_HILLS = 0.6 * stats.norm.pdf(PLACE, 60, 8) + 0.4 * stats.norm.pdf(PLACE, 140, 15)


def drawn(pixels, seed=1):
    return np.random.default_rng(seed).multinomial(pixels, TWO_HILLS / TWO_HILLS.sum())


@pytest.mark.parametrize("name", ESTIMATORS)
def test_many_pixels_give_the_density_itself(name):
    found = ESTIMATORS[name](drawn(10**7))
    assert found.sum() == pytest.approx(1)
    # Silverman's bandwidth, 1.5 bins here, widens the narrower hill by 1.7 %
    assert np.abs(found - TWO_HILLS).sum() < 0.03


@pytest.mark.parametrize(
    ("name", "share"), [("nearest-neighbor", 0.8), ("penalized-likelihood", 0.5)]
)
def test_few_pixels_are_smoothed(name, share):
    counts = drawn(2000)
    hills = 0.1 * TWO_HILLS.max() < TWO_HILLS  # neighbors that are far make heavy tails
    raw = np.abs(counts / counts.sum() - TWO_HILLS)[hills].sum()
    assert np.abs(ESTIMATORS[name](counts) - TWO_HILLS)[hills].sum() < share * raw


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_uniform_histogram_stays_uniform(name):
    np.testing.assert_allclose(ESTIMATORS[name](np.full(50, 40.0)), 0.02, rtol=1e-6)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_one_bin_and_two_are_no_special_case(name):
    np.testing.assert_allclose(ESTIMATORS[name](np.array([7.0])), [1.0])
    assert ESTIMATORS[name](np.array([9.0, 9.0])).tolist() == pytest.approx([0.5, 0.5])


def test_the_kernel_is_that_of_scipy():
    """Of one hill, far from the ends; scipy puts the pixels of a bin at its middle, too."""
    counts = np.zeros(400)
    counts[100:300] = drawn(3000)
    place = np.arange(400)
    mean = counts @ place / counts.sum()
    deviation = np.sqrt(counts @ (place - mean) ** 2 / counts.sum())
    sample = np.repeat(place, counts.astype(int))
    quartile = np.diff(np.quantile(sample, [0.25, 0.75]))[0] / 1.34
    width = 0.9 * min(deviation, quartile) * counts.sum() ** -0.2
    theirs = stats.gaussian_kde(sample, width / np.std(sample, ddof=1))(place)
    # Quartiles within a bin, and a kernel that is sampled
    assert np.abs(kernel(counts) - theirs).sum() < 0.01


def test_the_nearest_neighbor_is_found_by_counting():
    counts = drawn(900)
    cells = np.repeat(np.arange(-200, 400), np.concatenate([counts[::-1], counts, counts[::-1]]))
    ranks = np.concatenate([np.arange(n) for n in np.unique(cells, return_counts=True)[1]])
    sizes = np.repeat(*[np.unique(cells, return_counts=True)[1]] * 2)
    pixels = cells + (ranks + 0.5) / sizes  # spread evenly over their bins
    reach = np.array([np.sort(np.abs(pixels - x))[29] for x in PLACE])  # the 30th of 900
    expected = (1 / reach) / (1 / reach).sum()
    found = nearest_neighbor(counts)
    inner = counts > 0
    # Half a pixel of thirty, at one end or at both
    np.testing.assert_allclose(found[inner], expected[inner], rtol=0.05)


@pytest.mark.parametrize("strength", [1.0, 1e3])
def test_a_penalized_fit_is_the_largest_likelihood(strength):
    counts = drawn(500)[::5].astype(float)
    found, _ = density_estimators._penalized_fit(counts, strength)

    def loss(eta):
        return np.exp(eta).sum() - counts @ eta + strength / 2 * np.square(np.diff(eta, 2)).sum()

    start = np.log(counts + 1.0)
    best = optimize.minimize(loss, start, method="BFGS", options={"gtol": 1e-7, "maxiter": 4000})
    np.testing.assert_allclose(found, np.exp(best.x), rtol=1e-3, atol=1e-4)
    assert found.sum() == pytest.approx(counts.sum())  # a constant is no roughness


def test_the_penalty_of_least_aic_follows_the_roughness():
    straight = np.random.default_rng(3).poisson(np.geomspace(5, 500, 150))
    slope = np.diff(np.log(penalized(straight)), 2)
    assert np.abs(slope).max() < 1e-3  # the logarithm of an exponential density is a line
