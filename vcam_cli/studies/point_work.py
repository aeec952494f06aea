"""One point of a sweep, computed: wherever it runs, the same numbers come back."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, field

from vcam_cli.camera.camera import Camera
from vcam_cli.engine.parallel import available_workers
from vcam_cli.errors import BadInput, CannotDo, Problem, dotted, one_line
from vcam_cli.files.png import write_png
from vcam_cli.files.points import as_bytes
from vcam_cli.studies import outputs
from vcam_cli.studies.shared import Shared
from vcam_cli.studies.simulate import Result, simulate

FRAMES = {"raw": "raw.exr", "render": "render.png"}
"""What may be kept of a point -> its file's name."""


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


@dataclass(frozen=True)
class Outcome:
    """What came of a point."""

    id: str
    metrics: dict[str, float] = field(default_factory=dict)
    error: str = ""
    final: bool = True
    """Whether another try would end alike; a machine may have more memory tomorrow."""
    seconds: float = 0.0
    frames: dict[str, bytes] = field(default_factory=dict)
    """Name of a file -> its bytes."""
    trace: str = ""
    """Of a bug."""

    def content(self) -> dict:
        """As it is kept."""
        names = ("metrics", "error", "final", "seconds")
        return {name: getattr(self, name) for name in names}


def kept(point: str, content: dict) -> Outcome:
    """The outcome of what was kept of a point. Raises ValueError where it is none."""
    try:
        return Outcome(
            point,
            {str(name): float(value) for name, value in content["metrics"].items()},
            str(content["error"]),
            bool(content["final"]),
            float(content["seconds"]),
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(str(error)) from None


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


def in_a_cell(problems: Sequence[Problem]) -> str:
    """Problems as the column `error` has them: without places, which depend on the machine."""
    texts = []
    for p in problems:
        text = ": ".join(part for part in (dotted(p.path), p.message) if part)
        texts.append(one_line(f"{text}; {p.remedy}" if p.remedy else text))
    return " | ".join(dict.fromkeys(texts))


_SHARED = Shared()


def work_far(jobs: Sequence[Job], tasks: int) -> list[Outcome]:
    """Computes points in a process of a cluster that runs so many tasks at once."""
    threads = max(1, available_workers() // max(1, tasks))
    return [work(job, threads, _SHARED) for job in jobs]


def _same_versions(job: Job) -> None:
    own = outputs.versions()
    for name, wanted in job.versions.items():
        if own.get(name) != wanted:
            message = f"the worker has {name} {own.get(name)}, the sweep {wanted}"
            raise CannotDo(message, "install the same version on both")


def _frame(what: str, result: Result) -> bytes:
    if what == "raw":
        return as_bytes(FRAMES[what], lambda path: outputs.write_raw(result, path))
    return as_bytes(FRAMES[what], lambda path: write_png(path, result.render))
