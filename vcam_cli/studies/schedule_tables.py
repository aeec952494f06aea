"""What a schedule study leaves: schedule.csv, summary.csv, tables it asks for, and plots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vcam_cli.camera.schedule_study import ScheduleStudy
from vcam_cli.files import pdf_plots
from vcam_cli.files import schedule_plots as plots
from vcam_cli.files.pdf_plots import Units
from vcam_cli.files.schedule_plots import Curve
from vcam_cli.files.tables import Cell, write_table
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.studies import online
from vcam_cli.studies.schedule_methods import Found, Task

if TYPE_CHECKING:
    from vcam_cli.studies.schedule import ScheduleResult

SCHEDULE = ("count", "method", "capture", "time_ratio", "photocurrent")
TIME = "time [s]"
"""The further column where there is a sensor."""
SUMMARY = (
    *("count", "method", "expected_snr", "single_capture_snr", "gain"),
    *("upper_bound", "gap", "used", "seconds"),
)
SEGMENTS = ("segments", *SUMMARY[:5])
TARGETS = ("target", "captures", "gain", "upper_bound")
SHOWN = 8
"""Captures of the schedules that are drawn, or the number of the study nearest to it."""
FEW = 10
"""Segments of a histogram of which every step of its binning is drawn."""
SCALES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))

Row = tuple[Cell, ...]
Writers = dict[str, Callable[[Path], None]]


def schedule_columns(study: ScheduleStudy) -> tuple[str, ...]:
    """Of schedule.csv."""
    return SCHEDULE if study.sensor is None else (*SCHEDULE, TIME)


def schedule_rows(study: ScheduleStudy, found: Sequence[Found]) -> Iterator[Row]:
    """One row a capture."""
    for one in found:
        times, photocurrents = one.schedule.times, one.schedule.photocurrents
        for k, (when, i) in enumerate(zip(times, photocurrents, strict=True), 1):
            row = (one.count, one.method, k, float(when / times[0]), float(i))
            yield row if study.sensor is None else (*row, float(when))


def summary_rows(task: Task, found: Sequence[Found]) -> Iterator[Row]:
    """One row a method and number of captures; the gap is empty where none is certified."""
    for one in found:
        value, gap = one.schedule.expected_snr, one.schedule.gap
        yield (
            one.count,
            one.method,
            value,
            task.single,
            value / task.single,
            one.bound / task.single,
            "" if gap is None else float(gap),
            one.used,
            round(one.seconds, 6),
        )


def summary_dicts(task: Task, found: Sequence[Found]) -> list[dict[str, Any]]:
    """The rows of summary.csv as mappings, None in place of an empty cell."""
    rows = (dict(zip(SUMMARY, row, strict=True)) for row in summary_rows(task, found))
    return [{k: None if v == "" else v for k, v in row.items()} for row in rows]


def segments_rows(result: ScheduleResult) -> Iterator[Row]:
    """What schedules are worth that are found on coarser approximations of the pdf."""
    single = result.task.single
    for step in result.steps:
        for one in step.found:
            value = one.schedule.expected_snr
            yield (step.segments, one.count, one.method, value, single, value / single)


def targets_rows(result: ScheduleResult) -> Iterator[Row]:
    """The fewest captures for each gain; empty where none, or none that was tried, reach it."""
    bound = result.task.best / result.task.single
    for found in result.targets:
        cells = ("" if value is None else value for value in (found.count, found.gain))
        yield (found.target, *cells, bound)


def writers(result: ScheduleResult) -> Writers:
    """Name of a file -> what writes it."""
    model, found = result.study.model, result.found
    rows, columns = schedule_rows(model, found), schedule_columns(model)
    out: Writers = {
        "schedule.csv": partial(write_table, columns=columns, rows=rows),
        "summary.csv": partial(write_table, columns=SUMMARY, rows=summary_rows(result.task, found)),
    }
    if result.steps:
        out["segments.csv"] = partial(write_table, columns=SEGMENTS, rows=segments_rows(result))
        out["segments.png"] = partial(_segments_plot, result)
    if result.targets:
        out["targets.csv"] = partial(write_table, columns=TARGETS, rows=targets_rows(result))
    if result.online:
        cells = [row.cells() for row in result.online]
        out["online.csv"] = partial(write_table, columns=online.COLUMNS, rows=cells)
        said = f"{model.name}: captures planned online"
        out["online.png"] = partial(online.draw, title=said, rows=result.online)
    return out | _plots(result)


def shown_count(result: ScheduleResult) -> int:
    """The number of captures whose schedules are drawn."""
    return min(result.study.model.counts, key=lambda n: (abs(n - SHOWN), n))


def _plots(result: ScheduleResult) -> Writers:
    out: Writers = {"captures.png": partial(_captures_plot, result)}
    out["pdf.png"] = partial(_pdf_plot, result)
    if len(result.study.model.counts) > 1:
        out["gain.png"] = partial(_gain_plot, result)
    if _steps(result):
        out["binning.png"] = partial(_binning_plot, result)
    return out


def _units(result: ScheduleResult) -> Units:
    if result.study.model.sensor is None:
        of_camera = result.study.camera is not None
        return Units("photocurrent [e/s]" if of_camera else "photocurrent")
    last = max(float(one.schedule.times[-1]) for one in result.found)
    size, name = next((s for s in SCALES if last >= s[0]), SCALES[-1])
    return Units("photocurrent [e/s]", f"time [{name}]", size)


def _of(result: ScheduleResult, count: int) -> list[Found]:
    return [one for one in result.found if one.count == count]


def _curves(found: Sequence[Found], single: float) -> list[Curve]:
    """Gain over the number of captures, of every method."""
    curves = []
    for method in dict.fromkeys(one.method for one in found):
        own = sorted((one for one in found if one.method == method), key=lambda one: one.count)
        gains = tuple(one.schedule.expected_snr / single for one in own)
        bound = tuple(one.bound / single for one in own) if method == "weighted" else ()
        curves.append(Curve(method, tuple(one.count for one in own), gains, bound))
    return curves


def _gain_plot(result: ScheduleResult, path: Path) -> None:
    task, name = result.task, result.study.model.name
    curves = _curves(result.found, task.single)
    bound = task.best / task.single
    plots.gain_over_captures(path, name, curves, bound, task.pdf, _units(result))


def _captures_plot(result: ScheduleResult, path: Path) -> None:
    count, task, units = shown_count(result), result.task, _units(result)
    if result.study.model.sensor is None:
        units = Units(units.photocurrent, units.time, task.first)
    rows = [
        plots.Row(one.method, one.schedule.times, one.schedule.expected_snr / task.single)
        for one in _of(result, count)
    ]
    title = f"{result.study.model.name}: {count} captures"
    plots.captures_over_time(path, title, task.pdf, task.sensor, rows, units)


def _pdf_plot(result: ScheduleResult, path: Path) -> None:
    task = result.task
    count = shown_count(result)
    whole = "photocurrents of the pixels"
    panels = [(whole if task.approximated else f"{whole}, and {count} captures", task.pdf)]
    if task.approximated:
        name = f"approximated by {_segments(task.plan)}, and {count} captures"
        panels.append((name, task.plan))
    drawn = [
        (one.method, one.schedule.photocurrents)
        for one in _of(result, count)
        if one.method in ("optimal", "heuristic", "weighted")
    ]
    pdf_plots.pdf_and_captures(path, result.study.model.name, panels, drawn, _units(result))


def _segments(pdf: Pdf) -> str:
    return "1 segment" if len(pdf.low) == 1 else f"{len(pdf.low)} segments"


def _steps(result: ScheduleResult) -> list[tuple[str, Pdf]]:
    """The pdf on its way to the segments that are asked for: the original, then each drawn step."""
    whole = result.approximation
    least = min(result.study.model.segments, default=0)
    if whole is None or whole.most <= least:
        return []
    if whole.most <= FEW:
        numbers = list(range(whole.most, least - 1, -1))
    else:
        numbers = [
            whole.most,
            *(n for n in (least * 2**k for k in (4, 3, 2, 1, 0)) if n < whole.most),
        ]
    first, *later = map(whole.pdf, numbers)
    return [(f"{whole.most} bins", first), *((_segments(pdf), pdf) for pdf in later)]


def _binning_plot(result: ScheduleResult, path: Path) -> None:
    pdf_plots.binning(path, result.study.model.name, _steps(result), _units(result))


def _segments_plot(result: ScheduleResult, path: Path) -> None:
    """Of the largest number of captures."""
    count, single = max(result.study.model.counts), result.task.single
    curves = []
    for method in dict.fromkeys(one.method for one in result.steps[0].found):
        points = [
            (step.segments, one.schedule.expected_snr / single)
            for step in result.steps
            for one in step.found
            if (one.method, one.count) == (method, count)
        ]
        x, y = zip(*points, strict=True)
        curves.append(Curve(method, x, y))
    best = result.task.exact.optimum([count])[count].expected_snr / single
    limits = [Curve("optimal", (0,), (best,), name="optimal for the pdf itself")]
    title = f"{result.study.model.name}: {count} captures"
    plots.gain_over_segments(path, title, curves, limits)
