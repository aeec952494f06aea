"""Edge-aware demosaicing against its definition, pixel by pixel, and against what it promises."""

import numpy as np
import pytest
from demosaiced import bilinear, edge_aware
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vcam_cli.processing.base import Block, mirrored_index
from vcam_cli.processing.edge_aware import REACH, EdgeAware

RGB = ("R", "G", "B")
ORDERS = ("RGGB", "GRBG", "GBRG", "BGGR")
EVEN = np.ones(3)


def pattern_of(order):
    return (tuple(order[:2]), tuple(order[2:]))


def mosaic_of(planes, pattern):
    raw = np.empty(planes.shape[1:], planes.dtype)
    for i in range(2):
        for j in range(2):
            raw[i::2, j::2] = planes[RGB.index(pattern[i][j]), i::2, j::2]
    return raw


def by_loops(mosaic, pattern, white):
    """The definition in plain words, in double precision."""
    rows, columns = mosaic.shape

    def at(y, x):  # the mosaic, mirrored, on the scale of green; and its color
        y, x = int(mirrored_index(np.array(y), rows)), int(mirrored_index(np.array(x), columns))
        color = RGB.index(pattern[y % 2][x % 2])
        return mosaic[y, x] * white[1] / white[color], color

    def guess(y, x, dy, dx):
        before, after = at(y - dy, x - dx)[0], at(y + dy, x + dx)[0]
        second = 2 * at(y, x)[0] - at(y - 2 * dy, x - 2 * dx)[0] - at(y + 2 * dy, x + 2 * dx)[0]
        return (before + after) / 2 + second / 4, abs(before - after) + abs(second)

    def green(y, x):
        value, color = at(y, x)
        if color == 1:
            return value
        along, rough_along = guess(y, x, 0, 1)
        down, rough_down = guess(y, x, 1, 0)
        flat = (1e-3 * white[1]) ** 2
        weights = rough_down**2 + flat, rough_along**2 + flat
        return (weights[0] * along + weights[1] * down) / sum(weights)

    result = np.zeros((3, rows, columns))
    rings = ([(0, -1), (0, 1)], [(-1, 0), (1, 0)], [(-1, -1), (-1, 1), (1, -1), (1, 1)])
    for y in range(rows):
        for x in range(columns):
            for color in range(3):
                if at(y, x)[1] == color:
                    result[color, y, x] = mosaic[y, x]
                    continue
                near = []
                for ring in rings if color != 1 else ():
                    places = [(y + i, x + j) for i, j in ring if at(y + i, x + j)[1] == color]
                    near = near or [at(*place)[0] - green(*place) for place in places]
                value = green(y, x) + (np.mean(near) if near else 0)
                result[color, y, x] = value * white[color] / white[1]
    return result


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("shape", [(2, 2), (3, 2), (2, 5), (7, 8), (8, 7)])
def test_equals_the_definition_up_to_the_border(order, shape):
    mosaic, white = np.random.default_rng(3).random(shape), np.array([0.5, 1.0, 0.7])
    ours = edge_aware(mosaic, pattern_of(order), RGB, white)
    # float32, and a weight that is a quotient of squares of differences below 1
    np.testing.assert_allclose(ours, by_loops(mosaic, pattern_of(order), white), atol=2e-6, rtol=0)


@pytest.mark.parametrize("order", ORDERS)
def test_flat_color_is_flat_to_the_corners(order):
    planes = np.ones((3, 7, 9)) * np.array([3.0, 5.0, 7.0])[:, None, None]
    found = edge_aware(mosaic_of(planes, pattern_of(order)), pattern_of(order), RGB, EVEN)
    np.testing.assert_allclose(found, planes, rtol=3e-7)  # two roundings of float32


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("axis", [0, 1])
def test_a_gray_edge_along_rows_or_columns_has_no_color(order, axis):
    """All its pixels at the edge know which way it runs; white of the camera is not gray."""
    white = np.array([0.4, 1.0, 0.6])
    step = np.where(np.arange(16) < 7, 0.2, 0.9)
    gray = np.broadcast_to(step if axis else step[:, None], (16, 16))
    planes = gray * white[:, None, None]
    mosaic = mosaic_of(planes, pattern_of(order))
    error = np.abs(edge_aware(mosaic, pattern_of(order), RGB, white) - planes).max()
    # The wrong guess has a weight of (1e-3 / 0.7)^2; bilinear is wrong by a quarter and more.
    assert error < 1e-5
    assert np.abs(bilinear(mosaic, pattern_of(order), RGB) - planes).max() > 0.1


def test_planes_follow_the_order_of_the_colors_asked_for():
    mosaic = np.random.default_rng(5).random((6, 6))
    forward = edge_aware(mosaic, pattern_of("RGGB"), RGB, np.array([0.5, 1.0, 0.7]))
    backward = edge_aware(mosaic, pattern_of("RGGB"), RGB[::-1], np.array([0.7, 1.0, 0.5]))
    np.testing.assert_array_equal(forward, backward[::-1])


@settings(max_examples=40, deadline=None)
@given(
    mosaic=arrays(np.float32, (6, 5), elements=st.floats(-70000, 70000, width=32)),
    white=arrays(np.float64, 3, elements=st.sampled_from([-1.0, 0.0, 1e-3, 1.0, 60000.0])),
)
def test_measured_values_stay_and_all_are_finite(mosaic, white):
    planes = edge_aware(mosaic, pattern_of("RGGB"), RGB, white)
    assert np.all(np.isfinite(planes))
    for i in range(2):
        for j in range(2):
            plane = planes[RGB.index(pattern_of("RGGB")[i][j])]
            np.testing.assert_array_equal(plane[i::2, j::2], mosaic[i::2, j::2])


@pytest.mark.parametrize("first_row", [-3, 0, 1, 61, 62])
def test_a_block_knows_its_phase(first_row):
    frame = np.random.default_rng(6).random((70, 6)).astype(np.float32)
    rows = frame[mirrored_index(np.arange(first_row, first_row + 10), 70)]
    method = EdgeAware(pattern_of("GRBG"), RGB, (0.5, 1.0, 0.7))
    block = method.process_block(Block(rows[np.newaxis], first_row))
    assert block.first_row == first_row + REACH
    whole = edge_aware(frame, pattern_of("GRBG"), RGB, np.array([0.5, 1.0, 0.7]))
    np.testing.assert_array_equal(block.planes, whole[:, first_row + 3 : first_row + 7])
