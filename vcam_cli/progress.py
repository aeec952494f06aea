"""Progress of a run: named stages, how long each took, and an observer that follows them."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from vcam_cli.arguments import brief


class Observer(Protocol):
    """Follows a run, called by the thread that works: it must return at once and never fail."""

    def begin(self, stage: str) -> None:
        """Note that a stage begins."""

    def expect(self, seconds: float) -> None:
        """Note how long all stages together, those that are over included, will take [s]."""

    def step(self, done: int, total: int) -> None:
        """Note how many of the stage's steps are done."""


class Silent:
    """An observer that shows nothing."""

    def begin(self, stage: str) -> None:
        """Do nothing."""

    def expect(self, seconds: float) -> None:
        """Do nothing."""

    def step(self, done: int, total: int) -> None:
        """Do nothing."""


class Timekeeper:
    """An observer that estimates how long the work takes."""

    def __init__(self) -> None:
        self._start = self._stage_start = clock.monotonic()
        self._stage, self._expected, self._steps = "", 0.0, (0, 0)

    def begin(self, stage: str) -> None:
        """Note that a stage begins."""
        self._stage, self._stage_start, self._steps = stage, clock.monotonic(), (0, 0)

    def expect(self, seconds: float) -> None:
        """Note how long all stages together will take [s]."""
        self._expected = seconds

    def step(self, done: int, total: int) -> None:
        """Note how many of the stage's steps are done."""
        self._steps = (done, total)

    def seconds_left(self, now: float) -> float | None:
        """Return the seconds left at a time of the clock; None where they are unknown or overdue.

        Finished steps give a better estimate than the one from before the run.
        """
        done, total = self._steps
        if done:
            return (now - self._stage_start) * (total - done) / done
        return self._start + self._expected - now if now < self._start + self._expected else None

    @property
    def is_foretold(self) -> bool:
        """Whether anything is known of the time that is left."""
        return bool(self._expected or self._steps[0])


Callback = Callable[[str, float | None], object]
"""A function of a stage and of the share of the time that is over, from 0 to 1 or None."""


class Calling(Timekeeper):
    """An observer that calls a function whenever there is something new."""

    def __init__(self, function: Callback) -> None:
        super().__init__()
        self._function = function

    def begin(self, stage: str) -> None:
        """Tell that a stage begins."""
        super().begin(stage)
        self._tell()

    def expect(self, seconds: float) -> None:
        """Tell the share, now that more is known."""
        super().expect(seconds)
        self._tell()

    def step(self, done: int, total: int) -> None:
        """Tell the share after a step."""
        super().step(done, total)
        self._tell()

    def _tell(self) -> None:
        now = clock.monotonic()
        left, over = self.seconds_left(now), now - self._start
        known = left is not None and over + left > 0
        self._function(self._stage, over / (over + left) if known and left is not None else None)


def observer(watch: Observer | Callback | None) -> Observer:
    """Return what follows a run: an observer, one that calls a function, or `Silent`.

    The function gets the name of the stage and the share of the time that is over, from 0 to 1, or
    None as long as nothing is known of it. The thread that works calls it, when a stage begins and
    after each of its steps; what it raises ends the run.

    Raises TypeError for anything else.
    """
    if watch is None:
        return Silent()
    methods = [getattr(watch, name, None) for name in ("begin", "expect", "step")]
    if all(map(callable, methods)):
        return watch  # type: ignore[return-value]
    if callable(watch):
        return Calling(watch)
    message = f"watch={brief(watch)} cannot follow a run"
    raise TypeError(f"{message}; give a function of a stage and a share, such as print")


@dataclass
class Stages:
    """Seconds that each stage took, in the order in which they ran."""

    seconds: dict[str, float] = field(default_factory=dict)
    watch: Observer = field(default_factory=Silent)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time what runs in the `with` block as a stage."""
        self.watch.begin(name)
        start = clock.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + clock.perf_counter() - start
