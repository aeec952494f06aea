"""Measured seconds of a frame before a scene, with the effects of the plan and with all effects.

The two cameras take turns, so that a load of the machine slows both. The first run of each does not
count: it fills caches and imports libraries. The medians of the others are compared.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from vcam_cli.camera.camera import Camera
from vcam_cli.records import dataclass
from vcam_cli.simulation.plan import Decision
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import Result, simulate

TURNS = 5
"""Runs of each camera that count."""


@dataclass(frozen=True)
class SceneTimes:
    """Seconds of the runs of one camera before one scene."""

    auto: tuple[float, ...]
    """With the effects that the plan keeps [s]."""
    every: tuple[float, ...]
    """With all effects that the file does not switch off [s]."""

    @property
    def seconds_auto(self) -> float:
        """Median with the effects that the plan keeps [s]."""
        return statistics.median(self.auto)

    @property
    def seconds_all(self) -> float:
        """Median with all effects [s]."""
        return statistics.median(self.every)


def compute_frame(camera: Camera, workers: int, device: str = "cpu") -> Result:
    """Compute a frame from the scene to its render and metrics; no file is written.

    Parameters
    ----------
    camera : Camera
        The camera.
    workers : int
        Number of threads.
    device : str, optional
        As that of `simulate`.

    Returns
    -------
    Result
        The frame, its render and metrics computed.

    Raises
    ------
    BadInput
        For a camera that contradicts itself.
    CannotDo
        Where memory does not suffice.
    """
    result = simulate(camera, workers, shared=Shared(), device=device)
    if camera.output.render:
        _ = result.render
    _ = result.metrics
    return result


def with_every_effect(camera: Camera, decisions: Sequence[Decision]) -> Camera:
    """Return the camera with all effects on but those that its file switches off.

    Parameters
    ----------
    camera : Camera
        The camera.
    decisions : sequence of Decision
        Its plan before the same scene.
    """
    here = [d for d in decisions if d.by != "camera"]
    states = {d.name: "off" if (d.state, d.by) == ("off", "user") else "on" for d in here}
    return camera.model_copy(update={"effects": states})


def measure(
    camera: Camera, decisions: Sequence[Decision], workers: int, turns: int = TURNS
) -> SceneTimes:
    """Return the seconds of frames with the plan and with all effects, measured in turns.

    Parameters
    ----------
    camera : Camera
        The camera, with its scene.
    decisions : sequence of Decision
        Its plan.
    workers : int
        Number of threads, and of processors that the process may use meanwhile.
    turns : int
        Runs of each that count.

    Returns
    -------
    SceneTimes
        Seconds of the runs, by the clock [s].

    Raises
    ------
    BadInput
        For a camera that contradicts itself.
    CannotDo
        Where memory does not suffice.
    """
    cameras = camera, with_every_effect(camera, decisions)
    runs: tuple[list[float], list[float]] = [], []
    with _pinned(workers):
        for turn in range(turns + 1):
            # Turns alternate in their order: what the first run of a turn leaves in the caches
            # helps each camera as often as the other.
            for which in (0, 1) if turn % 2 else (1, 0):
                start = time.perf_counter()
                compute_frame(cameras[which], workers)
                if turn:
                    runs[which].append(time.perf_counter() - start)
    return SceneTimes(tuple(runs[0]), tuple(runs[1]))


@contextmanager
def _pinned(workers: int) -> Iterator[None]:
    """Let the process run on `workers` processors only, where the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, set(sorted(before)[:workers]))
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
