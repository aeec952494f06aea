"""Runs of cells laid over each other, against painting them one by one."""

import numpy as np
import pytest

from vcam_cli.scenes import runs


@pytest.mark.parametrize("line", [1, 7, 64, 1000])
@pytest.mark.parametrize("at_once", [1, 100, 1 << 17])
def test_the_largest_number_is_seen(line, at_once, monkeypatch):
    monkeypatch.setattr(runs, "CELLS_AT_ONCE", at_once)
    draw = np.random.default_rng(line)
    lines, count = 9, 200
    row = draw.integers(0, lines, count) * line
    start = draw.integers(0, line, count)
    stop = start + 1 + (draw.random(count) ** 3 * (line - start)).astype(int)
    number = draw.integers(1, 1000, count)
    expected = np.zeros(line * lines, int)
    for first, last, new in zip(row + start, row + stop, number, strict=True):
        expected[first:last] = np.maximum(expected[first:last], new)
    found = runs.topmost_numbers(row + start, row + stop, number, line * lines, line)
    np.testing.assert_array_equal(found, expected)


def test_without_runs_nothing_is_seen():
    none = np.empty(0, int)
    assert not runs.topmost_numbers(none, none, none, 6, 3).any()


def test_members_are_numbered_in_order():
    item, number = runs.expand_ranges(np.array([3, 5, 0]), np.array([5, 4, 1]))
    assert item.tolist() == [0, 0, 2]
    assert number.tolist() == [3, 4, 0]
