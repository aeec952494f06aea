"""Frames whose every pixel has all its colors: the same steps, without a mosaic."""

import numpy as np
import pytest

from tests.processing.test_processing_steps import BLACK, RGB, Step, mosaic_of
from vcam_cli.errors import BadInput
from vcam_cli.processing import Context, check, process

WHITE = np.array([520.0, 1020.0, 270.0])
STACKED = Context((RGB,), RGB, WHITE, BLACK, planes=True, saturated_dn=2000)


def steps(**given):
    return tuple(Step(name, value) for name, value in given.items())


def seen(reflectance):
    """(3, rows, columns) DN of a gray scene, reflectance (rows, columns)."""
    return BLACK + np.asarray(reflectance) * (WHITE - BLACK)[:, None, None]


@pytest.mark.parametrize("balance", ["illuminant", "gray-world", "bright-block"])
def test_every_pixel_stands_for_itself(balance):
    """Noise of pixels and the codes stay where they are: nothing is interpolated."""
    scene = np.random.default_rng(0).random((150, 40))  # more than a block of rows
    done = process(
        seen(scene), STACKED, steps(black_level="subtract", white_balance=balance, gamma="srgb")
    )
    assert done.linear.shape == (150, 40, 3)
    np.testing.assert_allclose(done.linear, np.dstack([scene] * 3), atol=1e-6)  # float32
    assert done.encode(8).shape == (150, 40, 3)
    np.testing.assert_allclose(done.ideal(seen(scene)), done.linear, atol=1e-6)


def test_gives_what_a_mosaic_of_an_even_scene_gives():
    flat = seen(np.full((20, 20), 0.4))
    mosaic = Context((("R", "G"), ("G", "B")), RGB, WHITE, BLACK)
    wanted = steps(black_level="subtract", demosaic="bilinear", white_balance="gray-world")
    expected = process(mosaic_of(flat), mosaic, wanted).linear
    stacked = steps(black_level="subtract", white_balance="gray-world")
    np.testing.assert_allclose(process(flat, STACKED, stacked).linear, expected, rtol=1e-6)


def test_a_pixel_is_saturated_where_one_of_its_colors_is():
    """A lamp in the brightest block, clipped in blue alone, does not decide what white is."""
    scene = np.full((32, 32), 0.5)
    frame = seen(scene)
    frame[2, 3, 3], frame[:2, :16, :16] = 2000, seen(np.full((16, 16), 0.9))[:2]
    linear = process(
        frame, STACKED, steps(black_level="subtract", white_balance="bright-block")
    ).linear
    np.testing.assert_allclose(linear[20:, 20:], 0.5, rtol=1e-5)


def test_codes_of_a_logarithmic_converter():
    bent = Context((RGB,), RGB, np.log(WHITE), float(np.log(BLACK)), linearize=np.exp, planes=True)
    scene = np.random.default_rng(1).random((9, 9))
    wanted = steps(black_level="subtract", white_balance="illuminant")
    done = process(np.log(seen(scene)), bent, wanted)
    np.testing.assert_allclose(done.linear, np.dstack([scene] * 3), rtol=1e-4, atol=1e-5)


def test_workers_make_no_difference():
    frame = seen(np.random.default_rng(2).random((200, 30)))
    wanted = steps(black_level="subtract", white_balance="gray-world", gamma=2.2)
    one, three = (process(frame, STACKED, wanted, workers).encode(16) for workers in (1, 3))
    assert np.array_equal(one, three)


def test_what_can_be_done_and_what_not():
    check(steps(white_balance="illuminant", color_correction="fit"), (), RGB, ("mse",), planes=True)
    with pytest.raises(BadInput, match="every pixel of this array has all its colors"):
        check(steps(demosaic="bilinear"), (), RGB, planes=True)
    with pytest.raises(BadInput, match="cannot be judged"):
        check((), (), RGB, ("mse",), scattered=True)
    with pytest.raises(BadInput, match="put demosaic before it"):
        check(steps(color_correction="fit"), (), RGB, scattered=True)
