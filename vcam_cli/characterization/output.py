"""What `vcam characterize` leaves in its folder: tables, plots, the report, characterize.json."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.characterization import merged_snr
from vcam_cli.characterization.characterize import Characterization
from vcam_cli.characterization.datasheet import COLUMNS
from vcam_cli.characterization.plots import characterization_panels
from vcam_cli.files import curves, tables
from vcam_cli.files.folder import OutputFolder
from vcam_cli.reports.page import Table, note_facts, number_columns
from vcam_cli.simulation.output.study_files import write_study

SHOWN = (
    "system_gain",
    "quantum_efficiency",
    "temporal_dark_noise",
    "read_noise",
    "dark_current",
    "full_well",
    "saturation_capacity",
    "threshold_photons",
    "snr_max_db",
    "emva_dynamic_range_db",
    "dynamic_range_db",
    "snr_db",
    "linearity_error",
    "dsnu",
    "prnu",
    "mtf50",
)
"""The quantities of the table; the others are in the files."""


def write(
    found: Characterization,
    camera: Camera,
    folder: OutputFolder,
    report: bool = False,
    formats: Sequence[str] = (),
) -> None:
    """Write all files of a measurement; report: report.html, too; formats: of plots beside PNG."""
    tables.write_table(folder.new("characterize.csv"), COLUMNS, (q.row for q in found.quantities))
    if found.merged:
        rows = (point.row for point in found.merged)
        tables.write_table(folder.new("merged_snr.csv"), merged_snr.COLUMNS, rows)
    drawn = {
        name: partial(curves.draw, title=title, panels=panels)
        for name, (title, panels) in characterization_panels(found).items()
    }
    page = report_arguments(found) if report else None
    record = found.report() | {"camera": camera.model_dump(mode="json")}
    write_study(folder, drawn, formats, page, record)


def report_arguments(found: Characterization) -> dict[str, Any]:
    """Return title, text, facts and captions of the report."""
    head, rows = quantities_table(found)
    parts = [
        Table(
            "In short",
            head,
            rows,
            "Measured, and expected of the file.",
            numbers=number_columns(rows),
        ),
        *note_facts(found.notes),
    ]
    captions = {
        "characterize.csv": "Measured values beside those of the camera file.",
        "photon_transfer.png": "Temporal variance over the mean; the slope is the system gain K",
        "snr.png": "Temporal SNR over the luminous exposure of the sensor, with the model",
        "linearity.png": "Mean over photons, and the deviation from a straight line",
        "merged_snr.png": "SNR of all readouts merged, with the model; one by one they saturate",
        "merged_snr.csv": "SNR of all readouts merged, measured and expected.",
        "mtf.png": "MTF of a slanted edge over spatial frequency, with the model",
    }
    about = "Measured on simulated raw frames as EMVA 1288 and ISO 12233 have it."
    title = f"{found.bench.camera.name}: a camera on the bench"
    return {"title": title, "about": about, "facts": parts, "captions": captions}


def quantities_table(found: Characterization) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the quantities: measured and expected values of every color."""
    colors = list(dict.fromkeys(q.channel for q in found.quantities))
    if found.merged:  # of each readout its first color: all of them are in the files
        colors = colors[:: len(found.channels)]
    measured = ["measured"] if len(colors) == 1 else colors
    head = ["quantity", *(name for color in measured for name in (color, "expected")), "unit"]
    rows = []
    for name in SHOWN:
        every = [found.get(name, color) for color in colors]
        cells = [_number(value) for q in every for value in (q.measured, q.expected)]
        rows.append([name, *cells, every[0].unit])
    return head, rows


def _number(value: float) -> str:
    """Return four digits of a number, those of electrons without an exponent."""
    return f"{float(f'{value:.4g}'):.8g}"
