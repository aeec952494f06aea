"""One point of a sweep, computed: wherever it runs, the same numbers come back."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass

from vcam_cli.camera.camera import Camera
from vcam_cli.engine.parallel import available_workers
from vcam_cli.errors import BadInput, CannotDo, one_line
from vcam_cli.files.png import write_png
from vcam_cli.files.points import as_bytes
from vcam_cli.studies import outputs
from vcam_cli.studies.outcome import FRAMES, Outcome, in_a_cell
from vcam_cli.studies.provenance import versions
from vcam_cli.studies.shared import Shared
from vcam_cli.studies.simulate import Result, simulate


@dataclass(frozen=True)
class Job:
    """A point to compute."""

    id: str
    camera: Camera
    """Without its origin, which only messages need."""
    metrics: tuple[str, ...]
    keep: tuple[str, ...]
    versions: dict[str, str]
    """Of the process that asks."""


def work(job: Job, threads: int, shared: Shared) -> Outcome:
    """Computes a point. What goes wrong is its outcome, but for an interrupt."""
    start = time.perf_counter()
    trace, final = "", True
    try:
        _same_versions(job)
        result = simulate(job.camera, threads, shared=shared)
        found = {name: value for name, value, _ in result.metrics}
        metrics = {name: found[name] for name in job.metrics}
        frames = {FRAMES[what]: _frame(what, result) for what in job.keep}
        return Outcome(job.id, metrics, seconds=time.perf_counter() - start, frames=frames)
    except BadInput as error:
        message = in_a_cell(error.problems)
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


def work_far(jobs: Sequence[Job], tasks: int) -> list[Outcome]:
    """Computes points in a process of a cluster that runs so many tasks at once."""
    threads = max(1, available_workers() // max(1, tasks))
    return [work(job, threads, _SHARED) for job in jobs]


def _same_versions(job: Job) -> None:
    own = versions()
    for name, wanted in job.versions.items():
        if own.get(name) != wanted:
            message = f"the worker has {name} {own.get(name)}, the sweep {wanted}"
            raise CannotDo(message, "install the same version on both")


def _frame(what: str, result: Result) -> bytes:
    if what == "raw":
        return as_bytes(FRAMES[what], lambda path: outputs.write_raw(result, path))
    return as_bytes(FRAMES[what], lambda path: write_png(path, result.render))
