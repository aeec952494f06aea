"""Progress on stderr: a bar on a terminal after two seconds; without one, a line a stage after ten.

The bar shows the share of the time that is over, and moves back and forth while the total is
unknown. Lines of a sweep come once a minute, too.

The bar is drawn only on a terminal that takes it: NO_COLOR (https://no-color.org), a dumb terminal
and --quiet are respected. The work goes on in the thread that began it; the display has a thread of
its own, which loads the library that draws the bar only then.
"""

import contextlib
import os
import queue
import sys
import threading
import time
from typing import Any, Self

from vcam_cli.interrupts import defer_interrupts
from vcam_cli.progress import Timekeeper

AFTER = 1.8
"""Seconds from the start of the program to the bar, which needs some 0.2 s to appear."""
STARTED = time.monotonic()
BAR_INTERVAL = 0.1
"""Seconds between two updates of the bar."""
LOG_AFTER = 10.0
"""Seconds before the first lines of a log."""
LOG_INTERVAL = 60.0
"""Seconds between two lines of a log about one stage."""
LOG_STEP = 0.1
"""Seconds between two looks at which stages have begun."""
WORDS = {
    "read": "reading the image",
    "scene": "building the scene",
    "optics": "light through the lens",
    "rays": "tracing rays",
    "exposure": "planning",
    "capture": "taking the frame",
    "flats": "taking flat fields",
    "darks": "taking dark frames",
    "stacks": "taking stacks of frames",
    "edge": "taking the slanted edge",
    "balance": "measuring colors",
    "processing": "processing",
    "ideal": "ideal image",
    "quality": "measuring image quality",
    "files": "writing files",
    "irradiance": "spectral irradiance",
    "isetcam": "light for ISETCam",
    "radiance": "light of the scene",
    "points": "checking all points",
    "sweep": "computing points",
    "frames": "computing frames",
    "figures": "computing figures",
    "tables": "writing tables",
    "compare": "comparing images",
    "report": "writing the report",
}
"""Stage -> its description; that of others is their name."""


def may_draw(quiet: bool = False) -> bool:
    """Return whether a bar may be drawn: stderr is a terminal, and --quiet is not set."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    return not quiet and not plain and sys.stderr.isatty()


class Progress(Timekeeper):
    """Context around some work, and its observer (see `vcam_cli.progress.Observer`).

        with Progress(quiet) as progress:
            simulate(camera, watch=progress)

    log: the name of the work in the lines that are written where no bar can be drawn.
    """

    def __init__(self, quiet: bool = False, log: str = "") -> None:
        super().__init__()
        self._log = log
        self._begun: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._over = threading.Event()
        show = self._draw_bar if may_draw(quiet) else None if quiet else self._write_log
        self._thread = threading.Thread(target=show, daemon=True) if show else None

    def __enter__(self) -> Self:
        if self._thread is not None:
            try:
                self._thread.start()
            except RuntimeError:  # the system starts no thread: the work goes on without a bar
                self._thread = None
        return self

    def __exit__(self, *_: object) -> None:
        with defer_interrupts():  # else the terminal stays without its cursor
            self._over.set()
            if self._thread is not None:
                self._thread.join()

    def begin(self, stage: str) -> None:
        """Note that a stage begins."""
        if stage != self._stage:
            self._begun.put(stage)
        super().begin(stage)

    def _draw_bar(self) -> None:
        if self._over.wait(max(STARTED + AFTER - time.monotonic(), 0.0)):
            return
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[left]}"))
        console = Console(stderr=True)
        with Bar(*columns, console=console, transient=True, redirect_stdout=False) as bar:
            task = bar.add_task("", left="")
            while True:
                bar.update(task, **self._state(time.monotonic()))
                if self._over.wait(BAR_INTERVAL):
                    return

    def _state(self, now: float) -> dict[str, Any]:
        """Return what the bar shows: no share of work of unknown length, 95 % of overdue work."""
        left, done = self.seconds_left(now), now - self._start
        total = None if not self.is_foretold else done / 0.95 if left is None else done + left
        return {
            "description": WORDS.get(self._stage, self._stage),
            "completed": done,
            "total": total,
            "left": time_left_text(left) if self.is_foretold else "",
        }

    def _write_log(self) -> None:
        """Write a line for every stage of work that takes long, and every minute of steps."""
        last = time.monotonic()
        if self._over.wait(LOG_AFTER):
            return
        while True:
            lines = [f"{WORDS.get(stage, stage)}{self._left_text()}" for stage in self._stages()]
            now = time.monotonic()
            done, total = self._steps
            if lines:
                last = now
            elif total and now - last >= LOG_INTERVAL:
                lines, last = [f"{done} of {total}{self._left_text()}"], now
            head = f"{self._log}: " if self._log else ""
            with contextlib.suppress(OSError):
                for line in lines:
                    print(f"{head}{line}", file=sys.stderr, flush=True)
            if self._over.wait(LOG_STEP):
                return

    def _stages(self) -> list[str]:
        """Return the stages that have begun since it was last asked."""
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._begun.get_nowait())
        return found

    def _left_text(self) -> str:
        """Return the time left as the end of a line; "" where nothing is known of it."""
        left = self.seconds_left(time.monotonic())
        return "" if left is None or not self.is_foretold else f", {time_left_text(left)}"


def time_left_text(left: float | None) -> str:
    """Return the time left [s] in words."""
    if left is None:
        return "a little longer"
    if left < 1.5:
        return "about 1 s left"
    if left < 99.5:
        return f"about {left:.0f} s left"
    return f"about {left / 60:.0f} min left" if left < 5970 else f"about {left / 3600:.1f} h left"
