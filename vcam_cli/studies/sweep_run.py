"""A sweep that has something left to do: its points computed, everything written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

from vcam_cli.camera.camera import Camera
from vcam_cli.engine.lights import depends_on
from vcam_cli.engine.stages import Observer
from vcam_cli.files.points import POINTS, SweepFolder
from vcam_cli.files.report import hash_file
from vcam_cli.studies import (
    expectations,
    figures,
    figures_made,
    provenance,
    run_on,
    sweep_tables,
)
from vcam_cli.studies.outcome import FRAMES, Outcome, kept
from vcam_cli.studies.point_work import Job
from vcam_cli.studies.run_on import Verdict
from vcam_cli.studies.sweep_order import Order, Share
from vcam_cli.studies.sweep_points import LIBRARIES, Grid
from vcam_cli.studies.sweep_result import SweepResult


def swept(
    grid: Grid,
    sets: Sequence[str],
    place: Path,
    order: Order,
    watch: Observer,
    tell: Callable[[str], None],
) -> SweepResult:
    """Computes what is left and writes everything."""
    planner = figures.Planner(grid, sets)
    planned, expected = figures.plan(grid, planner), expectations.plan(grid, planner)
    hashes = {str(path): hash_file(path) for path in grid.inputs}
    for refused in grid.refused:
        tell(str(refused))
    with SweepFolder(place) as folder:
        folder.begin({"name": grid.study.model.name})
        run = _Run(grid, folder, order.fresh)
        run.look()
        if folder.corrupted:
            names = ", ".join(folder.corrupted[:3])
            tell(f"computed again, since corrupted: {POINTS}/{names}" + _more(folder.corrupted, 3))
        computed = _compute(run, order, watch, tell)
        found = tuple(sweep_tables.optima(grid, run.outcomes))
        verdicts = tuple(each.verdict(run.outcomes, found) for each in expected)
        result = sweep_tables.result(grid, place, run.outcomes, found, verdicts, computed)
        files = sweep_tables.writers(grid, run.outcomes, found)
        if verdicts:
            files["expected.csv"] = partial(expectations.write, verdicts)
        if not result.missing:
            made = figures_made.make(
                planned, grid, run.outcomes, found, folder, order.fresh, watch, tell
            )
            files |= made.writers
            result = replace(result, unmade=made.unmade)
        watch.begin("tables")
        asked = order.asked if run.lasting and not result.unmade else ""
        study = grid.study.model.model_dump(mode="json")
        record = result.record() | {"study": study, "hashes": hashes, "asked": asked}
        folder.finish(files, record, grid.inputs)
    return result


class _Run:
    """The points of a sweep, and what is known of them."""

    def __init__(self, grid: Grid, folder: SweepFolder, fresh: bool) -> None:
        self.outcomes: dict[str, Outcome] = {}
        self._folder, self._fresh = folder, fresh
        model = grid.study.model
        self._frames = tuple(FRAMES[what] for what in model.keep)
        self._points = {p.id: p for p in grid.points if p.camera is not None}
        self._metrics, self._keep = model.metrics, model.keep

    def look(self) -> None:
        """Reads what is finished."""
        if not self._fresh:
            for point in self._points:
                self._read(point)

    def _read(self, point: str) -> bool:
        """Whether a point is finished, or ended with an error that it would end with again."""
        content = self._folder.read(point, () if self._fresh else self._frames)
        if content is None:
            return False
        try:
            found = kept(point, content)
        except ValueError:
            return False
        self.outcomes[point] = found
        return found.final

    @property
    def lasting(self) -> bool:
        """Whether all is known, and nothing of it would end otherwise another time."""
        return all(p in self.outcomes and self.outcomes[p].final for p in self._points)

    def groups(self) -> list[list[Job]]:
        """All points, those of the same light together, in the study's order."""
        versions = {name: v for name, v in provenance.versions().items() if name in LIBRARIES}
        lights: dict[str, str] = {}
        groups: dict[str, list[Job]] = {}
        for point in self._points.values():
            camera = point.camera
            assert camera is not None
            if point.content not in lights:
                lights[point.content] = depends_on(camera)
            job = Job(point.id, _bare(camera), self._metrics, self._keep, versions)
            groups.setdefault(lights[point.content], []).append(job)
        return list(groups.values())

    def left(self, groups: list[list[Job]]) -> list[list[Job]]:
        """Of these points those that are not finished."""
        done = {point for point, found in self.outcomes.items() if found.final}
        return [[job for job in group if job.id not in done] for group in groups]

    def ask(self, job: Job) -> Verdict:
        """Whether a point is still to be computed."""
        if not self._folder.claim(job.id):
            return "later"
        if not self._fresh and self._read(job.id):
            self._folder.release(job.id)
            return "skip"
        return "go"

    def keep(self, outcome: Outcome) -> None:
        """Keeps what came of a point."""
        self._folder.write(outcome.id, outcome.content(), outcome.frames)
        self._folder.release(outcome.id)
        self.outcomes[outcome.id] = replace(outcome, frames={})


def _bare(camera: Camera) -> Camera:
    """A camera without what is only needed for messages, quick to send."""
    bare = camera.model_copy()
    bare._origin = None
    return bare


def _shared_out(groups: list[list[Job]], share: Share | None) -> list[list[Job]]:
    """The groups of a share: whole groups where there are enough, parts of them otherwise.

    They depend on the study alone: a point that is finished keeps its place.
    """
    if share is None:
        return groups
    if len(groups) >= share.of:
        return groups[share.number - 1 :: share.of]
    return [
        group[len(group) * (share.number - 1) // share.of : len(group) * share.number // share.of]
        for group in groups
    ]


def _compute(run: _Run, order: Order, watch: Observer, tell: Callable[[str], None]) -> int:
    """Computes what is left; the number of points computed."""
    if run.lasting:
        return 0
    groups = run.left(_shared_out(run.groups(), order.share))
    total = sum(len(group) for group in groups)
    if not total:
        return 0
    watch.begin("sweep")
    watch.step(0, total)
    computed, bugs = 0, 0
    outcomes: Iterator[Outcome]
    if order.scheduler is not None:
        outcomes = run_on.cluster(groups, run.ask, order.scheduler, tell)
    else:
        processes, threads = run_on.shares(order.workers, total)
        outcomes = (
            run_on.here(groups, run.ask, threads)
            if processes == 1
            else run_on.local(groups, run.ask, processes, threads)
        )
    with closing(outcomes):  # type: ignore[type-var]
        for outcome in outcomes:
            run.keep(outcome)
            computed += 1
            watch.step(computed, total)
            if outcome.trace and not bugs:
                tell(outcome.trace)
            bugs += bool(outcome.trace)
    return computed


def _more(names: Sequence[str], shown: int) -> str:
    return f" and {len(names) - shown} more" if len(names) > shown else ""
