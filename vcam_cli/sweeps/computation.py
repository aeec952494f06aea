"""A sweep that has something left to do: its points computed, everything written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, overload

from vcam_cli.camera.camera import Camera
from vcam_cli.files.in_use import POINTS
from vcam_cli.files.plots import in_formats
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.files.report import hash_file
from vcam_cli.progress import Observer
from vcam_cli.records import dataclass
from vcam_cli.simulation.output import provenance
from vcam_cli.sweeps import (
    expectations,
    figures,
    sweep_points,
    sweep_report,
    sweep_tables,
)
from vcam_cli.sweeps.execution import Execution
from vcam_cli.sweeps.point_effects import effect_differences, with_named_effects
from vcam_cli.sweeps.point_execution import (
    claim_point,
    compute,
    groups_of_share,
    keep_outcome,
)
from vcam_cli.sweeps.point_work import Job, Task
from vcam_cli.sweeps.study_cameras import StudyCameras
from vcam_cli.sweeps.sweep_file import StudyFile
from vcam_cli.sweeps.sweep_points import LIBRARIES, Grid, Point
from vcam_cli.sweeps.sweep_result import (
    FRAMES,
    Extras,
    Outcome,
    SweepResult,
    read_outcome,
)
from vcam_cli.sweeps.sweep_tables import Findings
from vcam_cli.sweeps.workers import Verdict


def computed_sweep(
    study: StudyFile,
    sets: Sequence[str],
    out: Path,
    execution: Execution,
    request: str,
    watch: Observer,
    tell: Callable[[str], None],
    extras: Extras,
) -> SweepResult:
    """Compute the missing points of a sweep and write everything; request: see `request_hash`."""
    grid = sweep_points.grid(study, sets, device=execution.device)
    cameras = StudyCameras(grid, sets)
    planned, expected = figures.plan(cameras), expectations.plan(cameras)
    hashes = {str(path): hash_file(path) for path in grid.inputs}
    for refused in grid.problems:
        tell(str(refused))
    whole = provenance.versions()
    versions = {name: whole[name] for name in LIBRARIES}
    with SweepFolder(out) as folder:
        former = folder.begin({"name": study.model.name, "versions": whole}, grid.hash)
        if changed := _changes(former.get("versions"), versions):
            tell(f"points of other code are left out, and computed again ({changed})")
        points = _Points(grid, folder, execution, versions)
        points.read_finished()
        if folder.corrupted:
            names, shown = list(folder.corrupted), ", ".join(list(folder.corrupted)[:3])
            tell(f"computed again, since corrupted: {POINTS}/{shown}" + _more_text(names, 3))
        computed = 0 if points.are_final else _compute(points, execution, watch, tell)
        if differences := effect_differences(grid.points):
            tell(differences)
        with folder.summarizing():
            points.read_missing()
            findings = Findings(grid, points.outcomes)
            compared = tuple(each.result(findings) for each in expected)
            result = sweep_tables.result(findings, out, compared, computed)
            files = sweep_tables.writers(findings) | figures.metric_plots(findings)
            if compared:
                files["expected.csv"] = partial(expectations.write, compared)
            if not result.missing:
                made, unmade = figures.writers(planned, findings, watch, tell)
                files, result = files | made, replace(result, unmade=unmade)
            watch.begin("tables")
            asked = request if points.are_final and not result.unmade else ""
            plain = study.model.model_dump(mode="json")
            record = result.record() | {"study": plain, "hashes": hashes, "asked": asked}
            record |= {"device": execution.device}
            report = partial(sweep_report.report_file, result) if extras.report else None
            files = in_formats(files, extras.formats)
            folder.finish(files, record, grid.inputs, report)
    return result


class _Points:
    """The points of a sweep, and their records."""

    def __init__(
        self, grid: Grid, folder: SweepFolder, execution: Execution, versions: dict[str, str]
    ) -> None:
        self.outcomes: dict[str, Outcome] = {}
        self._folder, self._fresh, self._versions = folder, execution.fresh, versions
        self._device = execution.device
        model = grid.study.model
        self._frames = tuple(FRAMES[what] for what in model.keep)
        self._points = {p.id: p for p in grid.points if p.id}
        self._metrics, self._keep = model.metrics, model.keep

    def read_finished(self) -> None:
        """Read the outcomes of points that are finished."""
        if not self._fresh:
            for point in self._points:
                self._read(point)

    def read_missing(self) -> None:
        """Read the outcomes of points that other processes have finished meanwhile."""
        for point in self._points:
            if point not in self.outcomes or not self.outcomes[point].final:
                self._read(point)

    def _read(self, point: str) -> bool:
        """Return whether a point is finished, or ended with an error that would come again."""
        content = self._folder.read(point, () if self._fresh else self._frames)
        if content is None:
            return False
        try:
            found = read_outcome(point, content)
        except ValueError:
            return False
        self.outcomes[point] = found
        return found.final

    @property
    def are_final(self) -> bool:
        """Whether all outcomes are known, and none would be another one at another time."""
        return all(p in self.outcomes and self.outcomes[p].final for p in self._points)

    def groups(self) -> list[list[Point]]:
        """Return all points in the study's order, those of the same light together."""
        groups: dict[str, list[Point]] = {}
        for point in self._points.values():
            groups.setdefault(point.light, []).append(point)
        return list(groups.values())

    def unfinished_jobs(self, groups: Sequence[Sequence[Point]]) -> list[_Jobs]:
        """Return the points of these groups that are not finished, to be computed."""
        final = {point for point, outcome in self.outcomes.items() if outcome.final}
        given = self._metrics, self._keep, self._versions, self._device
        left = ([point for point in group if point.id not in final] for group in groups)
        return [_Jobs(points, *given) for points in left]

    def ask(self, job: Task) -> Verdict:
        """Return whether a point is still to be computed, and claim it then."""
        return claim_point(self._folder, job.id, lambda: not self._fresh and self._read(job.id))

    def keep(self, outcome: Outcome) -> None:
        """Keep the outcome of a point; one that cannot be kept ends with an error."""
        self.outcomes[outcome.id] = keep_outcome(self._folder, outcome, self._versions["code"])


