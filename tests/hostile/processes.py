"""vcam as a process of its own, and what it may use."""

import os
import resource
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import vcam_cli

ROOT = Path(vcam_cli.__file__).parents[1]
VCAM = [sys.executable, "-m", "vcam_cli.commands.main"]
TIMEOUT = 300
"""Seconds after which a process hangs, on however busy a machine."""
GB = 1 << 30


@dataclass(frozen=True)
class Done:
    """A process that has ended."""

    code: int
    out: str
    said: str
    """On stderr."""
    peak: int
    """The most memory it held [bytes]."""
    seconds: float
    """Of processors."""


def environment(more: Mapping[str, str] | None = None) -> dict[str, str]:
    """Of a process that finds the package, and runs in one thread."""
    others = os.environ.get("PYTHONPATH")
    path = os.pathsep.join(p for p in (str(ROOT), others) if p)
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    return os.environ | {"PYTHONPATH": path} | one | dict(more or {})


def vcam(
    args: Sequence[str | Path], folder: Path, memory: int | None = None, before: Sequence[str] = ()
) -> Done:
    """Runs `vcam ...` in a folder.

    memory: bytes of address space it may take; before: a command that starts it.
    """

    def limited() -> None:
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    process = subprocess.Popen(
        [*before, *VCAM, *map(str, args)],
        cwd=folder, env=environment(), preexec_fn=limited, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    return _ended(process)


def _ended(process: subprocess.Popen) -> Done:
    """Waits for its end and for what it used."""
    import threading

    late = threading.Timer(TIMEOUT, process.kill)
    late.start()
    said: list[str] = []
    reader = threading.Thread(target=lambda: said.append(process.stderr.read()))
    reader.start()
    out = process.stdout.read()
    reader.join()
    _, status, used = os.wait4(process.pid, 0)
    late.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stdout.close()
    process.stderr.close()
    seconds = used.ru_utime + used.ru_stime
    return Done(process.returncode, out, said[0], used.ru_maxrss * 1024, seconds)


def refused(done: Done, *words: str, code: int = 2) -> None:
    """It ended as it does with what it cannot take: an exit code, words, no traceback."""
    assert done.code == code, done
    assert "Traceback" not in done.said, done
    assert done.out == "", done
    for word in words:
        assert word in done.said, (word, done.said)
