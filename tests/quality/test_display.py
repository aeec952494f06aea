"""The display: its light against colour-science, its pixels against geometry."""

import math
import warnings

import numpy as np
import pytest

from vcam_cli.camera.quality import Display
from vcam_cli.quality.display import D65, Screen, display_screen, rgb_to_xyz, samples_per_degree
from vcam_cli.quality.scielab import cielab_map


def test_crt_primaries_are_those_of_colour_science() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    guns = colour.MSDS_DISPLAY_PRIMARIES["Typical CRT Brainard 1997"]
    eye = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    at = np.clip(guns.wavelengths, 380, 780)
    sampled = np.array([np.interp(at, eye.wavelengths, f) for f in eye.values.T]) @ guns.values
    expected = 100 * sampled / sampled[1].sum()
    # a sum in steps of 5 nm against the integral between the knots
    np.testing.assert_allclose(rgb_to_xyz("crt-brainard"), expected, rtol=0.04)
    np.testing.assert_allclose(rgb_to_xyz("crt-brainard").sum(1), expected.sum(1), rtol=2e-3)


def test_srgb_is_the_matrix_of_its_standard() -> None:
    """IEC 61966-2-1:1999, from a white rounded to 4 decimals of its chromaticity."""
    expected = [
        [0.4124, 0.3576, 0.1805],
        [0.2126, 0.7152, 0.0722],
        [0.0193, 0.1192, 0.9505],
    ]
    np.testing.assert_allclose(rgb_to_xyz("srgb", 1.0), expected, atol=2.1e-4)
    np.testing.assert_allclose(rgb_to_xyz("srgb").sum(axis=1), D65, rtol=1e-14)


@pytest.mark.parametrize("primaries", ["crt-brainard", "srgb"])
def test_the_luminance_of_white_changes_no_delta_e(primaries) -> None:
    one, other = np.random.default_rng(1).random((2, 6, 7, 3))
    maps = [
        cielab_map(one, other, Screen(rgb_to_xyz(primaries, white), 20)) for white in (1.0, 250.0)
    ]
    assert rgb_to_xyz(primaries, 250.0)[1].sum() == pytest.approx(250, rel=1e-14)
    np.testing.assert_allclose(*maps, rtol=1e-10)


def test_samples_per_degree() -> None:
    """A degree at 18 inches is 18 tan 1 degree wide, 22.6 dots of 1/72 inch."""
    assert samples_per_degree(72, 18 * 0.0254) == pytest.approx(1296 * math.tan(math.pi / 180))
    assert samples_per_degree(144, 18 * 0.0254) == pytest.approx(45.2435, abs=1e-4)


def test_a_picture_of_stated_width_has_finer_pixels_when_it_has_more() -> None:
    inch = 0.0254
    wide = Display.model_validate({"width": "7.11 in"})
    assert display_screen(wide, 512).samples_per_degree == pytest.approx(
        samples_per_degree(512 / 7.11, 18 * inch)
    )
    assert display_screen(wide, 1024).samples_per_degree == pytest.approx(
        2 * display_screen(wide, 512).samples_per_degree
    )
    default = display_screen(Display(), 512)
    assert default.samples_per_degree == pytest.approx(22.6218, abs=1e-4)
    assert default.white[1] == pytest.approx(100)
    far = Display.model_validate({"dpi": 100, "viewing_distance": "36 in", "primaries": "srgb"})
    assert display_screen(far, 512).samples_per_degree == pytest.approx(
        22.6218 * 2 / 0.72, abs=1e-3
    )
    np.testing.assert_allclose(display_screen(far, 9).white, D65, rtol=1e-14)
