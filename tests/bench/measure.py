"""What is measured and how: medians of repeated runs, by the wall clock and by processor time."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.fft

from vcam_cli import simulate
from vcam_cli.camera.camera import Camera
from vcam_cli.parallel import available_workers
from vcam_cli.progress import Silent
from vcam_cli.simulation.shared import Shared

NOISE_SOURCES = 5
"""Noise sources in the yardstick."""
READ = "read"
"""The stage that reads files, which is not counted."""
Clocks = tuple[float, float]
"""Readings of the wall clock and of the processors' [s]."""


@dataclass(frozen=True)
class Cost:
    """Seconds of a piece of work, positive."""

    wall: float
    cpu: float
    """Processor time of all threads together."""

    def ratio(self, other: Cost) -> dict[str, float]:
        """How many times as much this is as the other, by either clock."""
        return {"wall": self.wall / other.wall, "cpu": self.cpu / other.cpu}

    def scale(self, factor: float) -> Cost:
        """This cost times a factor."""
        return Cost(self.wall * factor, self.cpu * factor)


def process_clocks() -> Clocks:
    """The wall clock and this process's processor time."""
    return time.perf_counter(), time.process_time()


def children_clocks() -> Clocks:
    """The wall clock and the processor time of all processes that this one has waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), used.ru_utime + used.ru_stime


def elapsed(start: Clocks, end: Clocks) -> Cost:
    """The cost between two readings; at least a nanosecond, so that clocks that stand divide."""
    return Cost(max(end[0] - start[0], 1e-9), max(end[1] - start[1], 1e-9))


def median(costs: Sequence[Cost]) -> Cost:
    """The median of wall clock and of processor time, each by itself."""
    wall = statistics.median(c.wall for c in costs)
    return Cost(wall, statistics.median(c.cpu for c in costs))


def run_cost(work: Callable[[], object], clocks: Callable[[], Clocks] = process_clocks) -> Cost:
    """What one run costs."""
    start = clocks()
    work()
    return elapsed(start, clocks())


def median_cost(work: Callable[[], object], repeats: int, warm: bool = True) -> Cost:
    """Median of `repeats` runs of `work`, after one more to warm up."""
    if warm:
        work()
    return median([run_cost(work) for _ in range(repeats)])


def start_cost(work: Sequence[str], folder: str) -> Cost:
    """What a Python process of its own costs, as it is installed: compiled once, into a folder.

    It raises CalledProcessError where the process fails.
    """
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    kept["PYTHONPYCACHEPREFIX"] = f"{folder}/compiled"
    command = [sys.executable, *work]
    silent = {"env": kept, "check": True, "stdout": subprocess.DEVNULL}
    return run_cost(lambda: subprocess.run(command, **silent), children_clocks)


def take_turns(repeats: int, *works: Callable[[], Cost]) -> list[Cost]:
    """Medians of the costs of several works, one of each at a time, after a first that is not
    counted.

    A machine is faster at one moment than at another; turns let that happen to all alike.
    """
    turns = [[work() for work in works] for _ in range(repeats + 1)]
    return [median(costs) for costs in zip(*turns[1:], strict=True)]


PEAK = """
import sys
from vcam_cli import load, simulate
from vcam_cli.memory import peak_memory
{work}
print(peak_memory())
"""
"""A process that does some work and prints its peak memory [bytes]."""
FRAME = "result = simulate(load(sys.argv[1])); result.render, result.metrics"


def peak_memory(*arguments: str, work: str = FRAME) -> int:
    """Peak memory of a process that takes a frame of a camera file, with its metrics [bytes].

    work: what it does in place of that, with the arguments in `sys.argv`.
    """
    command = [sys.executable, "-c", PEAK.replace("{work}", work), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(done.stdout)


@dataclass(frozen=True)
class Yardstick:
    """R_compute, what no simulator can do without, by the number of the scene's components."""

    transform: Cost
    """The cost of a real FFT of one component of the scene, on all processors."""
    rest: Cost
    """The cost of one FFT back for each of three colors, and of a standard normal per pixel for
    each of five noise sources, from one generator."""

    def compute(self, components: int) -> Cost:
        """R_compute of a scene of so many components, in 32 bits."""
        return Cost(
            self.rest.wall + components * self.transform.wall,
            self.rest.cpu + components * self.transform.cpu,
        )


def yardstick(rows: int, columns: int, repeats: int) -> Yardstick:
    """The yardstick of a frame of that size."""
    workers = available_workers()
    scene = np.random.default_rng(0).random((rows, columns), dtype=np.float32)
    spectrum = scipy.fft.rfft2(scene, workers=workers)
    generator = np.random.Generator(np.random.Philox(0))

    def rest() -> None:
        for _ in range(3):
            scipy.fft.irfft2(spectrum, s=scene.shape, workers=workers)
        for _ in range(NOISE_SOURCES):
            generator.standard_normal((rows, columns), dtype=np.float32)

    transform = median_cost(lambda: scipy.fft.rfft2(scene, workers=workers), repeats)
    return Yardstick(transform, median_cost(rest, repeats))


def median_yardstick(found: Sequence[Yardstick]) -> Yardstick:
    """The median of several yardsticks."""
    return Yardstick(median([y.transform for y in found]), median([y.rest for y in found]))


@dataclass
class _Reading(Silent):
    """Adds up what reading files costs, to be taken off the rest."""

    wall: float = 0.0
    cpu: float = 0.0
    _since: Clocks | None = None

    def begin(self, stage: str) -> None:
        now = process_clocks()
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
    """Mixtures of the scene's components that were transformed."""

    def take(self, repeats: int = 1, warm: bool = False) -> Frames:
        """Takes so many more; where `warm`, after one that does not count."""
        for number in range(repeats + warm):
            cost, stages = self._one()
            if number or not warm:
                self.costs.append(cost)
                self.stages.append(stages)
        return self

    def _one(self) -> tuple[Cost, dict[str, float]]:
        reading, results = _Reading(), []

        def work() -> None:
            results.append(simulate(self.camera, watch=reading, shared=Shared()))
            results[0].render  # noqa: B018

        whole = run_cost(work)
        self.components = max(1, results[0].frame.spectrum.planes)
        stages = {k: v for k, v in results[0].stages.seconds.items() if k != READ}
        cost = Cost(max(whole.wall - reading.wall, 1e-9), max(whole.cpu - reading.cpu, 1e-9))
        return cost, stages

    @property
    def cost(self) -> Cost:
        """The median of all frames."""
        return median(self.costs)

    @property
    def shares(self) -> dict[str, float]:
        """Each stage's part of all stages by the wall clock, over all frames together."""
        sums = {name: sum(s[name] for s in self.stages) for name in self.stages[-1]}
        return {name: seconds / sum(sums.values()) for name, seconds in sums.items()}


def frames(camera: Camera, repeats: int) -> Frames:
    """Takes so many of a camera's frames, after one to warm up."""
    return Frames(camera).take(repeats, warm=True)
