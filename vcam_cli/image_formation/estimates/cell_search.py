"""The search for the fewest cells of a chart whose error on crops keeps a budget."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

CHEAP = 1 << 20
"""Cells that are painted without asking whether fewer would do."""
FASTEST_FALL = 4.0
"""Power of the cells with which their error falls, at most: numbers of cells that would need a
faster fall from those tried before are not tried."""
SLOWEST_FALL = 2.0
"""That power, at least: numbers that would need a slower one are not tried either."""
USUAL_FALL = 2.5
"""That power where no other trial tells it: of edges."""
BETWEEN = 1.04
"""Of two numbers tried, of which one errs too much, cells between them are tried so many times what
the law of powers asks for."""


class CellTrial(NamedTuple):
    """What cells err on crops of a chart."""

    cells: float
    """Cells per pixel pitch."""
    error: float
    """Rms of the signal [e/s]."""

    def error_of(self, cells: float, power: float) -> float:
        """Return the error of other cells, where it falls with a power of them [e/s]."""
        return self.error * (self.cells / cells) ** power

    def enough_beside(self, finer: CellTrial, budget: float) -> float:
        """Return the cells with which the error falls to a budget that a finer trial keeps.

        It is a power of the cells between the two.
        """
        if finer.error <= 0:
            return self.cells
        power = math.log(self.error / finer.error) / math.log(finer.cells / self.cells)
        return float(self.cells * (self.error / budget) ** (1 / power))


@dataclass
class CellSearch:
    """Trials of cells, until few are found whose error keeps a budget."""

    measure: Callable[[float], CellTrial]
    budget: float
    """[e/s]"""
    kept: CellTrial | None = None
    """The fewest cells that keep it."""
    failed: CellTrial | None = None
    """The most that do not."""
    trials: int = 1
    """That of the reference among them."""

    def attempt(self, cells: float) -> bool:
        """Try so many cells a pixel pitch, and return whether they keep the budget."""
        trial = self.measure(cells)
        self.trials += 1
        if trial.error <= self.budget:
            self.kept = trial
        else:
            self.failed = trial
        return trial is self.kept

    def try_upward(self, ladder: Sequence[float]) -> None:
        """Try more and more cells, until some keep the budget."""
        for cells in ladder:
            if self.failed and self.failed.error_of(cells, FASTEST_FALL) > self.budget:
                continue
            if self.attempt(cells):
                return

    def try_downward(self, ladder: Sequence[float]) -> None:
        """Try fewer and fewer, where all before kept it, until some do not."""
        for cells in reversed(ladder):
            if self.failed or not self.kept:
                return
            if self.kept.error_of(cells, SLOWEST_FALL) > self.budget:
                return
            self.attempt(cells)

    def try_between(self, pixels: int, least: float) -> None:
        """Try cells between the two, twice at most, where that spares an image of `pixels` many.

        Where none failed they are tried above the `least`.
        """
        for _ in range(2):
            if not self.kept:
                return
            if self.failed:
                cells = BETWEEN * self.failed.enough_beside(self.kept, self.budget)
            else:
                part = self.kept.error / self.budget if self.budget else 1.0
                cells = max(BETWEEN * self.kept.cells * part ** (1 / USUAL_FALL), least)
            if (self.kept.cells**2 - cells**2) * pixels < CHEAP or self.attempt(cells):
                return
