"""MSE and PSNR: closed forms, the trap of float32 sums, properties."""

import math

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vcam_cli.quality import mse, psnr_db, psnr_of_mse

PICTURES = arrays(np.float32, (7, 5, 3), elements=st.floats(-2, 4, width=32))


def test_a_constant_difference_is_its_own_error():
    ideal = np.full((100, 30, 3), 0.25)
    assert mse(ideal + 0.125, ideal) == 0.125**2
    # 10 log10(1 / (1/64)), exact up to the logarithm
    assert psnr_db(ideal - 0.125, ideal) == pytest.approx(20 * math.log10(8), rel=1e-15)


def test_all_channels_count_alike():
    ideal = np.zeros((4, 4, 3))
    image = ideal.copy()
    image[..., 2] = 0.3
    assert mse(image, ideal) == pytest.approx(0.09 / 3, rel=1e-15)


def test_a_black_picture_of_a_ramp_has_the_mean_of_squares():
    n = 101
    ramp = np.arange(n)[:, None] / (n - 1) * np.ones((1, 3))
    # sum of k^2 for k < n, divided by n (n - 1)^2
    assert mse(np.zeros_like(ramp), ramp) == pytest.approx((2 * n - 1) / (6 * (n - 1)), rel=1e-14)


def test_a_sinusoid_has_half_its_squared_amplitude():
    wave = 0.2 * np.cos(2 * np.pi * np.arange(64) / 16) * np.ones((100, 1))
    assert mse(wave, np.zeros_like(wave)) == pytest.approx(0.02, rel=1e-14)


def test_uniform_noise_within_five_standard_errors():
    noise = np.random.default_rng(1).uniform(-0.5, 0.5, (400, 500))
    # mean 1/12, variance of a square 1/80 - 1/144, 200 000 samples
    tolerance = 5 * math.sqrt((1 / 80 - 1 / 144) / noise.size)
    assert mse(0.5 + noise, np.full(noise.shape, 0.5)) == pytest.approx(1 / 12, abs=tolerance)


@pytest.mark.parametrize("order", ["C", "F"])
def test_many_small_errors_are_not_lost_beside_a_large_one(order):
    """In float32 each 1e-8 vanishes beside 1.0, in any running sum over this picture."""
    shape = (4096, 1024)
    image = np.full(shape, 1e-4, np.float32, order=order)
    image[0, 0] = 1.0
    small = float(np.float32(1e-4)) ** 2
    expected = (1.0 + (image.size - 1) * small) / image.size
    # float64 sums of 65 000 terms of one sign
    assert mse(image, np.zeros(shape, np.float32, order=order)) == pytest.approx(
        expected, rel=1e-12
    )


def test_squares_of_integers_do_not_overflow():
    white, black = np.full((3, 3), 255, np.uint8), np.zeros((3, 3), np.uint8)
    assert mse(black, white) == mse(white, black) == 255.0**2
    assert psnr_db(black, white, peak=255) == 0.0


def test_large_float32_values_are_squared_in_float64():
    assert mse(np.full((2, 2), 1e30, np.float32), np.zeros((2, 2), np.float32)) == pytest.approx(
        float(np.float32(1e30)) ** 2, rel=1e-15
    )


def test_identical_pictures_have_infinite_psnr_written_inf():
    picture = np.random.default_rng(2).random((9, 9, 3))
    assert mse(picture, picture) == 0.0
    assert f"{psnr_db(picture, picture.copy())}" == "inf"


@pytest.mark.parametrize(("error", "expected"), [(1.0, 0.0), (0.01, 20.0), (1e-4, 40.0)])
def test_psnr_of_an_error(error, expected):
    assert psnr_of_mse(error) == pytest.approx(expected, abs=1e-13)


def test_pictures_that_cannot_be_compared():
    with pytest.raises(ValueError, match="shapes differ"):
        mse(np.zeros((2, 3)), np.zeros((3, 2)))
    with pytest.raises(ValueError, match="shapes differ"):
        mse(np.zeros((2, 3, 1)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="no pixels"):
        mse(np.zeros((0, 3)), np.zeros((0, 3)))


def test_nan_is_not_hidden():
    broken = np.zeros((70, 3))
    broken[66, 1] = np.nan
    assert math.isnan(mse(broken, np.zeros((70, 3))))
    assert math.isnan(psnr_db(broken, np.zeros((70, 3))))


@examples(50)
@given(PICTURES, PICTURES)
def test_symmetric_and_zero_only_for_equal_pictures(a, b):
    assert mse(a, b) == mse(b, a) >= 0
    # differences below 1e-160 square to zero; float32 values this close are equal
    assert (mse(a, b) == 0) == bool(np.array_equal(a, b))


@examples(50)
@given(PICTURES, PICTURES, st.sampled_from([0.25, 0.5, 2.0, 8.0]))
def test_scales_with_the_square(a, b, factor):
    # powers of two scale exactly
    assert mse(a.astype(float) * factor, b.astype(float) * factor) == mse(a, b) * factor**2
    if mse(a, b) > 0:
        change = psnr_db(a * factor, b * factor, peak=factor) - psnr_db(a, b)
        assert abs(change) < 1e-4  # products in float32 may lose their last bits near zero


@examples(50)
@given(PICTURES, PICTURES)
def test_the_order_of_pixels_does_not_matter(a, b):
    # the order of a float64 sum
    assert mse(a[::-1, ::-1], b[::-1, ::-1]) == pytest.approx(mse(a, b), rel=1e-13)
