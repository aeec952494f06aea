"""Denoising, sharpening, gamut mapping and compression, alone and in a whole camera."""

import math

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from tests.making import long_except, tree
from vcam_cli.camera.camera import Camera
from vcam_cli.processing import jpeg, picture_steps
from vcam_cli.processing.base import Block
from vcam_cli.simulation.simulate import simulate

pytestmark = pytest.mark.keeps_light  # steps are tried on the light of a few scenes

BT709 = np.array([0.2126, 0.7152, 0.0722])


def test_the_noise_level_is_that_of_white_noise_on_a_plane():
    noise = np.random.default_rng(1).normal(0, [[[0.01]], [[0.2]]], (2, 400, 500))
    ramp = np.add.outer(np.arange(400) * 0.3, np.arange(500) * -0.1)  # no second difference
    found = picture_steps.noise_level(picture_steps.noise_sums(ramp + noise))
    # 200 000 differences, of which 9 see each pixel: five standard errors of the mean are 2.4 %
    np.testing.assert_allclose(found, [0.01, 0.2], rtol=0.024)


def test_denoising_leaves_the_share_of_lee():
    """Where the window's variance is far from the noise, by the formula; elsewhere its mean."""
    flat = np.full((1, 20, 20), 0.5, np.float32)
    flat[0, ::2] += 0.01
    sigma = np.array([0.02])  # above the picture's own deviation: everywhere the mean
    expected = ndimage.uniform_filter(flat[0], 5)
    np.testing.assert_allclose(picture_steps.denoised(flat, sigma)[0], expected, atol=1e-7)
    spike = np.zeros((1, 11, 11), np.float32)
    spike[0, 5, 5] = 1.0
    mean, variance = 1 / 25, 1 / 25 - 1 / 25**2
    wanted = mean + (variance - 0.01) / variance * (1 - mean)
    assert picture_steps.denoised(spike, np.array([0.1]))[0, 5, 5] == pytest.approx(wanted)
    np.testing.assert_allclose(picture_steps.denoised(spike, np.array([0.0])), spike, atol=1e-7)


def test_sharpening_multiplies_a_wave_by_what_the_blur_leaves_of_it():
    radius, amount, period = 1.5, 0.8, 12
    wave = np.cos(2 * np.pi * np.arange(240) / period)[np.newaxis, np.newaxis] + np.ones((1, 40, 1))
    sharp = picture_steps.sharpened(wave, radius, amount)
    left = math.exp(-2 * (math.pi * radius / period) ** 2)
    gain = (sharp[0, 20, 60] - sharp[0, 20, 66]) / 2
    # The Gaussian ends at 4 standard deviations and is sampled: 1e-4 of it is missing
    assert gain == pytest.approx(1 + amount * (1 - left), rel=2e-4)
    assert sharp[0, 20, 60:180].mean() == pytest.approx(1.0, rel=1e-6)


def test_mapped_colors_keep_their_luminance_and_lie_on_the_way_to_gray():
    colors = np.random.default_rng(2).normal(0.3, 0.5, (3, 1000))
    mapped = picture_steps.desaturated(colors, BT709)
    light = BT709 @ colors
    outside = (colors.min(axis=0) < 0) & (light > 0)
    assert 100 < outside.sum() < 900
    np.testing.assert_array_equal(mapped[:, ~outside], colors[:, ~outside])
    np.testing.assert_allclose(BT709 @ mapped[:, outside], light[outside], rtol=1e-12)
    np.testing.assert_allclose(mapped[:, outside].min(axis=0), 0, atol=1e-15)
    away, before = (c[:, outside] - light[outside] for c in (mapped, colors))
    share = np.linalg.norm(away, axis=0) / np.linalg.norm(before, axis=0)
    np.testing.assert_allclose(away, share * before, atol=1e-12)


def test_a_block_is_mirrored_at_the_border_of_the_picture_and_cut_at_no_other():
    picture = np.random.default_rng(3).random((2, 9, 8)).astype(np.float32)

    def mean(planes):
        return ndimage.uniform_filter(planes, (0, 5, 5))

    operation = picture_steps.PictureOperation(mean, 2, 9)
    wanted = np.stack([ndimage.uniform_filter(p, 5, mode="mirror") for p in picture])
    garbage = np.full((2, 4, 8), np.nan, np.float32)  # beyond the border: no step knows it
    for start, stop in ((0, 4), (4, 9), (0, 9)):
        above, below = min(start, 4), min(9 - stop, 4)
        rows = picture[:, start - above : stop + below]
        rows = np.concatenate([garbage[:, above:], rows, garbage[:, below:]], axis=1)
        done = operation.process_block(Block(rows, start - 4))
        assert done.first_row == start - 2
        inner = done.planes[:, 2:-2]
        np.testing.assert_allclose(inner, wanted[:, start:stop], atol=1e-6)


