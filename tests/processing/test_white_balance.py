"""Gray world: equal means, sane gains on frames with nothing to balance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.processing.base import Block, Context
from vcam_cli.processing.white_balance import Gains, color_sums, gray_world_gains, illuminant_gains

BAYER = Context((("R", "G"), ("G", "B")), ("R", "G", "B"), np.ones(3), 0.0)
MEANS = st.lists(st.floats(1.0, 500.0), min_size=3, max_size=3)


@given(MEANS)
def test_gains_make_the_means_equal_to_the_largest(means):
    gains = gray_world_gains(np.array(means), 500.0)
    # a quotient times its divisor: two roundings
    np.testing.assert_allclose(gains * means, max(means), rtol=4e-16)
    assert gains.min() == 1.0


@given(MEANS, st.floats(0.01, 100.0))
def test_gains_do_not_depend_on_the_exposure(means, factor):
    once = gray_world_gains(np.array(means), 500.0)
    again = gray_world_gains(np.array(means) * factor, 500.0 * factor)
    np.testing.assert_allclose(again, once, rtol=1e-14)


@pytest.mark.parametrize(
    "means", [(0.0, 0.0, 0.0), (-0.2, 0.1, -3.0), (0.01, 0.03, 0.02), (-1.0, -1.0, -1.0)]
)
def test_a_black_frame_has_gains_of_one(means):
    assert gray_world_gains(np.array(means), 1000.0).tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("white", [0.0, -5.0])
def test_no_light_at_all_has_gains_of_one(white):
    assert gray_world_gains(np.zeros(3), white).tolist() == [1.0, 1.0, 1.0]


def test_a_color_that_sees_nothing_is_left_alone():
    gains = gray_world_gains(np.array([0.0, 200.0, 100.0]), 500.0)
    assert gains.tolist() == [1.0, 1.0, 2.0]
    assert gray_world_gains(np.array([0.1, 200.0, -1.0]), 500.0).tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("first_row", [-1, 0, 1, 63, 64])
def test_a_mosaic_block_is_summed_and_balanced_color_by_color(first_row):
    values = np.random.default_rng(1).random((5, 7)).astype(np.float32)
    names = [[BAYER.pattern[(first_row + i) % 2][j % 2] for j in range(7)] for i in range(5)]
    gain = {"R": 2.0, "G": 1.0, "B": 4.0}
    total, count = color_sums(Block(values[np.newaxis], first_row), BAYER)
    for c, name in enumerate(BAYER.colors):
        mask = np.array(names) == name
        assert count[c] == mask.sum()
        # float64 sums of float32 values
        assert total[c] == pytest.approx(values[mask].sum(dtype=np.float64), rel=1e-14)
    block = Block(values.copy()[np.newaxis], first_row)
    balanced = Gains((2.0, 1.0, 4.0), BAYER).process_block(block).planes[0]
    expected = [[values[i, j] * gain[names[i][j]] for j in range(7)] for i in range(5)]
    np.testing.assert_array_equal(balanced, expected)


def test_full_color_is_summed_and_balanced_by_planes():
    planes = np.random.default_rng(2).random((3, 4, 5)).astype(np.float32)
    total, count = color_sums(Block(planes, 0), BAYER)
    np.testing.assert_allclose(total, planes.sum(axis=(1, 2), dtype=np.float64), rtol=1e-14)
    assert count.tolist() == [20, 20, 20]
    gains = Gains((2.0, 1.0, 0.5), BAYER)
    expected = gains.process_colors(planes)
    assert expected.dtype == np.float32
    np.testing.assert_array_equal(gains.process_block(Block(planes, 0)).planes, expected)
    np.testing.assert_array_equal(gains.process_colors(np.ones(3)), [2.0, 1.0, 0.5])


def test_the_illuminant_makes_white_gray():
    gains = illuminant_gains(np.array([500.0, 1000.0, 250.0]))
    assert gains.tolist() == [2.0, 1.0, 4.0]
    assert illuminant_gains(np.zeros(3)).tolist() == [1.0, 1.0, 1.0]
