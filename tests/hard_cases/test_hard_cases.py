"""The hard cases of `python -m tests.hard_cases`, one test each, and the judge itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hard_cases.cases import CASES
from hard_cases.hard_case import FAR, Case, error, judge

ALL = [case for cases in CASES.values() for case in cases]


LARGE = "100 million"
"""In the names of cases that take a second; test_readme.py judges them, too."""


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=pytest.mark.long if LARGE in c.name else ()) for c in ALL],
    ids=lambda case: case.name,
)
def test_hard_case(case):
    verdict = judge(case)
    assert verdict.ours <= case.allowed, f"{case.hard}; allowed as {case.why}"
    assert verdict.naive > FAR * max(case.allowed, verdict.ours), "the naive form does as well"
    assert verdict.holds


def test_names_are_unique_and_fit_the_table():
    names = [case.name for case in ALL]
    assert len(set(names)) == len(names)
    assert max(map(len, names)) <= 50
    assert max(len(case.reference) for case in ALL) <= 28


THIRD = Case(
    name="a third",
    hard="no float is a third",
    reference="exact",
    exact=lambda: [0.25, 0.5],
    ours=lambda: np.array([0.25, 0.5 + 1e-12]),
    naive=lambda: [0.25, 0.5 + 1e-9],
    form="added",
    allowed=1e-11,
    why="made up",
)


def test_the_judge_holds_what_holds():
    verdict = judge(THIRD)
    assert verdict.holds
    assert verdict.ours == pytest.approx(2e-12, rel=1e-3)
    assert verdict.naive == pytest.approx(2e-9, rel=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"allowed": 1e-12},
        {"ours": lambda: [0.25, math.nan]},
        {"ours": lambda: [0.25]},
        {"ours": lambda: [0.25, math.inf]},
        {"naive": lambda: [0.25, 0.5]},
        {"naive": lambda: [0.25, 0.5 + 1e-11]},
        {"exact": lambda: [0.25, math.inf]},
    ],
)
def test_the_judge_fails_what_does_not(change):
    assert not judge(replace(THIRD, **change)).holds


def test_a_warning_of_ours_is_an_error():
    with pytest.raises(RuntimeWarning):
        judge(replace(THIRD, ours=lambda: np.log(np.array([0.0, 1.0]))))


def test_a_naive_form_that_raises_errs_without_bound():
    verdict = judge(replace(THIRD, naive=lambda: 1 // 0))
    assert verdict.holds
    assert verdict.naive == math.inf
    assert verdict.naive_said == "raises"


def test_what_is_zero_must_be_zero():
    assert error([0.0, math.inf], [0.0, math.inf], absolute=False) == 0
    assert error([1e-300], [0.0], absolute=False) == math.inf
    assert error([1e-300], [0.0], absolute=True) == 1e-300
