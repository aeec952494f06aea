"""How floating-point errors are treated whatever the caller has set, and the root mean square."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numpy as np

from vcam_cli.arrays import Array

P = ParamSpec("P")
T = TypeVar("T")


def own_float_errors(function: Callable[P, T]) -> Callable[P, T]:
    """Return a function that neither uses the caller's `np.seterr` nor changes it.

    What underflows is 0, as the computations take it; all else is a warning of NumPy.
    """
    return np.errstate(all="warn", under="ignore")(function)


def rms(values: Array) -> float:
    """Return the root of the mean square of values of any shape, in their unit."""
    return float(np.sqrt(np.square(values, dtype=np.float64).mean()))
