"""What comes of colors: a ColorChecker through a camera with published sensitivities.

The colors that should come out are computed by colour-science alone.
"""

import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from vcam_cli import load, simulate
from vcam_cli.processing import process

QUIET = "effects={shot_noise: off, reset_noise: off, read_noise: off, fpn: off, off_axis: off}"
SMALL = ("array.rows=256", "array.columns=384", "quality=[]", "adc.bits=16", "accuracy=draft")
"""The white patch holds whole blocks of 16 pixels."""
D65 = (0.3127, 0.3290)


@pytest.fixture(scope="module")
def colour():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


def steps(balance, correction="fit", demosaic="bilinear"):
    return (
        f"processing=[black_level: subtract, demosaic: {demosaic}, "
        f"white_balance: {balance}, color_correction: {correction}]"
    )


def patches(result):
    """(24, 3) mean linear RGB of the middle of every patch.

    The chart's proportions: patches of 40, gaps of 5, 7.5 around, as large as fits the array.
    """
    rows, columns = result.linear.shape[:2]
    scale = min(rows / 190, columns / 280)  # pixels of one unit
    out = []
    for i in range(4):
        y = rows / 2 + scale * (45 * i - 67.5)
        for j in range(6):
            x = columns / 2 + scale * (45 * j - 112.5)
            reach = 10 * scale
            here = result.linear[round(y - reach) : round(y + reach)]
            here = here[:, round(x - reach) : round(x + reach)]
            out.append(here.mean(axis=(0, 1), dtype=float))
    return np.array(out)


def expected(colour, lamp):
    """(24, 3) CIELAB of the chart under a lamp, adapted to D65 by linear Bradford."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        light = colour.SDS_ILLUMINANTS[lamp]
        ones = colour.sd_ones(colour.SpectralShape(380, 780, 5))
        chart = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].values()
        *xyz, white = [colour.sd_to_XYZ(sd, illuminant=light) / 100 for sd in (*chart, ones)]
        adapted = colour.chromatic_adaptation(
            np.array(xyz), white, colour.xy_to_XYZ(D65), method="Von Kries", transform="Bradford"
        )
        return colour.XYZ_to_Lab(adapted, D65)


def lab(colour, rgb):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return colour.XYZ_to_Lab(colour.RGB_to_XYZ(rgb, "sRGB"), D65)


@cache
def photograph(*sets):
    return simulate(load("true-color", [QUIET, *SMALL, *sets]), workers=1)


def developed(result, processing):
    """The same frame through other steps."""
    steps = load("true-color", [processing]).processing
    context = result.processed.context
    return replace(result, process=lambda _: process(result.dn, context, steps))


def through(lamp, processing):
    return developed(photograph(f"scene={{use: colorchecker, illuminant: {lamp}}}"), processing)


@pytest.mark.parametrize(("lamp", "most"), [("D65", 1.2), ("A", 1.35), ("FL2", 1.1)])
def test_the_mean_difference_is_about_one(colour, lamp, most):
    """CIEDE2000, noise off; below 3 few people see it. Measured: 1.05, 1.20, 0.97."""
    found = lab(colour, patches(through(lamp, steps("illuminant"))))
    difference = colour.delta_E(found, expected(colour, lamp), method="CIE 2000")
    assert difference.mean() < most
    assert difference.max() < 4


def test_it_is_the_correction_that_does_it(colour):
    found = lab(colour, patches(through("D65", steps("illuminant", "none"))))
    assert colour.delta_E(found, expected(colour, "D65"), method="CIE 2000").mean() > 5


@pytest.mark.parametrize("balance", ["illuminant", "bright-block"])
@pytest.mark.parametrize("lamp", ["D65", "A", "FL2"])
def test_gray_is_neutral_after_white_balance(colour, lamp, balance):
    """Neutral 8, 6.5 and 5: within 1 Delta E of gray, by correction and without it."""
    for correction in ("fit", "none"):
        rgb = patches(through(lamp, steps(balance, correction)))[19:22]
        found = lab(colour, rgb)
        assert np.hypot(found[:, 1], found[:, 2]).max() < 1, correction


@pytest.mark.parametrize(
    ("name", "gain"),
    [pytest.param("still-life", 4.0, marks=pytest.mark.long), ("colorchecker-d65", 5.0)],
)
def test_edge_aware_comes_closer_to_the_picture_than_bilinear(name, gain):
    """PSNR [dB] of a mosaic of the scene sampled at the pixels' centers; measured: 5.3 and 8.2."""
    from demosaiced import bilinear, edge_aware

    frame = simulate(load(name, ["quality=[]"]), workers=1).frame
    white = frame.white_dn - frame.black_dn
    full = frame.ideal_dn() - frame.black_dn
    pattern, colors = frame.mosaic.block, frame.mosaic.colors
    raw = np.empty(full.shape[1:])
    for i in range(2):
        for j in range(2):
            raw[i::2, j::2] = full[colors.index(pattern[i][j]), i::2, j::2]

    def error(found):
        return np.mean(((found - full) / white[:, None, None]) ** 2)

    ratio = error(bilinear(raw, pattern, colors)) / error(edge_aware(raw, pattern, colors, white))
    assert 10 * np.log10(ratio) > gain


def test_the_ideal_image_has_the_same_colors():
    """Without noise and blur, picture and ideal image agree inside the patches."""
    result = through("D65", steps("illuminant"))
    ideal = result.ideal
    rows, columns = slice(128 + 26, 128 + 34), slice(192 + 26, 192 + 34)  # the middle of a patch
    found, expected = (
        image[rows, columns].mean(axis=(0, 1), dtype=float) for image in (result.linear, ideal)
    )
    np.testing.assert_allclose(found, expected, atol=1e-2)  # the settings' half of `draft`


@pytest.mark.parametrize(
    "sets",
    [
        ("scene.illuminant={monochromatic: 550 nm}",),
        ("scene.illuminant={monochromatic: 690 nm}",),
        ("array.filters={R: generic-red, G: generic-red, B: generic-blue}",),
        ("array.filters={R: 0.5, G: 0.5, B: 0.5}",),
        ("exposure.time=1 ns",),
    ],
)
def test_light_and_filters_that_tell_nothing_are_harmless(sets):
    base = ("array.rows=32", "array.columns=48", "quality=[]", "accuracy=draft")
    result = simulate(load("colorchecker-d65", [*base, *sets]), workers=1)
    for balance in ("illuminant", "none", "gray-world", "bright-block"):
        found = developed(result, steps(balance, "fit", "edge-aware"))
        assert np.isfinite(found.linear).all()
        assert np.isfinite(found.ideal).all()
        notes = found.processed.notes
        assert "exposure" in sets[0] or any("color correction" in note for note in notes)
