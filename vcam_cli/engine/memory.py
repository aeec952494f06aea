"""How much memory a frame takes, asked before it is taken."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from vcam_cli.camera.geometry import Geometry
from vcam_cli.engine.settings import Settings
from vcam_cli.errors import CannotDo
from vcam_cli.scenes.base import SampledScene, WaveScene

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


def estimate(
    geometry: Geometry, settings: Settings, samples: int, colors: int, judged: bool
) -> int:
    """Peak memory of a frame [bytes]: planes of the scene, spectra of the colors, the frame.

    samples: of one scene plane; judged: whether an ideal image is made.
    """
    pixels = geometry.rows * geometry.columns
    width = settings.float_width // 8
    planes = samples * width * max(1, colors)
    series = 2 * pixels * width * colors
    frame = pixels * (3 * width + 2 + 12 * colors)
    return BASE + max(planes + series, frame) + (pixels * 8 * colors if judged else 0)


def samples_of(scene: WaveScene | SampledScene) -> int:
    """Samples of one plane of a scene; none for a scene known in closed form."""
    return 0 if isinstance(scene, WaveScene) else scene.shape[0] * scene.shape[1]


def require(needed: int, geometry: Geometry) -> None:
    """Raises CannotDo where `needed` bytes are not to be had."""
    free = available()
    if needed > free:
        raise CannotDo(
            f"{geometry.rows} x {geometry.columns} pixels need about {needed / 1e9:.3g} GB of"
            f" memory; {free / 1e9:.3g} GB are free",
            "use fewer pixels (array), or accuracy: draft",
        )
