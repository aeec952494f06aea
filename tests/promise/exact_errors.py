"""The engine's error of the mean against exact truths: lattices, charts and fine images."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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

    @property
    def line(self) -> str:
        """What is printed of it."""
        errors = "  ".join(f"{preset} {over:.3g} T" for preset, over in self.over_tolerance.items())
        return f"{self.kind:<14} {self.name:<40} {errors}"


def mean_error(camera: PeriodicCamera | ChartCamera, folder: Path) -> MeanError:
    """The engine's error before the camera's scene, at every preset."""
    truth = camera.truth(camera.load(folder, "reference"))
    over = {
        preset: periodic_cameras.error_of_mean(camera.load(folder, preset), truth) / tolerance
        for preset, tolerance in TOLERANCES.items()
    }
    return MeanError(camera.name, getattr(camera, "chart", "point-grid"), over)
