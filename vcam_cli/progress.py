"""Progress of a run: named stages, how long each took, and an observer that follows them."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol


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
