"""A schedule study from its file to its tables: what `vcam schedule` does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from vcam_cli.camera.pdf_source import BINS
from vcam_cli.camera.schedule_study import MOST_CAPTURES
from vcam_cli.engine.stages import Observer, Silent
from vcam_cli.errors import BadInput
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.points import RECORD
from vcam_cli.files.report import hash_file
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.scheduling.targets import Fewest, fewest
from vcam_cli.studies import (
    online,
    photocurrents,
    provenance,
    schedule_file,
    schedule_frames,
    schedule_tables,
)
from vcam_cli.studies.photocurrents import Approximation
from vcam_cli.studies.schedule_file import ScheduleFile
from vcam_cli.studies.schedule_frames import Frames
from vcam_cli.studies.schedule_methods import (
    Found,
    Task,
    constraints_of,
    find,
    sensor_of,
)
from vcam_cli.studies.schedule_notes import notes

LEAST_SNR = 1e-200
"""Of a single capture: with less, products of what schedules are worth vanish in rounding."""


@dataclass(frozen=True)
class Step:
    """A pdf approximated by so many segments, and what was found on it."""

    segments: int
    plan: Pdf
    found: tuple[Found, ...]


@dataclass(frozen=True)
class ScheduleResult:
    """The schedules of a study, and what they are worth."""

    study: ScheduleFile
    out: Path
    task: Task
    """The pdf, the sensor and their bounds."""
    approximation: Approximation | None
    """Of the pdf, where the study asks for it."""
    found: tuple[Found, ...]
    """Of all methods and numbers of captures, in the study's order."""
    steps: tuple[Step, ...] = ()
    """Of the approximations, where the study asks for several."""
    targets: tuple[Fewest, ...] = ()
    """The fewest captures that reach each gain that the study names."""
    online: tuple[online.Row, ...] = ()
    """What choosing times while capturing loses, where the study asks for it."""
    frames: Frames | None = None
    """Pictures taken with several schedules, where the study asks for them."""
    notes: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def summary_rows(self) -> list[dict[str, Any]]:
        """The rows of summary.csv, with the names of its columns; None where a cell is empty."""
        return schedule_tables.summary_dicts(self.task, self.found)

    @property
    def schedule_rows(self) -> list[dict[str, Any]]:
        """The rows of schedule.csv, with the names of its columns."""
        columns = schedule_tables.schedule_columns(self.study.model)
        rows = schedule_tables.schedule_rows(self.study.model, self.found)
        return [dict(zip(columns, row, strict=True)) for row in rows]

    def times(self, method: str, count: int) -> NDArray:
        """Capture times (N,) [s]; without a sensor in 1 / the pdf's unit. Raises KeyError."""
        for one in self.found:
            if (one.method, one.count) == (method, count):
                return one.schedule.times
        raise KeyError((method, count))

    def summary(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "name": self.study.model.name,
            "out": str(self.out),
            "summary": self.summary_rows,
            "schedule": self.schedule_rows,
            "targets": [vars(target) for target in self.targets],
            **({"frames": list(self.frames.dicts())} if self.frames else {}),
            "notes": list(self.notes),
            "seconds": self.seconds,
        }


def schedule(
    study: str | Path,
    out: str | Path | None = None,
    sets: Sequence[str] = (),
    seed: int = 0,
    accuracy: str | None = None,
    workers: int | None = None,
    watch: Observer | None = None,
    tell: Callable[[str], None] | None = None,
) -> ScheduleResult:
    """Runs a study of capture schedules, and writes its tables and plots.

    study: a file, or the name of a shipped study; out: folder, default out/NAME; sets: overrides
    "PATH=VALUE" of the study; seed: of random starts and simulated noise; accuracy, workers: of
    the camera whose photocurrents are wanted. watch is told of the progress, tell gets messages.
    Raises BadInput and CannotDo.
    """
    start = time.perf_counter()
    watch, tell = watch or Silent(), tell or (lambda _: None)
    read = schedule_file.read(study, sets, accuracy)
    _check(read)
    place = Path(out) if out is not None else Path("out") / read.model.name
    with OutputFolder(place, RECORD, read.inputs) as folder:
        run = _Run(read, seed, workers, watch)
        result = run.result(place)
        for note in result.notes:
            tell(note)
        watch.begin("tables and plots")
        for name, write in schedule_tables.writers(result).items():
            write(folder.new(name))
        result = replace(result, frames=_frames(read, folder, workers, watch))
        result = replace(result, seconds=time.perf_counter() - start)
        folder.finish(_record(result))
    return result


def _check(study: ScheduleFile) -> None:
    """Says what the pictures lack before any light is simulated."""
    if study.pictured is None:
        return
    try:
        schedule_frames.check(study.pictured)
    except BadInput as error:
        raise error.located(study.locate) from None


