"""What `vcam verify` leaves in its folder: verify.csv, errors.png, verify.json, a report."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from vcam_cli.files import tables
from vcam_cli.files.folder import OutputFolder
from vcam_cli.reports.page import Facts, note_facts
from vcam_cli.simulation.output.study_files import write_study
from vcam_cli.verification.plots import draw_errors
from vcam_cli.verification.verify import COLUMNS, Verification


def write(
    found: Verification, folder: OutputFolder, report: bool = False, formats: Sequence[str] = ()
) -> None:
    """Write all files of a prediction; report: report.html, too; formats: of plots beside PNG."""
    tables.write_table(folder.new("verify.csv"), COLUMNS, (row.cells for row in found.rows))
    drawn = {"errors.png": partial(draw_errors, result=found)}
    page = report_arguments(found) if report else None
    forms = {
        "camera": found.camera.model_dump(mode="json"),
        "measurement": found.measurement.model_dump(mode="json"),
    }
    write_study(folder, drawn, formats, page, found.report() | forms)


def report_arguments(found: Verification) -> dict[str, Any]:
    """Return title, text, facts and captions of the report."""
    numbers = found.summary().items()
    cards = [Facts("Errors", [(name.replace("_", " "), f"{value:.4g}") for name, value in numbers])]
    cards += note_facts(found.notes)
    captions = {
        "verify.csv": "Measured values beside predictions of the camera file.",
        "errors.png": "Histogram of prediction errors",
    }
    about = "Mean signals in uniform light of known irradiance, predicted from a camera file."
    title = f"{found.measurement.name} against {found.camera.name}"
    return {"title": title, "about": about, "facts": cards, "captions": captions}
