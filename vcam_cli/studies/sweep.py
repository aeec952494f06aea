"""A sweep from its study to its tables: what `vcam sweep` does.

What is finished is kept at once, a file a point; tables and plots are made of what is kept and
what is known, in the study's order. So they are the same bytes however often the sweep was
stopped, and whoever computed its points.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.engine.lights import depends_on
from vcam_cli.engine.stages import Observer, Silent
from vcam_cli.errors import bad
from vcam_cli.files.points import POINTS, SweepFolder
from vcam_cli.files.report import hash_file
from vcam_cli.studies import (
    expectations,
    figures,
    figures_made,
    outputs,
    run_on,
    study_file,
    sweep_points,
    sweep_tables,
)
from vcam_cli.studies.point_work import FRAMES, Job, Outcome, kept
from vcam_cli.studies.run_on import Groups, Verdict
from vcam_cli.studies.sweep_points import LIBRARIES, Grid


@dataclass(frozen=True)
class Share:
    """One of several shares of the points."""

    number: int
    of: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.of:
            message = f"there is no share {self.number} of {self.of}"
            raise bad("--shard", message, f"write 1/{max(1, self.of)} to {self.of}/{self.of}")


@dataclass(frozen=True)
class SweepResult:
    """What a sweep found."""

    grid: Grid
    out: Path
    outcomes: dict[str, Outcome]
    """Of the points of which something is known, by hash."""
    optima: tuple[sweep_tables.Found, ...]
    verdicts: tuple[expectations.Verdict, ...]
    """Of what the study expected."""
    computed: int
    """Points computed now; the others were there."""
    seconds: float
    unmade: dict[str, str] = field(default_factory=dict)
    """Figures that could not be made, and why."""

    @property
    def points(self) -> list[dict[str, Any]]:
        """The rows of points.csv, with the names of its columns."""
        names = (*sweep_tables.columns(self.grid), *self.grid.study.model.metrics, "error")
        rows = sweep_tables.rows(self.grid, self.outcomes)
        return [dict(zip(names, row, strict=True)) for row in rows]

    @property
    def failed(self) -> int:
        """Rows with an error."""
        return sum(1 for row in sweep_tables.rows(self.grid, self.outcomes) if row[-1])

    @property
    def missing(self) -> int:
        """Points of which nothing is known yet: those of other shares."""
        return sum(1 for p in self.grid.points if p.id and p.id not in self.outcomes)

    @property
    def exit_code(self) -> int:
        """0; 4 where some points or figures failed, 2 where every point was refused."""
        wrong = [
            not p.id or (p.id in self.outcomes and self._is_bad_input(self.outcomes[p.id]))
            for p in self.grid.points
        ]
        return 2 if all(wrong) else 4 if self.failed or self.unmade else 0

    @staticmethod
    def _is_bad_input(outcome: Outcome) -> bool:
        return bool(outcome.error) and outcome.final

    def summary(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "name": self.grid.study.model.name,
            "out": str(self.out),
            "points": len(self.grid.points),
            "computed": self.computed,
            "failed": self.failed,
            "missing": self.missing,
            "optimum": [_plain(f) for f in self.optima],
            "missed": [v.expected.name for v in self.verdicts if v.word == "missed"],
            "seconds": self.seconds,
            "unmade": self.unmade,
        }


def sweep(
    study: str | Path,
    out: str | Path | None = None,
    sets: Sequence[str] = (),
    workers: int | None = None,
    scheduler: str | None = None,
    shard: tuple[int, int] | None = None,
    fresh: bool = False,
    watch: Observer | None = None,
    tell: Callable[[str], None] | None = None,
) -> SweepResult:
    """Runs a sweep study, or what is left of it, and writes its tables and plots.

    study: a file, or the name of a shipped study; out: folder, default out/NAME; sets: overrides
    "PATH=VALUE" laid over every camera; workers: processes, default all processors; scheduler:
    address of a Dask scheduler in their place; shard: (i, n), the i-th of n shares of the points;
    fresh: computes all of them again. watch is told of the progress, tell gets messages. Raises
    BadInput (wrong study, or no camera of it is valid) and CannotDo (disk, scheduler).
    """
    start = time.perf_counter()
    share = Share(*shard) if shard else None
    watch, tell = watch or Silent(), tell or (lambda _: None)
    watch.begin("points")
    grid = sweep_points.grid(study_file.read(study), sets)
    planner = figures.Planner(grid, sets)
    planned, expected = figures.plan(grid, planner), expectations.plan(grid, planner)
    for problem in grid.refused:
        tell(str(problem))
    place = Path(out) if out is not None else Path("out") / grid.study.model.name
    with SweepFolder(place) as folder:
        folder.begin({"name": grid.study.model.name})
        run = _Run(grid, folder, fresh)
        run.look()
        if folder.corrupted:
            names = ", ".join(folder.corrupted[:3])
            tell(f"computed again, since corrupted: {POINTS}/{names}" + _more(folder.corrupted, 3))
        groups = run.left(_shared_out(run.groups(), share))
        computed = _compute(run, groups, workers, scheduler, watch, tell)
        found = tuple(sweep_tables.optima(grid, run.outcomes))
        verdicts = tuple(each.verdict(run.outcomes, found) for each in expected)
        seconds = time.perf_counter() - start
        result = SweepResult(grid, place, run.outcomes, found, verdicts, computed, seconds)
        files = sweep_tables.writers(grid, run.outcomes, found)
        if verdicts:
            files["expected.csv"] = partial(expectations.write, verdicts)
        if not result.missing:
            made = figures_made.make(planned, grid, run.outcomes, found, folder, fresh, watch, tell)
            files |= made.writers
            result = replace(result, unmade=made.unmade)
        watch.begin("tables")
        folder.finish(files, _record(result), grid.inputs)
    return replace(result, seconds=time.perf_counter() - start)


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

    def groups(self) -> list[list[Job]]:
        """All points, those of the same light together, in the study's order."""
        versions = {name: v for name, v in outputs.versions().items() if name in LIBRARIES}
        lights: dict[str, str] = {}
        groups: dict[str, list[Job]] = {}
        for point in self._points.values():
            camera = point.camera
            assert camera is not None
            if point.content not in lights:
                lights[point.content] = _light(camera)
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


