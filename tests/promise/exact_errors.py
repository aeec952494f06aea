"""The engine's error of the mean against exact truths: lattices, charts and fine images."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import chart_cameras
import periodic_cameras
from chart_cameras import ChartCamera
from periodic_cameras import TOLERANCES, PeriodicCamera


@dataclass(frozen=True)
class MeanError:
    """What one camera's mean signal is off by."""

    name: str
    kind: str
    over_tolerance: dict[str, float]
    """Preset -> rms error over its tolerance."""


def mean_error(camera: PeriodicCamera | ChartCamera, folder: Path) -> MeanError:
    """The engine's error before the camera's scene, at every preset."""
    truth = camera.truth(camera.load(folder, "reference"))
    over = {
        preset: periodic_cameras.error_of_mean(camera.load(folder, preset), truth) / tolerance
        for preset, tolerance in TOLERANCES.items()
    }
    return MeanError(camera.name, getattr(camera, "chart", "point-grid"), over)


def mean_errors(folder: Path) -> Iterator[MeanError]:
    """Of all cameras that have an exact truth."""
    for camera in (*periodic_cameras.CAMERAS.values(), *chart_cameras.CAMERAS.values()):
        yield mean_error(camera, folder)


def table(found: list[MeanError]) -> Iterator[str]:
    """Lines: of every kind the largest error over the tolerance, and whose it is."""
    yield f"{'exact truths':<14} {'cameras':>7}" + "".join(f"{p:>11}" for p in TOLERANCES)
    for kind in dict.fromkeys(each.kind for each in found):
        own = [each for each in found if each.kind == kind]
        worst = max(own, key=lambda each: max(each.over_tolerance.values()))
        largest = "".join(
            f"{max(each.over_tolerance[p] for each in own):11.3g}" for p in TOLERANCES
        )
        yield f"{kind:<14} {len(own):7d}{largest}   {worst.name}"
