"""Files that are whole or not there: write under a temporary name, flush to disk, rename.

Why fsync: a rename alone survives a killed process, not a power cut; flushing 65 MB just
written costs about 0.02 s on a local disk, against half a second to compress them.
"""

import errno
import os
import secrets
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from vcam_cli.errors import CannotDo, bad
from vcam_cli.interrupts import defer_interrupts

STAGING = ".vcam-new"  # folder where a run's files wait to appear together (see `folder`)

_REASONS = {
    errno.ENOSPC: ("the disk is full", "free some space, or choose another folder"),
    errno.EDQUOT: ("the disk quota is used up", "free some space, or choose another folder"),
    errno.EFBIG: ("the file grew larger than is allowed here", "choose another folder"),
    errno.EACCES: ("permission denied", "choose a folder you may write to"),
    errno.EPERM: ("not permitted", "choose a folder you may write to"),
    errno.EROFS: ("the file system is read-only", "choose another folder"),
}


@contextmanager
def write_whole(path: Path | str, is_flushed: bool = True) -> Iterator[Path]:
    """Yield a temporary name in the folder of `path`; on success the file gets its own name.

    is_flushed: whether it is on the disk then; else see `delayed_flush`.

    The body writes the file under the temporary name and closes it. When the body raises,
    whatever it raises, the temporary file is removed and a former `path` stays as it was.

    Raise CannotDo: disk full, no permission, no such folder (any OSError of the body).
    """
    path = Path(path)
    mark = f"{os.getpid()}-{secrets.token_hex(4)}"
    temporary = path.with_name(f".{path.name[:64]}.{mark}.part")
    try:
        yield temporary
        if is_flushed:
            flush(temporary)
        os.replace(temporary, path)
        if is_flushed:
            flush_folder(path.parent)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: Path | str, text: str, is_flushed: bool = True) -> None:
    """Write `text` as UTF-8 with line feeds, whole or not at all. Raise CannotDo.

    Bytes of a file's name that are no text become escapes, which JSON understands.
    """
    with write_whole(path, is_flushed) as temporary:
        temporary.write_text(text, "utf-8", "backslashreplace", newline="\n")


def write_bytes(path: Path | str, data: bytes, is_flushed: bool = True) -> None:
    """Write bytes, whole or not at all. Raise CannotDo."""
    with write_whole(path, is_flushed) as temporary:
        temporary.write_bytes(data)


def written_bytes(name: str, write: Callable[[Path], None]) -> bytes:
    """Return what `write` writes into a file of some path that ends in `name`. Raise CannotDo."""
    folder = None
    try:
        with defer_interrupts():
            folder = tempfile.TemporaryDirectory(prefix=f"{STAGING}-")
        path = Path(folder.name) / name
        write(path)
        return path.read_bytes()
    except OSError as error:
        raise cannot_write(tempfile.gettempdir(), error) from error
    finally:
        with defer_interrupts():
            if folder is not None:
                folder.cleanup()


def refuse_other(path: Path, text: str) -> None:
    """Raise BadInput where something is at `path` that is no file of this text."""
    if not os.path.lexists(path):
        return
    try:
        is_same = not path.is_symlink() and path.is_file() and path.read_bytes() == text.encode()
    except OSError as error:
        raise cannot_write(path, error) from error
    if not is_same:
        raise bad((), f"{path} exists already, with other content", "remove it, or give a folder")


def make_folder(folder: Path) -> None:
    """Make a folder and its parents where they are missing.

    Raise BadInput where something else has its name, CannotDo where it cannot be made.
    """
    if folder.exists() and not folder.is_dir():
        raise bad((), f"{folder} is not a folder", "give another one")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(folder, error) from error


def flush_folder(folder: Path) -> None:
    """Make renames in `folder` lasting, where the file system knows how to."""
    with suppress(OSError):
        flush(folder)


def cannot_write(path: Path | str, error: OSError) -> CannotDo:
    """Return the error that tells why `path` cannot be written and what would help."""
    default = (error.strerror or str(error), "choose another folder")
    reason, remedy = _REASONS.get(error.errno or 0, default)
    return CannotDo(f"cannot write {displayed_path(path)}: {reason}", remedy)


def displayed_path(path: Path | str) -> str:
    """Return `path` as the user knows it: without the folder where new files wait."""
    path = Path(path)
    return str(Path(*(part for part in path.parts if not part.startswith(STAGING))))


def flush(path: Path) -> None:
    """Have a file, or the names in a folder, on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
