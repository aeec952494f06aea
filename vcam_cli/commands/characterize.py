"""`vcam characterize`: a camera measured by EMVA 1288 and ISO 12233."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

if TYPE_CHECKING:
    from vcam_cli.characterization.characterize import Characterization


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
    device: options.Device = "cpu",
    wants_report: options.Report = False,
    formats: options.Formats = None,
    expect: options.Expect = None,
) -> None:
    """Measure a camera on a simulated bench: photon transfer, noise, range, linearity, MTF.

    The methods are those of EMVA 1288 and ISO 12233, applied to raw frames; each value is shown
    beside the one computed from the camera file. Write characterize.csv, characterize.json,
    photon_transfer.png, snr.png, linearity.png and mtf.png.

    \b
    Example:
      vcam characterize starter
      vcam characterize camera.yaml --set scene.illuminant=FL2
      vcam characterize kac-12040 --keep-frames
    """
    from vcam_cli import face
    from vcam_cli.camera.expectations import read_limits
    from vcam_cli.characterization.datasheet import UNITS
    from vcam_cli.characterization.kept_frames import DESCRIPTOR
    from vcam_cli.simulation.checks import load

    limits = read_limits(expect or (), UNITS)
    model = load(camera, options.overrides(set_, seed, accuracy))
    path = out or Path("out") / model.name
    with Progress(quiet) as bar:
        found = face.characterize(
            model, path, workers, bar, keep_frames, wants_report, formats or (), device
        )
    for note in found.notes:
        options.say(note, quiet)
    options.print_found(found, path, as_json, quiet, print_report)
    if keep_frames and not (as_json or quiet):
        print(f"{path}/frames: TIFF files of each color, and {DESCRIPTOR}, which lists them")
    options.end_with_expectations(limits, found.misses(limits), quiet)


def print_report(found: "Characterization", path: Path) -> None:
    """Print the table: measured and expected values of every color side by side."""
    from vcam_cli.characterization.output import quantities_table

    console, table = options.open_table()
    head, rows = quantities_table(found)
    for name in head:
        side = "left" if name in ("quantity", "unit") else "right"
        table.add_column(name, justify=side, no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console.print(table)
    console.print(f"{path}/characterize.csv, photon_transfer.png, snr.png, linearity.png, mtf.png")
