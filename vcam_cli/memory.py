"""The memory that this process may still take."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from vcam_cli.errors import CannotDo


def available() -> int:
    """Return the memory that this process may still take [bytes].

    That is the system's, or the control group's or the process's own where it is less.
    """
    found = [1 << 62]
    with contextlib.suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/meminfo").read_text().splitlines()
        line = next(text for text in lines if text.startswith("MemAvailable"))
        found.append(int(line.split()[1]) * 1024)
    with contextlib.suppress(OSError, ValueError):
        limit = int(Path("/sys/fs/cgroup/memory.max").read_text())
        used = int(Path("/sys/fs/cgroup/memory.current").read_text())
        found.append(limit - used)
    system = len(found) > 1
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            taken = int(Path("/proc/self/statm").read_text().split()[0])
            found.append(limit - taken * resource.getpagesize())
    if not system:
        with contextlib.suppress(OSError, ValueError, AttributeError):
            found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return min(found)


def require(needed: int, rows: int, columns: int) -> None:
    """Raise CannotDo where more than the available memory is needed.

    Parameters
    ----------
    needed : int
        Memory that a computation takes [bytes].
    rows, columns : int
        Size of the array, for the message.
    """
    free = available()
    if needed > free:
        raise CannotDo(
            f"{rows} x {columns} pixels need about {needed / 1e9:.3g} GB of"
            f" memory; {free / 1e9:.3g} GB are free",
            "use fewer pixels (array), or accuracy: draft",
        )
