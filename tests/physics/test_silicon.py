"""Silicon: absorption, intrinsic carriers, and the diffusion of charge.

The diffusion of charge is held to 60-digit values, to its limits, and to the diffusion equation
itself, solved over depth and width by finite differences.
"""

import json
import math
from pathlib import Path

import mpmath
import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.physics import silicon

DATA = json.loads((Path(__file__).parent.parent / "data" / "photodiode.json").read_text("utf-8"))
UM = 1e-6
EXACT = 1e-13
"""Relative: what float64 has left after some ten operations, with room."""

MEASURED = {
    77.8: 5.0e-20, 100.0: 2.0e-11, 120.75: 3.4e-6, 137.5: 4.6e-3, 148.4: 0.21, 169.7: 84,
    195.0: 1.78e4, 213.0: 4.16e5, 239.0: 1.92e7, 256.5: 1.45e8, 270.6: 6.7e8, 281.0: 1.79e9,
    300.0: 9.7e9, 319.5: 4.51e10, 340.5: 1.89e11,
}  # fmt: skip
"""Temperature [K] -> intrinsic concentration [1/cm3], measured by Misiakos and Tsamakis, Journal of
Applied Physics 74, 3293 (1993), to two or three digits."""


# --- absorption ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nm", "extinction"),
    [(350, 2.938), (400, 0.296), (450, 0.086302), (550, 0.027968), (700, 0.010528),
     (850, 0.003612), (1000, 5.093e-4), (1100, 3.0637e-5)],
)  # fmt: skip
def test_absorption_is_that_of_the_extinction_coefficient(nm, extinction):
    """4 pi k / wavelength, with k of Green 2008 as refractiveindex.info lists it: 3 digits."""
    expected = 4 * np.pi * extinction / (nm * 1e-9)
    assert silicon.absorption(nm * 1e-9) == pytest.approx(expected, rel=2e-3)


def test_absorption_is_a_geometric_mean_half_way_between_knots():
    """Knots of Green 2008 at 550 and 560 nm: 6390 and 5780 per cm."""
    assert silicon.absorption(555e-9) == pytest.approx(100 * np.sqrt(6390 * 5780), rel=1e-12)


def test_absorption_falls_with_wavelength_and_keeps_shape():
    wavelength = np.linspace(350e-9, 1100e-9, 1503).reshape(3, -1)
    value = silicon.absorption(wavelength)
    assert value.shape == wavelength.shape
    assert np.all(np.diff(value.ravel()) < 0)
    assert np.ndim(silicon.absorption(500e-9)) == 0
    assert silicon.absorption(np.empty(0)).shape == (0,)


def test_absorption_is_unknown_outside_its_table():
    low, high = silicon.ABSORPTION_RANGE
    assert silicon.absorption(low) > silicon.absorption(high)
    for wavelength in (low - 1e-9, high + 1e-9, [500e-9, 1200e-9]):
        with pytest.raises(ValueError, match="known from 350 to 1100 nm"):
            silicon.absorption(wavelength)


# --- intrinsic carriers --------------------------------------------------------------------------


def test_intrinsic_concentration_is_what_was_measured():
    """The fit leaves up to 14 % in the cold, over thirty powers of ten, and 8 % above 190 K."""
    temperature = np.array(list(MEASURED))
    ratio = silicon.intrinsic_concentration(temperature) / (1e6 * np.array(list(MEASURED.values())))
    assert np.abs(np.log(ratio)).max() < 0.15
    assert np.abs(np.log(ratio[temperature > 190])).max() < 0.08
    assert ratio[temperature == 300][0] == pytest.approx(1, abs=5e-3)


def test_intrinsic_concentration_is_near_another_model():
    """Sproul and Green, J. Appl. Phys. 70, 846 (1991): 9.15e19 (T / 300)^2 exp(-6880 / T)."""
    t = np.linspace(275, 400, 26)
    other = 9.15e25 * (t / 300) ** 2 * np.exp(-6880 / t)
    ratio = silicon.intrinsic_concentration(t) / other
    assert np.all((ratio > 0.965) & (ratio < 1))


@pytest.mark.parametrize("temperature", [0.0, 76.9, 400.1, np.nan, [300.0, 500.0]])
def test_intrinsic_concentration_is_unknown_outside(temperature):
    with pytest.raises(ValueError, match="from 77 to 400 K"):
        silicon.intrinsic_concentration(temperature)


# --- diffusion of charge -------------------------------------------------------------------------


