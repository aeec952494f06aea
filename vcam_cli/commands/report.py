"""`vcam report`: runs side by side on one page."""

from pathlib import Path
from typing import Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.commands.progress import Progress

OUT = Path("report.html")


def report(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Folders that `vcam run` wrote.", show_default=False),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help="The page to write.")
    ] = OUT,
    quiet: options.Quiet = False,
) -> None:
    """Write one page that shows runs side by side: pictures, settings, metrics, effects.

    Pictures have a common zoom. The page is self-contained and can be sent.

    \b
    Example:
      vcam report out/still-life out/f8
      vcam report out/night out/day -o night-and-day.html
    """
    from vcam_cli.errors import bad
    from vcam_cli.files.atomic import cannot_write
    from vcam_cli.files.records import adopt
    from vcam_cli.reports import page
    from vcam_cli.reports.side_by_side import read_runs, side_by_side

    if out.suffix.lower() not in (".html", ".htm"):
        raise bad(
            "--out", f"{out} is not the name of an HTML page", "write for example -o report.html"
        )
    try:
        if out.exists() and not page.is_report(out):
            raise bad("--out", f"{out} exists and is not a report of vcam", "choose another name")
    except OSError as error:
        raise cannot_write(out, error) from error
    with Progress(quiet) as progress:
        progress.begin("report")
        page.write(out, side_by_side(read_runs(folders)))
    adopt(out)
    if not quiet:
        print(out)
