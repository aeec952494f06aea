"""A camera file -> a `Camera`, read by its format."""

from collections.abc import Sequence
from pathlib import Path

from vcam_cli.arguments import require_name, require_overrides
from vcam_cli.camera.camera import FORMAT, MERGE_RULES, Camera
from vcam_cli.camera.hint_tables import PICTURES
from vcam_cli.config import document, overrides
from vcam_cli.config import merge as merging
from vcam_cli.config.document import Document
from vcam_cli.config.file_format import Check
from vcam_cli.config.file_names import current_folder
from vcam_cli.config.yaml_tree import Node
from vcam_cli.errors import bad
from vcam_cli.floats import own_float_errors

CameraCheck = Check[Camera]


@own_float_errors
def load(
    camera: str | Path,
    sets: Sequence[str] = (),
    folder: Path | None = None,
    checks: Sequence[CameraCheck] = (),
) -> Camera:
    """Return the validated camera of a file, or of a shipped camera's name.

    Parameters
    ----------
    camera : str or Path
        The file or name.
    sets : sequence of str
        Overrides "PATH=VALUE", VALUE read as YAML.
    folder : Path, optional
        Where relative paths start; default the current folder.
    checks : sequence
        Further checks, made where the sections that they need are valid.

    Returns
    -------
    Camera
        The camera, whose `locate(path)` gives the place of a key.

    Raises
    ------
    BadInput
        With every problem of the file.
    CannotDo
        Where a file may not be read.
    TypeError
        For what is no name, or no list of overrides.
    """
    require_name(camera, "camera")
    require_overrides(sets)
    start = folder or current_folder()
    return read(camera, start).overlay(overlay(sets, start)).validate(checks)


def read(camera: str | Path, folder: Path) -> Document[Camera]:
    """Return a camera file, or a shipped camera's, with all its parts.

    Raises BadInput, CannotDo.
    """
    if Path(camera).suffix.lower() in PICTURES:
        remedy = f'write --set scene.source="{{kind: image, file: {camera}}}" behind a camera'
        raise bad((), f"{str(camera)!r} is a picture, not a camera", remedy)
    return document.read(camera, folder, FORMAT)


def overlay(sets: Sequence[str], folder: Path) -> Node:
    """Return the tree of overrides "PATH=VALUE" of a camera. Raises BadInput."""
    return overrides.overlay(sets, folder, MERGE_RULES)


def merge(base: Node, over: Node) -> Node:
    """Return a camera's tree with another one laid over it. Raises BadInput."""
    return merging.merge(base, over, MERGE_RULES)
