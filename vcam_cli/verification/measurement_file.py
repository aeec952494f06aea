"""A measurement file -> a `Measurement`, with its places."""

from pathlib import Path

from vcam_cli.camera.camera import MERGE_RULES
from vcam_cli.camera.hint_tables import PICTURES
from vcam_cli.config import document
from vcam_cli.config.file_format import FileFormat
from vcam_cli.config.file_names import current_folder
from vcam_cli.config.yaml_tree import Node
from vcam_cli.errors import BadInput, bad
from vcam_cli.files.file_checks import RAW_SUFFIXES
from vcam_cli.floats import own_float_errors
from vcam_cli.verification.model import Measurement

FRAMES = frozenset((*RAW_SUFFIXES, ".npy", ".npz", ".pgm", *PICTURES))
"""Ends of the names of files of frames."""


def _refuse_others(root: Node) -> None:
    """Raise BadInput where the file is no measurement."""
    kind = root.get("kind")
    if kind is None or kind.value != "measurement":
        message, remedy = "this is no measurement", "write kind: measurement, or give another file"
        raise BadInput([(kind or root).problem(("kind",), message, remedy)])


FORMAT = FileFormat(
    model=Measurement,
    kind="measurements",
    file_keys=frozenset({"file"}),
    merge_rules=MERGE_RULES,
    refuse=_refuse_others,
)


@own_float_errors
def read(measurement: str | Path) -> Measurement:
    """Return the validated measurement of a file, or of a shipped one's name.

    Raises BadInput, CannotDo.
    """
    path = Path(measurement)
    if path.suffix.lower() in FRAMES:
        remedy = (
            "write a measurement file that lists it: kind: measurement, frames:"
            f" [{{files: {path.name}, exposure: 10 ms, light: none}}], levels: {{bits: 12}}, pixel:"
            " {width: 3.45 um}"
        )
        raise bad((), f"{str(measurement)!r} is a frame, not a measurement file", remedy)
    return document.read(measurement, current_folder(), FORMAT).validate()
