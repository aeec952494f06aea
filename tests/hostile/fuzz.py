"""One harmed file through vcam: refused with a message, or accepted; anything else is a bug.

Most cases end with `vcam validate`'s checks, as simulating them would be slow; of those that pass,
some are simulated on 8 x 9 pixels. Studies are held to few points, cameras to charts that are
quickly drawn, so that a case takes milliseconds and one that takes `LONGEST` hangs.
"""

import os
import re
import signal
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np
from mutations import harmed

from vcam_cli.camera.camera import Camera
from vcam_cli.capture_schedules import schedule_file
from vcam_cli.commands.validate import _study_kind
from vcam_cli.config import shipped
from vcam_cli.errors import VcamError
from vcam_cli.simulation.checks import load
from vcam_cli.simulation.simulate import simulate
from vcam_cli.sweeps import sweep_file, sweep_points

LONGEST = 60
"""Seconds of a case, a thousand times what it takes."""
MOST_POINTS = 24
SLOW = ("dead-leaves", "eye-chart")
"""Charts whose drawing takes longer than all else."""
FEWER = (("count: 9", "count: 2"), ("seeds: 4", "seeds: 2"), (r"\[2 cd/m2, .*\]", "[2 cd/m2]"))
"""What makes a study long, and what makes it short."""
FILE = "it.yaml"


@dataclass(frozen=True)
class Case:
    """What became of a file: `end` is refused, accepted, simulated or bug."""

    kind: str
    seed: int
    of: str
    end: str
    said: str


def case(kind: str, seed: int, simulated: bool = False) -> Case:
    """Harms a shipped file, writes it to the current folder as `FILE` and has it checked.

    kind: cameras or studies; simulated: whether a camera that is accepted is simulated.
    """
    of, data = made(kind, seed)
    Path(FILE).write_bytes(data)
    try:
        with deadline(), warnings.catch_warnings():
            warnings.simplefilter("error")
            camera = checked()
            if camera is None or not simulated:
                return Case(kind, seed, of, "accepted", "")
            return Case(kind, seed, of, *taken(camera))
    except VcamError as error:
        good = str(error).strip() and error.exit_code in (2, 3)
        return Case(kind, seed, of, "refused" if good else "bug", str(error))
    except Exception:
        return Case(kind, seed, of, "bug", traceback.format_exc())


def made(kind: str, seed: int) -> tuple[str, bytes]:
    """The shipped file's name, and the bytes it became."""
    names = shipped.names(kind)
    of = names[seed % len(names)]
    text = shipped.find(kind, of).read_text("utf-8")
    for many, few in FEWER:
        text = re.sub(many, few, text)
    return of, harmed(text, seed)


def checked() -> Camera | None:
    """As `vcam validate` checks a file; the camera, or None of a study. Raises VcamError."""
    kind = _study_kind(FILE)
    if kind == "schedule":
        schedule_file.read(FILE)
    elif kind == "sweep":
        with mock.patch.object(sweep_points, "MOST_POINTS", MOST_POINTS):
            sweep_points.grid(sweep_file.read(FILE))
    else:
        return load(FILE)
    return None


def taken(camera: Camera) -> tuple[str, str]:
    """A photograph on 8 x 9 pixels: how it ended. Raises VcamError where that is refused."""
    sets = ["array.rows=8", "array.columns=9", "accuracy=draft"]
    if getattr(camera.scene.source, "chart", "") in SLOW:
        sets.append("scene.source={kind: chart, chart: slanted-edge}")
    small = load(FILE, sets)
    result = simulate(small, 1)
    wrong = [name for name, value in result.metrics.items() if value != value]
    if wrong or not (np.isfinite(result.electrons).all() and np.isfinite(result.dn).all()):
        return "bug", f"not finite: {wrong or 'the frame'}"
    return "simulated", ""


@contextmanager
def deadline(seconds: float = 0) -> Iterator[None]:
    """Ends what takes longer (default `LONGEST`), with TimeoutError."""
    seconds = seconds or LONGEST

    def ring(*_: object) -> None:
        raise TimeoutError(f"{seconds} s")

    former = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, former)


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    """That folder as the current one."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
