"""A lens from a file or by its shipped name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from vcam_cli.config import shipped
from vcam_cli.errors import BadInput, CannotDo, Problem
from vcam_cli.lenses import table, zmx
from vcam_cli.lenses.glasses import Glass
from vcam_cli.lenses.prescription import Prescription

NO_GLASSES: Mapping[str, Glass] = {}


def read(file: Path, given: Mapping[str, Glass] = NO_GLASSES) -> Prescription:
    """Return the lens of a `.zmx` or YAML file.

    Parameters
    ----------
    file : Path
        The file.
    given : mapping, optional
        Name -> glass, of glasses that the user gives.

    Raises
    ------
    BadInput
        For what is no lens that can be traced, with file and line.
    CannotDo
        Where the file may not be read.
    """
    upper = {name.upper(): glass for name, glass in given.items()}
    if file.suffix.lower() != ".zmx":
        return table.read(file, upper)
    try:
        return zmx.read(file, upper)
    except (FileNotFoundError, IsADirectoryError):
        raise BadInput([Problem((), f"there is no file {file}", "check the path")]) from None
    except OSError as error:
        message = f"{file}: cannot be read: {error.strerror or error}"
        raise CannotDo(message, "check its permissions") from None


def shipped_lens(name: str) -> Prescription:
    """Return a lens that ships. Raises BadInput with the nearest name."""
    return read(shipped.find("lenses", name))
