"""Bounds on what blurs change of scenes, against what they change."""

import math

import numpy as np
import pytest
from scipy import integrate

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.scenes.blur_change import BlurLoss, edge_energy, squares_factor

PITCH = 2e-6


def loss(spread: float, most: float = 2.0) -> BlurLoss:
    return BlurLoss(np.ones((1, 1, 1)), np.array([spread]), most)


@pytest.mark.parametrize("most", [1.0, 2.0])
@pytest.mark.parametrize("distance", [0.0, 0.3e-6, 5e-6, 80e-6])
def test_energy_of_edges_is_the_integral_over_frequency(distance, most):
    """Of min(most, 2 pi f s)^2 / (2 pi f)^2 cos(2 pi f u), both signs of f."""
    spread = 0.4e-6
    end = most / (2 * math.pi * spread)
    turn = 2 * math.pi * distance * end  # of x = f / end
    below, _ = integrate.quad(lambda x: math.cos(turn * x), 0, 1, limit=2000)
    beyond = 1.0
    if distance:
        beyond, _ = integrate.quad(lambda x: x**-2, 1, math.inf, weight="cos", wvar=turn)
    expected = 2 * spread**2 * below * end + 2 * (most / (2 * np.pi)) ** 2 * beyond / end
    found = edge_energy(np.array(distance), np.array([spread]), most)[0]
    assert found == pytest.approx(expected, abs=1e-7 * spread)


@pytest.mark.parametrize("displaced", [0.1, 0.7, 3.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_picture_changes_by_at_most_the_factor_of_its_steps(displaced, seed):
    """Squares of light, half of which go one way and half the other: the worst of that spread."""
    rng = np.random.default_rng(seed)
    samples = rng.random(64) if seed else (np.arange(64) % 2).astype(float)
    parts = 50
    light = np.repeat(samples, parts)
    shift = round(displaced * parts)
    moved = (np.roll(light, shift) + np.roll(light, -shift)) / 2
    for blurred in (moved, np.roll(light, shift)):
        change = math.sqrt(np.mean(np.square(blurred - light)))
        steps = math.sqrt(np.mean(np.square(np.roll(samples, 1) - samples)))
        factor = squares_factor(PITCH, loss(displaced * PITCH))[0]
        assert change <= factor * steps


def test_the_factor_of_small_blurs_is_close():
    """Checks are the picture of which a displacement takes most."""
    samples, parts, shift = (np.arange(64) % 2).astype(float), 100, 3
    light = np.repeat(samples, parts)
    change = math.sqrt(np.mean(np.square(np.roll(light, shift) - light)))
    factor = squares_factor(PITCH, loss(shift / parts * PITCH))[0]
    assert change <= factor <= 1.8 * change


@pytest.mark.parametrize("f_number", [1.4, 4.0, 16.0])
def test_the_spread_of_diffraction_bounds_its_transfer(f_number):
    lens = Diffraction(f_number, 0.0)
    wavelength = 550e-9
    f = np.linspace(1e-6, 2, 4000) * lens.cutoff(wavelength)
    lost = (1 - lens.otf(f, wavelength)) / (2 * np.pi * f)
    spread = lens.spread(np.array([wavelength]))[0]
    assert lost.max() <= spread * (1 + 1e-9)
    assert lost.max() >= 0.95 * spread
