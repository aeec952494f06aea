"""`vcam schema`: the JSON Schemas of the files a user writes."""

from pathlib import Path
from typing import Annotated

import typer

from vcam_cli.commands import options


def schema(
    folder: Annotated[
        Path,
        typer.Argument(metavar="[DIR]", help="Folder to write into; default the current one."),
    ] = Path("."),
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Write the JSON Schemas of camera, study and technology files, for editors and programs.

    Other files of the same names are never overwritten.

    An editor that reads YAML schemas completes and checks a camera file whose first line is
    `# yaml-language-server: $schema=camera.schema.json`.

    \b
    Example:
      vcam schema schemas
    """
    from vcam_cli.commands.schemas import schemas
    from vcam_cli.config.schema import text
    from vcam_cli.files import atomic

    texts = {folder / name: text(content) for name, content in schemas().items()}
    for path, content in texts.items():
        atomic.refuse_other(path, content)
    atomic.make_folder(folder)
    for path, content in texts.items():
        atomic.write_text(path, content)
    written = [str(path) for path in texts]
    if as_json:
        options.write_json({"files": written})
    else:
        options.say(f"wrote {', '.join(written)}", quiet)
