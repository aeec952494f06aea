"""`vcam init`: a camera file and a study to start from."""

from pathlib import Path
from typing import Annotated

import typer

from vcam_cli.commands import options

FILE = "camera.yaml"
STARTER = "starter"  # the shipped camera that is copied
STUDY = "study.yaml"
STARTER_STUDY = "exposure-and-noise"  # the shipped study of that camera that is copied


def init(
    folder: Annotated[
        Path,
        typer.Argument(metavar="[DIR]", help="Folder to write into; default the current one."),
    ] = Path("."),
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Write a small commented camera file and a study of it, which run as they are.

    Existing files are never overwritten.

    \b
    Example:
      vcam init mycamera
      vcam run mycamera/camera.yaml
    """
    from vcam_cli.config import shipped
    from vcam_cli.errors import bad
    from vcam_cli.files import atomic

    camera, study = folder / FILE, folder / STUDY
    for target in (camera, study):
        if target.exists() or target.is_symlink():
            raise bad((), f"{target} exists already", "give another folder, or remove the file")
    atomic.make_folder(folder)
    atomic.write_text(camera, shipped.find("cameras", STARTER).read_text("utf-8"))
    _, _, text = shipped.find("studies", STARTER_STUDY).read_text("utf-8").partition("\n")
    atomic.write_text(study, text.replace(f"camera: {STARTER}", f"camera: {FILE}"))
    if as_json:
        options.write_json({"files": [str(camera), str(study)]})
    else:
        options.say(f"wrote {camera}; next: vcam run {camera}", quiet)
        options.say(f"wrote {study}; next: vcam sweep {study}", quiet)
