"""The fewest captures that reach a gain: how many exposures a scene is worth.

The gain of an optimal schedule never falls with the number of captures, so that doubling and
bisection find the fewest with some 2 log2(N) schedules a target, and targets share them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

SLACK = 1e-12
"""Relative: a gain that misses a target by its own rounding error reaches it."""


@dataclass(frozen=True)
class Fewest:
    """The answer for one target gain.

    count : the fewest captures, or None: `possible` says whether more than were tried may do
    gain : of so many captures; without a count that of the largest number tried, None if none was
    """

    target: float
    count: int | None
    gain: float | None
    possible: bool


def fewest(
    gain: Callable[[int], float],
    targets: Sequence[float],
    largest: int,
    upper_bound: float = float("inf"),
) -> tuple[Fewest, ...]:
    """The fewest captures for each of `targets`, in their order.

    Parameters
    ----------
    gain : of N captures, not falling with N; called once for each N it is needed for
    largest : captures tried at most
    upper_bound : gain that no number of captures exceeds; a target above it costs no call

    Raises ValueError for largest < 1 and for a target that is not a finite number.
    """
    if largest < 1:
        raise ValueError("the largest number of captures must be at least 1")
    if not all(abs(target) < float("inf") for target in targets):
        raise ValueError("target gains must be finite numbers")
    known: dict[int, float] = {}

    def reaches(count: int, target: float) -> bool:
        if count not in known:
            known[count] = gain(count)
        return at_least(known[count], target)

    def answer(target: float) -> Fewest:
        if not at_least(upper_bound, target):
            return Fewest(target, None, None, possible=False)
        count = _first(lambda n: reaches(n, target), largest)
        return Fewest(target, count, known[largest if count is None else count], possible=True)

    return tuple(answer(target) for target in targets)


def at_least(gain: float, target: float) -> bool:
    """Whether a gain reaches a target, but for rounding."""
    return gain >= target - SLACK * abs(target)


def _first(true: Callable[[int], bool], largest: int) -> int | None:
    """The least n in 1..largest for which `true`, which stays true from there on; None: none."""
    above, top = 0, 1  # false up to `above`
    while not true(top):
        if top == largest:
            return None
        above, top = top, min(2 * top, largest)
    while top - above > 1:
        middle = (above + top) // 2
        above, top = (above, middle) if true(middle) else (middle, top)
    return top
