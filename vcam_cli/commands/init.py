"""`vcam init`: a camera file and a study to start from."""

from pathlib import Path
from typing import Annotated

import typer

from vcam_cli.commands import options

FILE = "camera.yaml"
STARTER = "starter"  # the shipped camera that is copied
STUDY = "study.yaml"
STARTER_STUDY = "exposure-and-noise"  # the shipped study of that camera that is copied
SCHEMA = "schemas/{}.schema.json"
MODELINE = "# yaml-language-server: $schema={}\n"
"""First line by which editors find the schema of a file."""


def init(
    folder: Annotated[
        Path,
        typer.Argument(metavar="[DIR]", help="Folder to write into; default the current one."),
    ] = Path("."),
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Write a small commented camera file and a study of it, both ready to run.

    Existing files are never overwritten. The JSON Schemas in `schemas` let an editor complete
    and check both files.

    \b
    Example:
      vcam init mycamera
      vcam run mycamera/camera.yaml
    """
    from vcam_cli.config import shipped
    from vcam_cli.errors import bad
    from vcam_cli.files import atomic

    if folder.suffix in (".yaml", ".yml"):
        other = folder.with_suffix("")
        raise bad((), f"{folder} would be a folder", f"write vcam init {other}")
    camera, study = folder / FILE, folder / STUDY
    for target in (camera, study):
        if target.exists() or target.is_symlink():
            raise bad((), f"{target} exists already", "give another folder, or remove the file")
    names = [SCHEMA.format(kind) for kind in ("camera", "study")]
    texts = [(shipped.schemas() / Path(name).name).read_text("utf-8") for name in names]
    for name, text in zip(names, texts, strict=True):
        atomic.refuse_other(folder / name, text)
    atomic.make_folder(folder)
    atomic.make_folder(folder / Path(names[0]).parent)
    for name, text in zip(names, texts, strict=True):
        atomic.write_text(folder / name, text)
    first, second = map(MODELINE.format, names)
    atomic.write_text(camera, first + shipped.find("cameras", STARTER).read_text("utf-8"))
    _, _, text = shipped.find("studies", STARTER_STUDY).read_text("utf-8").partition("\n")
    atomic.write_text(study, second + text.replace(f"camera: {STARTER}", f"camera: {FILE}"))
    if as_json:
        written = [camera, study, *(folder / name for name in names)]
        options.write_json({"files": list(map(str, written))})
    else:
        options.say(f"wrote {camera}; next: vcam run {camera}", quiet)
        options.say(f"wrote {study}; next: vcam sweep {study}", quiet)
