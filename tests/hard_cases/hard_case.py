"""A hard case: one formula at places where floating point fails its textbook form.

Every case is worked out three ways: `exact`, in 50 digits or by a property that holds exactly;
`ours`, by the package; `naive`, the form that a competent programmer would write first, in plain
float64 unless said otherwise. A case holds where ours errs by no more than `allowed` and the naive
form by far more: a case that the naive form passes is not hard, and a tolerance that it meets
proves nothing.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mpmath as mp
import numpy as np

DIGITS = 50
FAR = 10.0
"""The naive form must err by so many times what is allowed."""

Values = Callable[[], object]
"""Numbers of any kind: floats, arrays, 50-digit numbers, nested in lists."""


@dataclass(frozen=True)
class Case:
    """One formula at its hard places; `exact`, `ours` and `naive` give as many numbers each."""

    name: str
    hard: str
    """What is hard about these places."""
    reference: str
    """Where the exact values come from."""
    exact: Values
    ours: Values
    naive: Values
    form: str
    """The naive form in words."""
    allowed: float
    """Largest error of ours."""
    why: str
    """Why so much and no less."""
    absolute: bool = False
    """Whether errors are absolute; else relative, and what is 0 must be 0."""


@dataclass(frozen=True)
class Verdict:
    """How far off ours and the naive form were."""

    ours: float
    naive: float
    naive_said: str
    """The error of the naive form as printed, or how it ended."""
    holds: bool


def judge(case: Case) -> Verdict:
    """Works the case out three ways; a warning in ours is an error."""
    with mp.workdps(DIGITS):
        exact = list(numbers(case.exact()))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ours = error(case.ours(), exact, case.absolute)
        naive, said = _naive_error(case, exact)
    holds = ours <= case.allowed and naive > FAR * case.allowed and naive > FAR * ours
    return Verdict(ours, naive, said, holds)


def _naive_error(case: Case, exact: list[mp.mpf]) -> tuple[float, str]:
    """Its error and how to print it; one that raises errs without bound."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            found = list(numbers(case.naive()))
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            return math.inf, "raises"
    naive = error(found, exact, case.absolute)
    if any(mp.isnan(value) for value in found):
        return naive, "not a number"
    return naive, "infinite" if math.isinf(naive) else f"{naive:.1e}"


def error(found: object, exact: list[mp.mpf], absolute: bool) -> float:
    """The largest error, infinite where a number is none, is missing or is infinite unlike it."""
    values = list(numbers(found))
    if len(values) != len(exact) or not values:
        return math.inf
    return max(_error(value, true, absolute) for value, true in zip(values, exact, strict=True))


def _error(value: mp.mpf, true: mp.mpf, absolute: bool) -> float:
    if value == true:  # infinities too
        return 0.0
    if mp.isnan(value) or mp.isinf(value) or mp.isinf(true):
        return math.inf
    if absolute:
        return float(abs(value - true))
    return float(abs((value - true) / true)) if true else math.inf


def numbers(values: object) -> Iterator[mp.mpf]:
    """All numbers in nested lists and arrays, exactly as they are."""
    if isinstance(values, np.ndarray):
        values = values.ravel().tolist()
    if isinstance(values, list | tuple):
        for value in values:
            yield from numbers(value)
    else:
        yield values if isinstance(values, mp.mpf) else mp.mpf(float(values))


def pairs(*axes: object) -> list[np.ndarray]:
    """All combinations of some values: an array (n,) for each axis."""
    return [grid.ravel() for grid in np.meshgrid(*(np.asarray(a, float) for a in axes))]


def in_digits(formula: Callable[..., object], *columns: object) -> list[object]:
    """A formula of 50-digit numbers at every row of some columns of floats, which are exact."""
    rows = zip(*(np.asarray(c, float).tolist() for c in columns), strict=True)
    return [formula(*map(mp.mpf, row)) for row in rows]
