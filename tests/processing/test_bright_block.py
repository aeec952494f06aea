"""White balance by bright blocks: which blocks count, and what comes out."""

from dataclasses import dataclass

import numpy as np
import pytest

from vcam_cli.processing import Context, process
from vcam_cli.processing.base import Block
from vcam_cli.processing.bright_block import BLOCK_SIDE, measure, white_means

RGB = ("R", "G", "B")
RGGB = (("R", "G"), ("G", "B"))
WHITE = np.array([500.0, 1000.0, 250.0])


@dataclass(frozen=True)
class Step:
    name: str
    value: str


def context(saturated=1e9):
    return Context(RGGB, RGB, WHITE, 0.0, saturated_dn=saturated)


def mosaic_of(planes):
    raw = np.empty(planes.shape[1:])
    for i in range(2):
        for j in range(2):
            raw[i::2, j::2] = planes[RGB.index(RGGB[i][j]), i::2, j::2]
    return raw


def picture(rows=128, columns=160):
    """A large red wall with a gray card in its middle, brighter than the wall."""
    planes = np.full((3, rows, columns), 0.1)
    planes[0] = 0.6
    planes[:, 48:80, 64:96] = 0.7
    return planes * WHITE[:, None, None]


@pytest.mark.parametrize("balance_first", [True, False])
@pytest.mark.parametrize("workers", [1, 4])
def test_the_card_is_gray_where_gray_world_fails(balance_first, workers):
    order = [Step("white_balance", "bright-block"), Step("demosaic", "bilinear")]
    order = order if balance_first else order[::-1]
    raw = mosaic_of(picture())
    card = process(raw, context(), order, workers).linear[64, 80]
    # Demosaic first: red of the wall leaks into the card's outermost pixels, 1 in 16 of a block.
    np.testing.assert_allclose(card, 0.7, rtol=1e-6 if balance_first else 0.02)
    order = [Step("white_balance", "gray-world"), Step("demosaic", "bilinear")]
    card = process(raw, context(), order).linear[64, 80]
    assert card[2] > 2 * card[0]


def test_blocks_with_a_saturated_pixel_are_left_out():
    planes = picture()
    planes[:, :16, :16] = [[[900.0]], [[900.0]], [[900.0]]]
    raw = mosaic_of(planes)
    order = [Step("white_balance", "bright-block"), Step("demosaic", "bilinear")]
    card = process(raw, context(saturated=900), order).linear[64, 80]
    np.testing.assert_allclose(card, 0.7, rtol=1e-6)


def test_where_all_is_saturated_it_is_gray_world():
    raw = np.random.default_rng(1).uniform(100, 200, (40, 50))
    results = [
        process(raw, context(saturated=50), [Step("white_balance", name)]).linear
        for name in ("bright-block", "gray-world")
    ]
    np.testing.assert_allclose(results[0], results[1], rtol=1e-6)


@pytest.mark.parametrize("shape", [(2, 2), (3, 5), (70, 33)])
@pytest.mark.parametrize("level", [0.0, -1.0])
def test_black_and_small_frames_are_finite(shape, level):
    linear = process(
        np.full(shape, level), context(), [Step("white_balance", "bright-block")]
    ).linear
    assert np.isfinite(linear).all()


@pytest.mark.parametrize("first_row", [0, 1])
def test_a_mosaic_is_measured_color_by_color(first_row):
    values = np.random.default_rng(2).random((20, 35)).astype(np.float32)
    found = measure(Block(values[np.newaxis], first_row), values, context())
    assert found.sums.shape == found.counts.shape == (3, 2 * 3)
    rows, columns = np.indices(values.shape)
    number = (rows // BLOCK_SIDE) * 3 + columns // BLOCK_SIDE
    names = np.array(RGGB)[(rows + first_row) % 2, columns % 2]
    for c, name in enumerate(RGB):
        for n in range(6):
            here = (names == name) & (number == n)
            assert found.counts[c, n] == here.sum()
            # float64 sums of float32 values
            assert found.sums[c, n] == pytest.approx(values[here].sum(dtype=float), rel=1e-12)


def test_the_brightest_hundredth_counts():
    """200 blocks of which block n has the level n in every color: the two brightest count."""
    levels = np.repeat(np.arange(200.0), BLOCK_SIDE)[np.newaxis].repeat(BLOCK_SIDE, axis=0)
    found = measure(Block(levels[np.newaxis].astype(np.float32), 0), levels, context())
    np.testing.assert_allclose(white_means([found]), 198.5)
