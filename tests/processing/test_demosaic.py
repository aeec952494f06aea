"""Bilinear demosaicing against a loop over pixels, against colour-demosaicing, and its limits."""

import numpy as np
import pytest
from demosaiced import bilinear
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vcam_cli.processing.base import Block, mirrored_index
from vcam_cli.processing.demosaic import Bilinear, is_bayer

RGB = ("R", "G", "B")
ORDERS = ("RGGB", "GRBG", "GBRG", "BGGR")


def pattern_of(order):
    return (tuple(order[:2]), tuple(order[2:]))


def by_loops(mosaic, order):
    """The definition, pixel by pixel: a color's mean over the nearest pixels that measured it."""
    rows, columns = mosaic.shape
    pattern = pattern_of(order)
    result = np.zeros((3, rows, columns))

    def reflected(i, n):
        return -i if i < 0 else 2 * (n - 1) - i if i >= n else i

    rings = ([(0, 0)], [(-1, 0), (1, 0), (0, -1), (0, 1)], [(-1, -1), (-1, 1), (1, -1), (1, 1)])
    for c, name in enumerate(RGB):
        for i in range(rows):
            for j in range(columns):
                for ring in rings:
                    found = [
                        mosaic[reflected(i + di, rows), reflected(j + dj, columns)]
                        for di, dj in ring
                        if pattern[(i + di) % 2][(j + dj) % 2] == name
                    ]
                    if found:
                        result[c, i, j] = np.mean(found)
                        break
    return result


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("shape", [(2, 2), (2, 7), (5, 2), (8, 8), (9, 7)])
def test_equals_the_definition_up_to_the_border(order, shape):
    mosaic = np.random.default_rng(3).random(shape)
    # float32: sums of four values below 1 err by a few times 2^-24
    np.testing.assert_allclose(
        bilinear(mosaic, pattern_of(order), RGB), by_loops(mosaic, order), atol=4e-7, rtol=0
    )


@pytest.mark.parametrize("order", ORDERS)
def test_equals_colour_demosaicing_inside(order):
    """That package mirrors with the border pixel doubled, which changes the phase: inside only."""
    from colour_demosaicing import demosaicing_CFA_Bayer_bilinear  # loads for a second

    mosaic = np.random.default_rng(4).random((30, 41))
    theirs = np.moveaxis(demosaicing_CFA_Bayer_bilinear(mosaic, order), 2, 0)
    ours = bilinear(mosaic, pattern_of(order), RGB)
    inside = (slice(None), slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(ours[inside], theirs[inside], atol=4e-7, rtol=0)


@pytest.mark.parametrize("order", ORDERS)
def test_flat_color_is_flat_to_the_corners(order):
    value = {"R": 3.0, "G": 5.0, "B": 7.0}
    tile = np.array([[value[name] for name in row] for row in pattern_of(order)])
    planes = bilinear(np.tile(tile, (4, 5))[:7, :9], pattern_of(order), RGB)
    for name, plane in zip(RGB, planes, strict=True):
        np.testing.assert_array_equal(plane, value[name])


@pytest.mark.parametrize("order", ORDERS)
def test_a_gray_ramp_is_reproduced_inside(order):
    """Bilinear interpolation is exact for a plane: every stencil is symmetric."""
    ramp = 2.0 * np.arange(12)[:, None] + 3.0 * np.arange(10)
    planes = bilinear(ramp, pattern_of(order), RGB)
    np.testing.assert_array_equal(planes[:, 1:-1, 1:-1], np.tile(ramp[1:-1, 1:-1], (3, 1, 1)))


def test_planes_follow_the_order_of_the_colors_asked_for():
    mosaic = np.random.default_rng(5).random((6, 6))
    forward = bilinear(mosaic, pattern_of("RGGB"), RGB)
    backward = bilinear(mosaic, pattern_of("RGGB"), ("B", "G", "R"))
    np.testing.assert_array_equal(forward, backward[::-1])


@examples(50)
@given(
    mosaic=arrays(np.float32, (6, 5), elements=st.floats(-1000, 1000, width=32)),
    order=st.sampled_from(ORDERS),
)
def test_measured_values_stay_and_others_lie_between_the_extremes(mosaic, order):
    planes = bilinear(mosaic, pattern_of(order), RGB)
    for i in range(2):
        for j in range(2):
            site = (slice(i, None, 2), slice(j, None, 2))
            plane = planes[RGB.index(pattern_of(order)[i][j])]
            np.testing.assert_array_equal(plane[site], mosaic[site])
    slack = 1e-3  # float32 rounding of sums up to 4000
    assert planes.min() >= mosaic.min() - slack
    assert planes.max() <= mosaic.max() + slack


@pytest.mark.parametrize("first_row", [-1, 0, 1, 62, 63])
def test_a_block_knows_its_phase(first_row):
    frame = np.random.default_rng(6).random((70, 6)).astype(np.float32)
    rows = frame[mirrored_index(np.arange(first_row, first_row + 6), 70)]
    block = Bilinear(pattern_of("GRBG"), RGB).process_block(Block(rows[np.newaxis], first_row))
    assert block.first_row == first_row + 1
    whole = bilinear(frame, pattern_of("GRBG"), RGB)
    np.testing.assert_array_equal(block.planes, whole[:, first_row + 1 : first_row + 5])


@pytest.mark.parametrize("count", [2, 3, 8])
def test_mirror_is_that_of_numpy_and_keeps_parity(count):
    reach = count - 1
    index = mirrored_index(np.arange(-reach, count + reach), count)
    np.testing.assert_array_equal(index, np.pad(np.arange(count), reach, mode="reflect"))
    np.testing.assert_array_equal(index % 2, np.arange(-reach, count + reach) % 2)


def test_only_a_bayer_block_is_a_bayer_block():
    assert all(is_bayer(pattern_of(order)) for order in ORDERS)
    for rows in ("Y", ("RG", "BB"), ("RR", "GB"), ("GG", "GG"), ("RG", "GR"), ("RGB", "RGB")):
        assert not is_bayer(tuple(tuple(row) for row in rows))


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("shape", [(2, 2), (2, 7), (5, 2), (8, 8), (9, 7)])
def test_sums_of_colors_need_no_picture(order, shape):
    mosaic = np.random.default_rng(4).random(shape)
    method, middle = Bilinear(pattern_of(order), RGB), shape[0] // 2
    parts = [
        method.color_sums(Block(mosaic[np.newaxis, rows], rows.start), shape)
        for rows in (slice(0, middle), slice(middle, shape[0]))
    ]
    expected = bilinear(mosaic, pattern_of(order), RGB).sum(axis=(1, 2), dtype=float)
    # float32: each value to 6e-8
    np.testing.assert_allclose(sum(parts)[0], expected, rtol=1e-6)
    assert np.all(sum(parts)[1] == mosaic.size)
