"""The memory that this process has taken, and may still take."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

from vcam_cli.errors import CannotDo

LEAST_ADDRESS_SPACE = 400_000_000
"""Of a process that simulates a few pixels: interpreter, libraries, what they reserve [bytes]."""
LITTLE = 1 << 22
"""What a process may take without a look at what is free, less than it takes by importing a module
or two [bytes]. A look takes 0.3 ms, 4 % of a frame of 64 x 64 pixels of a data set."""
BLAS_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables of the environment that tell a BLAS how many threads it may start."""
MOST_HEAPS = -8
"""The number of `M_ARENA_MAX` in the GNU C library's `malloc.h`."""


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


def peak_memory() -> int:
    """Return the largest memory of this process so far [bytes]."""
    # Linux's `ru_maxrss` begins with the memory of the process that started this one.
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/self/status").read_text("ascii").splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmHWM:")).split()[1])
    import resource  # not on Windows

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def limit_blas_threads() -> None:
    """Let a BLAS start no threads, unless the environment says how many.

    To be called before it is loaded. vcam has threads of its own; those of a BLAS spin beside them,
    which takes half of the processors' time again and gains nothing, and reserve address space.
    """
    for name in BLAS_VARIABLES:
        os.environ.setdefault(name, "1")


def share_heap() -> None:
    """Let all threads allocate from one heap, where the C library is GNU's.

    To be called before any thread is started. Each would have a heap of its own, and what is freed
    there is no room for arrays of others: with two threads the peak of a frame was a tenth to a
    fifth higher, and depended on which of them met. Processor time is the same.
    """
    with contextlib.suppress(ImportError, OSError, AttributeError, TypeError):
        import ctypes

        ctypes.CDLL(None).mallopt(MOST_HEAPS, 1)


def require_address_space() -> None:
    """Raise CannotDo where the process's address space does not hold the libraries it needs.

    To be asked before they are loaded: OpenBLAS waits forever for what it cannot have.
    """
    limit = _address_space()
    if limit is not None and limit < LEAST_ADDRESS_SPACE:
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
    if needed < LITTLE:
        return
    free = available()
    if needed > free:
        raise CannotDo(
            f"{rows} x {columns} pixels need about {needed / 1e9:.3g} GB of"
            f" memory; {free / 1e9:.3g} GB are free",
            "use fewer pixels (array), or accuracy: draft",
        )
