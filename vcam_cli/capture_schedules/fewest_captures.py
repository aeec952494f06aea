"""The fewest captures that reach a gain: how many exposures a scene is worth.

The gain of an optimal schedule never falls with the number of captures, so that doubling and
bisection find the fewest with some 2 log2(N) schedules a target, and targets share them.
"""

from collections.abc import Callable, Sequence

from vcam_cli.records import dataclass

SLACK = 1e-12
"""Relative: a gain that misses a target by its own rounding error reaches it."""


@dataclass(frozen=True)
class FewestCaptures:
    """The answer for one target gain.

    Parameters
    ----------
    target : float
        The gain that is wanted.
    count : int or None
        The fewest captures that reach it; None where none that were tried do.
    gain : float or None
        Gain of these captures; without a count that of the largest number tried, None if none
        was.
    possible : bool
        Whether more captures than were tried may reach it.
    """

    target: float
    count: int | None
    gain: float | None
    possible: bool


def fewest_captures(
    gain: Callable[[int], float],
    targets: Sequence[float],
    largest: int,
    upper_bound: float = float("inf"),
) -> tuple[FewestCaptures, ...]:
    """Find the fewest captures for each target gain.

    Parameters
    ----------
    gain : callable
        Gain of N captures, not falling with N; called once for each N it is needed for.
    targets : sequence of float
        Gains that are wanted.
    largest : int
        The largest number of captures that is tried.
    upper_bound : float
        Gain that no number of captures exceeds; a target above it costs no call.

    Returns
    -------
    tuple of FewestCaptures
        One answer for each target, in their order.

    Raises
    ------
    ValueError
        If `largest` is below 1 or a target is not a finite number.
    """
    if largest < 1:
        raise ValueError("the largest number of captures must be at least 1")
    if not all(abs(target) < float("inf") for target in targets):
        raise ValueError("target gains must be finite numbers")
    known: dict[int, float] = {}

    def reaches(count: int, target: float) -> bool:
        if count not in known:
            known[count] = gain(count)
        return _reaches_target(known[count], target)

    def answer(target: float) -> FewestCaptures:
        if not _reaches_target(upper_bound, target):
            return FewestCaptures(target, None, None, possible=False)
        count = _least_number(lambda n: reaches(n, target), largest)
        reached = known[largest if count is None else count]
        return FewestCaptures(target, count, reached, possible=True)

    return tuple(answer(target) for target in targets)


def _reaches_target(gain: float, target: float) -> bool:
    return gain >= target - SLACK * abs(target)


def _least_number(condition: Callable[[int], bool], largest: int) -> int | None:
    """Return the least n in 1..largest for which `condition` holds, as it does for all above."""
    above, top = 0, 1  # the condition fails up to `above`
    while not condition(top):
        if top == largest:
            return None
        above, top = top, min(2 * top, largest)
    while top - above > 1:
        middle = (above + top) // 2
        above, top = (above, middle) if condition(middle) else (middle, top)
    return top
