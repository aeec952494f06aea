"""What `vcam fit` leaves in its folder: camera.yaml, parameters.csv, plots, fit.json, a report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import yaml

from vcam_cli.files import tables
from vcam_cli.files.atomic import write_text
from vcam_cli.files.folder import OutputFolder
from vcam_cli.fitting.camera_file import MTF
from vcam_cli.fitting.edge import COLUMNS as LENS_COLUMNS
from vcam_cli.fitting.parameters import COLUMNS
from vcam_cli.fitting.plots import plots
from vcam_cli.fitting.result import Fit
from vcam_cli.reports.page import note_facts
from vcam_cli.simulation.output.study_files import write_study


def write(
    found: Fit, folder: OutputFolder, report: bool = False, formats: Sequence[str] = ()
) -> None:
    """Write all files of a fit; report: report.html, too; formats: of plots beside PNG."""
    text = yaml.safe_dump(found.camera, sort_keys=False, allow_unicode=True)
    write_text(folder.new("camera.yaml"), f"# Estimated by vcam fit; see fit.json.\n{text}")
    tables.write_table(folder.new("parameters.csv"), COLUMNS, (p.cells for p in found.parameters))
    if found.lens is not None:
        tables.write_table(folder.new(MTF), LENS_COLUMNS, found.lens.rows())
    page = report_arguments(found) if report else None
    form = {"measurement": found.measurement.model_dump(mode="json")}
    write_study(folder, plots(found), formats, page, found.report() | form)


def report_arguments(found: Fit) -> dict[str, Any]:
    """Return title, text, facts and captions of the report."""
    unknown = [f"not determined by the frames: {name}" for name in found.unknown]
    captions = {
        "parameters.csv": "Every number with its 90 % interval and its method.",
        "photon_transfer.png": "Temporal variance over signal, from which the gain follows",
        "dark_signal.png": "Dark frames: black level and dark current",
        "intervals.png": "90 % confidence intervals",
        "mtf.csv": "MTF of the lens: that of the edge, divided by that of the pixel.",
    }
    return {
        "title": f"{found.measurement.name}: a camera from its frames",
        "about": "Estimated by vcam fit from raw frames; definitions of EMVA 1288 release 4.0.",
        "facts": note_facts((*found.notes, *unknown)),
        "captions": captions,
    }
