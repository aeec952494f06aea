"""How floating-point errors are treated while vcam computes, whatever the caller has set."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numpy as np

P = ParamSpec("P")
T = TypeVar("T")


def own_float_errors(function: Callable[P, T]) -> Callable[P, T]:
    """Return a function that neither heeds the caller's `np.seterr` nor changes it.

    What underflows is 0, as the computations take it; all else is a warning of NumPy.
    """
    return np.errstate(all="warn", under="ignore")(function)
