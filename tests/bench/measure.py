"""What is timed and how: medians of repeated runs in one process, wall clock and processor time."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.fft

from vcam_cli import simulate
from vcam_cli.camera.camera import Camera
from vcam_cli.parallel import available_workers
from vcam_cli.progress import Silent

SOURCES = 5
"""Of noise in the yardstick."""
READ = "read"
"""The stage that reads files: not counted."""


@dataclass(frozen=True)
class Cost:
    """Seconds of a piece of work, positive."""

    wall: float
    cpu: float
    """Of all threads of this process together."""

    def over(self, other: Cost) -> dict[str, float]:
        """How many times as much as the other."""
        return {"wall": self.wall / other.wall, "cpu": self.cpu / other.cpu}

    def scaled(self, factor: float) -> Cost:
        return Cost(self.wall * factor, self.cpu * factor)


def median(costs: Sequence[Cost]) -> Cost:
    """Of wall and of processor time, each by itself."""
    wall = statistics.median(c.wall for c in costs)
    return Cost(wall, statistics.median(c.cpu for c in costs))


def once(work: Callable[[], object]) -> Cost:
    """What one run costs; at least a nanosecond, so that clocks that stand still divide."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return Cost(max(time.perf_counter() - wall, 1e-9), max(time.process_time() - cpu, 1e-9))


def timed(work: Callable[[], object], repeats: int, warm: bool = True) -> Cost:
    """Median of `repeats` runs of `work`, after one more to warm up."""
    if warm:
        work()
    return median([once(work) for _ in range(repeats)])


@dataclass(frozen=True)
class Yardstick:
    """R_compute, what no simulator can do without, by the number of the scene's components."""

    transform: Cost
    """A real FFT of one component of the scene, on all processors."""
    rest: Cost
    """One back for each of three colors; a standard normal per pixel for each of five noise
    sources, from one generator."""

    def of(self, components: int) -> Cost:
        """All of it, in 32 bits."""
        return Cost(
            self.rest.wall + components * self.transform.wall,
            self.rest.cpu + components * self.transform.cpu,
        )


def yardstick(rows: int, columns: int, repeats: int) -> Yardstick:
    """Measured for a frame of that size."""
    workers = available_workers()
    scene = np.random.default_rng(0).random((rows, columns), dtype=np.float32)
    spectrum = scipy.fft.rfft2(scene, workers=workers)
    generator = np.random.Generator(np.random.Philox(0))

    def rest() -> None:
        for _ in range(3):
            scipy.fft.irfft2(spectrum, s=scene.shape, workers=workers)
        for _ in range(SOURCES):
            generator.standard_normal((rows, columns), dtype=np.float32)

    transform = timed(lambda: scipy.fft.rfft2(scene, workers=workers), repeats)
    return Yardstick(transform, timed(rest, repeats))


def middle(found: Sequence[Yardstick]) -> Yardstick:
    """The median of several."""
    return Yardstick(median([y.transform for y in found]), median([y.rest for y in found]))


@dataclass
class _Reading(Silent):
    """Adds up what reading files costs, to be taken off the rest."""

    wall: float = 0.0
    cpu: float = 0.0
    _since: tuple[float, float] | None = None

    def begin(self, stage: str) -> None:
        now = time.perf_counter(), time.process_time()
        if self._since is not None:
            self.wall += now[0] - self._since[0]
            self.cpu += now[1] - self._since[1]
        self._since = now if stage == READ else None


@dataclass
class Frames:
    """A camera's frames, from the scene in memory to the render: what they cost, by stage."""

    camera: Camera
    costs: list[Cost] = field(default_factory=list)
    stages: list[dict[str, float]] = field(default_factory=list)
    components: int = 1
    """Planes of the scene that were transformed."""

    def take(self, repeats: int = 1, warm: bool = False) -> Frames:
        """Takes so many more; warm: and one before them that does not count."""
        for number in range(repeats + warm):
            cost, stages = self._one()
            if number or not warm:
                self.costs.append(cost)
                self.stages.append(stages)
        return self

    def _one(self) -> tuple[Cost, dict[str, float]]:
        reading, results = _Reading(), []

        def work() -> None:
            results.append(simulate(self.camera, watch=reading))
            results[0].render  # noqa: B018

        whole = once(work)
        self.components = max(1, results[0].frame.spectrum.planes)
        stages = {k: v for k, v in results[0].stages.seconds.items() if k != READ}
        cost = Cost(max(whole.wall - reading.wall, 1e-9), max(whole.cpu - reading.cpu, 1e-9))
        return cost, stages

    @property
    def cost(self) -> Cost:
        return median(self.costs)

    @property
    def shares(self) -> dict[str, float]:
        """Of the wall clock: stage -> median of its part of the stages' sum."""
        parts = [{k: v / sum(s.values()) for k, v in s.items()} for s in self.stages]
        return {name: statistics.median(p[name] for p in parts) for name in parts[-1]}


def frames(camera: Camera, repeats: int) -> Frames:
    """So many of a camera's frames, after one to warm up."""
    return Frames(camera).take(repeats, warm=True)
