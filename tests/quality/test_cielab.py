"""CIELAB and Delta E against colour-science, published pairs, closed forms."""

import math
import warnings
from types import ModuleType

import numpy as np
import pytest

from vcam_cli.quality.cielab import THRESHOLD, delta_e, lab

SHARMA = [
    ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
    ((50, -1, 2), (50, 0, 0), 2.3669),
    ((50, 2.49, -0.001), (50, -2.49, 0.0009), 7.1792),
    ((50, 2.49, -0.001), (50, -2.49, 0.0011), 7.2195),
    ((50, 2.5, 0), (50, 0, -2.5), 4.3065),
    ((50, 2.5, 0), (73, 25, -18), 27.1492),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
]
"""Pairs of Table 1 of Sharma, Wu, Dalal (2005), DOI 10.1002/col.20070: CIEDE2000 to 4 decimals.

The third and fourth lie on either side of a jump of the formula."""


@pytest.fixture(scope="module")
def colour() -> ModuleType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


def colors(count: int = 2000, seed: int = 1) -> np.ndarray:
    """X/Xn, Y/Yn, Z/Zn (3, count): bright, dark and very dark ones."""
    rng = np.random.default_rng(seed)
    return rng.random((3, count)) * np.where(rng.random(count) < 0.3, 0.02, 1.0)


def test_lab_is_that_of_colour_science(colour: ModuleType) -> None:
    """It has (6/29)^3 for 0.008856 and (29/3)^3 for 903.3: up to 1.7e-4 apart in a*."""
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    xyz = colors() * colour.xy_to_XYZ(white)[:, None]
    np.testing.assert_allclose(
        lab(colors()), np.transpose(colour.XYZ_to_Lab(xyz.T, white)), atol=2e-4
    )


@pytest.mark.parametrize("formula", ["1976", "1994", "2000"])
def test_delta_e_is_that_of_colour_science(colour: ModuleType, formula: str) -> None:
    one, other = lab(colors(seed=1)), lab(colors(seed=2))
    expected = colour.delta_E(other.T, one.T, method=f"CIE {formula}")  # the reference comes first
    np.testing.assert_allclose(delta_e(one, other, formula), expected, rtol=1e-9, atol=1e-9)
    near = other + np.array([0.3, -0.2, 0.1])[:, None]
    expected = colour.delta_E(other.T, near.T, method=f"CIE {formula}")
    np.testing.assert_allclose(delta_e(near, other, formula), expected, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("one", "other", "expected"), SHARMA)
def test_published_pairs_of_ciede2000(one, other, expected) -> None:
    a, b = np.array(one, float)[:, None], np.array(other, float)[:, None]
    assert delta_e(a, b, "2000")[0] == pytest.approx(expected, abs=5e-5)
    assert delta_e(b, a, "2000")[0] == pytest.approx(expected, abs=5e-5)


def test_white_gray_and_black() -> None:
    white, gray, black = lab(np.array([[1.0, 0.184, 0.0]] * 3)).T
    np.testing.assert_allclose(white, [100, 0, 0], atol=1e-12)
    np.testing.assert_allclose(gray, [116 * 0.184 ** (1 / 3) - 16, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(black, [0, 0, 0])


def test_the_line_meets_the_cube_root_and_goes_on_below_zero() -> None:
    below, above = lab(np.array([[THRESHOLD, np.nextafter(THRESHOLD, 1)]] * 3)).T
    np.testing.assert_allclose(below, above, atol=1e-3)  # the rounded constants
    np.testing.assert_allclose(lab(np.full((3, 1), -0.001))[0], -0.9033, rtol=1e-12)


@pytest.mark.parametrize("formula", ["1976", "1994", "2000"])
def test_equal_colors_and_finite_ones(formula: str) -> None:
    one = lab(colors())
    assert not delta_e(one, one.copy(), formula).any()
    extreme = lab(np.array([[-0.1, 0.0, 1e-9, 1.0, 1e4]] * 3) * np.array([[1.0], [1.1], [0.3]]))
    for other in (np.zeros_like(extreme), extreme[:, ::-1], extreme * 1.001):
        assert np.isfinite(delta_e(extreme, other, formula)).all()
        assert (delta_e(extreme, other, formula) >= 0).all()


@pytest.mark.parametrize("formula", ["1976", "2000"])
def test_neither_color_comes_first(formula: str) -> None:
    one, other = lab(colors(seed=3)), lab(colors(seed=4))
    forth, back = delta_e(one, other, formula), delta_e(other, one, formula)
    np.testing.assert_allclose(forth, back, rtol=1e-12)


def test_1994_takes_its_weights_from_the_reference() -> None:
    gray, vivid = np.array([[50.0], [0.0], [0.0]]), np.array([[50.0], [60.0], [0.0]])
    assert delta_e(vivid, gray, "1994")[0] == 60
    assert delta_e(gray, vivid, "1994")[0] == pytest.approx(60 / (1 + 0.045 * 60), rel=1e-14)


@pytest.mark.parametrize("formula", ["1976", "1994", "2000"])
def test_float32_stays_float32(formula: str) -> None:
    one, other = colors(seed=5), colors(seed=6)
    single = delta_e(lab(one.astype(np.float32)), lab(other.astype(np.float32)), formula)
    assert single.dtype == np.float32
    # half a unit in the last place of f = 1 is 6e-8; a* has 500 of it, and hue angles amplify
    np.testing.assert_allclose(single, delta_e(lab(one), lab(other), formula), atol=2e-3)


def test_what_cannot_be_compared() -> None:
    one = np.zeros((3, 4))
    with pytest.raises(ValueError, match="one shape"):
        delta_e(one, np.zeros((3, 5)))
    with pytest.raises(ValueError, match="one shape"):
        delta_e(np.zeros((4, 3)), np.zeros((4, 3)))
    with pytest.raises(ValueError, match="formula"):
        delta_e(one, one, "2001")
    assert math.isnan(delta_e(np.full((3, 1), math.nan), np.zeros((3, 1)))[0])
