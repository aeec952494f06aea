"""Who computes the points of a sweep, or the frames of a data set, and how they are kept.

A share is identified by its number; workers are processes of this machine or of a cluster.
Finished points are kept at once, so that an interrupted study continues.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Protocol, TypeVar

from vcam_cli.errors import BadInput
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.progress import Observer
from vcam_cli.sweeps import workers
from vcam_cli.sweeps.execution import Execution, Share
from vcam_cli.sweeps.point_work import Task
from vcam_cli.sweeps.sweep_result import Outcome, error_cell
from vcam_cli.sweeps.workers import Groups, Verdict

Item = TypeVar("Item")


class Points(Protocol):
    """The points that are computed, and where they are kept."""

    def ask(self, job: Task) -> Verdict:
        """Return whether a point is still to be computed, and claim it then."""

    def keep(self, outcome: Outcome) -> None:
        """Keep the outcome of a point."""


def claim_point(folder: SweepFolder, point: str, is_finished: Callable[[], bool]) -> Verdict:
    """Claim a point and return that it is to be computed, or why it is not."""
    if not folder.claim(point):
        return "claimed"
    if is_finished():
        folder.release(point)
        return "finished"
    return "compute"


def keep_outcome(folder: SweepFolder, outcome: Outcome, code: str) -> Outcome:
    """Keep the outcome of a point; one that cannot be kept ends with an error.

    code: hash of the code that computed it. Return it without its frames.
    """
    try:
        folder.write(outcome.id, outcome.content() | {"code": code}, outcome.frames)
    except BadInput as error:
        outcome = Outcome(outcome.id, error=error_cell(error.problems), final=False)
    folder.release(outcome.id)
    return replace(outcome, frames={})


def groups_of_share(
    groups: Sequence[Sequence[Item]], share: Share | None
) -> Sequence[Sequence[Item]]:
    """Return the groups of a share: whole groups where there are enough, parts of them otherwise.

    They depend on the study alone: a point that is finished keeps its place.
    """
    if share is None:
        return groups
    last, count = share.number, share.count
    if len(groups) >= count:
        return groups[last - 1 :: count]
    ends = [(len(g) * (last - 1) // count, len(g) * last // count) for g in groups]
    return [group[start:end] for group, (start, end) in zip(groups, ends, strict=True)]


def compute(
    groups: Groups,
    points: Points,
    execution: Execution,
    watch: Observer,
    tell: Callable[[str], None],
    stage: str = "sweep",
    sizes: Mapping[str, int] | None = None,
) -> int:
    """Compute the points of these groups, and return their number.

    stage: name of the work in the progress; sizes: id of a point -> how many it counts for, where
    that is not 1.
    """
    count = sum(len(group) for group in groups)
    if not count:
        return 0
    total = count if sizes is None else sum(sizes.values())
    watch.begin(stage)
    watch.step(0, total)
    computed, has_told = 0, False
    outcomes = _outcomes(groups, count, points, execution, tell)
    with closing(outcomes):  # type: ignore[type-var]
        for outcome in outcomes:
            points.keep(outcome)
            computed += 1 if sizes is None else sizes[outcome.id]
            watch.step(computed, total)
            if outcome.trace and not has_told:
                tell(outcome.trace)
                has_told = True
    return computed


def _outcomes(
    groups: Groups,
    total: int,
    points: Points,
    execution: Execution,
    tell: Callable[[str], None],
) -> Iterator[Outcome]:
    """Yield the outcomes of points as they are computed, on a cluster or on this machine."""
    if execution.scheduler is not None:
        return workers.compute_on_dask(groups, points.ask, execution.scheduler, tell)
    processes, threads = workers.processes_and_threads(execution.workers, total)
    if processes == 1:
        return workers.compute_here(groups, points.ask, threads)
    return workers.compute_in_processes(groups, points.ask, processes, threads)
