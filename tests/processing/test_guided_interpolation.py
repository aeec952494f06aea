"""Edge-aware demosaicing of blocks that are no Bayer blocks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.processing.test_normalized_convolution import PATTERNS, colors_of, in_spans
from vcam_cli import load, simulate
from vcam_cli.processing.base import padded_block
from vcam_cli.processing.guided_interpolation import GuidedInterpolation
from vcam_cli.processing.normalized_convolution import NormalizedConvolution, Sites, half_width

NAMES = ("quad", "stripes", "white")


def method(pattern, shape, white=None):
    colors = colors_of(pattern)
    white = np.ones(len(colors)) if white is None else white
    return GuidedInterpolation(pattern, colors, tuple(map(float, white)), Sites(pattern, shape))


def demosaiced(mosaic, pattern, white=None, spans=None):
    return in_spans(method(pattern, mosaic.shape, white), mosaic, spans)


def mosaic_of(planes, pattern):
    """What the array measures of full color (C, rows, columns), colors in the order of names."""
    colors, (_, rows, columns) = colors_of(pattern), planes.shape
    site = np.array(
        [
            [colors.index(pattern[i % len(pattern)][j % len(pattern[0])]) for j in range(columns)]
            for i in range(rows)
        ]
    )
    return np.take_along_axis(planes, site[np.newaxis], axis=0)[0].astype(np.float32), site


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 1000))
def test_even_colors_stay_even_up_to_the_corners(height, width, seed):
    rng = np.random.default_rng(seed)
    names = rng.choice(["R", "G", "B", "W"], (height, width))
    pattern = tuple(tuple(str(c) for c in row) for row in names)
    colors = colors_of(pattern)
    reach = max(half_width(pattern, c) for c in colors)
    level = 0.05 + rng.random(len(colors))
    shape = (len(colors), reach + height + 1, reach + width + 1)
    mosaic, _ = mosaic_of(np.ones(shape) * level[:, None, None], pattern)
    for plane, expected in zip(demosaiced(mosaic, pattern, level), level, strict=True):
        np.testing.assert_allclose(plane, expected, rtol=1e-5)  # float32, some hundred terms


@pytest.mark.parametrize("name", NAMES)
def test_measured_values_are_kept(name):
    mosaic = np.random.default_rng(0).random((40, 36)).astype(np.float32)
    planes = demosaiced(mosaic, PATTERNS[name], 1 + np.arange(len(colors_of(PATTERNS[name]))))
    _, site = mosaic_of(np.zeros((len(planes), *mosaic.shape)), PATTERNS[name])
    assert np.array_equal(np.take_along_axis(planes, site[np.newaxis], axis=0)[0], mosaic)


@pytest.mark.parametrize("name", NAMES)
def test_blocks_of_rows_make_no_difference(name):
    mosaic = np.random.default_rng(2).random((70, 33)).astype(np.float32)
    whole = demosaiced(mosaic, PATTERNS[name])
    parts = demosaiced(mosaic, PATTERNS[name], spans=[(0, 20), (20, 33), (33, 70)])
    assert np.array_equal(whole, parts)


@pytest.mark.parametrize(
    ("name", "axis"), [("quad", 1), ("quad", 2), ("white", 1), ("white", 2), ("stripes", 1)]
)
def test_an_edge_along_rows_or_columns_is_found_along_it(name, axis):
    """A gray step: half the error of the plain mean at most. Upright stripes see none along it."""
    pattern = PATTERNS[name]
    colors = colors_of(pattern)
    shape = (len(colors), 48, 48)
    step = np.where(np.arange(48) < 25, 0.2, 0.8).reshape((1, -1, 1) if axis == 1 else (1, 1, -1))
    white = 1.0 + np.arange(len(colors))
    full = np.broadcast_to(step, shape) * white[:, None, None]
    mosaic, _ = mosaic_of(full, pattern)
    plain = NormalizedConvolution(pattern, colors, Sites(pattern, mosaic.shape))
    inside = np.s_[:, 8:-8, 8:-8]

    def error(planes):
        return np.sqrt(np.mean(((planes - full) / white[:, None, None])[inside] ** 2))

    smeared = error(plain.process_block(padded_block(mosaic, 0, 48, plain.halo)).planes)
    assert error(demosaiced(mosaic, pattern, white)) < 0.5 * smeared


def test_white_scales_cancel():
    """Sensitivity is no color: twice the signal of one color gives twice its plane."""
    pattern = PATTERNS["quad"]
    rng = np.random.default_rng(4)
    full = rng.random((3, 30, 30)).cumsum(axis=2) / 15
    scale = np.array([0.25, 1.0, 0.5])
    one = demosaiced(mosaic_of(full, pattern)[0], pattern)
    other = demosaiced(mosaic_of(full * scale[:, None, None], pattern)[0], pattern, scale)
    np.testing.assert_allclose(other, one * scale[:, None, None], atol=2e-5)  # float32


@pytest.mark.parametrize("white", [(0.0, 1.0, 1e-9), (0.0, 0.0, 0.0)])
def test_colors_without_light_are_harmless(white):
    mosaic = np.random.default_rng(0).random((20, 20)).astype(np.float32)
    assert np.isfinite(demosaiced(mosaic, PATTERNS["quad"], white)).all()


def test_the_leader_is_the_color_with_most_pixels_then_with_the_brightest_white():
    assert colors_of(PATTERNS["white"])[method(PATTERNS["white"], (8, 8)).leader] == "W"
    assert colors_of(PATTERNS["quad"])[method(PATTERNS["quad"], (8, 8), (9, 1, 9)).leader] == "G"
    stripes = method(PATTERNS["stripes"], (8, 8), (1, 2, 3))  # B, G, R
    assert stripes.colors[stripes.leader] == "R"


@pytest.mark.long
@pytest.mark.parametrize(("pattern", "decibels", "share"), [("quad-bayer", 2.5, 0.87),
                                                            ("rgbw", 5, 0.7)])  # fmt: skip
def test_it_is_better_than_bilinear_in_numbers_and_to_the_eye(pattern, decibels, share):
    """On still-life: measured 2.9 dB and 0.83 of the S-CIELAB, 5.5 dB and 0.66."""
    found = []
    for how in ("bilinear", "edge-aware"):
        sets = [f"array.pattern={pattern}", f"processing.1.demosaic={how}"]
        found.append(dict(simulate(load("still-life", sets)).metrics))
    plain, aware = found
    assert aware["psnr_db"] > plain["psnr_db"] + decibels
    assert aware["mean_s_cielab"] < share * plain["mean_s_cielab"]
