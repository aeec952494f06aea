"""What follows from a camera, worked out once: effects, plan and readout ask for it many times.

Cameras never change, so the same object has the same answer. Only the last few are kept: a sweep
makes thousands.
"""

from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

C = TypeVar("C")
T = TypeVar("T")

KEPT = 4
"""Cameras of which answers are kept: one a thread of a worker, and those it was made from."""


def once(function: Callable[[C], T]) -> Callable[[C], T]:
    """A function of a camera alone that remembers its answers for the last few cameras."""
    known: deque[tuple[Any, T]] = deque(maxlen=KEPT)

    @wraps(function)
    def remembered(camera: C) -> T:
        for asked, answer in tuple(known):
            if asked is camera:
                return answer
        answer = function(camera)
        known.append((camera, answer))
        return answer

    return remembered
