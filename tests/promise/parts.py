"""The parts of `python -m tests.promise`: what each measures case by case, and its figures."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import chart_cameras
import exact_errors
import frames
import layer_accuracies
import periodic_cameras
import promises
import random_cameras
import scene_matrix
import spent

from vcam_cli.accuracy_study import ablation
from vcam_cli.config import shipped

Figure = tuple[str, str, bool]
"""What is promised, what was found, whether it holds."""


@dataclass(frozen=True)
class Named:
    """What was found of a camera of `promises.CAMERAS`."""

    name: str
    full: float
    """Full signal [electrons]."""
    kept: tuple[promises.Kept, ...]
    estimates: tuple[promises.Estimate, ...]
    costly: tuple[tuple[str, str, bool], ...]
    """Preset, effect that is not worth its cost there, whether it is off."""
    idle: tuple[tuple[str, bool], ...]
    """Work that nobody asks for, whether it is not done."""
    auto: float
    """Time of a frame as planned at standard accuracy [s]."""
    all: float
    """The same with everything on at reference [s]."""

    @property
    def line(self) -> str:
        """What is printed of it, several lines."""
        lines = [f"{self.name}: full signal {self.full:.4g} e"]
        lines += [
            f"  {k.preset:<10} mean {k.mean:9.2e} of {k.tolerance:7.0e}"
            f"   variance {k.variance:9.2e} of {2 * k.tolerance:7.0e}"
            for k in self.kept
        ]
        lines += [
            f"  {e.name:<16} {e.predicted:10.3e} expected {e.measured:10.3e} found {e.ratio:7.3f}"
            for e in self.estimates
        ]
        lines += [
            f"  {effect} is not worth its cost at {preset}: {'off' if off else 'ON'}"
            for preset, effect, off in self.costly
        ]
        lines += [f"  auto at standard {self.auto:.3f} s, all at reference {self.all:.3f} s"]
        return "\n".join(lines)


def named(name: str, folder: Path) -> Named:
    """Measure a camera of `promises.CAMERAS`."""
    camera = promises.made(name, folder)
    true = promises.truth(camera)
    shares = ablation.variance_shares(true.found, true.full, 2)
    costly = (
        (preset, effect, off)
        for preset in promises.PRESETS
        for effect, off in promises.worth_leaving_out(preset, true, shares)
    )
    return Named(
        name,
        true.full,
        tuple(promises.kept(true)),
        tuple(promises.estimates(camera, true)),
        tuple(costly),
        tuple(promises.idle_work(camera)),
        *promises.seconds(camera),
    )


def named_figures(found: Sequence[Named]) -> Iterator[Figure]:
    """Figures of the cameras of `promises.CAMERAS`."""
    kept = [k for each in found for k in each.kept]
    mean = max(k.mean / k.tolerance for k in kept)
    yield "error of the mean raw over the tolerance, largest; at most 1", f"{mean:.2f}", mean <= 1
    noise = max(k.variance / (2 * k.tolerance) for k in kept)
    text = "change of a variance over twice the tolerance, largest; at most 1"
    yield text, f"{noise:.2f}", noise <= 1
    ratios = [e.ratio for each in found for e in each.estimates if e.ratio != 1.0] or [1.0]
    text = "expected over measured contribution, least; at least 0.9"
    yield text, f"{min(ratios):.3f}", min(ratios) >= 0.9
    middle = statistics.median(ratios)
    yield "the same, median; at most 3", f"{middle:.3f}", middle <= 3
    yield "the same, largest; at most 10", f"{max(ratios):.3f}", max(ratios) <= 10
    off = [is_off for each in found for _, _, is_off in each.costly]
    text = "draws of an ablation under a tenth of their share that are off; at least 80 %"
    yield text, f"{sum(off)} of {len(off)}", sum(off) >= 0.8 * len(off)
    idle = [is_left for each in found for _, is_left in each.idle]
    text = "work that nobody asks for (ideal image, metrics, demosaic) and is not done; all"
    yield text, f"{sum(idle)} of {len(idle)}", all(idle)
    part = sum(each.auto for each in found) / sum(each.all for each in found)
    text = "time of auto at standard over all at reference, of all cameras; at most 60 %"
    yield text, f"{part:.0%}", part <= 0.6
    part = statistics.median(each.auto / each.all for each in found)
    yield "the same, median of the cameras; at most 60 %", f"{part:.0%}", part <= 0.6


@dataclass(frozen=True)
class Random:
    """What was found of a camera drawn at random."""

    number: int
    source: str
    held: tuple[random_cameras.Held, ...]

    @property
    def line(self) -> str:
        """What is printed of it, several lines."""
        lines = [f"random camera {self.number}: {self.source}"]
        lines += [
            f"  {h.tolerance:<6g} mean {h.mean:9.2e} ({h.expected:9.2e} expected)"
            f"   variance {h.variance:9.2e} of {2 * h.tolerance:7.0e}"
            for h in self.held
        ]
        return "\n".join(lines)


def drawn(number: int, folder: Path) -> Random:
    """Measure a camera drawn at random."""
    camera = random_cameras.made(number, folder)
    return Random(number, camera.scene.source.kind, tuple(random_cameras.held(camera)))


def random_figures(found: Sequence[Random]) -> Iterator[Figure]:
    """Figures of cameras drawn at random."""
    held = [h for each in found for h in each.held]
    worst = max(h.mean / h.tolerance for h in held)
    text = "random cameras: error of the mean raw over the tolerance; at most 1"
    yield text, f"{worst:.2f}", worst <= 1
    noise = max(h.variance / h.tolerance / 2 for h in held)
    text = "random cameras: change of a variance over twice the tolerance; at most 1"
    yield text, f"{noise:.2f}", noise <= 1
    ratios = [h.expected / h.mean for h in held if h.mean > 0] or [1.0]
    text = "random cameras: expected over measured error, least and median; for information"
    yield text, f"{min(ratios):.2f} {statistics.median(ratios):.2f}", True


def exact(name: str, folder: Path) -> exact_errors.MeanError:
    """Measure a camera before a scene whose signal is known exactly."""
    cameras = periodic_cameras.CAMERAS | chart_cameras.CAMERAS
    return exact_errors.mean_error(cameras[name], folder)


def exact_figures(found: Sequence[exact_errors.MeanError]) -> Iterator[Figure]:
    """Figures of exact truths, of every kind of scene."""
    for kind in dict.fromkeys(each.kind for each in found):
        own = {each.name: max(each.over_tolerance.values()) for each in found if each.kind == kind}
        worst = max(own, key=own.__getitem__)
        text = f"exact truths, {kind}: error of the mean raw over the tolerance; at most 1"
        yield text, f"{own[worst]:.2f} ({worst})", own[worst] <= 1


@dataclass(frozen=True)
class Part:
    """Some cases that are measured alike."""

    text: str
    """What `--help` says of it."""
    cases: tuple[tuple, ...]
    """Arguments of each case; the first is a camera."""
    measure: Callable[..., Any]
    """From a case and a folder for files to what was found, which has a `line`."""
    figures: Callable[[Sequence[Any]], Iterator[Figure]]


BEFORE_SCENES = tuple(itertools.product(scene_matrix.CAMERAS, scene_matrix.SCENES))
PARTS = {
    "named": Part(
        "twenty-four cameras with little in common",
        tuple((name,) for name in promises.CAMERAS),
        named,
        named_figures,
    ),
    "random": Part(
        "forty cameras drawn at random, with every effect",
        tuple((number,) for number in range(random_cameras.COUNT)),
        drawn,
        random_figures,
    ),
    "exact": Part(
        "cameras whose mean signal is known exactly",
        tuple((name,) for name in (*periodic_cameras.CAMERAS, *chart_cameras.CAMERAS)),
        exact,
        exact_figures,
    ),
    "frames": Part(
        "random frames of all kinds, and those that once broke the promise",
        frames.cases(frames.COUNT, 0),
        frames.measure,
        frames.figures,
    ),
    "layers": Part(
        "random layered frames at three accuracies: whether a tighter one errs less",
        tuple((seed,) for seed in layer_accuracies.SEEDS),
        layer_accuracies.measure,
        layer_accuracies.figures,
    ),
    "matrix": Part(
        "ten cameras before eighteen scenes: what is left out, against true ablations",
        BEFORE_SCENES,
        scene_matrix.cell,
        scene_matrix.figures,
    ),
    "times": Part(
        "the same and `everything`: seconds as planned, and with everything on",
        tuple(itertools.product(scene_matrix.TIMED, scene_matrix.SCENES | scene_matrix.EMPTY)),
        scene_matrix.times,
        scene_matrix.time_figures,
    ),
    "spent": Part(
        "shipped cameras: how much of the tolerance they spend, and what presets cost",
        tuple((name,) for name in shipped.names("cameras")),
        spent.spent,
        spent.figures,
    ),
}
