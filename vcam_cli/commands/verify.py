"""`vcam verify`: what a camera file predicts beside what was measured."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.verification.verify import Verification

MISSED = 4
"""Exit code where a stated tolerance is missed."""


def verify(
    camera: options.Camera,
    measurement: Annotated[
        str,
        typer.Argument(
            metavar="MEASUREMENT",
            help="A measurement file, or the name of a shipped one.",
            autocompletion=options.complete_measurement,
            show_default=False,
        ),
    ],
    out: options.Out = None,
    set_: options.Set = None,
    accuracy: options.Accuracy = None,
    wants_report: options.Report = False,
    formats: options.Formats = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Predict measured signals from a camera file, and show the errors.

    Mean signals under even light of known irradiance, stated or of raw frames, are predicted as
    the camera's pixels give them, its lens left out. Write verify.csv, verify.json and
    errors.png, a histogram of the errors. Of raw frames variances, spectra of rows and columns,
    tails and patterns are predicted, too, and judged by what is chance. The exit code is 4 where
    an error is larger than the measurement's tolerance, and more than chance.

    \b
    Example:
      vcam verify test-pixel-0.18um test-pixel-simulated
      vcam verify camera.yaml bench.yaml --set pixel.temperature="310 K"
    """
    from vcam_cli.files import tables
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.simulation.checks import load
    from vcam_cli.simulation.output import provenance
    from vcam_cli.simulation.output.study_files import write_study
    from vcam_cli.verification import measurement_file
    from vcam_cli.verification import verify as comparison
    from vcam_cli.verification.frames import paths
    from vcam_cli.verification.plots import draw_errors

    model = load(camera, options.overrides(set_, None, accuracy))
    measured = measurement_file.read(measurement)
    frames = [file for files in paths(measured, held_out=True).values() for file in files]
    inputs = (*provenance.inputs(model), *measured.files, *frames)
    path = out or Path("out") / measured.name
    with OutputFolder(path, record="verify.json", inputs=inputs) as folder, Progress(quiet) as bar:
        found = comparison.verify(model, measured, bar)
        rows = (row.cells for row in found.rows)
        tables.write_table(folder.new("verify.csv"), comparison.COLUMNS, rows)
        drawn = {"errors.png": partial(draw_errors, result=found)}
        page = report_arguments(found) if wants_report else None
        forms = {
            "camera": model.model_dump(mode="json"),
            "measurement": measured.model_dump(mode="json"),
        }
        write_study(folder, drawn, formats, page, found.report() | forms)
    for note in found.notes:
        options.say(note, quiet)
    options.print_found(found, path, as_json, quiet, print_report)
    if found.missed:
        options.say(f"{len(found.missed)} of {len(found.rows)} predictions miss their tolerance")
        raise typer.Exit(MISSED)


def report_arguments(found: "Verification") -> dict[str, Any]:
    """Return title, text, facts and captions of the report."""
    from vcam_cli.reports.page import Facts, note_facts

    numbers = found.summary().items()
    cards = [Facts("Errors", [(name.replace("_", " "), f"{value:.4g}") for name, value in numbers])]
    cards += note_facts(found.notes)
    captions = {
        "verify.csv": "What was measured beside what the camera file predicts.",
        "errors.png": "How many predictions have which error",
    }
    about = "Mean signals under even light of known irradiance, predicted from a camera file."
    title = f"{found.measurement.name} against {found.camera.name}"
    return {"title": title, "about": about, "facts": cards, "captions": captions}


def print_report(found: "Verification", path: Path) -> None:
    """Print the table of means, and of what differs: measured, predicted, error."""
    from vcam_cli.verification.stack_prediction import FALSE_ALARMS

    console, table = options.open_table()
    for name in ("frame", "channel", "quantity"):
        table.add_column(name, no_wrap=True)
    for name in ("measured", "predicted", "error"):
        table.add_column(name, justify="right", no_wrap=True)
    shown = [r for r in found.rows if r.quantity.startswith("mean") or r.verdict != "agrees"]
    for row in shown:
        late = f" {row.verdict}" if row.verdict in ("missed", "differs") else ""
        numbers = f"{row.measured:.5g}", f"{row.predicted:.5g}", f"{100 * row.error:+.2f} %{late}"
        table.add_row(row.frame, row.channel, row.quantity, *numbers)
    console.print(table)
    all_ = found.summary()
    console.print(
        f"errors of means: mean {all_['mean_error_percent']:+.2f} %,"
        f" rms {all_['rms_error_percent']:.2f} %, largest {all_['largest_error_percent']:.2f} %"
    )
    if found.judged:
        console.print(
            f"{all_['differing']} of {all_['judged']} quantities of frames differ by more than"
            f" chance ({FALSE_ALARMS:.0%} of right camera files have one)"
        )
    console.print(f"{path}/verify.csv, errors.png")
