"""report.html of a schedule study: its schedules, what they are worth, and plots on one page."""

from __future__ import annotations

from vcam_cli.capture_schedules.schedule_result import ScheduleResult
from vcam_cli.files.folder import OutputFolder
from vcam_cli.reports import study_report
from vcam_cli.reports.page import Facts

CAPTIONS = {
    "schedule.csv": "The capture times of every method, relative to the first.",
    "summary.csv": "Gain of each schedule: E[SNR] over that of a single capture. Gap: upper bound"
    " on the relative distance to the optimal schedule.",
    "segments.csv": "Gain of schedules computed on coarser pdfs.",
    "targets.csv": "The fewest captures that reach each gain.",
    "online.csv": "Loss by planning one capture at a time.",
    "charge.png": "Charge over time of a bright and a dark pixel, and the samples that count",
    "captures.png": "The capture times of every method",
    "pdf.png": "The probability of photocurrents, and its approximation",
    "gain.png": "Gain over the number of captures for every method",
    "binning.png": "Steps of the approximation by histogram binning",
    "segments.png": "Gain over the number of segments",
    "online.png": "Loss of online schedules over the number of captures",
}


def write(result: ScheduleResult, folder: OutputFolder) -> None:
    """Write report.html of the tables and plots that are new in the folder."""
    name = result.study.model.name
    best: dict[int, tuple[str, float]] = {}
    for row in result.summary_rows:
        if row["gain"] > best.get(row["count"], ("", -1.0))[1]:
            best[row["count"]] = row["method"], row["gain"]
    facts = [
        (f"best of {count} captures", f"{method}, gain {gain:.6g}")
        for count, (method, gain) in best.items()
    ]
    facts += [("note", note) for note in result.notes]
    about = "Capture times of one exposure with several readouts."
    title = f"{name}: capture times"
    study_report.write(folder, title, about, [Facts("In short", facts)], CAPTIONS)
