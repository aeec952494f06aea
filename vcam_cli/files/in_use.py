"""Who is at work in an output folder: one run alone, or processes that share a sweep.

A run holds the lock file, every process of a sweep a byte of the claims beside its points. Whoever
comes takes its own lock first and looks for the other kind then: of two that come at once at least
one sees the other. The kernel drops both locks when their holder dies.
"""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path

from vcam_cli.errors import CannotDo
from vcam_cli.files.records import LOCK

POINTS = "points"
"""Folder of a sweep's points."""
CLAIMS = ".claims"
"""File there whose bytes processes lock."""
STUDIES, STUDIES_END = 1 << 60, 1 << 61
"""Bytes of a study: each process of a sweep locks its own. Those before are claims of points."""


def require_no_sweep(folder: Path) -> None:
    """Raise CannotDo where a sweep is at work in the folder of a run."""

    def lock(claims: int) -> None:
        fcntl.lockf(claims, fcntl.LOCK_EX | fcntl.LOCK_NB, STUDIES_END - STUDIES, STUDIES)

    if _is_locked(folder / POINTS / CLAIMS, os.O_RDWR, lock):
        raise _in_use(folder, "a sweep")


def require_no_run(folder: Path) -> None:
    """Raise CannotDo where a run is at work in the folder of a sweep."""

    def lock(file: int) -> None:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)

    if _is_locked(folder / LOCK, os.O_RDONLY, lock):
        raise _in_use(folder, "another run")


def _is_locked(path: Path, mode: int, lock: Callable[[int], None]) -> bool:
    """Return whether another process locks a file; nothing is locked where there are no locks."""
    try:
        file = os.open(path, mode | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        lock(file)
    except OSError as error:
        return isinstance(error, BlockingIOError | PermissionError)
    finally:
        os.close(file)
    return False


def _in_use(folder: Path, who: str) -> CannotDo:
    message = f"folder in use: {who} is writing {folder}"
    return CannotDo(message, "wait for it, or choose another folder")
