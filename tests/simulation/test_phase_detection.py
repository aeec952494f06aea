"""Halves of pixels see halves of the lens: what is out of focus lies apart in their pictures."""

import math
import tracemalloc

import numpy as np
import OpenImageIO as oiio
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.optics.half_pupil import LEFT, RIGHT, HalfPupil
from vcam_cli.errors import BadInput
from vcam_cli.quality.disparity import disparity, needed_bytes
from vcam_cli.simulation.output.phase_files import frame_disparity

WAVE = {
    "scene.source": {
        "kind": "chart",
        "chart": "sinusoid",
        "frequency": "6.25 lp/mm",
        "contrast": 1,
    },
    "scene.radiance": radiance_for(2e4),
    "effects": QUIET,
    "accuracy": {"preset": "standard", "float_width": 64},
    "pixel.phase_detection": "dual",
}
"""Two whole periods on the 64 columns of 5 um."""


def wave_disparity(left: np.ndarray, right: np.ndarray) -> float:
    """How far a wave of two periods along the rows lies farther right in the left picture [pixels].

    Fitted on 32 columns, one whole period, away from the border.
    """
    x = np.arange(16, 48)
    wave = np.exp(-2j * np.pi * 2 * x / 64)
    apart = np.angle((left[24, 16:48] @ wave) / (right[24, 16:48] @ wave))
    return -apart * 64 / (2 * np.pi * 2)


def halves(folder, **changes: object) -> tuple[np.ndarray, np.ndarray]:
    found = simulate(camera(folder, WAVE | changes)).frame.halves
    assert found is not None
    return found


@pytest.mark.parametrize("defocus", [40, 100, -100])
def test_disparity_is_the_closed_form_of_half_disks(defocus, tmp_path):
    left, right = halves(tmp_path, **{"optics.defocus": f"{defocus} um"})
    diameter = defocus / (4 / (1 - 5e-3)) / 5  # shift over the working f-number, in pixels
    found = wave_disparity(left, right)
    assert found == pytest.approx(4 / (3 * math.pi) * diameter, abs=0.02)


def test_what_is_near_lies_to_the_right_in_the_left_picture(tmp_path):
    """As for two eyes. Thin lens of 5 mm and f/4 at 1 m before something at 0.25 m."""
    near = {"scene.distance": "0.25 m", "optics.focus_distance": "1 m"}
    v, f = 1 / (1 / 5e-3 - 1 / 1.0), 5e-3
    diameter = f / 4 * v * (1 / 0.25 - 1 / 1.0) / 5e-6
    found = wave_disparity(*halves(tmp_path, **near))
    assert found == pytest.approx(4 / (3 * math.pi) * diameter, abs=0.02)


def test_halves_add_up_to_the_pixel_and_soft_ones_lie_less_apart(tmp_path):
    soft = {"optics.defocus": "100 um", "pixel.phase_detection": {"dual": {"separation": "60 %"}}}
    frame = simulate(camera(tmp_path, WAVE | soft)).frame
    left, right = frame.halves
    np.testing.assert_allclose(left + right, frame.rate, rtol=1e-12)
    ideal = wave_disparity(*halves(tmp_path, **{"optics.defocus": "100 um"}))
    assert wave_disparity(left, right) == pytest.approx(0.6 * ideal, rel=0.02)


def test_in_focus_halves_are_alike(tmp_path):
    left, right = halves(tmp_path)
    np.testing.assert_allclose(left, right, rtol=1e-12)


def test_the_raw_frame_is_that_of_whole_pixels(tmp_path):
    plain = {**WAVE, "effects": "all", "optics.defocus": "60 um"}
    with_halves = simulate(camera(tmp_path, plain)).dn
    del plain["pixel.phase_detection"]
    np.testing.assert_array_equal(with_halves, simulate(camera(tmp_path, plain)).dn)


def test_half_a_disk_by_brute_force():
    """The center of gravity 4 R / (3 pi), and the transfer, by points of half a disk."""
    radius, g = 8e-6, np.linspace(-1, 1, 1001)
    x, y = np.meshgrid(g, g)
    inside = (x**2 + y**2 < 1) & (x > 0)
    fx, fy = np.array([2e4, 9e4]), np.array([0.0, 5e4])
    for half, side in ((LEFT, 1), (RIGHT, -1)):
        found = HalfPupil(radius, half).otf_plane(fx, fy, 550e-9)
        for i, j in np.ndindex(2, 2):
            turns = radius * (side * fx[j] * x[inside] + fy[i] * y[inside])
            # A grid of 1000 points a side errs by a thousandth at the rim.
            assert found[i, j] == pytest.approx(np.exp(-2j * np.pi * turns).mean(), abs=2e-3)
    slight = HalfPupil(radius, LEFT).otf_plane(np.array([1e-3]), np.zeros(1), 550e-9)[0, 0]
    moved = -np.angle(slight) / (2 * np.pi * 1e-3)
    assert moved == pytest.approx(4 * radius / (3 * math.pi), rel=1e-6)