@dataclass(frozen=True)
class _Jobs(Sequence[Job]):
    """Points to compute; each has its camera made when it is read."""

    points: Sequence[Point]
    metrics: tuple[str, ...]
    keep: tuple[str, ...]
    versions: dict[str, str]
    device: str

    def __len__(self) -> int:
        return len(self.points)

    @overload
    def __getitem__(self, index: int) -> Job: ...
    @overload
    def __getitem__(self, index: slice) -> _Jobs: ...
    def __getitem__(self, index: int | slice) -> Job | _Jobs:
        if isinstance(index, slice):
            return replace(self, points=self.points[index])
        point = self.points[index]
        camera = point.camera
        assert camera is not None
        asked = self.metrics, self.keep, self.versions, self.device
        every = with_named_effects(camera, point.effects)
        return Job(point.id, _without_texts(every), *asked)


def _changes(former: Any, versions: dict[str, str]) -> str:
    """Return by what these versions differ from those of a folder's record; "" where they agree."""
    known = former if isinstance(former, dict) else {}
    return ", ".join(
        f"{name} {known.get(name, 'unknown')}, now {version}"
        for name, version in versions.items()
        if known.get(name) != version
    )


def _without_texts(camera: Camera) -> Camera:
    """Return a camera without what is only needed for messages, quick to send."""
    bare = camera.model_copy()
    bare._origin = None
    return bare


def _compute(
    points: _Points, execution: Execution, watch: Observer, tell: Callable[[str], None]
) -> int:
    """Compute the missing points of a share, and return the number of points computed."""
    groups = points.unfinished_jobs(groups_of_share(points.groups(), execution.share))
    return compute(groups, points, execution, watch, tell)


def _more_text(names: Sequence[str], shown: int) -> str:
    return f" and {len(names) - shown} more" if len(names) > shown else ""
