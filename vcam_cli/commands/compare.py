"""`vcam compare`: how different two image files look."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

DISTANCE = "18 in"


def check_positive(value: float | None) -> float | None:
    """Check that a number, if given, is positive and finite."""
    if value is not None and not 0 < value < float("inf"):
        raise typer.BadParameter(f"{value:g} is not a positive number")
    return value


def check_white(value: str | None) -> str | None:
    """Check that a white, if given, is three positive numbers."""
    if value is not None:
        parse_white(value)
    return value


def parse_white(text: str) -> tuple[float, float, float]:
    """Parse a white such as "95.047,100,108.883"."""
    from vcam_cli.comparison.image_files import white_problem

    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = -1.0
    if problem := white_problem((x, y, z), text):
        raise typer.BadParameter(problem)
    return x, y, z


def check_distance(value: str | None) -> str | None:
    """Check that a distance from the eye to the display, if given, is a positive length."""
    from vcam_cli.units import parse

    if value is not None:
        try:
            length = parse(value, "length")
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
        if not 0 < length < float("inf"):
            raise typer.BadParameter(f"{value!r} is not positive; write for example {DISTANCE}")
    return value


def compare(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", show_default=False)],
    reference: Annotated[
        Path,
        typer.Argument(
            metavar="REFERENCE",
            help="Two image files of the same size, any that OpenImageIO reads.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            metavar="DIR",
            help="Folder for compare.csv, s_cielab.exr and s_cielab.png; default: none written.",
        ),
    ] = None,
    ppd: Annotated[
        float | None,
        typer.Option(
            "--ppd", metavar="N", callback=check_positive, help="Pixels in a degree of vision."
        ),
    ] = None,
    dpi: Annotated[
        float | None,
        typer.Option(
            "--dpi", metavar="N", callback=check_positive, help="In place of --ppd; default 72."
        ),
    ] = None,
    distance: Annotated[
        str | None,
        typer.Option(
            "--distance",
            metavar="LENGTH",
            callback=check_distance,
            help='From eye to display; default "18 in".',
        ),
    ] = None,
    space: Annotated[
        Literal["srgb", "linear-srgb", "xyz"] | None,
        typer.Option(
            "--space", help="Color space of the values; default from each file, else srgb."
        ),
    ] = None,
    white: Annotated[
        str | None,
        typer.Option(
            "--white",
            metavar="X,Y,Z",
            callback=check_white,
            help="White of --space xyz; default D65 with Y = 100.",
        ),
    ] = None,
    delta_e: Annotated[
        Literal["1976", "1994", "2000"], typer.Option("--delta-e", help="Formula of Delta E.")
    ] = "1976",
    filters: Annotated[
        Literal["zhang-wandell-1996", "isetcam", "continuous"],
        typer.Option("--filters", help="Variant of the eye's filters of S-CIELAB."),
    ] = "zhang-wandell-1996",
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    workers: options.Workers = None,
) -> None:
    """Compare two images: MSE, PSNR, CIELAB and S-CIELAB differences.

    \b
    Example:
      vcam compare out/a/render.png out/b/render.png
      vcam compare out/a/raw.dng out/a/render.png
      vcam compare a.exr b.exr --space xyz --ppd 23 --delta-e 2000 -o out/ab
    """
    from vcam_cli import face
    from vcam_cli.files.report import to_json

    with Progress(quiet) as progress:
        progress.begin("compare")
        found = face.compare(
            image,
            reference,
            out,
            ppd,
            dpi,
            distance,
            space,
            None if white is None else parse_white(white),
            delta_e,
            filters,
            workers,
        )
    for note in found.notes:
        options.say(note, quiet)
    if as_json:
        print(to_json(found.report() | {"out": None if out is None else str(out)}), end="")
    else:
        rows = [(name, f"{value:.6g}", unit) for name, value, unit in found.metrics]
        plain = "\n".join(f"{n:<20} {v:>12} {unit}".rstrip() for n, v, unit in rows)
        options.print_rows(("metric", ">value", "unit"), rows, plain)
        if out is not None:
            print(f"map and numbers: {out}/")