def test_masked_pixels_see_half_the_light_and_are_filled_in_the_picture(tmp_path):
    masked = {
        **WAVE,
        "optics.defocus": "100 um",
        "pixel.phase_detection": {"masked": {"period": [8, 4], "offset": [3, 2]}},
    }
    result = simulate(camera(tmp_path, masked))
    frame = result.frame
    left, right = frame.halves
    np.testing.assert_allclose(frame.rate[3::8, 2::8], left[3::8, 2::8])
    np.testing.assert_allclose(frame.rate[3::8, 6::8], right[3::8, 6::8])
    whole = left + right
    other = np.ones(whole.shape, bool)
    other[3::8, 2::4] = False
    np.testing.assert_allclose(frame.rate[other], whole[other])
    assert [half.shape for half in frame.phase_dn] == [(6, 8), (6, 8)]
    # The mean of two neighbors of a wave of 32 pixels errs by 2 % of its amplitude; and rounding.
    error = np.abs(frame.picture_dn - frame.chain.to_dn(whole * frame.exposure_time))
    assert error.max() < 0.025 * frame.dn.max() + 1


@pytest.mark.draws
def test_files_of_halves(tmp_path):
    dark = {"pixel.photodetector.dark_current": "9 ke/s", "output.phase": True, "effects": "all"}
    result = simulate(camera(tmp_path, {**WAVE, **dark, "optics.defocus": "100 um"}))
    result.save(tmp_path / "out")
    image = oiio.ImageBuf(str(tmp_path / "out" / "phase.exr"))
    assert image.spec().channelnames == ("left", "right")
    np.testing.assert_array_equal(image.get_pixels()[..., 0], result.frame.phase_dn[0])
    assert (tmp_path / "out" / "disparity.png").is_file()


def test_one_side_may_have_more_masked_pixels(tmp_path):
    """Eight columns of left ones, seven of right ones."""
    masked = {"masked": {"period": [8, 4], "offset": [3, 2]}}
    changes = {"pixel.phase_detection": masked, "array.columns": 62, "output.phase": True}
    result = simulate(camera(tmp_path, WAVE | changes))
    assert [half.shape for half in result.frame.phase_dn] == [(6, 8), (6, 7)]
    assert frame_disparity(result.frame).shape == (6, 7)


@pytest.mark.parametrize("shape", [(240, 320), (1000, 300)])
def test_the_disparity_takes_what_is_stated(shape):
    left, right = np.random.default_rng(1).random((2, *shape))
    disparity(left[:40, :40], right[:40, :40], 8)  # modules are loaded
    tracemalloc.start()
    disparity(left, right, 24)
    peak = tracemalloc.get_traced_memory()[1] + left.nbytes + right.nbytes
    tracemalloc.stop()
    assert peak <= needed_bytes(*shape, 24) <= 1.3 * peak


@pytest.mark.parametrize("shift", [-3.4, 0.0, 1.3, 6.0])
def test_disparity_of_pictures_that_are_moved(shift):
    """Waves of several lengths, moved by a known distance; within a twentieth of a pixel."""
    rng = np.random.default_rng(3)
    frequencies, phases = rng.uniform(0.01, 0.12, 24), rng.uniform(0, 2 * np.pi, (24, 1))
    x = np.arange(160.0)

    def picture(at: float) -> np.ndarray:
        line = np.cos(2 * np.pi * frequencies[:, None] * (x - at) + phases).sum(axis=0)
        return np.tile(line, (40, 1))

    found = disparity(picture(shift / 2), picture(-shift / 2), 8)[20, 30:-30]
    assert np.median(np.abs(found - shift)) < 0.05


def test_nothing_tells_the_disparity_of_an_even_wall():
    noise = np.random.default_rng(1).normal(0, 2, (2, 40, 60))
    assert np.isnan(disparity(100 + noise[0], 100 + noise[1], 4, noise=8.0)).all()


def test_what_is_not_simulated_is_said(tmp_path):
    for change, said in (
        ({"pixel.phase_detection": "both"}, "dual"),
        ({"pixel.phase_detection": {"masked": {"period": 16}}}, "pair"),
        ({"pixel.phase_detection": "none", "output.phase": True}, "needs phase-detection pixels"),
        ({"array.binning": {"rows": 2, "columns": 2, "kind": "charge"}}, "binned pixels"),
        ({"array.pattern": "honeycomb"}, "stacked or scattered"),
    ):
        with pytest.raises(BadInput, match=said):
            camera(tmp_path, WAVE | change)
