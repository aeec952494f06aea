"""Results of pure functions that are kept by equal arguments."""

import numpy as np

from vcam_cli.cache import remembered


def test_equal_arguments_are_computed_once_and_the_last_are_kept():
    asked = []

    @remembered(2)
    def double(value, *, plus=0):
        asked.append(value)
        return 2 * value + plus

    assert [double(n) for n in (1, 2, 1, 2)] == [2, 4, 2, 4]
    assert double(1, plus=5) == 7
    assert asked == [1, 2, 1]
    assert double(2) == 4  # kept still
    assert double(1) == 2  # not any more
    assert asked == [1, 2, 1, 1]


def test_arguments_without_a_hash_are_computed_each_time():
    asked = []

    @remembered(4)
    def total(values):
        asked.append(len(values))
        return sum(values)

    values = np.arange(4)
    assert total(values) == 6
    values += 1
    assert total(values) == 10
    assert total([1, 2]) == total([1, 2]) == 3
    assert asked == [4, 4, 2, 2]
