"""How much memory a frame takes, asked before it is taken."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

from vcam_cli.camera.geometry import Geometry
from vcam_cli.engine.settings import Settings
from vcam_cli.errors import CannotDo
from vcam_cli.scenes.base import SampledScene

if TYPE_CHECKING:
    from vcam_cli.engine.ways import Followed

BASE = 150_000_000
"""Interpreter and libraries [bytes]."""


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


def of_planes(scene: SampledScene, planes: int, geometry: Geometry, knobs: Settings) -> int:
    """Peak memory while a sampled scene of so many planes is filtered [bytes]."""
    return _filtering(scene.shape[0] * scene.shape[1], planes, geometry, knobs)


def of_followed(followed: Followed, geometry: Geometry, knobs: Settings) -> int:
    """Peak memory that a scene took while it was filtered [bytes]."""
    needed = _filtering(followed.held, 1, geometry, knobs)
    if followed.passes > 1:  # a filter's signal beside the sum of those before, in three colors
        needed += 3 * geometry.rows * geometry.columns * (knobs.float_width // 8)
    return needed + 16 * followed.table_values


def _filtering(samples: int, planes: int, geometry: Geometry, knobs: Settings) -> int:
    return samples * planes * (knobs.float_width // 8) + of_frame(geometry, knobs, 3, False)


def require(needed: int, geometry: Geometry) -> None:
    """Raises CannotDo where `needed` bytes are not to be had."""
    free = available()
    if needed > free:
        raise CannotDo(
            f"{geometry.rows} x {geometry.columns} pixels need about {needed / 1e9:.3g} GB of"
            f" memory; {free / 1e9:.3g} GB are free",
            "use fewer pixels (array), or accuracy: draft",
        )
