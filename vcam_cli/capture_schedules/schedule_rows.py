"""The rows of schedule.csv and summary.csv: the captures of schedules, and what they are worth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from vcam_cli.capture_schedules.methods import MethodResult, Task
from vcam_cli.capture_schedules.model import ScheduleStudy
from vcam_cli.files.tables import Cell

SCHEDULE = ("count", "method", "capture", "time_ratio", "photocurrent")
TIME = "time [s]"
"""The further column where there is a sensor."""
SUMMARY = (
    *("count", "method", "expected_snr", "single_capture_snr", "gain"),
    *("upper_bound", "gap", "used", "seconds"),
)

Row = tuple[Cell, ...]


def schedule_columns(study: ScheduleStudy) -> tuple[str, ...]:
    """Return the columns of schedule.csv."""
    return SCHEDULE if study.sensor is None else (*SCHEDULE, TIME)


def schedule_rows(study: ScheduleStudy, found: Sequence[MethodResult]) -> Iterator[Row]:
    """Yield the rows of schedule.csv, one a capture."""
    for one in found:
        times, photocurrents = one.schedule.times, one.schedule.photocurrents
        for k, (when, i) in enumerate(zip(times, photocurrents, strict=True), 1):
            row = (one.count, one.method, k, float(when / times[0]), float(i))
            yield row if study.sensor is None else (*row, float(when))


def summary_rows(task: Task, found: Sequence[MethodResult]) -> Iterator[Row]:
    """Yield the rows of summary.csv; the gap is empty where none is certified."""
    for one in found:
        gap = one.schedule.gap
        yield (
            one.count,
            one.method,
            one.schedule.expected_snr,
            task.single,
            task.gain(one.schedule),
            one.bound / task.single,
            "" if gap is None else float(gap),
            one.distinct_captures,
            round(one.seconds, 6),
        )


def summary_dicts(task: Task, found: Sequence[MethodResult]) -> list[dict[str, Any]]:
    """Return the rows of summary.csv as mappings, None in place of an empty cell."""
    rows = (dict(zip(SUMMARY, row, strict=True)) for row in summary_rows(task, found))
    return [{k: None if v == "" else v for k, v in row.items()} for row in rows]
