"""Checks of a file before it is read, and the errors that they report."""

import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

from vcam_cli.errors import BadInput, CannotDo, bad

PNG_START = b"\x89PNG\r\n\x1a\n"

RAW_SUFFIXES = (
    ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw", ".3fr", ".iiq",
)  # fmt: skip
"""Ends of the names of raw files."""


class UnusableFile(Exception):
    """A file that cannot be used: the reason, and a remedy where it is not that of its kind."""

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(reason)
        self.reason, self.remedy = reason, remedy


@contextmanager
def convert_errors(
    path: Path, yaml_path: tuple[str | int, ...] | str, remedy: str
) -> Iterator[None]:
    """Convert what can be wrong with a file into BadInput and CannotDo.

    remedy: the remedy for a file that is not of its kind.
    """
    try:
        yield
    except UnusableFile as error:
        raise bad(yaml_path, f"{path}: {error.reason}", error.remedy or remedy) from None
    except PermissionError:
        raise CannotDo(f"{path} may not be read", "give yourself read permission") from None
    except (OSError, UnicodeError, ValueError, RuntimeError) as error:
        raise _unreadable(path, error, yaml_path, remedy) from error
    except MemoryError:
        raise too_large(f"{path} does not fit the memory") from None


def is_raw(path: Path) -> bool:
    """Return whether a file is a camera's raw file, by its name."""
    return path.suffix.lower() in RAW_SUFFIXES


def check_file(path: Path) -> os.stat_result:
    """Return the state of a file; refuse what is no whole regular one, before OpenImageIO."""
    status = check_regular(path)
    if not _is_whole(path, status.st_size, status.st_ctime_ns, status.st_ino):
        raise truncated_file()
    return status


@lru_cache(1024)
def _is_whole(path: Path, size: int, changed: int, inode: int) -> bool:
    """Return whether a file is whole, where its format shows it; read once in each state."""
    del changed, inode
    with open(path, "rb") as file:
        return file.read(8) != PNG_START or _png_is_whole(file, size)


def check_regular(path: Path) -> os.stat_result:
    """Return the state of a regular file; refuse all else unopened: a pipe would hang."""
    str(path).encode("utf-8")  # OpenImageIO takes no other names
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise UnusableFile("there is no such file", "check the name and the folder") from None
    if stat.S_ISDIR(status.st_mode):
        raise UnusableFile("is a folder, not an image file", "give an image file")
    if not stat.S_ISREG(status.st_mode):
        raise UnusableFile("is a device, pipe or socket", "give a regular image file")
    if status.st_size == 0:
        raise UnusableFile("the file is empty", "give a complete image file")
    return status


def _png_is_whole(file: Any, size: int) -> bool:
    """Tell whether a PNG's chunks reach IEND unharmed (libpng would print its own complaint).

    Those that it can do without may be damaged: their name begins with a small letter.
    """
    place = len(PNG_START)
    while place + 12 <= size:
        file.seek(place)
        head = file.read(8)
        if head[4:] == b"IEND":
            return True
        if not head[4:].isalpha():
            return False
        length = int.from_bytes(head[:4], "big")
        place += 12 + length
        if place > size:
            return False
        if head[4:5].isupper() and not _check_sum_holds(file, head[4:], length):
            return False
    return False


def _check_sum_holds(file: Any, name: bytes, length: int) -> bool:
    """Tell whether the CRC-32 of a PNG's chunk, whose data comes next, is the one stored."""
    found = zlib.crc32(name)
    while length > 0:
        part = file.read(min(length, 1 << 20))
        found, length = zlib.crc32(part, found), length - len(part)
        if not part:
            return False
    return found == int.from_bytes(file.read(4), "big")


def truncated_file(reason: str = "") -> UnusableFile:
    """Return the error for a file that ends too early."""
    detail = f" ({reason[:100]})" if reason else ""
    return UnusableFile(f"is truncated or damaged{detail}", "copy or download the file again")


def _unreadable(
    path: Path, error: Exception, yaml_path: tuple[str | int, ...] | str, remedy: str
) -> BadInput:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return bad(yaml_path, f"{path}: cannot be read ({brief_reason(reason, path)})", remedy)


def too_large(text: str) -> CannotDo:
    """Return the error for a file that needs more memory than there is."""
    return CannotDo(text, "reduce the image's size, or use a machine with more memory")


def brief_reason(reason: str, path: Path) -> str:
    """Return a library's reason on one short line, the file by its name alone."""
    reason = reason.replace(str(path.absolute()), path.name) or "unknown format"
    return reason if len(reason) <= 120 else reason[:117] + "..."
