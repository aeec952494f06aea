"""`vcam init`: a camera file to start from."""

from pathlib import Path
from typing import Annotated

import typer

from vcam_cli.commands import options

FILE = "camera.yaml"
STARTER = "starter"  # the shipped camera that is copied


def init(
    folder: Annotated[
        Path,
        typer.Argument(metavar="[DIR]", help="Folder to write into; default the current one."),
    ] = Path("."),
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Writes a small commented camera file that runs as it is.

    Existing files are never overwritten.

    \b
    Example:
      vcam init mycamera
      vcam run mycamera/camera.yaml
    """
    from vcam_cli.camera import shipped
    from vcam_cli.errors import bad
    from vcam_cli.files import atomic

    target = folder / FILE
    if target.exists() or target.is_symlink():
        raise bad((), f"{target} exists already", "give another folder, or remove the file")
    atomic.make_folder(folder)
    atomic.write_text(target, shipped.find("cameras", STARTER).read_text("utf-8"))
    if as_json:
        options.write_json({"files": [str(target)]})
    else:
        options.say(f"wrote {target}; next: vcam run {target}", quiet)
