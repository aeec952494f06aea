"""How much memory a frame takes, asked before it is taken."""

from __future__ import annotations

import contextlib
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

from vcam_cli.camera.geometry import Geometry
from vcam_cli.engine.settings import Settings
from vcam_cli.errors import CannotDo
from vcam_cli.scenes.base import Rectangles, SampledScene

if TYPE_CHECKING:
    from vcam_cli.engine.room import Room
    from vcam_cli.engine.sampling import Filter

BASE = 150_000_000
"""Interpreter and libraries [bytes]."""
SLACK = 1.1
"""Of what is in use, what the process has: memory that was freed is not given back at once."""
SAMPLED, POOLS = 96, 250
"""Rows of a spectrum that are looked at, and terms along them that are told apart, about."""


def available() -> int:
    """Memory this process may still take [bytes]: the system's, or its control group's if less."""
    found = [1 << 62]
    with contextlib.suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/meminfo").read_text().splitlines()
        line = next(text for text in lines if text.startswith("MemAvailable"))
        found.append(int(line.split()[1]) * 1024)
    with contextlib.suppress(OSError, ValueError):
        limit = int(Path("/sys/fs/cgroup/memory.max").read_text())
        used = int(Path("/sys/fs/cgroup/memory.current").read_text())
        found.append(limit - used)
    if len(found) == 1:
        with contextlib.suppress(OSError, ValueError, AttributeError):
            found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return min(found)


def of_frame(
    geometry: Geometry, knobs: Settings, colors: int, judged: bool, samples: int = 0
) -> int:
    """Peak memory of a frame without its scene [bytes]: spectra, signal, raw, render.

    judged: whether an ideal image is made and compared; samples: of one integration, of each color
    that a pixel has; 0 for a single exposure.
    """
    pixels = geometry.rows * geometry.columns
    width = knobs.float_width // 8
    series = pixels * width * (colors + 1)
    frame = pixels * (2 * width + 2 + colors)
    if samples:  # their electrons and codes, the photocurrent and what is made into a picture
        frame += pixels * (samples * (width + 4) + 8)
    return BASE + max(series, frame) + (16 * pixels * colors if judged else 0)


def of_boxes(scene: SampledScene, planes: int, geometry: Geometry, knobs: Settings) -> int:
    """Peak memory while a picture of so many planes is averaged over boxes [bytes].

    The planes, points and means of each; running sums and what is read of them in 64 bits.
    """
    samples, pixels = math.prod(scene.shape), geometry.rows * geometry.columns
    width = knobs.float_width // 8
    kept = planes * (samples * width + pixels * (width + 8))
    return BASE + kept + 5 * 8 * max(samples, pixels)


def of_overlaps(light: Rectangles, geometry: Geometry, knobs: Settings) -> int:
    """Peak memory while boxes of pixels are laid over even rectangles [bytes].

    Shares of every run in every box, while they are computed in 64 bits; what is kept, of points
    and of means.
    """
    planes, runs_y, runs_x = light.values.shape
    shares = geometry.rows * runs_y, geometry.columns * runs_x
    kept = shares[0] + planes * runs_y * geometry.columns
    return BASE + round(SLACK * (6 * 8 * max(shares) + 2 * kept * knobs.float_width // 8))


def of_tabulating(tables: Room, held: int, knobs: Settings) -> int:
    """Peak memory while tables are computed, with samples of planes that are there already."""
    return BASE + round(SLACK * (tables.most + held * knobs.float_width // 8))


def of_looking(filter: Filter, held: int, width: int, tables: Room) -> int:
    """Peak memory while a scene is transformed and rows of its spectrum are looked at [bytes].

    held: samples of all its planes in memory together; width: bytes of one.
    """
    planes, colors, _ = filter.tables.values.shape
    pairs = planes * (planes + 1) // 2
    taken = SAMPLED * filter.x.terms * planes * (8 + width)
    sample = SAMPLED * POOLS * 8 * (2 * pairs + 2 * planes + colors) + taken
    return BASE + round(SLACK * max(tables.most, tables.kept + held * width + sample))


def of_filtering(
    filter: Filter, held: int, width: int, tables: Room, passing: bool, workers: int, signal: int
) -> int:
    """Peak memory while a scene's spectrum is filtered for colors that are filtered together.

    [bytes]. passing: whether its planes pass one by one; signal: bytes of what other filters gave.
    """
    work = filter.takes(width, passing) + filter.beside(width, workers)
    return BASE + round(SLACK * (tables.kept + held * width + signal + work))


def require(needed: int, geometry: Geometry) -> None:
    """Raises CannotDo where `needed` bytes are not to be had."""
    free = available()
    if needed > free:
        raise CannotDo(
            f"{geometry.rows} x {geometry.columns} pixels need about {needed / 1e9:.3g} GB of"
            f" memory; {free / 1e9:.3g} GB are free",
            "use fewer pixels (array), or accuracy: draft",
        )
