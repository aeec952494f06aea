"""`vcam fit`: a camera file from raw frames of a sensor."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.fitting.fit import Fit


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
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Estimate a camera from dark frames, flat frames and edges, every number with its interval.

    Write camera.yaml, which runs as it is, parameters.csv with 90 % intervals and methods (EMVA
    1288 release 4.0 where it defines one), and fit.json. What the frames cannot tell is listed.

    \b
    Example:
      vcam fit bench.yaml -o out/my-sensor
      vcam run out/my-sensor/camera.yaml
    """
    import yaml

    from vcam_cli.files import report, tables
    from vcam_cli.files.atomic import write_text
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.fitting import fit as fitting
    from vcam_cli.fitting.parameters import COLUMNS
    from vcam_cli.simulation import provenance
    from vcam_cli.verification import measurement_file
    from vcam_cli.verification.frames import paths

    measured = measurement_file.read(measurement)
    frames = [file for files in paths(measured).values() for file in files]
    path = out or Path("out") / measured.name
    inputs = (*measured.files, *frames)
    with OutputFolder(path, record="fit.json", inputs=inputs) as folder, Progress(quiet) as bar:
        found = fitting.fit(measured, bar)
        text = yaml.safe_dump(found.camera, sort_keys=False, allow_unicode=True)
        write_text(folder.new("camera.yaml"), f"# Estimated by vcam fit; see fit.json.\n{text}")
        tables.write_table(
            folder.new("parameters.csv"), COLUMNS, (p.cells for p in found.parameters)
        )
        form = {"measurement": measured.model_dump(mode="json")}
        folder.finish(found.report() | form | {"versions": provenance.versions()})
    for note in found.notes:
        options.say(note, quiet)
    for name in found.unknown:
        options.say(f"not told by the frames: {name}", quiet)
    if as_json:
        print(report.to_json({"out": str(path), **found.report()}), end="")
    elif not quiet:
        print_fit(found, path)


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
    print(f"{path}/camera.yaml, parameters.csv, fit.json")
