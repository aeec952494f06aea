"""Black level: what is taken off, and that noise below it stays."""

import numpy as np
import pytest

from vcam_cli.processing.base import Block
from vcam_cli.processing.black_level import BlackLevel, subtracted_level


@pytest.mark.parametrize(("value", "expected"), [("subtract", 33.5), ("none", 0.0), (12, 12.0)])
def test_level_is_that_of_the_camera_none_or_the_number_given(value, expected):
    assert subtracted_level(value, 33.5) == expected


def test_values_below_black_become_negative():
    block = BlackLevel(32.0).process_block(Block(np.array([[[30.0, 32.0, 100.0]]], np.float32), 0))
    assert block.planes.tolist() == [[[-2.0, 0.0, 68.0]]]


def test_both_faces_do_the_same_and_colors_are_left_untouched():
    values = np.arange(12, dtype=np.float32).reshape(3, 2, 2)
    kept = values.copy()
    result = BlackLevel(5.25).process_colors(values)
    np.testing.assert_array_equal(values, kept)
    np.testing.assert_array_equal(BlackLevel(5.25).process_block(Block(kept, 0)).planes, result)
