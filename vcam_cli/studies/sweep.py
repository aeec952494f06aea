"""A sweep from its study to its tables: what `vcam sweep` does.

What is finished is kept at once, a file a point; tables and plots are made of what is kept and
what is known, in the study's order. So they are the same bytes however often the sweep was
stopped, and whoever computed its points.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from vcam_cli.engine.stages import Observer, Silent
from vcam_cli.studies import study_file, unchanged
from vcam_cli.studies.sweep_order import Order, Share
from vcam_cli.studies.sweep_result import SweepResult


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
    file = study_file.read(study)
    place = Path(out) if out is not None else Path("out") / file.model.name
    asked = unchanged.asked(file, sets)
    result = None if fresh else unchanged.result(place, file, asked)
    if result is None:
        # With the whole engine behind them: a sweep that is finished starts without.
        from vcam_cli.studies import sweep_points, sweep_run

        order = Order(share, workers, scheduler, fresh, asked)
        result = sweep_run.swept(sweep_points.grid(file, sets), sets, place, order, watch, tell)
    else:
        for problem in result.refused:
            tell(problem)
    return replace(result, seconds=time.perf_counter() - start)
