"""A bound from below on full signal, from the lowest frequencies of a picture."""

from dataclasses import replace

import numpy as np
import pytest

from vcam_cli.engine import bandwidth, brightness, sampling
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.transfer import Tables

PITCH = 2e-6
SIZE = 40, 56


def filter_of(dense: int = 1, aperture: float = PITCH) -> sampling.Filter:
    """A picture of one sample a pixel through a lens that is dark from 1.4 Nyquist frequencies."""
    top = 1.4 / (2 * PITCH)
    values = np.linspace(1, 0, 200)[None, None] ** np.array([1.0, 2.0])[:, None]
    tables = Tables(np.eye(1), 300 * values, top, 0.0)
    y, x = (Axis(n, PITCH, dense * n, PITCH / dense, PITCH / dense / 2, True, top) for n in SIZE)
    along = [np.sinc(a.frequencies * aperture) for a in (x, y)]
    return sampling.Filter(x, y, tables, *along)


def star(rng):
    picture = np.zeros(SIZE)
    picture[17, 30] = 1.0
    return picture


PICTURES = {
    "even": lambda rng: np.ones(SIZE),
    "noise": lambda rng: rng.random(SIZE),
    "star": star,
    "half": lambda rng: np.repeat([[0.1, 1.0]], SIZE[1] // 2, axis=1) * np.ones((SIZE[0], 1)),
    "stripes": lambda rng: np.indices(SIZE)[1] % 2.0,
}


@pytest.mark.parametrize("kind", PICTURES)
def test_no_patch_is_brighter_than_the_brightest_place(kind):
    picture = PICTURES[kind](np.random.default_rng(4))
    filter = filter_of()
    coefficients = sampling.spectrum(picture[None].copy(), 1)
    least = brightness.least(filter, coefficients)
    dense = replace(filter, x=filter_of(8).x, y=filter_of(8).y)
    series = dense.apply(coefficients, 1)
    most = max(series(c, slice(None)).max() for c in (0, 1))
    # A hundredth of a percent: the brightest place lies between those that are looked at.
    assert 0 < least <= most * (1 + 1e-4)
    if kind in ("even", "half"):  # larger than the patches: a tenth of them is elsewhere
        assert least > 0.9 * most


def test_an_even_picture_is_its_level():
    coefficients = sampling.spectrum(np.full((1, *SIZE), 0.7), 1)
    assert brightness.least(filter_of(), coefficients) == pytest.approx(0.7 * 300, rel=1e-12)


def test_one_term_is_the_mean():
    picture = np.random.default_rng(3).random((1, *SIZE))
    coefficients = sampling.spectrum(picture.copy(), 1)
    mean = 300 * picture.mean()
    assert brightness.least(filter_of(), coefficients, 1) == pytest.approx(mean, rel=1e-12)


@pytest.mark.parametrize("tolerance", [0.02, 0.005, 0.001, 0.0002])
def test_a_spectrum_at_hand_may_lose_half_of_what_is_asked(tolerance):
    part = bandwidth.at_hand(tolerance)
    assert tolerance / 10 <= part <= tolerance / 2
    assert part <= 8e-4 or tolerance > 0.005  # standard accuracy is to be within 0.1 %


@pytest.mark.parametrize("seed", range(5))
def test_a_spectrum_is_followed_as_far_as_it_must_be_and_no_further(seed):
    rng = np.random.default_rng(seed)
    frequency = np.sort(rng.uniform(0, 4, 200))
    spread = bandwidth.Spread(frequency, rng.exponential(size=(3, 200)) / (1 + frequency) ** 4)
    budget = 0.3 * spread.beyond(0.0)
    enough = spread.enough(budget)
    shorter = frequency[np.searchsorted(frequency, enough) - 1]
    assert spread.beyond(enough) <= budget < spread.beyond(shorter)
