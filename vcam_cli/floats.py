"""How floating-point errors are treated whatever the caller has set, and the root mean square."""

import math
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numpy as np

from vcam_cli.arrays import Array

P = ParamSpec("P")
T = TypeVar("T")


AT_ONCE = 1 << 20
"""Values whose squares are held at once: those of 50 megapixels would take 400 MB."""


def own_float_errors(function: Callable[P, T]) -> Callable[P, T]:
    """Return a function that neither uses the caller's `np.seterr` nor changes it.

    What underflows is 0, as the computations take it; all else is a warning of NumPy.
    """
    return np.errstate(all="warn", under="ignore")(function)


def rms(values: Array) -> float:
    """Return the root of the mean square of values of any shape, in their unit."""
    flat = values.reshape(-1)
    if flat.size <= AT_ONCE:
        return float(np.sqrt(np.square(flat, dtype=np.float64).mean()))
    parts = (flat[start : start + AT_ONCE] for start in range(0, flat.size, AT_ONCE))
    squares = sum(float(np.square(part, dtype=np.float64).sum()) for part in parts)
    return math.sqrt(squares / flat.size)
