"""`--expect` of a sweep: limits that a metric keeps at every point, or that the optimum keeps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from vcam_cli.camera.expectations import Limit, read_limits
from vcam_cli.sweeps.model import OPTIMUM
from vcam_cli.sweeps.quantities import METRICS
from vcam_cli.sweeps.sweep_file import StudyFile
from vcam_cli.sweeps.sweep_result import SweepResult


def study_limits(study: StudyFile, texts: Sequence[str]) -> tuple[Limit, ...]:
    """Return the limits that texts state of a study's metrics and its optimum. Raises BadInput."""
    known = {name: METRICS[name] for name in study.model.metrics}
    parameters = study.case_parameters(None)
    if study.model.optimize is not None and len(parameters) == 1:
        (parameter,) = parameters.values()
        if isinstance(parameter.cells[0], float):
            known[OPTIMUM] = parameter.unit
    return read_limits(texts, known)


def missed_limits(limits: Sequence[Limit], result: SweepResult) -> tuple[str, ...]:
    """Return a sentence for each limit that is not kept; metrics are means, as in its tables.

    Nothing is said before all points are there.
    """
    if result.missing:
        return ()
    return tuple(sentence for limit in limits for sentence in _misses(limit, result))


def _misses(limit: Limit, result: SweepResult) -> Iterator[str]:
    if limit.metric == OPTIMUM:
        for best in result.optima:
            if not limit.holds(float(best.optimum)):
                none = f": best at the {best.edge} end of the range" if best.edge else ""
                yield limit.miss(float(best.optimum), f"case {best.case}{none}")
        return
    rows = result.mean_rows
    values = [math.nan if row[limit.metric] in (None, "") else row[limit.metric] for row in rows]
    wrong = [i for i, value in enumerate(values) if not limit.holds(value)]
    if not wrong:
        return
    known = [i for i in wrong if not math.isnan(values[i])]
    pick = max if limit.relation.startswith("<") else min
    worst = pick(known, key=lambda i: values[i]) if known else wrong[0]
    where = f"at {len(wrong)} of {len(rows)} points; the worst: {_place(rows[worst], result)}"
    yield limit.miss(values[worst], where)


def _place(row: dict[str, Any], result: SweepResult) -> str:
    """Return what is varied at a row of means, in words."""
    names = [name for name in row if name not in (*METRICS, "error")]
    return ", ".join(f"{name} = {row[name]}" for name in names)
