"""`vcam verify`: what a camera file predicts beside what was measured."""

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.verification.verify import Row, Verification

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

    Mean signals under uniform light of known irradiance, stated or of raw frames, are predicted
    from the camera's pixels, without its lens. Write verify.csv, verify.json and
    errors.png, a histogram of the errors. For raw frames, variances, spectra of rows and
    columns, tails and patterns are predicted and tested for significance, too. The exit code is 4
    where an error exceeds the measurement's tolerance and is significant.

    \b
    Example:
      vcam verify test-pixel-0.18um test-pixel-simulated
      vcam verify camera.yaml bench.yaml --set pixel.temperature="310 K"
    """
    from vcam_cli import face
    from vcam_cli.simulation.checks import load
    from vcam_cli.verification import measurement_file

    model = load(camera, options.overrides(set_, None, accuracy))
    measured = measurement_file.read(measurement)
    path = out or Path("out") / measured.name
    with Progress(quiet) as bar:
        found = face.verify(model, measured, path, bar, wants_report, formats or ())
    for note in found.notes:
        options.say(note, quiet)
    options.print_found(found, path, as_json, quiet, print_report)
    if found.missed:
        options.say(f"{len(found.missed)} of {len(found.rows)} predictions miss their tolerance")
        raise typer.Exit(MISSED)


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
        numbers = f"{row.measured:.5g}", f"{row.predicted:.5g}", f"{_percent(row)}{late}"
        table.add_row(row.frame, row.channel, row.quantity, *numbers)
    console.print(table)
    all_ = found.summary()
    console.print(
        f"errors of means: mean {all_['mean_error_percent']:+.2f} %,"
        f" rms {all_['rms_error_percent']:.2f} %, largest {all_['largest_error_percent']:.2f} %"
    )
    if found.judged:
        console.print(
            f"{all_['differing']} of {all_['judged']} quantities of frames differ significantly"
            f" (a correct camera file has such a quantity in {FALSE_ALARMS:.0%} of cases)"
        )
    if found.least_errors:
        errors = found.least_errors.items()
        listed = [f"{100 * least:.2g} % of {name}" for name, least in errors]
        console.print(f"smallest errors that 90 % of tests detect: {'; '.join(listed)}")
    console.print(f"{path}/verify.csv, errors.png")


def _percent(row: "Row") -> str:
    """Return an error in words; a prediction of what was measured as 0 has none."""
    return f"{100 * row.error:+.2f} %" if isfinite(row.error) else "of 0"
