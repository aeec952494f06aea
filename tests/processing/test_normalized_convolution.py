"""Normalized convolution of any mosaic, against its definition and against bilinear."""

import numpy as np
import pytest
from demosaiced import bilinear
from hypothesis import given, settings
from hypothesis import strategies as st

from vcam_cli.processing.base import padded_block
from vcam_cli.processing.normalized_convolution import (
    NormalizedConvolution,
    Sites,
    half_width,
    tent,
)

PATTERNS = {
    "bayer": (("R", "G"), ("G", "B")),
    "quad": (("R", "R", "G", "G"),) * 2 + (("G", "G", "B", "B"),) * 2,
    "stripes": (("R", "G", "B"),),
    "white": tuple(tuple(row) for row in ("WGWR", "GWRW", "WBWG", "BWGW")),
}


def colors_of(pattern):
    return tuple(sorted({c for row in pattern for c in row}))


def demosaiced(mosaic, pattern, rows=None):
    sites = Sites(pattern, mosaic.shape)
    return in_spans(NormalizedConvolution(pattern, colors_of(pattern), sites), mosaic, rows)


def in_spans(operation, mosaic, spans=None):
    """Full color from spans of rows (start, stop), by default from the whole mosaic."""
    spans = [(0, mosaic.shape[0])] if spans is None else spans
    parts = [
        operation.process_block(padded_block(mosaic, *span, operation.halo)).planes
        for span in spans
    ]
    return np.concatenate(parts, axis=1)


def by_definition(mosaic, pattern):
    """sum of tent x sample over sum of tent, pixel by pixel."""
    rows, columns = mosaic.shape
    out = np.zeros((len(colors_of(pattern)), rows, columns))
    for plane, color in zip(out, colors_of(pattern), strict=True):
        width = half_width(pattern, color)
        for i in range(rows):
            for j in range(columns):
                if pattern[i % len(pattern)][j % len(pattern[0])] == color:
                    plane[i, j] = mosaic[i, j]
                    continue
                total = weight = 0.0
                for k in range(max(0, i - width + 1), min(rows, i + width)):
                    for m in range(max(0, j - width + 1), min(columns, j + width)):
                        if pattern[k % len(pattern)][m % len(pattern[0])] == color:
                            w = (width - abs(i - k)) * (width - abs(j - m))
                            total, weight = total + w * mosaic[k, m], weight + w
                plane[i, j] = total / weight
    return out


@pytest.mark.parametrize("name", PATTERNS)
def test_is_the_weighted_mean_of_the_samples_around(name):
    mosaic = np.random.default_rng(0).random((13, 14)).astype(np.float32)
    # 24 bits through sums of a few dozen terms
    np.testing.assert_allclose(
        demosaiced(mosaic, PATTERNS[name]), by_definition(mosaic, PATTERNS[name]), rtol=2e-6
    )


def test_of_a_bayer_mosaic_is_bilinear_inside():
    mosaic = np.random.default_rng(1).random((20, 24)).astype(np.float32)
    ours = demosaiced(mosaic, PATTERNS["bayer"])
    # colors_of sorts: B, G, R
    theirs = bilinear(mosaic, PATTERNS["bayer"], ("B", "G", "R"))
    np.testing.assert_allclose(ours[:, 1:-1, 1:-1], theirs[:, 1:-1, 1:-1], rtol=1e-6)


@pytest.mark.parametrize("name", PATTERNS)
def test_blocks_of_rows_make_no_difference(name):
    mosaic = np.random.default_rng(2).random((30, 16)).astype(np.float32)
    whole = demosaiced(mosaic, PATTERNS[name])
    parts = demosaiced(mosaic, PATTERNS[name], [(0, 8), (8, 16), (16, 24), (24, 30)])
    assert np.array_equal(whole, parts)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 1000))
def test_even_colors_stay_even_up_to_the_corners(height, width, seed):
    rng = np.random.default_rng(seed)
    names = rng.choice(["R", "G", "B"], (height, width))
    pattern = tuple(tuple(str(c) for c in row) for row in names)
    colors = colors_of(pattern)
    level = dict(zip(colors, rng.random(len(colors)), strict=True))
    reach = max(half_width(pattern, c) for c in colors)
    shape = (reach + height + 1, reach + width + 1)
    mosaic = np.array(
        [[level[pattern[i % height][j % width]] for j in range(shape[1])] for i in range(shape[0])],
        np.float32,
    )
    for plane, color in zip(demosaiced(mosaic, pattern), colors, strict=True):
        np.testing.assert_allclose(plane, level[color], rtol=1e-5)


def test_half_widths():
    assert [half_width(PATTERNS["bayer"], c) for c in "RGB"] == [2, 2, 2]
    assert [half_width(PATTERNS["quad"], c) for c in "RGB"] == [3, 3, 3]
    with pytest.raises(ValueError, match="no W"):
        half_width(PATTERNS["bayer"], "W")


@pytest.mark.parametrize("width", [1, 2, 3, 7])
@pytest.mark.parametrize("axes", [(0,), (1,), (0, 1)])
def test_a_tent_is_what_its_definition_says(width, axes):
    """Of arrays that are smaller than the tent, too; sums of whole numbers are exact."""
    rng, weights = np.random.default_rng(3), [*range(1, width + 1), *range(width - 1, 0, -1)]
    for shape in ((9, 14), (2, 3), (1, 1)):
        values = rng.integers(0, 9, shape).astype(np.float32)
        expected = values
        for axis in axes:

            def along(line):
                return np.convolve(line, weights)[width - 1 : width - 1 + len(line)]

            expected = np.apply_along_axis(along, axis, expected)
        assert np.array_equal(tent(values, width, axes), expected)
