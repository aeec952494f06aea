"""A hash of the package's own files, stored with every result.

Between releases the code changes and the version number does not, so that the version alone does
not identify the code. The files are listed with size and time when the package is loaded, and read
once, when the hash is first needed. Where the list has changed by then, the program in memory is no
longer the one on the disk, and has no hash.
"""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent
NOT_CODE = {"__pycache__", "configs", "schemas"}
"""Folders of the package that hold no code: results know the shipped files that they use."""
State = tuple[tuple[str, int, int], ...]
"""(path inside the package, size [bytes], time of the last change [ns]) of each file."""


def _state() -> State:
    """Return the state of the package's files: its modules, and its tables of constants."""
    return tuple(sorted(_files(PACKAGE, "")))


def _files(place: Path, folder: str) -> Iterator[tuple[str, int, int]]:
    with os.scandir(place) as entries:
        for entry in entries:
            name = f"{folder}{entry.name}"
            if entry.is_dir():
                if entry.name not in NOT_CODE:
                    yield from _files(Path(entry.path), f"{name}/")
            elif entry.name.endswith((".py", ".csv")):
                status = entry.stat()
                yield name, status.st_size, status.st_mtime_ns


LOADED = _state()
"""The state of the files when the package was loaded."""


def code_hash() -> str:
    """Return the hash of the code that this process runs, 16 hexadecimal digits.

    Raise CannotDo where its files have changed since it was loaded.
    """
    if _state() != LOADED:
        from vcam_cli.errors import CannotDo

        message = "the program's own files have changed since it was started"
        raise CannotDo(message, "start it again")
    return _hash(PACKAGE, LOADED)


@cache
def _hash(package: Path, files: State) -> str:
    """Return the hash of files, by their paths and their bytes."""
    import hashlib

    whole = hashlib.sha256()
    for name, size, _ in files:
        whole.update(f"{name}\0{size}\0".encode())
        whole.update((package / name).read_bytes())
    return whole.hexdigest()[:16]