def _light(camera: Camera) -> str:
    """What cameras of the same light have in common, the level of saturation included."""
    form = camera.model_dump(mode="json")
    level = [form["exposure"], form["adc"], form["pixel"]["readout"].get("gain")]
    return f"{depends_on(camera)} {level}"


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


def _compute(
    run: _Run,
    groups: Groups,
    workers: int | None,
    scheduler: str | None,
    watch: Observer,
    tell: Callable[[str], None],
) -> int:
    """Computes what is left; the number of points computed."""
    total = sum(len(group) for group in groups)
    if not total:
        return 0
    watch.begin("sweep")
    watch.step(0, total)
    computed, bugs = 0, 0
    outcomes: Iterator[Outcome]
    if scheduler is not None:
        outcomes = run_on.cluster(groups, run.ask, scheduler, tell)
    else:
        processes, threads = run_on.shares(workers, total)
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


def _record(result: SweepResult) -> dict[str, Any]:
    """What study.json says, but for the names of the files."""
    study = result.grid.study
    return {
        "name": study.model.name,
        "study": study.model.model_dump(mode="json"),
        "points": [point.id for point in result.grid.points],
        "failed": result.failed,
        "missing": result.missing,
        "unmade": result.unmade,
        "optimum": [_plain(f) for f in result.optima],
        "hashes": {str(path): hash_file(path) for path in result.grid.inputs},
        "versions": outputs.versions(),
    }


def _plain(found: sweep_tables.Found) -> dict[str, Any]:
    """An optimum with what is not known as null."""
    row = dict(zip(sweep_tables.OPTIMUM, found.row, strict=True))
    known = {k: None if v == "" and k in ("low", "high") else v for k, v in row.items()}
    return known | {"edge": found.edge}


def _more(names: Sequence[str], shown: int) -> str:
    return f" and {len(names) - shown} more" if len(names) > shown else ""
