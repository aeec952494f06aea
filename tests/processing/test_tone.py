"""Tone curves against published values and 50-digit arithmetic; the table against the formula."""

import mpmath
import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.processing import tone

CURVES = ["srgb", 1.0, 1.8, 2.2, 3.0, 0.45, 10.0]


def test_srgb_equals_colour_science():
    from colour.models import eotf_inverse_sRGB  # loads for a second

    linear = np.linspace(0, 1, 10001)
    # the same formula in double precision
    np.testing.assert_allclose(tone.srgb(linear), eotf_inverse_sRGB(linear), atol=1e-15)


def test_srgb_is_the_formula_of_the_standard():
    with mpmath.workdps(50):
        for linear in (0.0, 1e-6, 0.0031308, 0.00313081, 0.18, 0.5, 0.999, 1.0):
            x = mpmath.mpf(linear)
            exact = (
                x * mpmath.mpf("12.92")
                if x <= mpmath.mpf("0.0031308")
                else mpmath.mpf("1.055") * x ** (1 / mpmath.mpf("2.4")) - mpmath.mpf("0.055")
            )
            assert float(tone.srgb(np.array(linear))) == pytest.approx(float(exact), abs=3e-16)


def test_known_codes():
    """Middle gray 0.18 is code 118 in sRGB, half the light 188; 186 at gamma 2.2.

    In 16 bits 0.461356 and 0.735357 times 65535."""
    light = np.array([0.0, 0.18, 0.5, 1.0], np.float32)
    assert tone.encode(light, "srgb", 8).tolist() == [0, 118, 188, 255]
    assert tone.encode(light, 2.2, 8).tolist() == [0, 117, 186, 255]
    assert tone.encode(light, 1.0, 8).tolist() == [0, 46, 128, 255]
    assert tone.encode(light, "srgb", 16).tolist() == [0, 30235, 48192, 65535]


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("bits", [8, 16])
def test_out_of_range_is_clipped(curve, bits):
    light = np.array([-np.inf, -1e30, -1.0, -1e-30, -0.0, 1.0, 1.0000001, 7.0, 1e30, np.inf])
    result = tone.encode(light.astype(np.float32), curve, bits)
    assert result.dtype == (np.uint8 if bits == 8 else np.uint16)
    assert result.tolist() == [0] * 5 + [2**bits - 1] * 5


@pytest.mark.parametrize("curve", CURVES)
def test_the_table_gives_the_codes_of_the_formula(curve):
    """Around every decision level and every end of an interval of the table, one float apart,
    and at a million values spread over all floats from 1e-45 to 2."""
    assert tone._table(curve) is not None
    levels = tone._decision_levels(curve)
    edges = np.arange(0, 0x40000000, 1 << tone._table(curve).shift)
    spread = np.linspace(0, 0x40000000, 1_000_000).astype(np.int64)
    near = np.concatenate((levels, edges))
    bits = np.concatenate((near - 1, near, near + 1, spread)).clip(0)
    light = bits.astype(np.int32).view(np.float32)
    np.testing.assert_array_equal(tone.encode(light, curve, 8), tone.codes(light, curve, 8))


@pytest.mark.parametrize("curve", [1e-3, 0.05, 300.0])
def test_curves_too_steep_for_a_table_use_the_formula(curve):
    light = np.random.default_rng(1).random(1000, np.float32)
    np.testing.assert_array_equal(tone.encode(light, curve, 8), tone.codes(light, curve, 8))


@examples(100)
@given(
    st.lists(st.floats(-0.5, 1.5, width=32), min_size=2, max_size=20),
    st.sampled_from(CURVES),
    st.sampled_from([8, 16]),
)
def test_brighter_light_never_has_a_smaller_code(light, curve, bits):
    result = tone.encode(np.sort(np.array(light, np.float32)), curve, bits)
    assert np.all(np.diff(result.astype(int)) >= 0)


@pytest.mark.parametrize("curve", ["srgb", 2.2])
def test_encode_changes_nothing_it_is_given_and_takes_any_layout(curve):
    light = np.random.default_rng(2).random((6, 8, 3), np.float32)
    kept = light.copy()
    part = tone.encode(light[::2, ::-1, 1], curve, 8)
    np.testing.assert_array_equal(part, tone.codes(kept[::2, ::-1, 1], curve, 8))
    np.testing.assert_array_equal(light, kept)


@pytest.mark.parametrize("code", range(0, 256, 15))
def test_a_power_law_returns_to_its_code(code):
    assert tone.encode(np.array([(code / 255) ** 2.2], np.float32), 2.2, 8).tolist() == [code]
