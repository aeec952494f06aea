"""`vcam fit`: a camera file from raw frames of a sensor."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    wants_report: options.Report = False,
    formats: options.Formats = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Estimate a camera from dark frames, flat frames and edges, every number with its interval.

    Write camera.yaml, which runs as it is, parameters.csv with 90 % intervals and methods (EMVA
    1288 release 4.0 where it defines one), plots of photon transfer, dark signal and intervals,
    mtf.csv where there are edges, and fit.json. What the frames cannot tell is listed.

    \b
    Example:
      vcam fit bench.yaml -o out/my-sensor
      vcam run out/my-sensor/camera.yaml
    """
    import yaml

    from vcam_cli.files import tables
    from vcam_cli.files.atomic import write_text
    from vcam_cli.files.folder import OutputFolder
    from vcam_cli.fitting import fit as fitting
    from vcam_cli.fitting.camera_file import MTF
    from vcam_cli.fitting.edge import COLUMNS as LENS_COLUMNS
    from vcam_cli.fitting.parameters import COLUMNS
    from vcam_cli.fitting.plots import plots
    from vcam_cli.simulation.output.study_files import write_study
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
        if found.lens is not None:
            tables.write_table(folder.new(MTF), LENS_COLUMNS, found.lens.rows())
        page = report_arguments(found) if wants_report else None
        form = {"measurement": measured.model_dump(mode="json")}
        write_study(folder, plots(found), formats, page, found.report() | form)
    for note in found.notes:
        options.say(note, quiet)
    for name in found.unknown:
        options.say(f"not told by the frames: {name}", quiet)
    options.print_found(found, path, as_json, quiet, print_fit)


def report_arguments(found: "Fit") -> dict[str, Any]:
    """Return title, text, facts and captions of the report."""
    from vcam_cli.reports.page import note_facts

    unknown = [f"not told by the frames: {name}" for name in found.unknown]
    captions = {
        "parameters.csv": "Every number with its 90 % interval and its method.",
        "photon_transfer.png": "Temporal variance over signal, from which the gain follows",
        "dark_signal.png": "Dark frames: black level and dark current",
        "intervals.png": "How sure each number is",
        "mtf.csv": "Modulation transfer of the lens, the pixel's own taken out.",
    }
    return {
        "title": f"{found.measurement.name}: a camera from its frames",
        "about": "Estimated by vcam fit from raw frames; definitions of EMVA 1288 release 4.0.",
        "facts": note_facts((*found.notes, *unknown)),
        "captions": captions,
    }


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
