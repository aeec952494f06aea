"""A schedule study from its file to its tables: what `vcam schedule` does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from vcam_cli.arguments import (
    require_folder,
    require_name,
    require_overrides,
    require_whole,
)
from vcam_cli.arrays import Array
from vcam_cli.capture_schedules import (
    frames,
    online_loss,
    photocurrents,
    schedule_file,
    schedule_report,
    tables,
)
from vcam_cli.capture_schedules.fewest_captures import FewestCaptures, fewest_captures
from vcam_cli.capture_schedules.frames import Frames
from vcam_cli.capture_schedules.methods import (
    MethodResult,
    Task,
    find_schedules,
    study_constraints,
    study_sensor,
)
from vcam_cli.capture_schedules.model import MOST_CAPTURES, RANDOM_STARTS
from vcam_cli.capture_schedules.online_loss import OnlineLoss
from vcam_cli.capture_schedules.pdf_source import BINS
from vcam_cli.capture_schedules.photocurrents import Approximation
from vcam_cli.capture_schedules.schedule_file import ScheduleFile
from vcam_cli.capture_schedules.schedule_result import ApproximationStep, ScheduleResult
from vcam_cli.errors import BadInput
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.plots import in_formats
from vcam_cli.files.points_store import RECORD
from vcam_cli.floats import own_float_errors
from vcam_cli.progress import Callback, Observer, observer
from vcam_cli.scheduling.local_search import assignment_count
from vcam_cli.scheduling.pdf import Pdf

MOST_ASSIGNMENTS = 5000
"""Assignments of captures to segments that are searched: about a minute with one start."""
LEAST_SNR = 1e-200
"""Least mean SNR of a single capture: below it, products of what schedules are worth underflow."""


@own_float_errors
def schedule(
    study: str | Path,
    out: str | Path | None = None,
    sets: Sequence[str] = (),
    seed: int = 0,
    accuracy: str | None = None,
    workers: int | None = None,
    watch: Observer | Callback | None = None,
    tell: Callable[[str], None] | None = None,
    report: bool = False,
    formats: Sequence[str] = (),
) -> ScheduleResult:
    """Run a study of capture schedules, and write its tables and plots.

    Parameters
    ----------
    study : str or Path
        A file, or the name of a shipped study.
    out : str or Path, optional
        Output folder; by default out/NAME.
    sets : sequence of str
        Overrides "PATH=VALUE" of the study.
    seed : int
        Seed of random starts and simulated noise.
    accuracy, workers : optional
        Accuracy and threads of the camera whose photocurrents are wanted.
    watch : callable or Observer, optional
        Told of the progress.
    tell : callable, optional
        Gets messages.
    report : bool
        Whether to write report.html.
    formats : sequence of str
        Formats of plots beside PNG: "svg", "pdf".

    Raises
    ------
    BadInput
        If the study or a camera has mistakes.
    CannotDo
        If something cannot be computed or written.
    TypeError, ValueError
        For arguments that are none of these.
    """
    start = time.perf_counter()
    require_name(study, "study")
    require_overrides(sets)
    if out is not None:
        require_folder(out)
    require_whole(seed, "seed", 0)
    if workers is not None:
        require_whole(workers, "workers", 1)
    watch, tell = observer(watch), tell or (lambda _: None)
    read = schedule_file.read(study, sets, accuracy)
    _check_frames_camera(read)
    place = Path(out) if out is not None else Path("out") / read.model.name
    with OutputFolder(place, RECORD, read.inputs) as folder:
        result = _StudyRun(read, seed, workers, watch).result(place)
        for note in result.notes:
            tell(note)
        watch.begin("tables and plots")
        for name, write in in_formats(tables.writers(result), formats).items():
            write(folder.new(name))
        result = replace(result, frames=_take_frames(read, workers, watch))
        if result.frames is not None and (asked := read.model.frames) is not None:
            frames.write_frames(result.frames, asked, folder, read.model.name, formats)
        result = replace(result, seconds=time.perf_counter() - start)
        if report:
            schedule_report.write(result, folder)
        folder.finish(tables.record(result))
    return result


def _check_frames_camera(study: ScheduleFile) -> None:
    """Raise BadInput for what the pictures lack before any light is simulated."""
    if study.frames_camera is None:
        return
    try:
        frames.check_camera(study.frames_camera)
    except BadInput as error:
        raise error.with_places(study.locate) from None


def _take_frames(study: ScheduleFile, workers: int | None, watch: Observer) -> Frames | None:
    """Take the pictures that the study requests."""
    asked, camera = study.model.frames, study.frames_camera
    if asked is None or camera is None:
        return None
    try:
        return frames.take_frames(asked, camera, workers, watch)
    except BadInput as error:
        raise error.with_places(study.locate) from None


class _StudyRun:
    """The computation of a study."""

    def __init__(
        self, study: ScheduleFile, seed: int, workers: int | None, watch: Observer
    ) -> None:
        self.study, self.seed, self.workers, self.watch = study, seed, workers, watch
        self.model = study.model
        self.light: Array | None = None
        """(n,) photocurrents of the camera's pixels [e/s], where the pdf is of a camera."""
        self.pdf = study.known if study.known is not None else self._simulated_pdf()
        self.approximation = self._approximation(self.model.density[0])
        most = self.model.segments[-1] if self.model.segments else 0
        self.task = self._task(self.approximation.pdf(most) if self.approximation else None)

    def result(self, place: Path) -> ScheduleResult:
        """Compute the schedules and all else that the study requests."""
        self.watch.begin("schedules")
        found = self._method_results(self.task, self.model.methods)
        return ScheduleResult(
            study=self.study,
            out=place,
            task=self.task,
            approximation=self.approximation,
            found=found,
            steps=tuple(self._steps()),
            targets=self._targets(),
            online=self._online_losses(),
            notes=tuple(tables.notes(self.model, self.task, found)),
        )

    def _method_results(self, task: Task, methods: Sequence[str]) -> tuple[MethodResult, ...]:
        counts = self.model.counts
        return tuple(one for method in methods for one in find_schedules(task, method, counts))

    def _simulated_pdf(self) -> Pdf:
        assert self.study.camera is not None
        self.light = photocurrents.camera_photocurrents(self.study.camera, self.workers, self.watch)
        try:
            return photocurrents.photocurrent_histogram(self.light, self.model.pdf.bins or BINS)
        except ValueError as error:
            raise self._error(("pdf", "camera"), error) from None

    def _approximation(self, density: str) -> Approximation | None:
        """Return the pdf on its way to few segments, None where it is not to be approximated."""
        pixels = self.study.pixels if self.light is None else float(self.light.size)
        least = min(self.model.segments, default=0)
        try:
            return Approximation(self.pdf, least, pixels, density) if least else None
        except ValueError as error:
            raise self._error(("density",), error) from None

    def _task(self, plan: Pdf | None) -> Task:
        sensor, constraints = study_sensor(self.model), study_constraints(self.model)
        start = self.seed, self.model.starts
        try:
            task = Task(self.pdf, sensor, constraints, plan, *start)
            if (count := self.model.max_time_of) is not None:
                longest = float(task.exact_task.optimum([count])[count].times[-1])
                limited = replace(sensor, max_time=longest)
                task = Task(self.pdf, limited, constraints, plan, *start, bounded=sensor)
        except ValueError as error:
            raise self._error(("constraints", "frame_time"), error) from None
        self._check_room(task)
        self._check_assignments(task)
        if not task.single > LEAST_SNR:
            message = f"E[SNR] of a single capture is {task.single:.3g}: nothing to compare with"
            path = ("pdf",) if self.model.sensor is None else ("sensor",)
            raise self.study.error(path, message, "give it more light, or less noise")
        return task

    def _check_room(self, task: Task) -> None:
        """Raise BadInput where captures, as far apart as they must be, do not all fit."""
        count, most = max(self.model.counts), task.most_captures
        if count > most:
            gap, longest = task.constraints.read_interval, task.sensor.max_time
            message = (
                f"{count} captures, {gap:.3g} s apart, do not fit between {task.first:.3g} s, the"
                f" longest time of the brightest photocurrent, and {longest:.3g} s, the longest"
                " exposure"
            )
            limits = self.model.constraints
            key = "min_gap" if limits.min_gap >= limits.frame_time else "frame_time"
            remedy = f"request {most} at most, or make it smaller"
            raise self.study.error(("constraints", key), message, remedy)

    def _check_assignments(self, task: Task) -> None:
        """Raise BadInput where a search of all assignments would take too long."""
        if "sqp-assigned" not in self.model.methods:
            return
        most = assignment_count(task.plan, max(self.model.counts)) * self.model.starts
        if most > MOST_ASSIGNMENTS:
            message = f"sqp-assigned would search {most} assignments of captures to segments"
            path = ("methods", self.model.methods.index("sqp-assigned"))
            remedy = f"request fewer captures, segments or starts: at most {MOST_ASSIGNMENTS}"
            raise self.study.error(path, message, remedy)

    def _error(self, path: tuple[str, ...], error: ValueError) -> BadInput:
        message, _, remedy = str(error).partition("; ")
        return self.study.error(path, message, remedy)

    def _steps(self) -> list[ApproximationStep]:
        """Find schedules on coarser approximations."""
        if max(len(self.model.segments), len(self.model.density)) < 2:
            return []
        self.watch.begin("numbers of segments")
        planned = ("optimal", "heuristic", *RANDOM_STARTS, "weighted", "bracket")
        methods = [method for method in self.model.methods if method in planned]
        steps = []
        for density in self.model.density:
            approximation = self._approximation(density)
            assert approximation is not None
            for n in self.model.segments:
                plan = approximation.pdf(n)
                found = self._method_results(self._task(plan), methods)
                steps.append(ApproximationStep(density, n, plan, found))
        return steps

    def _targets(self) -> tuple[FewestCaptures, ...]:
        if not self.model.targets:
            return ()
        self.watch.begin("fewest captures")
        largest = self.task.reachable_gain
        return fewest_captures(self._optimal_gain, self.model.targets, MOST_CAPTURES, largest)

    def _optimal_gain(self, count: int) -> float:
        (found,) = find_schedules(self.task, "optimal", [count])
        return self.task.gain(found.schedule)

    def _online_losses(self) -> tuple[OnlineLoss, ...]:
        if not self.model.online:
            return ()
        self.watch.begin("online schedules")
        scene = self.pdf if self.light is None else self.light
        sensor, constraints = self.task.sensor, self.task.constraints
        try:
            losses = online_loss.online_losses(
                scene, sensor, self.model.counts, 1 + self.seed, constraints
            )
        except ValueError as error:
            raise self._error(("online",), error) from None
        return tuple(losses)
