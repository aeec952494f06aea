"""A bar on the terminal, with the time left, for whatever takes longer than two seconds.

It is drawn on stderr, and only when stderr is a terminal that takes it: NO_COLOR
(https://no-color.org), a dumb terminal and --quiet are respected. The work goes on in the thread
that began it; the bar has a thread of its own, which loads the library that draws it when the two
seconds are over, and not before.
"""

import contextlib
import os
import sys
import threading
import time
from types import TracebackType
from typing import Any, Self

AFTER = 2.0
"""Seconds before the bar appears."""
EVERY = 0.1
"""Seconds between two looks at the clock."""
WORDS = {
    "read": "reading the image",
    "scene": "building the scene",
    "optics": "light through the lens",
    "exposure": "planning",
    "capture": "taking the frame",
    "flats": "taking flat fields",
    "darks": "taking dark frames",
    "stacks": "taking stacks of frames",
    "edge": "taking the slanted edge",
    "balance": "measuring colors",
    "processing": "processing",
    "ideal": "ideal image",
    "quality": "judging the picture",
    "files": "writing files",
    "irradiance": "spectral irradiance",
    "points": "checking all points",
    "sweep": "computing points",
    "figures": "computing figures",
    "tables": "writing tables",
}
"""What is said of a stage; of others, their name."""


def wanted(quiet: bool = False) -> bool:
    """Whether a bar may be drawn: stderr is a terminal, and nobody has asked for silence."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return not quiet and not plain and sys.stderr.isatty()


LOG_EVERY = 60.0
"""Seconds between two lines of a log."""


class Progress:
    """Context around some work, and its observer (see `engine.stages.Observer`).

    with Progress(quiet) as progress:
        simulate(camera, watch=progress)
    """

    def __init__(self, quiet: bool = False) -> None:
        self._start = time.monotonic()
        self._stage = ""
        self._stage_start = self._start
        self._expected = 0.0
        self._steps = (0, 0)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._draw, daemon=True) if wanted(quiet) else None

    def __enter__(self) -> Self:
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def begin(self, stage: str) -> None:
        self._stage, self._stage_start, self._steps = stage, time.monotonic(), (0, 0)

    def expect(self, seconds: float) -> None:
        self._expected = seconds

    def step(self, done: int, total: int) -> None:
        self._steps = (done, total)

    def left(self, now: float) -> float | None:
        """Seconds left at a time of the clock; None where nothing is known, or it is overdue.

        Steps that are done tell more than what was foretold.
        """
        done, total = self._steps
        if done:
            return (now - self._stage_start) * (total - done) / done
        return self._start + self._expected - now if now < self._start + self._expected else None

    def _draw(self) -> None:
        if self._over.wait(AFTER):
            return
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[left]}"))
        with Bar(
            *columns, console=Console(stderr=True), transient=True, redirect_stdout=False
        ) as bar:
            task = bar.add_task("", left="")
            while True:
                bar.update(task, **self._state(time.monotonic()))
                if self._over.wait(EVERY):
                    return

    def _state(self, now: float) -> dict[str, Any]:
        """What the bar shows; what is overdue is nearly done."""
        left, done = self.left(now), now - self._start
        said = WORDS.get(self._stage, self._stage)
        total = done / 0.95 if left is None else done + left
        return {"description": said, "completed": done, "total": total, "left": in_words(left)}


class Log:
    """Context and observer of work of many steps, where no bar can be drawn: a line a minute."""

    def __init__(self, what: str, every: float = LOG_EVERY) -> None:
        self._what, self._every = what, every
        self._steps, self._start = (0, 0), time.monotonic()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._write, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        self._thread.join()

    def begin(self, stage: str) -> None:
        self._steps, self._start = (0, 0), time.monotonic()

    def expect(self, seconds: float) -> None:
        pass

    def step(self, done: int, total: int) -> None:
        self._steps = (done, total)

    def _write(self) -> None:
        while not self._over.wait(self._every):
            done, total = self._steps
            if not total:
                continue
            left = (time.monotonic() - self._start) * (total - done) / done if done else None
            said = f", {in_words(left)}" if done else ""
            with contextlib.suppress(OSError):
                print(f"{self._what}: {done} of {total}{said}", file=sys.stderr, flush=True)


def in_words(left: float | None) -> str:
    """The time left as people say it."""
    if left is None:
        return "a little longer"
    if left < 1.5:
        return "about 1 s left"
    if left < 99.5:
        return f"about {left:.0f} s left"
    return f"about {left / 60:.0f} min left" if left < 5970 else f"about {left / 3600:.1f} h left"
