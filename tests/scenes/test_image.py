"""Images on the sensor plane: crop, scale, black around, upright, mirrored."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import scene, view

from vcam_cli.errors import BadInput
from vcam_cli.scenes.build import build
from vcam_cli.scenes.image import image_scene, place
from vcam_cli.spectra import Spectrum

GRAY = {"kind": "image", "file": "/a.png", "model": "reflectance"}
LASER = {"kind": "image", "file": "/a.png", "model": "laser"}
WHITE = Spectrum.flat(1.0)


def picture(rows, columns, channels=1):
    return np.random.default_rng(2).random((rows, columns, channels)).astype(np.float32)


def test_the_same_aspect_keeps_every_sample():
    for rows, columns in [(12, 16), (24, 32), (6, 8), (9, 12), (3, 4)]:
        shown = image_scene(picture(rows, columns), (WHITE,), WHITE, view())
        assert shown.shape == (rows, columns)
        assert shown.pitch_x == shown.pitch_y == pytest.approx(48e-6 / columns, rel=1e-12)
        assert shown.samples == "squares"


@pytest.mark.parametrize(
    ("rows", "columns", "shape"),
    [
        (24, 40, (24, 32)),  # 4 samples cut on either side
        (24, 41, (24, 33)),  # 4.5 on either side: 4
        (24, 33, (24, 33)),  # half a sample on either side: none
        (30, 32, (24, 32)),
        (31, 32, (25, 32)),
        (10, 100, (10, 14)),  # 13.33 needed, of an even count: 14
        (10, 101, (10, 15)),  # 13.33 needed, of an odd count: 15
    ],
)
def test_cropped_centrally_to_whole_samples(rows, columns, shape):
    given_picture = picture(rows, columns)
    shown = image_scene(given_picture, (WHITE,), WHITE, view())
    assert shown.shape == shape
    top, left = (rows - shape[0]) // 2, (columns - shape[1]) // 2
    kept = given_picture[top : top + shape[0], left : left + shape[1], 0]
    np.testing.assert_allclose(shown.planes(np.ones((1, 1)))[0], kept, rtol=1e-6)


@given(
    st.integers(1, 500),
    st.integers(1, 500),
    st.integers(1, 300),
    st.integers(1, 300),
    st.sampled_from([None, 1e-5, 3.3e-4]),
)
def test_samples_cover_the_array_with_less_than_one_to_spare(rows, columns, high, wide, width):
    seen = view(rows=high, columns=wide, scene_width=width)
    placed = place(rows, columns, seen)
    for samples, cut, needed in [
        (columns, placed.cut_x, seen.width / placed.pitch),
        (rows, placed.cut_y, seen.height / placed.pitch),
    ]:
        kept = samples - 2 * cut
        # parity is kept, so less than 2 samples (1 on a side) are too many
        assert needed - 3e-6 <= kept < needed + 2
    if width is None:
        assert placed.cut_x >= 0 and placed.cut_y >= 0
        assert min(placed.cut_x, placed.cut_y) == 0


def test_a_width_of_its_own_puts_black_around():
    given_picture = picture(3, 4)
    shown = image_scene(given_picture, (WHITE,), WHITE, view(scene_width=24e-6))
    assert shown.pitch_x == pytest.approx(6e-6)
    planes = shown.planes(np.ones((1, 1)))[0]
    assert shown.shape == planes.shape == (7, 8)  # 6 rows needed, of an odd count: 7
    np.testing.assert_array_equal(planes[2:5, 2:6], given_picture[:, :, 0])
    assert planes.sum() == pytest.approx(given_picture.sum(), rel=1e-6)


def test_points_see_the_sample_they_fall_into():
    given_picture = picture(24, 41)
    shown = image_scene(given_picture, (WHITE,), WHITE, view())
    planes = shown.planes(np.ones((1, 1)))
    x = (np.arange(33) - 16) * shown.pitch_x
    y = (np.arange(24) - 11.5) * shown.pitch_y
    near = 0.4 * shown.pitch_x
    for dx, dy in [(0, 0), (near, -near), (-near, near)]:
        np.testing.assert_allclose(shown.at(x + dx, y + dy, np.ones((1, 1))), planes)
    beyond = shown.at(x[-1:] + shown.pitch_x, y, np.ones((1, 1)))
    np.testing.assert_allclose(beyond[:, :, 0], planes[:, :, -1])  # mirrored


def test_points_around_a_small_image_are_black():
    shown = image_scene(picture(3, 4) + 1, (WHITE,), WHITE, view(scene_width=24e-6))
    light = shown.at(
        np.array([-13e-6, -11e-6, 11e-6, 13e-6]), np.array([-10e-6, 0]), np.ones((1, 1))
    )
    assert (light[0] > 0).tolist() == [[False] * 4, [False, True, True, False]]


def test_an_image_is_upright():
    given_picture = np.zeros((12, 16, 3), np.float32)
    given_picture[0, 0] = [1, 2, 3]
    shown = build(scene(LASER), view(), given_picture)
    planes = shown.planes(np.eye(3))
    assert planes[:, 0, 0].tolist() == [1, 2, 3]
    assert shown.at(np.array([-23e-6]), np.array([-17e-6]), np.eye(3)).ravel().tolist() == [1, 2, 3]


def test_planes_are_the_linear_combination_of_channels():
    given_picture = picture(24, 32, 3)
    shown = build(scene(LASER), view(dtype=np.float32), given_picture)
    mix = np.array([[1.0, 0.5, 0.0], [0.0, 0.0, 2.0]])
    planes = shown.planes(mix)
    assert planes.dtype == np.float32
    expected = np.einsum("rk,ijk->rij", mix, given_picture)
    np.testing.assert_allclose(planes, expected, rtol=1e-6)
    x, y = (np.arange(32) - 15.5) * 1.5e-6, (np.arange(24) - 11.5) * 1.5e-6
    np.testing.assert_allclose(shown.at(x, y, mix), expected, rtol=1e-6)


def test_reflectance_of_three_channels_names_the_other_models():
    with pytest.raises(BadInput, match=r"scene.source.model: .*one channel.*laser") as caught:
        build(scene(GRAY), view(), picture(4, 4, 3))
    assert caught.value.problems[0].path == ("scene", "source", "model")


@pytest.mark.parametrize(("source", "channels"), [(LASER, 1), (GRAY, 2), (LASER, 2), (LASER, 4)])
def test_other_numbers_of_channels_are_refused(source, channels):
    with pytest.raises(BadInput, match=f"{channels} channel"):
        build(scene(source), view(), picture(4, 4, channels))


def test_laser_white_is_the_sum_of_equal_lines():
    shown = build(scene(LASER, radiance="0.6 W/(sr m2)"), view(), picture(4, 4, 3))
    lines = [spectrum.lines for spectrum in shown.spectra]
    assert [line[0][0] for line in lines] == [650e-9, 550e-9, 450e-9]  # red, green, blue
    assert [line[0][1] for line in lines] == pytest.approx([0.2] * 3)
    assert dict(shown.white.lines) == {line[0][0]: line[0][1] for line in lines}


def test_laser_luminance():
    # V(450, 550, 650 nm) = 0.038, 0.994950, 0.107 (CIE 1931, 1 nm table)
    shown = build(scene(LASER, luminance="100 cd/m2"), view(), picture(4, 4, 3))
    power = shown.spectra[0].lines[0][1]
    level = 683.0 * power * (0.038 + 0.9949501 + 0.107)
    assert math.isclose(level, 100.0, rel_tol=1e-3)  # 683 against 683.002


def test_laser_lines_outside_the_wavelengths_are_an_error():
    narrow = {"start": "500 nm", "stop": "700 nm"}
    with pytest.raises(BadInput, match=r"scene.wavelengths: .*450"):
        build(scene(LASER, wavelengths=narrow), view(), picture(4, 4, 3))
