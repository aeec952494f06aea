"""Zernike polynomials against Noll's table and his normalization; wavefronts and their slopes."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.physics import zernike as z

TABLE = {
    1: lambda r, t: 1,
    2: lambda r, t: 2 * r * np.cos(t),
    3: lambda r, t: 2 * r * np.sin(t),
    4: lambda r, t: np.sqrt(3) * (2 * r**2 - 1),
    5: lambda r, t: np.sqrt(6) * r**2 * np.sin(2 * t),
    6: lambda r, t: np.sqrt(6) * r**2 * np.cos(2 * t),
    7: lambda r, t: np.sqrt(8) * (3 * r**3 - 2 * r) * np.sin(t),
    8: lambda r, t: np.sqrt(8) * (3 * r**3 - 2 * r) * np.cos(t),
    9: lambda r, t: np.sqrt(8) * r**3 * np.sin(3 * t),
    10: lambda r, t: np.sqrt(8) * r**3 * np.cos(3 * t),
    11: lambda r, t: np.sqrt(5) * (6 * r**4 - 6 * r**2 + 1),
    12: lambda r, t: np.sqrt(10) * (4 * r**4 - 3 * r**2) * np.cos(2 * t),
    13: lambda r, t: np.sqrt(10) * (4 * r**4 - 3 * r**2) * np.sin(2 * t),
    14: lambda r, t: np.sqrt(10) * r**4 * np.cos(4 * t),
    15: lambda r, t: np.sqrt(10) * r**4 * np.sin(4 * t),
    22: lambda r, t: np.sqrt(7) * (20 * r**6 - 30 * r**4 + 12 * r**2 - 1),
}
"""Noll 1976, table I (Z_22 by the same rule)."""

coefficients = st.lists(
    st.tuples(st.integers(2, 36), st.floats(-1e-6, 1e-6)), min_size=1, max_size=5
).map(tuple)


@pytest.mark.parametrize("index", TABLE)
def test_agrees_with_the_table_of_noll(index):
    rho, theta = np.linspace(0, 1, 23)[:, None], np.linspace(-4, 4, 31)
    expected = np.broadcast_to(TABLE[index](rho, theta), (23, 31))
    # a few roundings of numbers up to 8
    np.testing.assert_allclose(z.polynomial(index, rho, theta), expected, atol=1e-13)


def test_every_order_has_its_terms():
    """n + 1 of order n; even indices are cosines: Noll 1976, section I."""
    orders = [z.noll_orders(index) for index in range(1, 137)]
    assert [n for n, _ in orders] == [n for n in range(16) for _ in range(n + 1)]
    for n in range(16):
        assert sorted(m for k, m in orders if k == n) == list(range(-n, n + 1, 2))
    assert all((m >= 0) == (i % 2 == 0) for i, (_, m) in enumerate(orders, 1) if m)
    with pytest.raises(ValueError, match="first is 1"):
        z.noll_orders(0)


def test_orthonormal():
    """Mean of the product of any two over the pupil: 0, or 1 for one with itself."""
    node, weight = np.polynomial.legendre.leggauss(24)
    rho, theta = ((node + 1) / 2)[:, None], 2 * np.pi * np.arange(64) / 64
    share = (weight * (node + 1) / 2)[:, None] * np.ones(64) / 64
    every = np.array([z.polynomial(index, rho, theta) for index in range(1, 67)])
    gram = np.einsum("iab,jab,ab->ij", every, every, share)
    # Gauss's rule is exact to degree 47 and so is the sum around: rounding alone
    np.testing.assert_allclose(gram, np.eye(66), atol=1e-12)


@pytest.mark.parametrize("index", [496, 700, 999])
def test_high_orders_keep_their_digits(index):
    """Where the sum of powers has lost them all: against 60 digits."""
    n, m = z.noll_orders(index)
    k = abs(m)
    for rho in (0.1, 0.77, 0.999, 1.0):
        with mpmath.workdps(60):
            total = mpmath.mpf(0)
            for s in range((n - k) // 2 + 1):
                bottom = math.factorial(s) * math.factorial((n + k) // 2 - s)
                bottom *= math.factorial((n - k) // 2 - s)
                whole = mpmath.mpf(math.factorial(n - s)) / bottom
                total += (-1) ** s * whole * mpmath.mpf(rho) ** (n - 2 * s)
            angle = mpmath.sin(k * mpmath.mpf(0.3)) if m < 0 else mpmath.cos(k * mpmath.mpf(0.3))
            expected = float(total * mpmath.sqrt((n + 1) * (2 if k else 1)) * angle)
        # recurrences of 20 steps, values up to 10
        assert z.polynomial(index, rho, 0.3) == pytest.approx(expected, abs=1e-11)


@given(coefficients, st.floats(0, 1), st.floats(-3.2, 3.2))
def test_gradient_is_the_difference_quotient(terms, rho, theta):
    x, y, h = rho * math.cos(theta), rho * math.sin(theta), 1e-4
    slope = z.gradient(terms, x, y)
    across = (z.wavefront(terms, x + h, y) - z.wavefront(terms, x - h, y)) / (2 * h)
    down = (z.wavefront(terms, x, y + h) - z.wavefront(terms, x, y - h)) / (2 * h)
    size = sum(abs(c) for _, c in terms) or 1
    # h^2 times a third derivative of at most 7^6 / 10 at order 7, 1e-3
    assert np.allclose(slope, (across, down), rtol=0, atol=2e-3 * size)


@given(coefficients, st.floats(-7, 7), st.floats(0, 1), st.floats(-3.2, 3.2))
def test_turned_wavefront_has_its_values_further_around(terms, angle, rho, theta):
    turned = z.rotate(terms, angle)
    there = rho * math.cos(theta + angle), rho * math.sin(theta + angle)
    here = rho * math.cos(theta), rho * math.sin(theta)
    assert z.wavefront(turned, *there) == pytest.approx(z.wavefront(terms, *here), abs=1e-18)


@given(coefficients)
def test_rms_is_that_of_the_wavefront(terms):
    node, weight = np.polynomial.legendre.leggauss(12)
    rho, theta = ((node + 1) / 2)[:, None], 2 * np.pi * np.arange(32) / 32
    w = z.wavefront(terms, rho * np.cos(theta), rho * np.sin(theta))
    share = (weight * (node + 1) / 2)[:, None] / 32
    mean = (w * share).sum()
    expected = math.sqrt(max(0.0, ((w - mean) ** 2 * share).sum()))
    assert z.rms(terms) == pytest.approx(expected, rel=1e-9, abs=1e-20)


def test_defocus_is_a_parabola():
    """shift / (8 N_w^2) from the center to the edge, and a mean of zero."""
    terms = z.defocus(20e-6, 2.0)
    edge = 20e-6 / (8 * 2.0**2)
    assert z.wavefront(terms, 1, 0) - z.wavefront(terms, 0, 0) == pytest.approx(edge, rel=1e-12)
    assert z.rms(terms) == pytest.approx(edge / math.sqrt(12), rel=1e-12)
    # similar triangles: the outermost ray lands shift / (2 N) beside the axis, on its own side
    right, down = z.gradient(terms, 1, 0)
    assert 2 * 2.0 * right == pytest.approx(20e-6 / (2 * 2.0), rel=1e-12)
    assert down == 0
    assert z.defocus(0.0, 2.0) == ()


def test_steepest_of_known_wavefronts():
    assert z.max_slope(((2, 1.0),)) == pytest.approx(2, rel=1e-12)
    assert z.max_slope(((4, 1.0),)) == pytest.approx(4 * math.sqrt(3), rel=1e-12)
    assert z.max_slope(((8, 1.0),)) == pytest.approx(7 * math.sqrt(8), rel=1e-12)
    assert z.max_slope(()) == 0


def test_parts_of_a_wavefront():
    terms = ((1, 5e-6), (2, 1e-6), (3, -2e-6), (4, 3e-7), (8, 0.0))
    assert z.combine(terms) == ((2, 1e-6), (3, -2e-6), (4, 3e-7))
    assert z.combine(terms, ((4, -3e-7),)) == ((2, 1e-6), (3, -2e-6))
    rest, tilt = z.split_tilt(terms)
    assert rest == ((4, 3e-7),)
    assert tilt == (2e-6, -4e-6)
    assert z.is_symmetric(rest)
    assert not z.is_symmetric(terms)
    assert z.strehl(((2, 1e-6), (4, 0.05e-6)), 500e-9) == pytest.approx(
        math.exp(-0.04 * math.pi**2)
    )


def test_symmetric_wavefronts_are_legendre_series():
    terms = ((4, 2e-7), (11, -1e-7), (22, 5e-8))
    rho = np.linspace(0, 1, 9)
    series = np.polynomial.legendre.legval(2 * rho**2 - 1, z.legendre_coefficients(terms))
    np.testing.assert_allclose(series, z.wavefront(terms, rho, 0), atol=1e-20)
    with pytest.raises(ValueError, match="not symmetric"):
        z.legendre_coefficients(((8, 1e-7),))
