"""`vcam characterize`: a camera measured by EMVA 1288 and ISO 12233."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.characterization.characterize import Characterization

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


def characterize(
    camera: options.Camera,
    out: options.Out = None,
    set_: options.Set = None,
    seed: options.Seed = None,
    accuracy: options.Accuracy = None,
    keep_frames: Annotated[
        bool,
        typer.Option(
            "--keep-frames",
            help="Also write the flat and dark frames as TIFF, with a descriptor file for"
            " emva1288, the standard's own program.",
        ),
    ] = False,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
    wants_report: options.Report = False,
    formats: options.Formats = None,
) -> None:
    """Measure a camera on a simulated bench: photon transfer, noise, range, linearity, MTF.

    The methods are those of EMVA 1288 and ISO 12233, applied to raw frames; each value is shown
    beside the one expected of the camera file. Write characterize.csv, characterize.json,
    photon_transfer.png, snr.png, linearity.png and mtf.png.

    \b
    Example:
      vcam characterize starter
      vcam characterize camera.yaml --set scene.illuminant=FL2
      vcam characterize kac-12040 --keep-frames
    """
    from vcam_cli.characterization import characterize as study
    from vcam_cli.characterization.kept_frames import DESCRIPTOR, FrameFiles
    from vcam_cli.characterization.plots import characterization_panels
    from vcam_cli.files import curves, tables
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.simulation.checks import load
    from vcam_cli.simulation.output import provenance
    from vcam_cli.simulation.output.study_files import write_study

    model = load(camera, options.overrides(set_, seed, accuracy))
    inputs = provenance.inputs(model)
    path = out or Path("out") / model.name
    with (
        OutputFolder(path, record="characterize.json", inputs=inputs) as folder,
        Progress(quiet) as bar,
    ):
        keeper = FrameFiles(folder.new) if keep_frames else None
        found = study.characterize(model, workers, bar, keeper)
        rows = (quantity.row for quantity in found.quantities)
        tables.write_table(folder.new("characterize.csv"), study.COLUMNS, rows)
        drawn = {
            name: partial(curves.draw, title=title, panels=panels)
            for name, (title, panels) in characterization_panels(found).items()
        }
        page = report_arguments(found) if wants_report else None
        record = found.report() | {"camera": model.model_dump(mode="json")}
        write_study(folder, drawn, formats, page, record)
    for note in found.notes:
        options.say(note, quiet)
    options.print_found(found, path, as_json, quiet, print_report)
    if keep_frames and not (as_json or quiet):
        print(f"{path}/frames: TIFF files of each color, and {DESCRIPTOR}, which lists them")


def report_arguments(found: "Characterization") -> dict[str, Any]:
    """Return title, text, facts and captions of the report."""
    from vcam_cli.reports.page import Table, note_facts, number_columns

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
        "characterize.csv": "What the bench measured beside what the camera file says.",
        "photon_transfer.png": "Temporal variance over the mean, whose slope is the system gain K",
        "snr.png": "Signal over temporal noise over the photons on a pixel, with the model",
        "linearity.png": "Mean over photons, and the deviation from a straight line",
        "mtf.png": "Transfer of contrast of a slanted edge over spatial frequency, with the model",
    }
    about = "Measured on simulated raw frames as EMVA 1288 and ISO 12233 have it."
    title = f"{found.bench.camera.name}: a camera on the bench"
    return {"title": title, "about": about, "facts": parts, "captions": captions}


def print_report(found: "Characterization", path: Path) -> None:
    """Print the table: measured and expected values of every color side by side."""
    console, table = options.open_table()
    head, rows = quantities_table(found)
    for name in head:
        side = "left" if name in ("quantity", "unit") else "right"
        table.add_column(name, justify=side, no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console.print(table)
    console.print(f"{path}/characterize.csv, photon_transfer.png, snr.png, linearity.png, mtf.png")


def quantities_table(found: "Characterization") -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the quantities: measured and expected values of every color."""
    colors = [channel.color for channel in found.channels]
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
