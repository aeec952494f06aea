"""A hash of the package's own files, stored with every result.

Between releases the code changes and the version number does not, so that the version alone does
not identify the code. The files are listed with size and time, and read, when the hash is first
needed: a list takes 2 ms on fast disks and 30 ms on slow ones, which commands that store no result
save. Where a file was changed, added or removed after the package was loaded, the program in memory
is no longer the one on the disk, and has no hash.
"""

import os
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent
NOT_CODE = {"__pycache__", "configs", "schemas"}
"""Folders of the package that hold no code: results know the shipped files that they use."""
STARTED = time.time_ns()
"""When the package was loaded [ns since 1970]."""
Files = dict[str, os.stat_result]
"""Path inside the package -> status of the file."""
State = tuple[tuple[str, int, int], ...]
"""(path inside the package, size [bytes], time of the last write [ns]) of each file."""


def code_hash() -> str:
    """Return the hash of the code that this process runs, 16 hexadecimal digits.

    Raise CannotDo where its files have changed since it was loaded.
    """
    files = dict(_files(PACKAGE, ""))
    first = _FIRST.get((PACKAGE, STARTED))
    if first is None and _is_as_loaded(files):
        first = _FIRST[PACKAGE, STARTED] = _state(files)
    if first is None or first != _state(files):
        from vcam_cli.errors import CannotDo

        message = "the program's own files have changed since it was started"
        raise CannotDo(message, "start it again")
    return _hash(PACKAGE, first)


_FIRST: dict[tuple[Path, int], State] = {}
"""(package, when it was loaded) -> its files when the hash was first needed."""


def _files(place: Path, folder: str) -> Iterator[tuple[str, os.stat_result]]:
    """Yield the package's files: its modules, and its tables of constants."""
    with os.scandir(place) as entries:
        for entry in entries:
            name = f"{folder}{entry.name}"
            if entry.is_dir():
                if entry.name not in NOT_CODE:
                    yield from _files(Path(entry.path), f"{name}/")
            elif entry.name.endswith((".py", ".csv")):
                yield name, entry.stat()


def _state(files: Files) -> State:
    return tuple(sorted((name, file.st_size, file.st_mtime_ns) for name, file in files.items()))


def _is_as_loaded(files: Files) -> bool:
    """Return whether no file was changed, added or removed since the package was loaded."""
    # By the time of the inode: `cp -p`, rsync and uv keep that of the last write. A removed file
    # has none, but may be a module in memory.
    if any(file.st_ctime_ns > STARTED for file in files.values()):
        return False
    sources = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    inside = f"{PACKAGE}{os.sep}"
    names = (source.removeprefix(inside) for source in sources if source and inside in source)
    return all(name.replace(os.sep, "/") in files for name in names if name.endswith(".py"))


@cache
def _hash(package: Path, files: State) -> str:
    """Return the hash of files, by their paths and their bytes."""
    import hashlib

    whole = hashlib.sha256()
    for name, size, _ in files:
        whole.update(f"{name}\0{size}\0".encode())
        # Unbuffered, and without a Path for each: half the time of the hash.
        with open(f"{package}{os.sep}{name}", "rb", buffering=0) as file:
            whole.update(file.read())
    return whole.hexdigest()[:16]
