"""Maps of differences as pictures."""

import numpy as np
import pytest

from vcam_cli.files.images.color import decode_srgb
from vcam_cli.quality.error_map import false_color, scale_limit


def test_lightness_rises_all_the_way() -> None:
    codes = false_color(np.linspace(0, 1, 256)[None], 1.0)[0]
    luminance = decode_srgb(codes / 255) @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(luminance) > 0).mean() > 0.95
    assert (np.diff(luminance) > -1e-3).all()
    assert luminance[0] < 1e-3
    assert luminance[-1] > 0.9
    lightness = 116 * np.cbrt(np.maximum(luminance, 0.008856)) - 16
    assert np.abs(lightness - np.linspace(0, 98, 256)).max() < 12, "about even steps"


@pytest.mark.parametrize(
    ("most", "expected"),
    [(0, 1), (0.3, 1), (1, 1), (1.1, 2), (2, 2), (4, 5), (7, 10), (10, 10), (11, 20), (350, 500)],
)
def test_the_scale_ends_at_a_round_number(most, expected) -> None:
    assert scale_limit(np.full((20, 20), float(most))) == expected


def test_one_bright_pixel_does_not_darken_the_rest() -> None:
    values = np.full((30, 30), 3.0)
    values[4, 5] = 500
    assert scale_limit(values) == 5
    codes = false_color(values, 5.0)
    assert (codes[4, 5] == (0xFC, 0xFF, 0xA4)).all()
    assert codes.shape == (30, 30, 3)
    assert codes.dtype == np.uint8


def test_nothing_is_black_and_what_is_no_number_stands_out() -> None:
    codes = false_color(np.array([[0.0, np.nan, np.inf]]), 1.0)[0]
    assert codes[0].tolist() == [0, 0, 4]
    assert codes[1].tolist() == codes[2].tolist() == [0xFC, 0xFF, 0xA4]
    assert scale_limit(np.full((3, 3), np.nan)) == 1.0


def test_blocks_of_rows_do_not_show() -> None:
    values = np.random.default_rng(1).random((600, 3))
    by_row = np.concatenate([false_color(row[None], 1.0) for row in values])
    np.testing.assert_array_equal(false_color(values, 1.0), by_row)
