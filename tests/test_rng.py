"""Streams: equal keys give equal numbers, different keys do not, blocks cover the array."""

import numpy as np
import pytest

from vcam_cli.rng import BLOCK_ROWS, blocks, stream


def test_equal_keys_give_equal_numbers():
    a = stream(3, "shot_noise", capture=1, block=7).standard_normal(100)
    b = stream(3, "shot_noise", capture=1, block=7).standard_normal(100)
    assert np.array_equal(a, b)


@pytest.mark.parametrize(
    "other",
    [
        (4, "shot_noise", 1, 7),
        (3, "read_noise", 1, 7),
        (3, "shot_noise", 2, 7),
        (3, "shot_noise", 1, 8),
    ],
)
def test_every_part_of_the_key_counts(other):
    a = stream(3, "shot_noise", 1, 7).standard_normal(1000)
    b = stream(*other).standard_normal(1000)
    # Independent: correlation within 5 standard errors of zero, and no shared number.
    assert abs(np.corrcoef(a, b)[0, 1]) < 5 / np.sqrt(1000)
    assert not np.isin(a, b).any()


def test_neighboring_blocks_do_not_overlap():
    # A block's counter starts 2^192 steps from its neighbor's: no finite frame reaches it.
    a = stream(1, "x", block=0).bit_generator.random_raw(20_000)
    b = stream(1, "x", block=1).bit_generator.random_raw(20_000)
    assert not np.isin(a, b).any()


@pytest.mark.parametrize("rows", [1, BLOCK_ROWS - 1, BLOCK_ROWS, BLOCK_ROWS + 1, 1000])
def test_blocks_cover_every_row_once(rows):
    covered = np.concatenate([np.arange(rows)[b] for b in blocks(rows)])
    assert np.array_equal(covered, np.arange(rows))
