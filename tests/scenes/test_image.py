"""Images on the sensor plane: crop, scale, black around, upright, mirrored."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import scene, view

from vcam_cli.errors import BadInput
from vcam_cli.scenes.build import build
from vcam_cli.scenes.image import image_scene, placement
from vcam_cli.spectra import Spectrum, cmf, integral, luminance, srgb_reflectances

GRAY = {"kind": "image", "file": "/a.png", "model": "reflectance"}
LASER = {"kind": "image", "file": "/a.png", "model": "laser"}
MALLETT = {"kind": "image", "file": "/a.png", "model": "mallett"}
DISPLAY = {"kind": "image", "file": "/a.png", "model": "rgb-display"}
WHITE = Spectrum.flat(1.0)
START, STOP = 380e-9, 780e-9


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
    placed = placement(rows, columns, seen)
    for samples, cut, needed in [
        (columns, placed.cut_x, seen.width / placed.pitch),
        (rows, placed.cut_y, seen.height / placed.pitch),
    ]:
        kept = samples - 2 * cut
        # parity is kept, so less than 2 samples (1 on a side) are too many
        assert needed - 3e-6 <= kept < needed + 2
    if width is None:
        assert placed.cut_x >= 0
        assert placed.cut_y >= 0
        assert min(placed.cut_x, placed.cut_y) == 0


def test_a_width_of_its_own_puts_black_around():
    given_picture = picture(3, 4)
    shown = image_scene(given_picture, (WHITE,), WHITE, view(scene_width=24e-6))
    assert shown.pitch_x == pytest.approx(6e-6)
    planes = shown.planes(np.ones((1, 1)))[0]
    assert shown.shape == planes.shape == (7, 8)  # 6 rows needed, of an odd count: 7
    np.testing.assert_array_equal(planes[2:5, 2:6], given_picture[:, :, 0])
    assert planes.sum() == pytest.approx(given_picture.sum(), rel=1e-6)


@pytest.mark.parametrize(("rows", "columns"), [(3, 4), (4, 3), (1, 1), (2, 2), (1, 2)])
def test_samples_far_larger_than_the_array_stay_in_place(rows, columns):
    """The middle sample, or the two that meet in the middle; few and small, whatever the width."""
    given_picture = picture(rows, columns) + 1
    seen = view(scene_width=1e3, margin=2)
    shown = image_scene(given_picture, (WHITE,), WHITE, seen)
    assert max(shown.shape) <= 2
    assert shown.pitch_x * shown.shape[1] == pytest.approx(seen.width + 4 * seen.pitch_x)
    assert shown.pitch_y * shown.shape[0] == pytest.approx(seen.height + 4 * seen.pitch_y)
    light = shown.values_at(np.array([-1e-6, 1e-6]), np.array([-1e-6, 1e-6]), np.ones((1, 1)))[0]
    down = [(rows - 1) // 2, rows // 2]
    across = [(columns - 1) // 2, columns // 2]
    np.testing.assert_array_equal(light, given_picture[np.ix_(down, across)][:, :, 0])


def test_points_see_the_sample_they_fall_into():
    given_picture = picture(24, 41)
    shown = image_scene(given_picture, (WHITE,), WHITE, view())
    planes = shown.planes(np.ones((1, 1)))
    x = (np.arange(33) - 16) * shown.pitch_x
    y = (np.arange(24) - 11.5) * shown.pitch_y
    near = 0.4 * shown.pitch_x
    for dx, dy in [(0, 0), (near, -near), (-near, near)]:
        np.testing.assert_allclose(shown.values_at(x + dx, y + dy, np.ones((1, 1))), planes)
    beyond = shown.values_at(x[-1:] + shown.pitch_x, y, np.ones((1, 1)))
    np.testing.assert_allclose(beyond[:, :, 0], planes[:, :, -1])  # mirrored


def test_points_around_a_small_image_are_black():
    shown = image_scene(picture(3, 4) + 1, (WHITE,), WHITE, view(scene_width=24e-6))
    light = shown.values_at(
        np.array([-13e-6, -11e-6, 11e-6, 13e-6]), np.array([-10e-6, 0]), np.ones((1, 1))
    )
    assert (light[0] > 0).tolist() == [[False] * 4, [False, True, True, False]]


def test_an_image_is_upright():
    given_picture = np.zeros((12, 16, 3), np.float32)
    given_picture[0, 0] = [1, 2, 3]
    shown = build(scene(LASER), view(), given_picture)
    planes = shown.planes(np.eye(3))
    assert planes[:, 0, 0].tolist() == [1, 2, 3]
    assert shown.values_at(np.array([-23e-6]), np.array([-17e-6]), np.eye(3)).ravel().tolist() == [
        1,
        2,
        3,
    ]


def test_planes_are_the_linear_combination_of_channels():
    given_picture = picture(24, 32, 3)
    shown = build(scene(LASER), view(dtype=np.float32), given_picture)
    mix = np.array([[1.0, 0.5, 0.0], [0.0, 0.0, 2.0]])
    planes = shown.planes(mix)
    assert planes.dtype == np.float32
    expected = np.einsum("rk,ijk->rij", mix, given_picture)
    np.testing.assert_allclose(planes, expected, rtol=1e-6)
    x, y = (np.arange(32) - 15.5) * 1.5e-6, (np.arange(24) - 11.5) * 1.5e-6
    np.testing.assert_allclose(shown.values_at(x, y, mix), expected, rtol=1e-6)


def test_reflectance_of_three_channels_names_the_other_models():
    with pytest.raises(BadInput, match=r"scene.source.model: .*one channel.*laser") as caught:
        build(scene(GRAY), view(), picture(4, 4, 3))
    assert caught.value.problems[0].path == ("scene", "source", "model")


@pytest.mark.parametrize("source", [LASER, MALLETT, DISPLAY], ids=lambda source: source["model"])
@pytest.mark.parametrize("channels", [1, 2, 4])
def test_models_for_colors_want_three_channels(source, channels):
    with pytest.raises(BadInput, match=f"{channels} channels? .*needs 3") as caught:
        build(scene(source), view(), picture(4, 4, channels))
    (problem,) = caught.value.problems
    assert problem.path == ("scene", "source", "file")
    assert ("model: reflectance" in problem.remedy) == (channels == 1)


def test_two_channels_are_no_reflectance():
    with pytest.raises(BadInput, match=r"2 channels .*needs 1"):
        build(scene(GRAY), view(), picture(4, 4, 2))


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


# ---- colors by the display's primaries and by reflectances


def color(spectrum) -> np.ndarray:
    """Chromaticity x, y."""
    xyz = [integral(spectrum.multiply(Spectrum(tables=(c,))), START, STOP) for c in cmf()]
    return np.array(xyz[:2]) / sum(xyz)


def light(built, rgb) -> float:
    """Luminance of a color [cd/m2]."""
    return sum(v * luminance(s, START, STOP) for v, s in zip(rgb, built.spectra, strict=True))


@pytest.mark.parametrize("primaries", ["crt-brainard", "srgb"])
def test_display_white_has_the_stated_luminance(primaries):
    shown = build(scene(DISPLAY, luminance="80 cd/m2"), view(), picture(4, 4, 3), primaries)
    assert luminance(shown.white, START, STOP) == pytest.approx(80, rel=1e-12)
    assert light(shown, [1, 1, 1]) == pytest.approx(80, rel=1e-12)
    assert light(shown, [0.5, 0.5, 0.5]) == pytest.approx(40, rel=1e-12)
    powers = [integral(s, START, STOP) for s in (*shown.spectra, shown.white)]
    assert sum(powers[:3]) == pytest.approx(powers[3], rel=1e-12)


def test_display_by_radiance_and_in_other_primaries():
    shown = build(scene(DISPLAY, radiance="0.3 W/(sr m2)"), view(), picture(4, 4, 3), "srgb")
    assert integral(shown.white, START, STOP) == pytest.approx(0.3, rel=1e-12)


def test_display_primaries_have_their_colors():
    # BT.709, which the reflectances of Mallett & Yuksel have as sums over 5 nm; and such sums of
    # the CRT with colour-science. Straight lines between the 5 nm instead: up to 6.3e-4.
    srgb = build(scene(DISPLAY), view(), picture(4, 4, 3), "srgb")
    expected = [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.3290)]
    for spectrum, xy in zip((*srgb.spectra, srgb.white), expected, strict=True):
        assert color(spectrum) == pytest.approx(xy, abs=7e-4)
    crt = build(scene(DISPLAY), view(), picture(4, 4, 3))
    expected = [(0.6189, 0.3440), (0.2765, 0.6049), (0.1512, 0.0611), (0.2884, 0.3131)]
    for spectrum, xy in zip((*crt.spectra, crt.white), expected, strict=True):
        assert color(spectrum) == pytest.approx(xy, abs=7e-4)


def test_a_display_beyond_the_wavelengths_is_an_error():
    dark = {"start": "800 nm", "stop": "900 nm"}
    with pytest.raises(BadInput, match=r"scene.wavelengths: .*no power"):
        lit = scene(DISPLAY, wavelengths=dark, radiance="1 W/(sr m2)")
        build(lit, view(), picture(4, 4, 3))


def test_mallett_white_is_a_perfect_diffuser():
    shown = build(scene(MALLETT, illuminant="FL2"), view(), picture(4, 4, 3))
    at = np.linspace(START, STOP, 201)
    total = sum(s.evaluate(at) for s in shown.spectra)
    np.testing.assert_allclose(
        total, shown.white.evaluate(at), rtol=1.1e-5
    )  # of the published basis
    assert luminance(shown.white, START, STOP) == pytest.approx(100, rel=1e-12)


def test_mallett_colors_under_d65_are_those_of_the_file():
    shown = build(scene(MALLETT), view(), picture(4, 4, 3))
    rgb = np.array([0.2, 0.5, 0.8])
    xyz = [
        sum(v * integral(s.multiply(Spectrum(tables=(c,))), START, STOP)
            for v, s in zip(rgb, shown.spectra, strict=True))
        for c in cmf()
    ]  # fmt: skip
    # IEC 61966-2-1, the matrix of linear sRGB; white has Y = 1. As above.
    matrix = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    white = integral(shown.white.multiply(Spectrum(tables=(cmf()[1],))), START, STOP)
    np.testing.assert_allclose(np.array(xyz) / white, matrix @ rgb, atol=8e-4)


def test_mallett_reflectances_reflect_at_most_all():
    for basis in srgb_reflectances():
        assert basis.tables[0].value.min() >= 0
        assert basis.tables[0].value.max() <= 1


def test_what_is_cropped_goes_on_beyond_the_array():
    """As far as array and margin reach, and no black: mirrored where the picture ends."""
    given_picture = picture(24, 60)
    shown = image_scene(given_picture, (WHITE,), WHITE, view(margin=3))  # 32 and 2 x 6 samples
    assert shown.shape == (24, 44)
    assert shown.black == (0, 0)
    np.testing.assert_array_equal(shown.planes(np.ones((1, 1)))[0], given_picture[:, 8:52, 0])
    wide = image_scene(given_picture, (WHITE,), WHITE, view(margin=30))
    assert wide.shape == (24, 60)
