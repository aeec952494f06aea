"""`vcam fit`: a camera file from raw frames of a sensor."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.fitting.result import Fit


def fit(
    measurement: Annotated[
        str,
        typer.Argument(
            metavar="MEASUREMENT",
            help="A measurement file with frames.",
            autocompletion=options.complete_measurement,
            show_default=False,
        ),
    ],
    out: options.Out = None,
    wants_report: options.Report = False,
    formats: options.Formats = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Estimate a camera from dark frames, flat frames and edges, with confidence intervals.

    Write camera.yaml, which runs as it is, parameters.csv with 90 % intervals and methods (EMVA
    1288 release 4.0 where it defines one), plots of photon transfer, dark signal and intervals,
    mtf.csv where there are edges, and fit.json. Parameters that the frames do not determine are
    listed.

    \b
    Example:
      vcam fit bench.yaml -o out/my-sensor
      vcam run out/my-sensor/camera.yaml
    """
    from vcam_cli import face
    from vcam_cli.verification import measurement_file

    measured = measurement_file.read(measurement)
    path = out or Path("out") / measured.name
    with Progress(quiet) as bar:
        found = face.fit(measured, path, bar, wants_report, formats or ())
    for note in found.notes:
        options.say(note, quiet)
    for name in found.unknown:
        options.say(f"not determined by the frames: {name}", quiet)
    options.print_found(found, path, as_json, quiet, print_fit)


def print_fit(found: "Fit", path: Path) -> None:
    """Print the parameters with their intervals."""
    rows = [
        (p.name, f"{p.value:.5g}", f"{p.low:.5g}", f"{p.high:.5g}", p.unit)
        for p in found.parameters
    ]
    plain = "\n".join(
        f"{n:<24} {v:>11}  {low:>11} .. {high:<11} {u}" for n, v, low, high, u in rows
    )
    options.print_rows(("parameter", ">value", ">from", ">to", "unit"), rows, plain)
    transfer = "" if found.lens is None else ", mtf.csv"
    print(f"{path}/camera.yaml, parameters.csv{transfer}, photon_transfer.png, fit.json")