def _frames(
    study: ScheduleFile, folder: OutputFolder, workers: int | None, watch: Observer
) -> Frames | None:
    """Takes and writes the pictures that the study asks for."""
    asked, camera = study.model.frames, study.pictured
    if asked is None or camera is None:
        return None
    try:
        return schedule_frames.make(asked, camera, folder, study.model.name, workers, watch)
    except BadInput as error:
        raise error.located(study.locate) from None


class _Run:
    """The work of a study."""

    def __init__(
        self, study: ScheduleFile, seed: int, workers: int | None, watch: Observer
    ) -> None:
        self.study, self.seed, self.workers, self.watch = study, seed, workers, watch
        self.model = study.model
        self.light: NDArray | None = None
        """(n,) photocurrents of the camera's pixels [e/s], where the pdf is of a camera."""
        self.pdf = study.known if study.known is not None else self._simulated()
        self.approximation = self._approximation()
        self.task = self._task(self._plan(self.model.segments[-1] if self.model.segments else 0))

    def result(self, place: Path) -> ScheduleResult:
        self.watch.begin("schedules")
        found = [
            one for method in self.model.methods for one in find(self.task, method, self.counts)
        ]
        return ScheduleResult(
            study=self.study,
            out=place,
            task=self.task,
            approximation=self.approximation,
            found=tuple(found),
            steps=tuple(self._steps()),
            targets=self._targets(),
            online=self._online(),
            notes=tuple(notes(self.model, self.task, found)),
        )

    @property
    def counts(self) -> tuple[int, ...]:
        return self.model.counts

    def _simulated(self) -> Pdf:
        assert self.study.camera is not None
        self.light = photocurrents.photocurrents(self.study.camera, self.workers, self.watch)
        try:
            return photocurrents.histogram(self.light, self.model.pdf.bins or BINS)
        except ValueError as error:
            raise self._wrong(("pdf", "camera"), error) from None

    def _approximation(self) -> Approximation | None:
        pixels = self.study.pixels if self.light is None else float(self.light.size)
        least = min(self.model.segments, default=0)
        return Approximation(self.pdf, least, pixels) if least else None

    def _plan(self, segments: int) -> Pdf | None:
        """The pdf approximated, None where it is not to be."""
        return self.approximation.pdf(segments) if self.approximation else None

    def _task(self, plan: Pdf | None) -> Task:
        sensor, constraints = sensor_of(self.model), constraints_of(self.model)
        try:
            task = Task(self.pdf, sensor, constraints, plan, self.seed)
        except ValueError as error:
            raise self._wrong(("constraints", "frame_time"), error) from None
        if not task.single > LEAST_SNR:
            message = f"E[SNR] of a single capture is {task.single:.3g}: nothing to compare with"
            path = ("pdf",) if self.model.sensor is None else ("sensor",)
            raise self.study.wrong(path, message, "give it more light, or less noise")
        return task

    def _wrong(self, path: tuple[str, ...], error: ValueError) -> BadInput:
        message, _, remedy = str(error).partition("; ")
        return self.study.wrong(path, message, remedy)

    def _steps(self) -> list[Step]:
        """What schedules are worth that are found on coarser approximations."""
        if len(self.model.segments) < 2:
            return []
        self.watch.begin("numbers of segments")
        methods = [
            m for m in self.model.methods if m in ("optimal", "heuristic", "sqp", "weighted")
        ]
        steps = []
        for n in self.model.segments:
            plan = self._plan(n)
            assert plan is not None
            task = self._task(plan)
            found = [one for method in methods for one in find(task, method, self.counts)]
            steps.append(Step(n, plan, tuple(found)))
        return steps

    def _targets(self) -> tuple[Fewest, ...]:
        if not self.model.targets:
            return ()
        self.watch.begin("fewest captures")
        bound = self.task.best / self.task.single
        return fewest(self._gain, self.model.targets, MOST_CAPTURES, bound)

    def _gain(self, count: int) -> float:
        (found,) = find(self.task, "optimal", [count])
        return found.schedule.expected_snr / self.task.single

    def _online(self) -> tuple[online.Row, ...]:
        """What each way to choose times while capturing loses, where the study asks for it."""
        if not self.model.online:
            return ()
        self.watch.begin("online schedules")
        scene = self.pdf if self.light is None else self.light
        sensor, constraints = self.task.sensor, self.task.constraints
        try:
            return tuple(online.online(scene, sensor, self.counts, 1 + self.seed, constraints))
        except ValueError as error:
            raise self._wrong(("online",), error) from None


def _record(result: ScheduleResult) -> dict[str, Any]:
    """What study.json says, but for the names of the files."""
    return {
        **result.summary(),
        "study": result.study.model.model_dump(mode="json"),
        "hashes": {str(path): hash_file(path) for path in result.study.inputs},
        "versions": provenance.versions(),
    }
