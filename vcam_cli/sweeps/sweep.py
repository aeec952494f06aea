"""A sweep from its study to its tables: what `vcam sweep` does.

What is finished is kept at once, a file a point; tables and plots are made of what is kept and
what is known, in the study's order. So they are the same bytes however often the sweep was
stopped, and whoever computed its points.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlsplit

from vcam_cli.arguments import (
    brief,
    require_folder,
    require_name,
    require_overrides,
    require_whole,
)
from vcam_cli.camera.expectations import notes
from vcam_cli.config.study_overrides import split_sets
from vcam_cli.errors import bad
from vcam_cli.floats import own_float_errors
from vcam_cli.progress import Callback, Observer, observer
from vcam_cli.sweeps import sweep_file
from vcam_cli.sweeps.limits import missed_limits, study_limits
from vcam_cli.sweeps.model import Sweep
from vcam_cli.sweeps.sweep_result import Extras, SweepResult, finished_result, request_hash


@dataclass(frozen=True)
class Share:
    """One of several shares of the points."""

    number: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count:
            message = f"there is no share {self.number} of {self.count}"
            raise bad(
                "--shard", message, f"write 1/{max(1, self.count)} to {self.count}/{self.count}"
            )


@dataclass(frozen=True)
class Execution:
    """Which points of a sweep are computed, and by whom."""

    share: Share | None = None
    workers: int | None = None
    """Processes; None for one a core."""
    scheduler: str | None = None
    """The address of a Dask scheduler that computes in their place."""
    fresh: bool = False
    """Whether finished points are computed again."""

    def __post_init__(self) -> None:
        if self.scheduler is not None:
            _check_address(self.scheduler)


def _check_arguments(
    study: object, out: object, sets: object, workers: object, shard: object
) -> None:
    """Raise TypeError or ValueError for arguments of Python callers that are of no use."""
    require_name(study, "study")
    require_overrides(sets)
    if out is not None:
        require_folder(out)
    if workers is not None:
        require_whole(workers, "workers", 1)
    if shard is not None:
        if not isinstance(shard, tuple | list) or len(shard) != 2:
            raise TypeError(f"shard={brief(shard)} is no share; write shard=(1, 4)")
        for part in shard:
            require_whole(part, "share", -sys.maxsize)


def _check_address(address: str) -> None:
    """Raise BadInput for what is no address of a scheduler, before Dask sees it."""
    try:
        parts = urlsplit(address if "://" in address else f"tcp://{address}")
        is_address = parts.scheme in ("tcp", "tls") and parts.hostname and parts.port
    except ValueError:
        is_address = False
    rest = address.rpartition("://")[2]
    if not is_address or not rest.isprintable() or set(rest) & set(" /?#@\\"):
        message = f"{address!a} is no address of a Dask scheduler"
        raise bad("--scheduler", message, "write tcp://HOST:8786")


@own_float_errors
def sweep(
    study: str | Path,
    out: str | Path | None = None,
    sets: Sequence[str] = (),
    workers: int | None = None,
    scheduler: str | None = None,
    shard: tuple[int, int] | None = None,
    fresh: bool = False,
    watch: Observer | Callback | None = None,
    tell: Callable[[str], None] | None = None,
    report: bool = False,
    formats: Sequence[str] = (),
    expect: Sequence[str] = (),
) -> SweepResult:
    """Run a sweep study, or what is left of it, and write its tables and plots.

    study: a file, or the name of a shipped study; out: folder, default out/NAME; sets: overrides
    "PATH=VALUE" of the study, and of every camera where PATH begins with no key of a study;
    workers: processes, default all processors; scheduler: address of a Dask scheduler in their
    place; shard: (i, n), the i-th of n shares of the points; fresh: computes all of them again;
    watch follows the progress, as that of `simulate` does; tell gets messages; report: also writes
    report.html; formats: "svg", "pdf" of plots, beside PNG; expect: limits "METRIC >= VALUE" that
    every point keeps, or "optimum <= 7 um": see `missed` of the result. Raises BadInput (wrong
    study, or no camera of it is valid), CannotDo (disk, scheduler), and TypeError or ValueError for
    arguments that are none of these.
    """
    start = time.perf_counter()
    _check_arguments(study, out, sets, workers, shard)
    execution = Execution(Share(*shard) if shard else None, workers, scheduler, fresh)
    watch, tell = observer(watch), tell or (lambda _: None)
    watch.begin("points")
    own, sets = split_sets(sets, Sweep.model_fields)
    file = sweep_file.read(study, sets=own)
    place = Path(out) if out is not None else Path("out") / file.model.name
    limits = study_limits(file, expect)
    expected = [limit.metric for limit in limits]
    expected += [item.quantity for item in file.model.expect.values()]
    for note in notes(expected):
        tell(note)
    extras = Extras(report, tuple(formats))
    request = request_hash(file, sets, extras)
    result = None if fresh else finished_result(place, file, request)
    if result is None:
        # With the whole engine behind it: a sweep that is finished starts without.
        from vcam_cli.sweeps.computation import computed_sweep

        result = computed_sweep(file, sets, place, execution, request, watch, tell, extras)
    else:
        for problem in result.refused:
            tell(problem)
    missed = missed_limits(limits, result)
    return replace(result, missed=missed, seconds=time.perf_counter() - start)
