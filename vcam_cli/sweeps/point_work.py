"""Computing a point of a sweep, or a frame of a data set: wherever it runs, the same comes back."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from typing import Protocol

from vcam_cli.camera.camera import Camera
from vcam_cli.errors import BadInput, CannotDo, one_line
from vcam_cli.files.atomic import written_bytes
from vcam_cli.files.images.png import write_png
from vcam_cli.floats import own_float_errors
from vcam_cli.interrupts import restore_interrupt
from vcam_cli.parallel import available_workers
from vcam_cli.records import dataclass
from vcam_cli.simulation.output import outputs
from vcam_cli.simulation.output.provenance import versions
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import Result, simulate
from vcam_cli.sweeps.sweep_result import FRAMES, Outcome, error_cell


class Task(Protocol):
    """What a worker computes."""

    @property
    def id(self) -> str:
        """The hash of all that its numbers depend on."""

    @property
    def versions(self) -> dict[str, str]:
        """The hash of the code, and the versions of the libraries, of the process that asks."""

    def compute(self, threads: int, shared: Shared) -> tuple[dict[str, float], dict[str, bytes]]:
        """Return its numbers, and the files that are kept of it."""


@dataclass(frozen=True)
class Job:
    """A point to compute."""

    id: str
    camera: Camera
    """The camera, with the effects that it simulates and without its origin, for messages alone."""
    metrics: tuple[str, ...]
    """The names of the metrics that are wanted."""
    keep: tuple[str, ...]
    """The frames that are kept, see `FRAMES`."""
    versions: dict[str, str]
    """The hash of the code, and the versions of the libraries, of the process that asks."""
    device: str = "cpu"
    """Where noise and readout are computed."""

    def compute(self, threads: int, shared: Shared) -> tuple[dict[str, float], dict[str, bytes]]:
        """Return the metrics of the point, and the files that are kept of it."""
        camera = self.camera
        if "render" not in self.keep:
            output = camera.output.model_copy(update={"render": None})
            camera = camera.model_copy(update={"output": output})
        result = simulate(camera, threads, shared=shared, device=self.device)
        metrics = {name: result.metrics[name] for name in self.metrics}
        return metrics, {FRAMES[what]: _frame(what, result) for what in self.keep}


@own_float_errors
def compute_points(jobs: Sequence[Task], threads: int, shared: Shared) -> list[Outcome]:
    """Return the outcomes of points of one study; an error is one, an interrupt is not.

    That this process has the code of the one that asks is looked up before the first of them and
    behind the last of every batch: modules are loaded where they are first needed.
    """
    try:
        if [jobs[0].versions] != _AGREED:
            _check_versions(jobs[0])
        outcomes = [_compute_point(job, threads, shared) for job in jobs]
        _check_versions(jobs[0])
    except CannotDo as error:
        return [Outcome(job.id, error=str(error), final=False) for job in jobs]
    return outcomes


def _compute_point(job: Task, threads: int, shared: Shared) -> Outcome:
    start = time.perf_counter()
    trace, final = "", True
    try:
        with restore_interrupt():
            metrics, frames = job.compute(threads, shared)
        return Outcome(job.id, metrics, seconds=time.perf_counter() - start, frames=frames)
    except BadInput as error:
        message = error_cell(error.problems)
    except CannotDo as error:
        message, final = str(error), False
    except MemoryError:
        message, final = "not enough memory; use a smaller array, or fewer workers", False
    except Exception as error:
        message, final = one_line(f"{type(error).__name__}: {error}"), False
        trace = traceback.format_exc()
    seconds = time.perf_counter() - start
    return Outcome(job.id, error=message, final=final, seconds=seconds, trace=trace)


_SHARED = Shared()


def compute_on_cluster(jobs: Sequence[Task], tasks: int) -> list[Outcome]:
    """Compute points in a process of a cluster that runs `tasks` tasks at once."""
    return compute_points(jobs, max(1, available_workers() // max(1, tasks)), _SHARED)


def _check_versions(job: Task) -> None:
    """Raise CannotDo where this process has other code or versions than the one that asks."""
    _AGREED.clear()
    own = versions()
    for name, wanted in job.versions.items():
        if own.get(name) != wanted:
            message = f"the worker has {name} {own.get(name)}, the sweep {wanted}"
            raise CannotDo(message, "install the same version on both")
    _AGREED[:] = [job.versions]


_AGREED: list[dict[str, str]] = []
"""Versions that this process had behind the last batch: a look takes 3 ms."""


def _frame(what: str, result: Result) -> bytes:
    """Return the file of a frame."""
    if what == "raw":
        return written_bytes(FRAMES[what], lambda path: outputs.write_raw(result, path))
    return written_bytes(FRAMES[what], lambda path: write_png(path, result.render))
