"""The memory that this process may still take."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from vcam_cli.errors import CannotDo

LEAST_ADDRESS_SPACE = 400_000_000
"""Of a process that simulates a few pixels: interpreter, libraries, what they reserve [bytes]."""


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
    space = _address_space()
    if space is not None:
        with contextlib.suppress(OSError, ValueError, AttributeError):
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            found.append(space - pages * os.sysconf("SC_PAGE_SIZE"))
    if not system:
        with contextlib.suppress(OSError, ValueError, AttributeError):
            found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return min(found)


def require_address_space() -> None:
    """Raise CannotDo where the process's address space does not hold the libraries it needs.

    To be asked before they are loaded: OpenBLAS waits forever for what it cannot have. It reserves
    space for each of its threads, so where space is limited it gets one: vcam has threads of its
    own.
    """
    limit = _address_space()
    if limit is None:
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if limit < LEAST_ADDRESS_SPACE:
        raise CannotDo(
            f"the process may have {limit / 1e6:.0f} MB of address space;"
            f" {LEAST_ADDRESS_SPACE / 1e6:.0f} MB are needed at least",
            "allow more (ulimit -v)",
        )


def _address_space() -> int | None:
    """Return the address space that this process may have [bytes]; None for no limit."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        return None if limit == resource.RLIM_INFINITY else limit
    return None


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
