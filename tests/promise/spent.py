"""How much of the tolerance every shipped camera spends, and what its presets cost.

Errors are those of small arrays, of the camera's own pixels behind its own lens, whose truth is
computed: with everything on, converged, on cells, with a margin and in floats that differ. Times
are processor seconds of one thread for a frame with its render, of the camera's own size but where
that is too small for its constant costs not to count, or so large that it only takes longer.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from promises import at_preset

from vcam_cli import load, simulate
from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.reference import prepare_converged
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.floats import rms
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import prepare

MOST_JUDGED = 60_000
"""Pixels of an array whose truth is computed, at most: it takes seconds."""
MOST_BYTES = 5e8
"""Memory beyond which the truth is no finer than `accuracy: reference`, whose errors are a part of
those at standard that does not count [bytes]."""
TIMED = (1_000_000, 2_000_000)
"""Pixels of an array that is timed, at least and at most."""
TURNS, LONG_TURNS, LONG = 9, 3, 2.0
"""Frames of every preset that are timed, in turns, of which the fastest counts; and of those that
take longer than so many seconds."""
SPENT = (0.2, 0.9)
"""Parts of the tolerance between which an error lies that is neither wasted nor risked."""
DRAFT, REFERENCE = 0.5, 10.0
"""Time of a frame at draft and at reference over that at standard, at most."""


@dataclass(frozen=True)
class Spent:
    """What was found of a shipped camera."""

    name: str
    errors: dict[str, float]
    """Preset -> rms error of the mean raw over the tolerance."""
    exact: tuple[str, ...]
    """Presets at which its light is a closed form, without any term of a spectrum."""
    seconds: dict[str, float]
    """Preset -> processor seconds of a frame [s]."""
    megapixels: float
    """Pixels of the frame that was timed."""

    @property
    def draft(self) -> float:
        """Time at draft over that at standard."""
        return self.seconds["draft"] / self.seconds["standard"]

    @property
    def reference(self) -> float:
        """Time at reference over that at standard."""
        return self.seconds["reference"] / self.seconds["standard"]

    @property
    def line(self) -> str:
        """What is printed of it."""
        errors = "  ".join(f"{preset} {error:.3f} T" for preset, error in self.errors.items())
        seconds = " ".join(f"{taken:.2f}" for taken in self.seconds.values())
        exact = f" (exact: {', '.join(self.exact)})" if self.exact else ""
        return (
            f"{self.name:<18} {errors}{exact}  {self.megapixels:.1f} MP in {seconds} s:"
            f" draft {self.draft:.2f}, reference {self.reference:.1f} of standard"
        )


def spent(name: str, folder: Path) -> Spent:
    """Measure the errors and times of a shipped camera."""
    small, large = resized(name, 1, MOST_JUDGED), resized(name, *TIMED)
    return Spent(name, *errors(small), seconds(large), _pixels(large) / 1e6)


def resized(name: str, least: int, most: int) -> Camera:
    """Return a shipped camera whose array has the same shape, and so many pixels."""
    camera = load(name)
    pixels = _pixels(camera)
    if least <= pixels <= most:
        return camera
    scale = math.sqrt(min(max(pixels, least), most) / pixels)
    solved = geometry(camera)
    rows, columns = (4 * round(scale * n / 4) for n in (solved.rows, solved.columns))
    die = ["array.die=null"] if camera.array.die else []
    return load(name, [*die, f"array.rows={rows}", f"array.columns={columns}"])


def _pixels(camera: Camera) -> int:
    solved = geometry(camera)
    return solved.rows * solved.columns


def errors(camera: Camera) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the errors at draft and standard over the tolerance, and which presets are exact."""
    ready = {
        preset: prepare(at_preset(camera, preset), 1)[0]
        for preset in ("draft", "standard", "reference")
    }
    found = prepare_converged(camera, ready.pop("reference"), 1, MOST_BYTES)
    true, full = ablation.mean_raw(found), ablation.full_signal(found)
    found_errors = {
        preset: rms(ablation.mean_raw(own) - true) / full / own.settings.tolerance
        for preset, own in ready.items()
    }
    return found_errors, tuple(p for p, own in ready.items() if not own.spectrum.terms)


def seconds(camera: Camera) -> dict[str, float]:
    """Return processor seconds of a frame with its render at every preset, the least of some.

    Every frame forms its own light.
    """
    presets = {p: at_preset(camera, p) for p in ("draft", "standard", "reference")}
    taken = dict.fromkeys(presets, math.inf)
    for turn in range(TURNS):
        for preset, made in presets.items():
            if turn >= LONG_TURNS and taken[preset] > LONG:
                continue
            start = time.process_time()
            _ = simulate(made, 1, shared=Shared()).render
            taken[preset] = min(taken[preset], time.process_time() - start)
    return taken


def figures(found: Sequence[Spent]) -> Iterator[tuple[str, str, bool]]:
    """Return (what is asked, what was found, whether it holds)."""
    every = {(each.name, preset): error for each in found for preset, error in each.errors.items()}
    worst = max(every, key=every.__getitem__)
    text = f"error over the tolerance, largest; at most {SPENT[1]}"
    yield text, f"{every[worst]:.2f} ({' at '.join(worst)})", every[worst] <= SPENT[1]
    exact = {(each.name, preset) for each in found for preset in each.exact}
    judged = {at: e for at, e in every.items() if at not in exact}
    idle = [f"{' at '.join(at)} {error:.2f}" for at, error in judged.items() if error < SPENT[0]]
    text = f"errors below {SPENT[0]} of the tolerance, but for exact ones; none"
    yield text, f"{len(idle)} of {len(judged)}: {', '.join(idle) or 'none'}", not idle
    if judged:
        yield "the same, median; for information", f"{statistics.median(judged.values()):.2f}", True
    names = [" at ".join(at) for at in sorted(exact)]
    yield "exact by a closed form", ", ".join(names) or "none", True
    for text, ratios, most in (
        ("time at draft over standard", {each.name: each.draft for each in found}, DRAFT),
        ("time at reference over standard", {e.name: e.reference for e in found}, REFERENCE),
    ):
        over = [f"{name} {ratio:.2f}" for name, ratio in ratios.items() if ratio > most]
        middle = statistics.median(ratios.values())
        yield f"{text}, of each; at most {most}", f"{', '.join(over) or 'all'}", not over
        yield "the same, median; for information", f"{middle:.2f}", True
