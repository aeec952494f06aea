"""Loops in place of thousands of tests: every case is checked, and all that fail are told."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def every(cases: Iterable[Any], check: Callable[..., None]) -> None:
    """Check each case, and fail with every case that fails and why.

    Parameters
    ----------
    cases
        What `check` takes: tuples are its arguments, all else is its only one.
    check
        Raises where a case fails.
    """
    cases, failed = list(cases), []
    assert cases, "there is no case to check"
    for case in cases:
        try:
            check(*(case if isinstance(case, tuple) else (case,)))
        except (Exception, pytest.fail.Exception) as error:
            failed.append(f"{case}: {type(error).__name__}: {error}")
    assert not failed, f"{len(failed)} of {len(cases)} cases fail:\n" + "\n".join(failed)
