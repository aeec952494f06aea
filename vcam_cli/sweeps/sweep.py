"""A sweep from its study to its tables: what `vcam sweep` does.

Finished points are kept at once, a file a point; tables and plots are made of these and of
the study, in its order. So they are the same bytes however often the sweep was
stopped, and whoever computed its points.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from vcam_cli.arguments import (
    brief,
    require_folder,
    require_name,
    require_overrides,
    require_whole,
)
from vcam_cli.camera.expectations import notes
from vcam_cli.config.study_overrides import split_sets
from vcam_cli.floats import own_float_errors
from vcam_cli.progress import Callback, Observer, observer
from vcam_cli.sweeps import sweep_file
from vcam_cli.sweeps.execution import Execution, Share
from vcam_cli.sweeps.limits import missed_limits, study_limits
from vcam_cli.sweeps.model import Sweep
from vcam_cli.sweeps.sweep_result import Extras, SweepResult, finished_result, request_hash


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
    device: str = "cpu",
) -> SweepResult:
    """Run a sweep study, or its missing points, and write its tables and plots.

    study: a file, or the name of a shipped study; out: folder, default out/NAME; sets: overrides
    "PATH=VALUE" of the study, and of every camera where PATH begins with no key of a study;
    workers: processes, default all processors; scheduler: address of a Dask scheduler in their
    place; shard: (i, n), the i-th of n shares of the points; fresh: computes all of them again;
    watch follows the progress, as that of `simulate` does; tell gets messages; report: also writes
    report.html; formats: "svg", "pdf" of plots, beside PNG; expect: limits "METRIC >= VALUE" that
    every point keeps, or "optimum <= 7 um": see `missed` of the result; device: as that of
    `simulate`. Raises BadInput (wrong
    study, or no camera of it is valid), CannotDo (disk, scheduler), and TypeError or ValueError for
    arguments that are none of these.
    """
    start = time.perf_counter()
    _check_arguments(study, out, sets, workers, shard)
    execution = Execution(Share(*shard) if shard else None, workers, scheduler, fresh, device)
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
    request = request_hash(file, sets, extras, device)
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