SMALL = {"array.rows": 96, "array.columns": 64, "quality": ["mse"], "output.render": 8}
BEFORE = [{"black_level": "subtract"}, {"demosaic": "bilinear"}, {"white_balance": "illuminant"}]


def camera(*steps, pattern="bayer-rggb", **changes):
    source = {"kind": "chart", "chart": "colorchecker"}
    more = {"scene.source": source, "array.pattern": pattern, "processing": [*BEFORE, *steps]}
    return Camera.model_validate(tree(SMALL | {"scene.illuminant": "D65"} | more | changes))


@pytest.mark.parametrize(
    "pattern", long_except(["honeycomb"], ["bayer-rggb", "quad-bayer", "honeycomb"])
)
@pytest.mark.parametrize("step", [{"denoise": {}}, {"sharpen": {"radius": "3 px"}}], ids=str)
def test_steps_are_those_of_the_whole_picture_for_any_workers(pattern, step):
    before = simulate(camera(pattern=pattern)).linear.transpose(2, 0, 1)
    one, two = (simulate(camera(step, pattern=pattern), workers=n) for n in (1, 2))
    np.testing.assert_array_equal(one.linear, two.linear)
    wide = np.pad(before, ((0, 0), (12, 12), (12, 12)), "reflect").astype(np.float64)
    if "sharpen" in step:
        whole = picture_steps.sharpened(wide, 3.0, 0.5)
    else:
        whole = picture_steps.denoised(wide, _level_by_blocks(before))
    done = one.linear.transpose(2, 0, 1)
    # 32-bit numbers; the picture reaches 1
    np.testing.assert_allclose(done, whole[:, 12:-12, 12:-12], atol=2e-5)


def _level_by_blocks(picture):
    """Noise measured in blocks of 64 rows, as processing has them."""
    parts = [picture_steps.noise_sums(picture[:, i : i + 64]) for i in (0, 64)]
    return picture_steps.noise_level(sum(parts))


def test_denoising_brings_a_noisy_picture_closer_to_the_ideal():
    noisy = {"pixel.readout.read_noise": "60 e"}
    errors = [
        simulate(camera({"denoise": {"strength": strength}}, **noisy)).metrics["mse"]
        for strength in (0, 0.5, 1)
    ]
    assert errors[0] > errors[1] > errors[2]
    without = simulate(camera(**noisy)).metrics["mse"]
    assert errors[0] == pytest.approx(without, rel=1e-6)


def test_compression_is_that_of_the_file_which_is_written(tmp_path):
    plain = simulate(camera({"gamma": "srgb"}))
    packed = simulate(camera({"gamma": "srgb"}, {"jpeg": {"quality": 60}}))
    packed.save(tmp_path / "packed")
    shown = np.asarray(Image.open(tmp_path / "packed/render.jpg"))
    np.testing.assert_array_equal(packed.render, shown)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "packed/render.png")), shown)
    assert (packed.render != plain.render).any()
    np.testing.assert_array_equal(packed.linear, plain.linear)
    sizes = [len(jpeg.compress(plain.render, quality)) for quality in (20, 60, 95)]
    assert sizes == sorted(sizes)
    # A uniform block is a multiple of the DC step of the tables at quality 100, 1 / 8 of a code
    gray = np.full((16, 16), 77, np.uint8)
    np.testing.assert_array_equal(jpeg.decompress(jpeg.compress(gray, 100)), gray)


def test_the_picture_after_each_step_is_the_render_of_a_camera_that_ends_there(tmp_path):
    steps = [*BEFORE, {"color_correction": "fit"}, {"gamma": 2.2}, {"jpeg": {"quality": 80}}]
    whole = camera(**{"processing": steps, "output.steps": True})
    simulate(whole).save(tmp_path / "run")
    names = [next(iter(step)) for step in steps]
    files = sorted(path.name for path in (tmp_path / "run").glob("step_*.png"))
    assert files == [f"step_{i:02d}_{name}.png" for i, name in enumerate(names, 1)]
    for number, name in enumerate(files, 1):
        ends = camera(**{"processing": steps[:number], "quality": []})
        shown = np.asarray(Image.open(tmp_path / "run" / name))
        np.testing.assert_array_equal(shown, simulate(ends).render)
    assert np.asarray(Image.open(tmp_path / "run" / files[0])).ndim == 2  # the mosaic