def printed(frequency, absorption, diffusion_length, depletion_width, neutral_depth):
    """Eq 2.28 as printed, its lengths named as they act, with 60 digits."""
    with mpmath.workdps(60):
        f, a, ln, w, d = map(
            mpmath.mpf, (frequency, absorption, diffusion_length, depletion_width, neutral_depth)
        )
        lf = ln / mpmath.sqrt(1 + (2 * mpmath.pi * f * ln) ** 2)
        u = a * lf
        first = (1 + u - mpmath.exp(-a * w)) / (1 + u)
        bottom = mpmath.exp(-a * d) - mpmath.exp(-d / lf)
        return float(first - u * mpmath.exp(-a * w) * bottom / ((1 - u**2) * mpmath.sinh(d / lf)))


@pytest.mark.parametrize("case", DATA["diffusion"], ids=lambda case: case["why"])
def test_collected_in_sixty_digits(case):
    value = silicon.collection_efficiency(
        float(case["per_um"]) / UM,
        float(case["absorption_per_um"]) / UM,
        float(case["diffusion_length_um"]) * UM,
        float(case["depletion_um"]) * UM,
        float(case["neutral_um"]) * UM,
    )
    assert value == pytest.approx(float(case["value"]), rel=EXACT)


positive = st.floats(-3, 3).map(lambda power: 10.0**power)
SILICON = st.tuples(positive, positive, positive, positive, positive)
"""Frequency, absorption, diffusion length, depletion width, neutral depth in units of one scale."""


@given(SILICON)
@examples(150)
def test_collected_as_printed(given):
    f, a, ln, w, d = given
    assert silicon.collection_efficiency(f, a, ln, w, d) == pytest.approx(
        printed(f, a, ln, w, d), rel=EXACT
    )


@given(SILICON, st.integers(-40, 40))
@examples(50)
def test_collected_knows_no_unit_of_length(given, power):
    """Scaled by a power of two every intermediate number is the same."""
    f, a, ln, w, d = given
    s = 2.0**power
    assert silicon.collection_efficiency(
        f / s, a / s, ln * s, w * s, d * s
    ) == silicon.collection_efficiency(*given)


@given(SILICON)
@examples(50)
def test_mtf_falls_from_one_to_the_part_of_the_depletion_region(given):
    _, a, ln, w, d = given
    f = np.concatenate([[0], np.geomspace(1e-4, 1e15, 300)])
    mtf = silicon.diffusion_mtf(f, a, ln, w, d)
    assert mtf[0] == 1
    assert np.all(np.diff(mtf) <= 4e-16), "up to a rounding"
    floor = -np.expm1(-a * w) / silicon.collection_efficiency(0.0, a, ln, w, d)
    assert np.all(mtf >= floor * (1 - 1e-14))
    assert mtf[-1] == pytest.approx(floor, rel=1e-9)
    assert np.array_equal(silicon.diffusion_mtf(-f, a, ln, w, d), mtf)


def finite_differences(f, a, ln, w, d, columns, rows):
    """Collected charge by the diffusion equation over one period of a grating and the depth.

    n_xx + n_zz - n / L_n^2 + a e^(-a (w + z)) cos(2 pi f x) = 0, n = 0 at z = 0 and z = d,
    periodic in x. What arrives at z = 0 is n_z there, here its part along the grating.
    """
    from scipy.sparse import diags, eye, kron
    from scipy.sparse.linalg import spsolve

    h, g = d / rows, 1 / f / columns
    inner = np.arange(1, rows)
    light = np.cos(2 * np.pi * np.arange(columns) / columns)
    born = a * np.exp(-a * (w + h * np.arange(rows)))
    depth = diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(rows - 1, rows - 1)) / h**2
    ring = diags(
        [1.0, 1.0, -2.0, 1.0, 1.0], [1 - columns, -1, 0, 1, columns - 1], shape=(columns, columns)
    )
    laplace = kron(depth, eye(columns)) + kron(eye(rows - 1), ring / g**2)
    matrix = laplace - eye((rows - 1) * columns) / ln**2
    n = spsolve(matrix.tocsc(), -np.outer(born[inner], light).ravel()).reshape(rows - 1, columns)
    slope = n[0] / h + h / 2 * born[0] * light  # Taylor: n_zz is -born where n is 0
    return -np.expm1(-a * w) + 2 * np.mean(slope * light)


@pytest.mark.parametrize(
    ("f", "a", "ln", "w", "d"),
    [(0.08, 0.281, 20, 0.373, 5), (0.3, 0.639, 10, 0.13, 2.57), (0.02, 0.1, 4, 1, 9)],
)
def test_collected_solves_the_diffusion_equation(f, a, ln, w, d):
    """Second order in both steps: halving them and extrapolating leaves some 1e-5."""
    coarse = finite_differences(f, a, ln, w, d, columns=24, rows=100)
    fine = finite_differences(f, a, ln, w, d, columns=48, rows=200)
    expected = (4 * fine - coarse) / 3
    assert abs(fine - coarse) < 3e-3, "the grid resolves it"
    assert silicon.collection_efficiency(f, a, ln, w, d) == pytest.approx(expected, rel=5e-5)


