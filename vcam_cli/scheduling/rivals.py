"""Schedules that know nothing of the scene but its brightest photocurrent: what others do.

All run from t1, the longest time in which the brightest photocurrent does not saturate, to T, the
longest exposure. No capture is longer than T: where T < t1 the first one ends at T too. `uniform`
and `exponential` are the rivals of Chen, "Digital Camera System Simulator and Applications", PhD
thesis, Stanford University, 2003, sections 4.4 and 4.6: with t1 = 5 ms and T = 200 ms four
uniform captures end at 5, 67, 133 and 200 ms, as in Fig 4.13.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def uniform(t1: float, longest: float, count: int) -> Floats:
    """t1 and j T / (N - 1), j = 1..N-1: (N,) rising times, in the unit of `longest`, T."""
    first = _first(t1, longest, count)
    rest = np.linspace(0.0, longest, count)[1:]
    return np.sort(np.append(rest, first))


def exponential(t1: float, longest: float, count: int) -> Floats:
    """min(2^(k-1) t1, T), k = 1..N: (N,) times, equal where they reach `longest`, T."""
    first = _first(t1, longest, count)
    with np.errstate(over="ignore"):  # longer than any T
        doubled = np.ldexp(first, np.arange(count))
    return np.minimum(doubled, longest)


def geometric(t1: float, longest: float, count: int) -> Floats:
    """t1 (T / t1)^((k-1)/(N-1)), k = 1..N: (N,) rising times from t1 to `longest`, T."""
    first = _first(t1, longest, count)
    if count == 1:
        return np.array([first])
    times = np.geomspace(first, longest, count)
    return np.maximum.accumulate(np.minimum(times, longest))  # but for rounding errors


def _first(t1: float, longest: float, count: int) -> float:
    """The first time; ValueError unless both are positive, finite and there is a capture."""
    if count < 1:
        raise ValueError("at least one capture is needed")
    if not (0 < t1 < np.inf and 0 < longest < np.inf):
        raise ValueError("the shortest and the longest time must be finite and above 0")
    return min(t1, longest)
