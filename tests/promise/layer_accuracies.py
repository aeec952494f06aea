"""Random layered frames at three accuracies: whether a tighter one errs less, and as predicted.

    python -m tests.promise --layers

Truths are those of `frame_rays.py`, with up to twice as many rays as other frames need; those
with diffraction are the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

import frame_rays
import frame_truth
import frames
from frame_judge import error

from vcam_cli import simulate

ACCURACIES = {"2 %": 0.02, "0.5 %": 0.005, "0.1 %": 0.001}
"""From loose to tight."""
SEEDS = range(60100, 60120)
TRUTH = {"GOAL": 5e-5, "RAYS": (300, 19200)}
"""What may be left of the truth's error, of full signal, and points of the pupil at most."""
COUNTED = 0.05
"""Errors below this part of the tolerance, or below the truth's own, say nothing of predictions."""


@dataclass(frozen=True)
class Converged:
    """One frame at every accuracy."""

    seed: int
    measured: dict[str, float]
    """Rms error, of full signal."""
    predicted: dict[str, float]
    """The same; nothing where no layer that is seen hides another."""
    unsure: float
    """What is left of the truth's error, of full signal."""

    @property
    def line(self) -> str:
        """What is printed of it."""
        each = "  ".join(
            f"{name}: {found:.2e} ({self.predicted.get(name, 0.0):.2e} predicted)"
            for name, found in self.measured.items()
        )
        return f"{self.seed}  {each}  truth {self.unsure:.0e}"

    @property
    def excess(self) -> float:
        """By how much a tighter accuracy errs more than a looser one, largest, of the tighter T."""
        return max(
            (self.measured[tight] - self.measured[loose] - self.unsure) / ACCURACIES[tight]
            for loose, tight in pairwise(ACCURACIES)
        )

    @property
    def ratios(self) -> list[float]:
        """Predicted over measured errors, of those that count."""
        return [
            self.predicted[name] / found
            for name, found in self.measured.items()
            if name in self.predicted and found > max(COUNTED * ACCURACIES[name], 2 * self.unsure)
        ]


def measure(seed: int, folder: Path) -> Converged:
    """Measure the frame of a seed."""
    frame = frames.frame_of("layers", seed)
    with patch.multiple(frame_rays, **TRUTH):
        true = frame_truth.truth(frame, frame.load(folder, "draft", "all"))
    measured, predicted = {}, {}
    for name in ACCURACIES:
        result = simulate(frame.load(folder, name, "auto"), workers=1)
        measured[name] = error(result.mean_electrons, true)
        if depth := result.frame.spectrum.depth:
            predicted[name] = depth.error
    return Converged(seed, measured, predicted, true.error)


def figures(found: Sequence[Converged]) -> Iterator[tuple[str, str, bool]]:
    """What is promised, what was found, whether it holds."""
    worst = max(found, key=lambda each: each.excess)
    text = "error of a tighter accuracy less that of a looser one, largest; at most 0.1 T"
    yield text, f"{worst.excess:.3f} ({worst.seed})", worst.excess <= 0.1
    ratios = [ratio for each in found for ratio in each.ratios]
    enough = sum(ratio >= 1 for ratio in ratios)
    text = "predicted errors that are at least the measured ones; at least nine of ten"
    yield text, f"{enough} of {len(ratios)}", enough >= 0.9 * len(ratios)
    least = min(ratios, default=1.0)
    yield "predicted over measured error, least; at least 0.5", f"{least:.2f}", least >= 0.5
