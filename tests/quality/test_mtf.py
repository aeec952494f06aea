"""The slanted edge on edges whose transfer is a closed form: a Gaussian lens, square pixels.

A pixel's value is the edge's error function averaged over its square by Gauss-Legendre rule.
"""

import itertools
import math

import numpy as np
import pytest
from making import long_except
from scipy.special import erf

from vcam_cli.quality.mtf import Lattice, crossing_frequency, slanted_edge_sfr, tukey_window

PITCH = 4e-6


def lattice(degrees, sigma, side=160, shift=0.3, step=1, start=(0, 0), bright=1.0):
    """An edge through (shift, 0) pixels, its normal turned by `degrees`; sigma in pixels."""
    x = np.arange(side) + 0.5 - side / 2
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    nodes, weights = np.polynomial.legendre.leggauss(9)
    value = np.zeros((side, side))
    for dx, wx in zip(nodes / 2, weights / 2, strict=True):
        for dy, wy in zip(nodes / 2, weights / 2, strict=True):
            away = (x[None, :] + dx - shift) * c + (x[:, None] + dy) * s
            value += wx * wy * (0.5 + 0.5 * bright * erf(away / sigma / math.sqrt(2)))
    rows, columns = slice(start[0], None, step), slice(start[1], None, step)
    return Lattice(1000 * value[rows, columns], PITCH * x[columns], PITCH * x[rows])


def closed_form(frequency, degrees, sigma):
    """Gaussian times the pixel's square, seen across the edge."""
    f = frequency * PITCH
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    aperture = np.abs(np.sinc(f * c) * np.sinc(f * s))
    return np.exp(-2 * (np.pi * f * sigma) ** 2) * aperture


def seen(*lattices, reach=40):
    return slanted_edge_sfr(lattices, PITCH, reach * PITCH)


@pytest.mark.parametrize(
    ("degrees", "sigma"),
    long_except(
        [(5, 0.3), (-5, 0.6), (12, 1.5), (85, 4.0), (95, 0.3), (185, 0.6), (5, 4.0)],
        itertools.product([5, -5, 12, 85, 95, 185], [0.3, 0.6, 1.5, 4.0]),
        several=True,
    ),
)
def test_transfer_and_angle(sigma, degrees):
    """Without noise: to 1e-3 of the transfer, and 0.1 % of MTF50, up to Nyquist's frequency."""
    found = seen(lattice(degrees, sigma))
    low = found.frequency < 0.5 / PITCH
    expected = closed_form(found.frequency, degrees, sigma)
    np.testing.assert_allclose(found.mtf[low], expected[low], atol=1e-3)
    half = crossing_frequency(found.frequency, expected, 0.5)
    assert found.mtf50 == pytest.approx(half, rel=1e-3)
    turned = math.degrees(found.angle) - degrees
    assert abs((turned + 90) % 180 - 90) < 0.01


def test_one_color_of_a_mosaic_sees_the_same():
    """A quarter of the pixels sample the edge unevenly: 0.5 % of MTF50."""
    half = crossing_frequency(f := np.linspace(0, 0.5 / PITCH, 2000), closed_form(f, 5, 0.6), 0.5)
    red = lattice(5, 0.6, step=2)
    assert seen(red).mtf50 == pytest.approx(half, rel=5e-3)
    greens = [lattice(5, 0.6, step=2, start=start) for start in ((0, 1), (1, 0))]
    assert seen(*greens).mtf50 == pytest.approx(half, rel=2e-3)


def test_dark_may_be_on_either_side():
    bright, dark = seen(lattice(5, 0.6)), seen(lattice(5, 0.6, bright=-1.0))
    np.testing.assert_allclose(bright.mtf, dark.mtf, atol=1e-9)


def test_noise_costs_little():
    """Noise of 1 % of the edge: single frames scatter, their mean does not move by 1 %."""
    edge, rng = lattice(5, 0.6), np.random.default_rng(8)
    half = seen(edge).mtf50
    each = [
        seen(Lattice(edge.values + rng.normal(0, 10, edge.values.shape), edge.x, edge.y)).mtf50
        for _ in range(25)
    ]
    assert np.abs(np.array(each) / half - 1).max() < 0.06
    assert np.mean(each) == pytest.approx(half, rel=0.01)


def test_corrections_matter():
    """Without those for derivative and bins MTF50 of a sharp edge is percents too low."""
    found = seen(lattice(5, 0.3))
    f = found.frequency * PITCH / 4
    plain = found.mtf * np.sinc(2 * f) * np.sinc(f)
    assert crossing_frequency(found.frequency, plain, 0.5) < 0.98 * found.mtf50


def test_a_bent_edge_wants_a_curve():
    """Distortion of a pixel over the field blurs a straight fit, and not one of degree 2."""
    x = np.arange(160) - 79.5
    bend = 0.087 * x + 2 * (x / 80) ** 2
    values = 0.5 + 0.5 * erf((x[None, :] - bend[:, None]) / 0.6 / math.sqrt(2))
    edge = [Lattice(values, PITCH * x, PITCH * x)]
    straight, curved = (
        slanted_edge_sfr(edge, PITCH, 40 * PITCH, degree=degree).mtf50 for degree in (1, 2)
    )
    gauss = math.sqrt(math.log(2) / 2) / (math.pi * 0.6 * PITCH)
    assert curved == pytest.approx(gauss, rel=0.01)
    assert straight < 0.97 * gauss


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.ones((40, 40)), "no edge"),
        (np.ones((1, 1)), "too few"),
        (np.ones((3, 80)), "too few"),
    ],
)
def test_no_edge(pixels, words):
    axes = [PITCH * np.arange(count) for count in pixels.shape[::-1]]
    with pytest.raises(ValueError, match=words):
        seen(Lattice(pixels, *axes))


def test_an_edge_along_the_pixels_is_refused():
    with pytest.raises(ValueError, match="turn it"):
        seen(lattice(0, 0.6))


def test_crossing():
    f, m = np.array([0.0, 1, 2, 3]), np.array([1.0, 0.6, 0.4, 0.5])
    assert crossing_frequency(f, m, 0.5) == pytest.approx(1.5)
    assert crossing_frequency(f, m, 0.1) == math.inf
    assert crossing_frequency(f, m - 1, 0.5) == 0


def test_window():
    for flat in (0.0, 0.5, 1.0):
        window = tukey_window(1000, flat)
        assert window.sum() == pytest.approx(1000 * (1 + flat) / 2, rel=1e-3)
        np.testing.assert_allclose(window, window[::-1], atol=1e-12)
