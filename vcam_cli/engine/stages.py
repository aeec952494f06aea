"""What a run is doing: named stages, how long each took, and whoever wants to be told meanwhile."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol


class Observer(Protocol):
    """Is told what goes on, by the thread that works: it must return at once and never fail."""

    def begin(self, stage: str) -> None:
        """A stage begins."""

    def expect(self, seconds: float) -> None:
        """All stages together, those that are over included, will take about so long [s]."""

    def step(self, done: int, total: int) -> None:
        """So many of the stage's steps are done."""


class Silent:
    """Nobody wants to know."""

    def begin(self, stage: str) -> None:
        pass

    def expect(self, seconds: float) -> None:
        pass

    def step(self, done: int, total: int) -> None:
        pass


@dataclass
class Stages:
    """Seconds that each stage took, in the order in which they ran."""

    seconds: dict[str, float] = field(default_factory=dict)
    watch: Observer = field(default_factory=Silent)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        self.watch.begin(name)
        start = clock.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + clock.perf_counter() - start
