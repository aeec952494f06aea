"""The fewest captures for a gain, against a search through all numbers and the closed form."""

import math

import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.capture_schedules.fewest_captures import fewest_captures


def uniform_gain(count):
    """2 v_N of the uniform pdf over (0, 1], v_1 = 1/2, v_n = (1 + v_(n-1)^2) / 2."""
    v = 0.5
    for _ in range(count - 1):
        v = (1 + v * v) / 2
    return 2 * v


class Counted:
    """A gain that remembers what it was asked."""

    def __init__(self, gain):
        self.gain, self.asked = gain, []

    def __call__(self, count):
        self.asked.append(count)
        return self.gain(count)


def test_uniform_pdf():
    """Gains 1, 1.25, 1.3906, 1.4835, ..., 1.7222 with ten captures; none reaches 2."""
    found = fewest_captures(
        uniform_gain, [1.0, 1.2, 1.25, 1.26, 1.7221, 2.0, 2.001], 1000, upper_bound=2
    )
    assert [answer.count for answer in found] == [1, 2, 2, 3, 10, None, None]
    assert [answer.possible for answer in found] == [True] * 6 + [False]
    assert found[4].gain == uniform_gain(10)
    assert found[5].gain == uniform_gain(1000)  # how far the largest number comes
    assert found[6].gain is None


@examples(100)
@given(
    st.lists(st.integers(0, 30), min_size=1, max_size=40),
    st.lists(st.integers(-2, 35), min_size=1, max_size=5),
)
def test_every_answer_is_that_of_a_full_search(gains, targets):
    gains = sorted(gains)  # plateaus and jumps
    found = fewest_captures(lambda n: float(gains[n - 1]), targets, len(gains))
    for answer, target in zip(found, targets, strict=True):
        reached = [n for n, gain in enumerate(gains, 1) if gain >= target]
        assert answer.count == (reached[0] if reached else None)
        assert answer.target == target
        assert answer.possible


def test_few_schedules_are_worked_out_and_none_beyond_the_largest():
    gain = Counted(lambda n: 1 - 1 / n)
    targets = [0.9, 0.99, 0.9, 0.998, 0.999]
    found = fewest_captures(gain, targets, 700)
    assert [answer.count for answer in found] == [10, 100, 10, 500, None]
    assert len(gain.asked) == len(set(gain.asked))
    assert max(gain.asked) == 700
    # doublings up to 700, and the bisections of three targets
    assert len(gain.asked) <= 11 + 3 + 6 + 9


def test_impossible_targets_are_not_tried():
    gain = Counted(uniform_gain)
    assert fewest_captures(gain, [2.1, 1e9], 64, upper_bound=2.0)[0].count is None
    assert gain.asked == []


def test_a_rounding_error_does_not_cost_a_capture():
    target = 1.25
    below = math.nextafter(target, 0)
    assert fewest_captures(lambda n: below, [target], 9, upper_bound=below)[0].count == 1
    assert fewest_captures(lambda n: target * (1 - 1e-9), [target], 9)[0].count is None


@pytest.mark.parametrize(("targets", "largest"), [([1.0], 0), ([math.nan], 4), ([math.inf], 4)])
def test_nonsense_is_refused(targets, largest):
    with pytest.raises(ValueError, match=r"largest|finite"):
        fewest_captures(uniform_gain, targets, largest)