def test_collected_is_the_integral_of_a_collection_probability():
    """At rest: 1 down to the edge of the depletion region, a hyperbolic sine below; by quadrature.

    20 Gauss points on 40 intervals are exact to rounding.
    """
    a, ln, w, d = 0.4, 6.0, 0.7, 5.0
    node, weight = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(0, d, 41)
    z = edges[:-1, None] + d / 40 * (node + 1) / 2
    below = np.sum(
        d / 80 * weight * a * np.exp(-a * (w + z)) * np.sinh((d - z) / ln) / np.sinh(d / ln)
    )
    expected = 1 - np.exp(-a * w) + below
    assert silicon.collection_efficiency(0.0, a, ln, w, d) == pytest.approx(expected, rel=1e-13)


def test_collected_where_the_closed_form_is_singular():
    """a L_f = 1: 1 - e^(-a w) / 2 - e^(-a w) r e^(-r) / (2 sinh r), r = L_d / L_f."""
    w, d = 0.3, 4.0
    limit = 1 - np.exp(-w) / 2 - np.exp(-w) * d * np.exp(-d) / (2 * np.sinh(d))
    for a in (1 - 1e-9, 1 - 1e-15, 1.0, 1 + 1e-15, 1 + 1e-9):
        assert silicon.collection_efficiency(0.0, a, 1.0, w, d) == pytest.approx(limit, rel=1e-8)
    assert silicon.collection_efficiency(0.0, 1.0, 1.0, w, d) == pytest.approx(limit, rel=1e-14)


def test_collected_at_its_ends():
    """No light, no silicon, everything collected, deep silicon: finite and right, no warnings."""
    assert silicon.collection_efficiency(0.0, 0.0, 1.0, 1.0, 1.0) == 0
    assert silicon.collection_efficiency(1.0, 2.0, 1.0, 0.0, 0.0) == 0
    assert silicon.collection_efficiency(0.0, 1e6, 1.0, 1.0, 1.0) == 1
    # infinitely deep: u / (1 + u); nothing recombines: a straight line of probability
    assert silicon.collection_efficiency(0.0, 3.0, 1.0, 0.0, 1e9) == pytest.approx(3 / 4, rel=1e-15)
    straight = 1 - (1 - np.exp(-2.0)) / 2.0
    assert silicon.collection_efficiency(0.0, 2.0, np.inf, 0.0, 1.0) == pytest.approx(
        straight, rel=1e-14
    )
    assert silicon.collection_efficiency(0.0, 2.0, 1e300, 0.0, 1.0) == pytest.approx(
        straight, rel=1e-14
    )
    huge = silicon.collection_efficiency(1e300, 1.0, 1.0, 0.5, 1.0)
    assert huge == pytest.approx(-np.expm1(-0.5), rel=1e-15)


def test_collected_broadcasts():
    f, a = np.linspace(0, 1, 4)[:, None, None], np.array([0.1, 1.0, 10.0])[:, None]
    d = np.array([0.5, 50.0])
    together = silicon.collection_efficiency(f, a, 5.0, 0.2, d)
    assert together.shape == (4, 3, 2)
    one = silicon.collection_efficiency(float(f[2, 0, 0]), 1.0, 5.0, 0.2, 50.0)
    assert together[2, 1, 1] == pytest.approx(one, rel=1e-14)
    assert np.ndim(one) == 0


@pytest.mark.parametrize("wrong", [(1, -1, 1, 1, 1), (1, 1, 0, 1, 1), (1, 1, 1, -1, 1),
                                   (1, 1, 1, 1, -1), (1, np.nan, 1, 1, 1)])  # fmt: skip
def test_collected_refuses_what_is_no_silicon(wrong):
    with pytest.raises(ValueError, match="diffusion length"):
        silicon.collection_efficiency(*wrong)


def test_dark_current_falls_with_the_band_gap():
    """0.0372 e/s at 200 K of 6241.5 e/s at 300 K (1 nA/cm2 on 10 um; Janesick 2001, 7.1.1)."""
    assert 6241.5 * silicon.dark_current_ratio(200, 300) == pytest.approx(0.0372, abs=6e-5)
    assert silicon.dark_current_ratio(300, 300) == 1


@pytest.mark.parametrize(("kelvin", "doubling"), [(300, 8.5), (200, 3.9)])
def test_dark_current_doubles_in_fewer_kelvins_where_it_is_cold(kelvin, doubling):
    """The derivative of T^1.5 exp(-E_g / 2kT), by central differences of 1 mK."""
    step = 1e-3
    growth = math.log(silicon.dark_current_ratio(kelvin + step, kelvin - step)) / (2 * step)
    assert math.log(2) / growth == pytest.approx(doubling, abs=0.05)
