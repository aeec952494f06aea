"""Schedules that know only the shortest and the longest time."""

import json
from pathlib import Path

import numpy as np
import pytest
from every import every
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.scheduling.comparison_schedules import (
    exponential_times,
    geometric_times,
    uniform_times,
)
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Pdf

DATA = json.loads((Path(__file__).parents[1] / "data/capture_schedules_rules.json").read_text())
CASES = [(name, row) for name, case in DATA["cases"].items() for row in case["results"]]
RULES = {
    "uniform": uniform_times,
    "exponential": exponential_times,
    "geometric": geometric_times,
}


@pytest.mark.parametrize("rule", RULES)
def test_what_they_are_worth(rule):
    def check(name, row):
        pdf = Pdf.segments(*np.array(DATA["cases"][name]["segments"]).T)
        found = RULES[rule](1.0, row["optimal"]["t"][-1], row["count"])
        assert expected_snr(pdf, found / pdf.max) == pytest.approx(row[rule]["J"], rel=1e-11)
        if "t" in row[rule]:
            np.testing.assert_allclose(found, np.sort(row[rule]["t"]), rtol=1e-14)

    every(CASES, check)


def test_the_uniform_times_of_the_thesis():
    """Fig 4.13: 5, 67, 133 and 200 ms, printed to the millisecond."""
    found = uniform_times(5e-3, 200e-3, 4)
    assert np.round(found * 1e3).tolist() == [5, 67, 133, 200]


def test_powers_of_two_end_at_the_longest_time():
    assert exponential_times(5.0, 200.0, 8).tolist() == [5, 10, 20, 40, 80, 160, 200, 200]
    assert exponential_times(5.0, 200.0, 5000)[-1] == 200  # 2^4999 is beyond any float


def test_equal_ratios():
    np.testing.assert_allclose(geometric_times(2.0, 54.0, 4), [2, 6, 18, 54], rtol=1e-14)


@pytest.mark.parametrize("rule", RULES)
def test_one_and_two_captures(rule):
    assert RULES[rule](5.0, 200.0, 1).tolist() == [5]
    assert RULES[rule](5.0, 200.0, 2).tolist() == ([5, 10] if rule == "exponential" else [5, 200])


@pytest.mark.parametrize("rule", RULES)
@examples(50)
@given(st.floats(1e-9, 1e3), st.floats(1e-9, 1e3), st.integers(1, 50))
def test_every_schedule_rises_to_the_longest_time(rule, t1, longest, count):
    found = RULES[rule](t1, longest, count)
    assert found.shape == (count,)
    assert (np.diff(found) >= 0).all()
    assert (found > 0).all()
    assert found[-1] <= longest  # above all where it is shorter than t1
    if rule != "uniform" or count == 1 or longest / (count - 1) >= t1:
        assert found[0] == min(t1, longest)
    if count > 1 and rule != "exponential":
        assert found[-1] == longest


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    ("t1", "longest", "count"),
    [(1.0, 2.0, 0), (0.0, 1.0, 2), (1.0, np.inf, 2), (np.nan, 1.0, 2), (1.0, -1.0, 2)],
)
def test_nonsense_is_refused(rule, t1, longest, count):
    with pytest.raises(ValueError, match=r"finite|at least one"):
        RULES[rule](t1, longest, count)
