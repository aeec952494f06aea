"""Color correction: white, known answers, colour-science's colors, light that tells nothing."""

import warnings
from dataclasses import dataclass

import numpy as np
import pytest

from vcam_cli.errors import BadInput
from vcam_cli.processing import Context, Patches, check, process
from vcam_cli.processing.base import Block
from vcam_cli.processing.color_correction import (
    ColorCorrection,
    chart_colors,
    fit_matrix,
    fit_relative,
    lab_slope,
)
from vcam_cli.spectra import Spectrum, illuminant

RGB = ("R", "G", "B")
RGGB = (("R", "G"), ("G", "B"))
RANGE = (380e-9, 780e-9)
TRUE = np.array([[0.6, 0.3, 0.1], [0.2, 0.7, 0.1], [0.1, 0.2, 0.7]])
"""A camera's answer to display red, green and blue: white is white."""


@dataclass(frozen=True)
class Step:
    name: str
    value: object


@dataclass(frozen=True)
class Matrix:
    matrix: tuple


def steps(**given):
    return tuple(Step(name, value) for name, value in given.items())


@pytest.fixture(scope="module")
def colour():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


@pytest.mark.parametrize("lamp", ["D65", "A", "FL2", "FL11"])
def test_the_chart_has_the_colors_of_colour_science(colour, lamp):
    """XYZ, linear Bradford, linear sRGB; theirs interpolates spectra otherwise."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        light = colour.SDS_ILLUMINANTS[lamp]
        shape = colour.SpectralShape(380, 780, 5)
        xyz = [
            colour.sd_to_XYZ(sd, illuminant=light) / 100
            for sd in colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].values()
        ]
        white = colour.sd_to_XYZ(colour.sd_ones(shape), illuminant=light) / 100
        d65 = colour.xy_to_XYZ([0.3127, 0.3290])
        adapted = colour.chromatic_adaptation(
            np.array(xyz), white, d65, method="Von Kries", transform="Bradford"
        )
        theirs = colour.XYZ_to_RGB(adapted, "ITU-R BT.709", apply_cctf_encoding=False)
    ours = chart_colors(illuminant(lamp), *RANGE)
    # 0.3 % of white: 5 nm sums and rounded matrices there, spikes of lamps integrated exactly here
    np.testing.assert_allclose(ours, theirs, atol=3e-3)


def test_the_slope_of_cielab_is_that_of_colour_science(colour):
    rgb = np.random.default_rng(1).uniform(-0.02, 1, (30, 3))

    def lab(values):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            matrix = colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_RGB_to_XYZ
            return colour.XYZ_to_Lab(values @ matrix.T, [0.3127, 0.3290])

    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        numeric = (lab(rgb + shift) - lab(rgb - shift)) / (2 * step)
        # their matrix is rounded to 4 digits; slopes are up to 1000
        np.testing.assert_allclose(lab_slope(rgb)[:, :, axis], numeric, atol=1.0, rtol=1e-3)


def test_a_camera_that_is_a_matrix_of_the_display_is_undone():
    target = chart_colors(illuminant("D65"), *RANGE)
    matrix, rank = fit_relative(target @ TRUE.T, target)
    # The pull towards the identity shifts coefficients by about its share in the squares.
    np.testing.assert_allclose(matrix, np.linalg.inv(TRUE), atol=2e-3)
    assert rank == 3


@pytest.mark.parametrize("count", [3, 4])
def test_white_stays_neutral_exactly(count):
    random = np.random.default_rng(2)
    matrix, _ = fit_relative(random.random((24, count)), random.random((24, 3)))
    np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-13)


def made(white, balanced=True, light="D65", mix=TRUE):
    target = chart_colors(illuminant("D65"), *RANGE)
    signals = (target @ mix.T).T * np.array(white)[:, None]
    patches = Patches(signals, illuminant(light), *RANGE)
    return fit_matrix(signals, np.array(white), balanced, patches)


def test_an_unbalanced_white_is_balanced_by_the_matrix():
    white = np.array([500.0, 1000.0, 250.0])
    np.testing.assert_allclose(made(white, False).matrix @ white, 1000, rtol=1e-12)
    # Balanced, well or not: the matrix is that of a white balanced well.
    np.testing.assert_allclose(made(white).matrix, made([1.0, 1.0, 1.0]).matrix, rtol=1e-9)


def test_colors_that_are_alike_get_a_finite_matrix_near_the_identity():
    same = np.array([[0.5, 0.4, 0.1], [0.5, 0.4, 0.1], [0.1, 0.2, 0.7]])
    two = made([1.0, 1.0, 1.0], mix=same)
    assert np.abs(two.matrix).max() < 3
    assert "too few colors" in two.note
    one = made([1.0, 1.0, 1.0], mix=np.full((3, 3), 1 / 3))
    np.testing.assert_allclose(one.matrix @ np.ones(3), 1, atol=1e-12)
    assert np.isfinite(one.matrix).all()
    assert one.note
    gray = np.linspace(0, 1, 24)[:, None] * np.ones(3)
    np.testing.assert_allclose(fit_relative(gray, gray)[0], np.eye(3), atol=1e-12)


@pytest.mark.parametrize("white", [[0.0, 0.0, 0.0], [-1.0, -1.0, -1.0], [1.0, 1.0, 0.0]])
def test_without_light_the_identity_is_left(white):
    found = made(white)
    np.testing.assert_array_equal(found.matrix, np.eye(3))
    assert "not every color" in found.note


@pytest.mark.parametrize("wavelength", [400e-9, 550e-9, 700e-9])
def test_light_of_one_wavelength_is_left_alone(wavelength):
    patches = Patches(np.ones((3, 24)), Spectrum.line(wavelength, 1.0), *RANGE)
    found = fit_matrix(np.ones((3, 24)), np.ones(3), True, patches)
    np.testing.assert_allclose(found.matrix, np.eye(3), atol=1e-12)
    assert found.note


def test_a_block_is_multiplied_as_colors_are():
    random = np.random.default_rng(4)
    planes, matrix = random.random((4, 5, 7)), random.normal(size=(3, 4))
    step = ColorCorrection(tuple(map(tuple, matrix.tolist())))
    expected = np.moveaxis(np.moveaxis(planes, 0, 2) @ matrix.T, 2, 0)
    np.testing.assert_allclose(step.process_colors(planes), expected, atol=1e-14)
    block = step.process_block(Block(planes.astype(np.float32), 3))
    assert block.first_row == 3
    assert block.planes.dtype == np.float32
    np.testing.assert_allclose(block.planes, expected, atol=2e-6)  # sums in float32


# In the whole of processing. A camera with black at 20 DN whose colors are a matrix of display's.

WHITE = np.array([500.0, 1000.0, 250.0])
TARGET = chart_colors(illuminant("D65"), *RANGE)


def seen(display):
    """(3, ...) DN of display colors (3, ...)."""
    return 20 + np.einsum("ij,j...->i...", TRUE * WHITE[:, None], display)


def context(**more):
    chart = Patches(seen(TARGET.T), illuminant("D65"), *RANGE)
    return Context(RGGB, RGB, 20 + WHITE, 20.0, patches=lambda: chart, **more)


def flat_frame(color, context):
    planes = seen(np.array(color))
    raw = np.empty((8, 10))
    for i in range(2):
        for j in range(2):
            raw[i::2, j::2] = planes[RGB.index(RGGB[i][j])]
    return raw


@pytest.mark.parametrize("demosaic", ["bilinear", "edge-aware"])
@pytest.mark.parametrize("balance", ["illuminant", "none"])
@pytest.mark.parametrize("black", ["subtract", "none"])
def test_display_colors_come_back(demosaic, balance, black):
    here, color = context(), [0.5, 0.2, 0.1]
    order = steps(
        black_level=black, demosaic=demosaic, white_balance=balance, color_correction="fit"
    )
    done = process(flat_frame(color, here), here, order)
    if black == "subtract":
        # The pull of the fit, 2e-3 in a coefficient.
        np.testing.assert_allclose(done.linear[4, 4], color, atol=2e-3)
    planes = np.ones((3, 8, 10)) * seen(np.array(color))[:, None, None]
    # Black that is left in the picture is the same whatever the scene, and not in the ideal image.
    left = done.linear - done.ideal(planes)
    dark = process(flat_frame([0, 0, 0], here), here, order).linear
    np.testing.assert_allclose(left, dark, atol=2e-6)
    np.testing.assert_allclose(done.ideal(np.full((3, 8, 10), here.black_dn)), 0, atol=1e-7)


def test_balance_may_come_after_correction_and_before_demosaic():
    here = context()
    after = steps(
        black_level="subtract",
        demosaic="bilinear",
        color_correction="fit",
        white_balance="illuminant",
    )
    before = steps(
        black_level="subtract",
        white_balance="illuminant",
        demosaic="bilinear",
        color_correction="fit",
    )
    frame = flat_frame([0.5, 0.2, 0.1], here)
    np.testing.assert_allclose(
        process(frame, here, after).linear, process(frame, here, before).linear, atol=1e-6
    )


def test_a_wrong_balance_stays_wrong():
    """Gray world on a red picture: color correction must not hide it."""
    here = context()
    order = steps(
        black_level="subtract",
        demosaic="bilinear",
        white_balance="gray-world",
        color_correction="fit",
    )
    linear = process(flat_frame([0.5, 0.2, 0.1], here), here, order).linear[4, 4]
    np.testing.assert_allclose(linear, linear[0], rtol=1e-5)


def test_a_given_matrix_and_one_that_leaves_nothing():
    here = context()
    matrix = tuple(map(tuple, (np.linalg.inv(TRUE) / WHITE).tolist()))
    given = steps(black_level="subtract", demosaic="bilinear", color_correction=Matrix(matrix))
    done = process(flat_frame([0.5, 0.2, 0.1], here), here, given)
    np.testing.assert_allclose(done.linear[4, 4], [0.5, 0.2, 0.1], atol=1e-6)
    nothing = Matrix(tuple((0.0, -1.0, 0.0) for _ in range(3)))
    with pytest.raises(BadInput) as caught:
        process(
            flat_frame([1, 1, 1], here), here, steps(demosaic="bilinear", color_correction=nothing)
        )
    assert caught.value.problems[0].path == ("processing", 1, "color_correction")


def test_clipped_white_is_white_and_colors_below_saturation_stay():
    here = context(saturated_dn=1000.0)
    order = steps(
        black_level="subtract",
        demosaic="bilinear",
        white_balance="illuminant",
        color_correction="fit",
    )
    for level in (1.2, 2.5, 8.0):
        clipped = np.minimum(flat_frame([level] * 3, here), 1000.0)
        linear = process(clipped, here, order).linear[4, 4]
        assert linear.min() >= 0.98, level
        assert np.ptp(linear) < 1e-5 * linear.max(), level
    plain = process(flat_frame([0.8] * 3, here), context(), order).linear
    np.testing.assert_array_equal(process(flat_frame([0.8] * 3, here), here, order).linear, plain)


@pytest.mark.parametrize(
    "given",
    [
        steps(color_correction="fit", demosaic="bilinear"),
        steps(demosaic="bilinear", color_correction=Matrix(((1.0, 0.0),) * 3)),
        steps(demosaic="bilinear", color_correction=Matrix(((1.0, 0.0, 0.0),) * 2)),
        steps(demosaic="bilinear", color_correction="fti"),
        steps(demosaic="bilinear", color_correction="fit", black_level="subtract"),
    ],
)
def test_orders_and_matrices_that_cannot_work(given):
    with pytest.raises(BadInput) as caught:
        check(given, RGGB, RGB)
    assert len(caught.value.problems) == 1


def test_one_color_has_nothing_to_correct():
    with pytest.raises(BadInput):
        check(steps(color_correction="fit"), (("Y",),), ("Y",))
    check(steps(color_correction="none"), (("Y",),), ("Y",))
