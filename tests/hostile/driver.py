"""vcam again and again: `Driver` runs it in forks of a process in which it is loaded already.

`python driver.py` reads lines of JSON and answers with lines of JSON. A line is a list of commands
that run at once: {"args": [...], "folder": "..."}, which may have "signal" and "after": the fork is
sent the signal after so many seconds; and "largest": no file may grow beyond so many bytes. The
answer of each has the exit code (negative for the signal it died of), what it printed, its seconds,
and its peak of memory.

Why forks: a run takes a tenth of a second, most of a process's second is the loading of libraries.
They are loaded before the first order, and no more than that: threads that a library begins when
it is used would not be there in a fork. A fork that hangs tells where, and ends.
"""

import contextlib
import faulthandler
import gc
import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any, Self

from processes import TIMEOUT, environment

MODULES = tempfile.NamedTemporaryFile(suffix=".json")  # noqa: SIM115 (as long as the process)
"""Names of modules that the first driver of a process found, for all others."""
HANGS = TIMEOUT / 2
"""Seconds after which a fork says where it is, and ends with exit code 1."""


class Driver:
    """Context of a process that runs vcam in forks.

    before: a command that starts it, for example in a name space of its own.
    """

    def __init__(self, *before: str) -> None:
        self._spare = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.process = subprocess.Popen(
            [*before, sys.executable, __file__, MODULES.name],
            env=environment({"TMPDIR": self._spare.name}),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    @property
    def left(self) -> list[str]:
        """What vcam left in the folder of temporary files."""
        return [name for name in os.listdir(self._spare.name) if "vcam-" in name]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait(TIMEOUT)
        self._spare.cleanup()

    def __call__(self, folder: Path, *args: str, **more: float) -> dict[str, Any]:
        """Runs `vcam ARGS` in a folder. more: signal, after, largest."""
        return self._told([{"args": args, "folder": str(folder), **more}])[0]

    def at_once(self, folder: Path, *lines: Sequence[str]) -> list[dict[str, Any]]:
        """Runs several `vcam ARGS` in a folder, all begun before the first has ended."""
        return self._told([{"args": args, "folder": str(folder)} for args in lines])

    def _told(self, orders: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """What came of orders that are carried out at once."""
        self.process.stdin.write(json.dumps(orders) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        assert line, f"the driver ended: {self.process.wait(TIMEOUT)}"
        return json.loads(line)


def answers(orders: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Runs commands as told, all at once, and says what came of each."""
    with contextlib.ExitStack() as files:
        begun = []
        for order in orders:
            printed = files.enter_context(tempfile.TemporaryFile("w+"))
            start = time.monotonic()
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # Python's own part of a fork
            process = os.fork()
            if process == 0:
                _child(order, printed.fileno())
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            begun.append((order, process, start, printed))
        return [_came_of(*each) for each in begun]


def _came_of(order: dict[str, Any], process: int, start: float, printed: IO[str]) -> dict[str, Any]:
    """Waits for a fork, and says what came of it."""
    if "signal" in order:
        time.sleep(order["after"])
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, order["signal"])
    _, status, used = os.wait4(process, 0)
    seconds = time.monotonic() - start
    printed.seek(0)
    code = os.waitstatus_to_exitcode(status)
    peak = used.ru_maxrss * 1024
    return {"code": code, "said": printed.read(), "seconds": seconds, "peak": peak}


def _child(order: dict[str, Any], printed: int) -> None:
    """Becomes `vcam`, and ends; a signal may come between any two of these lines."""
    code = 130
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        os.dup2(printed, 1)
        os.dup2(printed, 2)
        faulthandler.dump_traceback_later(HANGS, exit=True)
        os.chdir(order["folder"])
        if "largest" in order:
            resource.setrlimit(resource.RLIMIT_FSIZE, (order["largest"],) * 2)
        sys.argv = ["vcam", *order["args"]]
        code = _ended()
    except KeyboardInterrupt:
        code = 130
    finally:
        os._exit(code)


def _ended() -> int:
    """The exit code of `vcam`."""
    from vcam_cli.commands.main import main

    try:
        main()
    except SystemExit as error:
        return error.code or 0
    except Exception:
        traceback.print_exc()
        return 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
    return 0


STUDY = """\
kind: sweep
name: study
camera: starter
vary: {array.rows: {values: [16, 17]}}
cases: {a: {array.columns: 24, accuracy: draft, quality: [mse]}}
metrics: [mse]
keep: [raw]
"""


def _load(file: Path) -> None:
    """Imports what a sweep imports and a run: modules that a file names.

    Where it is empty, a fork runs both to tell it.
    """
    if not file.stat().st_size:
        for name in (
            "vcam_cli.commands.main",
            "vcam_cli.simulation.simulate",
            "vcam_cli.sweeps.sweep",
        ):
            importlib.import_module(name)  # most of them, which the fork need not load itself
        file.write_text(json.dumps(_used()))
    for name in json.loads(file.read_text()):
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    importlib.import_module("vcam_cli").load("starter")  # and what is kept of units and of tables


def _used() -> list[str]:
    """Names of the modules that a sweep uses, and a run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "study.yaml").write_text(STUDY)
        sets = [
            f"--set={s}"
            for s in ("array.rows=16", "array.columns=24", "quality=[mse]", "accuracy=draft")
        ]
        process = os.fork()
        if process == 0:
            with (path / "names").open("w") as names, (path / "said").open("w") as said:
                for args in (["run", "starter", *sets], ["sweep", "study.yaml", "--workers", "1"]):
                    os.dup2(said.fileno(), 1)
                    os.chdir(folder)
                    sys.argv = ["vcam", *args, "-q"]
                    code = _ended()
                    if code:
                        os._exit(code)
                json.dump(list(sys.modules), names)
            os._exit(0)
        _, status = os.waitpid(process, 0)
        assert not status, "a run or a sweep failed"
        return json.loads((path / "names").read_text())


if __name__ == "__main__":
    _load(Path(sys.argv[1]))
    gc.freeze()  # a fork that collects garbage copies the memory of all that is loaded
    os.fsync = lambda _: None  # half of a run's time; no fork is ended by a power cut
    for line in sys.stdin:
        print(json.dumps(answers(json.loads(line))), flush=True)
