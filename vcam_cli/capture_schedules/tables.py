"""Files of a schedule study: schedule.csv, summary.csv, requested tables, plots, and notes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from vcam_cli.capture_schedules import online_loss, pdf_scale
from vcam_cli.capture_schedules import schedule_plots as plots
from vcam_cli.capture_schedules.methods import MethodResult, Task
from vcam_cli.capture_schedules.model import ScheduleStudy
from vcam_cli.capture_schedules.schedule_result import ScheduleResult
from vcam_cli.capture_schedules.schedule_rows import (
    SUMMARY,
    Row,
    schedule_columns,
    schedule_rows,
    summary_rows,
)
from vcam_cli.files.report import hash_file
from vcam_cli.files.tables import write_table
from vcam_cli.scheduling.objective import expected_snr_noisy_saturation
from vcam_cli.simulation.output import provenance

SEGMENTS = ("segments", *SUMMARY[:5], "density")
TARGETS = ("target", "captures", "gain", "upper_bound")
NOTED_LOSS = 0.05
"""Relative loss above which a note is given."""

Writers = dict[str, Callable[[Path], None]]


def segments_rows(result: ScheduleResult) -> Iterator[Row]:
    """Yield what schedules are worth that are found on coarser approximations of the pdf."""
    task = result.task
    for step in result.steps:
        for one in step.found:
            value, gain = one.schedule.expected_snr, task.gain(one.schedule)
            row = (step.segments, one.count, one.method, value, task.single, gain)
            yield (*row, step.density)


def targets_rows(result: ScheduleResult) -> Iterator[Row]:
    """Yield the fewest captures for each gain; empty where none that was tried reaches it."""
    for target in result.targets:
        cells = ("" if value is None else value for value in (target.count, target.gain))
        yield (target.target, *cells, result.task.largest_gain)


def writers(result: ScheduleResult) -> Writers:
    """Return what writes each file of a study, by its name."""
    model, found = result.study.model, result.found
    rows, columns = schedule_rows(model, found), schedule_columns(model)
    out: Writers = {
        "schedule.csv": partial(write_table, columns=columns, rows=rows),
        "summary.csv": partial(write_table, columns=SUMMARY, rows=summary_rows(result.task, found)),
    }
    if result.steps:
        out["segments.csv"] = partial(write_table, columns=SEGMENTS, rows=segments_rows(result))
        out["segments.png"] = partial(plots.plot_gain_over_segments, result)
    if result.targets:
        out["targets.csv"] = partial(write_table, columns=TARGETS, rows=targets_rows(result))
    if result.online:
        cells = [loss.cells() for loss in result.online]
        out["online.csv"] = partial(write_table, columns=online_loss.COLUMNS, rows=cells)
        title = f"{model.name}: captures planned online"
        out["online.png"] = partial(online_loss.plot_losses, title=title, losses=result.online)
    out["captures.png"] = partial(plots.plot_captures, result)
    out["charge.png"] = partial(plots.plot_charge_over_time, result)
    out["pdf.png"] = partial(plots.plot_pdf, result)
    if len(model.counts) > 1:
        out["gain.png"] = partial(plots.plot_gain, result)
    if plots.binning_steps(result):
        out["binning.png"] = partial(plots.plot_binning, result)
    return out


def record(result: ScheduleResult) -> dict[str, Any]:
    """Return what study.json says, but for the names of the files."""
    return {
        **result.summary(),
        "study": result.study.model.model_dump(mode="json"),
        "hashes": {str(path): hash_file(path) for path in result.study.inputs},
        "versions": provenance.versions(),
    }


def notes(study: ScheduleStudy, task: Task, found: Sequence[MethodResult]) -> Iterator[str]:
    """Yield a sentence for each thing that the numbers of a study leave unsaid."""
    yield from pdf_scale.notes(task.pdf, study)
    yield from _probability_notes(study)
    if study.max_time_of is not None:
        of, ratio = study.max_time_of, task.sensor.max_time / task.first
        yield f"no exposure is longer than {ratio:.5g} t_1, that of the optimum of {of} captures"
    yield from _level_notes(study, task)
    yield from _gap_notes(task, found)
    yield from _approximation_notes(task, found)
    if study.sensor is not None:
        yield from _saturation_notes(task, found)


def _probability_notes(study: ScheduleStudy) -> Iterator[str]:
    total = sum(segment.probability for segment in study.pdf.segments or ())
    if study.pdf.segments is not None and abs(total - 1) > 1e-6:
        yield f"probabilities add up to {total:.6g}; they are divided by this sum"


def _level_notes(study: ScheduleStudy, task: Task) -> Iterator[str]:
    """Yield why more captures are not used."""
    pdf = task.pdf
    lit = int((pdf.probability > 0).sum() - (pdf.discrete and pdf.low[0] == 0))
    if pdf.discrete and lit < max(study.counts) and not task.is_approximate:
        are = "there is 1 level" if lit == 1 else f"there are {lit} levels"
        used = "1 is" if lit == 1 else f"{lit} are"
        yield f"{are} of light: of more captures than that, {used} used, the rest repeat"


def _gap_notes(task: Task, found: Sequence[MethodResult]) -> Iterator[str]:
    """Yield the captures of methods that come closer than the readout allows, and repeat."""
    if not task.is_restricted or task.pdf.discrete:
        return
    for one in found:
        if one.distinct_captures < one.count:
            kept = f"{one.distinct_captures} of its {one.count} captures"
            yield f"{one.method} keeps {kept} far enough apart; the rest repeat"


def _approximation_notes(task: Task, found: Sequence[MethodResult]) -> Iterator[str]:
    """Yield how much the approximation may cost, where that is more than rounding."""
    gaps = [one.schedule.gap or 0.0 for one in found if one.method == "optimal"]
    if not task.is_approximate or max(gaps, default=0.0) < NOTED_LOSS:
        return
    few = plots.segments_text(task.plan)
    cost = f"found on {few}, `optimal` may be {max(gaps):.2g} of its E[SNR] below the best"
    yield f"{cost} for the pdf itself; give more segments, or none"


def _saturation_notes(task: Task, found: Sequence[MethodResult]) -> Iterator[str]:
    """Yield the loss of real pixels: at the limit of a capture, noise fills every second one."""
    optimal = [one.schedule for one in found if one.method == "optimal"]
    if not task.pdf.discrete or not optimal:
        return
    loss = max(
        1 - expected_snr_noisy_saturation(task.pdf, one.times, task.sensor) / one.expected_snr
        for one in optimal
    )
    if loss > NOTED_LOSS:
        yield (
            "captures coincide with levels, where noise saturates one pixel in two: saturation "
            f"by noisy values takes up to {100 * loss:.2g} % off the E[SNR] of `optimal`"
        )
