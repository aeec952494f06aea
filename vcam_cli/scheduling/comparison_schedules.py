"""Schedules to compare the optimum with: rules of time, and the heuristic.

The rules know nothing of the scene but its brightest photocurrent. They run from t_1, the longest
time in which that does not saturate, to T, the longest exposure; where T < t_1 the first capture
ends at T too. `uniform_times` and `exponential_times` are those of [1]_, sections 4.4 and 4.6: with
t_1 = 5 ms and T = 200 ms four uniform captures end at 5, 67, 133 and 200 ms, as in its Fig 4.13.

The heuristic of [1]_, section 4.4.1, searches nothing: captures in proportion to the probability of
each segment, spread evenly in photocurrent, the first at the segment's bright end. It lies within
some tenths of a decibel of the optimum on ordinary scenes.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

import numpy as np

from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import SLACK


def uniform_times(t1: float, longest: float, count: int) -> Floats:
    """Return t_1 and j T / (N - 1), j = 1..N-1.

    Parameters
    ----------
    t1, longest : float
        The first time and the longest, T, in the same unit.
    count : int
        Number of captures, N.

    Returns
    -------
    (N,) array
        Rising times.

    Raises
    ------
    ValueError
        If there is no capture, or a time is not finite and above 0.
    """
    first = _first_time(t1, longest, count)
    rest = np.linspace(0.0, longest, count)[1:]
    return np.sort(np.append(rest, first))


def exponential_times(t1: float, longest: float, count: int) -> Floats:
    """Return min(2^(k-1) t_1, T), k = 1..N. Times are equal where they reach T.

    Parameters
    ----------
    t1 : float
        First time t_1 [s]; T where that is shorter.
    longest : float
        Longest time T [s].
    count : int
        Number of captures N.

    Returns
    -------
    (N,) array
        Rising times [s].

    Raises
    ------
    ValueError
        If there is no capture, or a time is not finite and above 0.
    """
    first = _first_time(t1, longest, count)
    with np.errstate(over="ignore"):  # longer than any T
        doubled = np.ldexp(first, np.arange(count))
    return np.minimum(doubled, longest)


def geometric_times(t1: float, longest: float, count: int) -> Floats:
    """Return t_1 (T / t_1)^((k-1)/(N-1)), k = 1..N.

    Parameters
    ----------
    t1 : float
        First time t_1 [s]; T where that is shorter.
    longest : float
        Longest time T [s].
    count : int
        Number of captures N.

    Returns
    -------
    (N,) array
        Rising times [s].

    Raises
    ------
    ValueError
        If there is no capture, or a time is not finite and above 0.
    """
    first = _first_time(t1, longest, count)
    if count == 1:
        return np.array([first])
    times = np.geomspace(first, longest, count)
    return np.maximum.accumulate(np.minimum(times, longest))  # but for rounding errors


def heuristic_photocurrents(pdf: Pdf, count: int) -> Floats:
    """Return the photocurrents that just fill the well in each capture of the heuristic schedule.

    Segments without probability get no captures.

    Parameters
    ----------
    pdf : Pdf
        Segments of photocurrent.
    count : int
        Number of captures.

    Returns
    -------
    (count,) array
        Photocurrents, falling from pdf.max.

    Raises
    ------
    ValueError
        If there is no capture, or the pdf is one of levels, which has no segments to spread
        captures over.
    """
    if count < 1:
        raise ValueError("at least one capture is needed")
    if pdf.discrete:
        raise ValueError("the heuristic schedule needs segments, not levels")
    occurs = pdf.probability > 0
    bright_first = (values[occurs][::-1] for values in (pdf.low, pdf.high, pdf.probability))
    low, high, probability = bright_first
    spread = zip(low, high, captures_per_segment(probability, count), strict=True)
    return np.concatenate([
        top - (top - bottom) * np.arange(share) / max(share, 1) for bottom, top, share in spread
    ])  # fmt: skip


def captures_per_segment(probability: Floats, count: int) -> list[int]:
    """Divide `count` captures among segments by the heuristic.

    The brightest segment's share is rounded up, so that it has a capture; each other's share of
    those that are left to the nearest, halves up. Why a slack: 0.07 x 100 is 7.000000000000001 in
    floating point, and must still be 7.

    Parameters
    ----------
    probability : (M,) array
        Probabilities above 0, of any sum, the brightest segment first.
    count : int
        Number of captures.

    Returns
    -------
    list of int
        (M,) numbers of captures, of sum `count`.
    """
    left_over = np.cumsum(probability[::-1])[::-1]  # of this segment and all darker ones
    shares = probability / left_over
    counts = [max(1, int(np.ceil(_add_slack(shares[0] * count, -SLACK))))]
    for share in shares[1:]:
        exact = (count - sum(counts)) * share
        counts.append(int(np.floor(_add_slack(exact, SLACK) + 0.5)))
    return counts


def _first_time(t1: float, longest: float, count: int) -> float:
    """Return the first time; raise unless both are positive, finite and there is a capture."""
    if count < 1:
        raise ValueError("at least one capture is needed")
    if not (0 < t1 < np.inf and 0 < longest < np.inf):
        raise ValueError("the shortest and the longest time must be finite and above 0")
    return min(t1, longest)


def _add_slack(value: float, slack: float) -> float:
    return value + slack * max(1.0, value)
