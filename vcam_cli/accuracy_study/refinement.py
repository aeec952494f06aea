"""A knob refined until its change is a tenth of the smallest error that is shown of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.knobs import Knob
from vcam_cli.accuracy_study.measurements import Shot
from vcam_cli.accuracy_study.setting_errors import FLOOR
from vcam_cli.camera.camera import Camera
from vcam_cli.floats import rms
from vcam_cli.records import dataclass
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.simulate import prepare
from vcam_cli.solve.settings import camera_settings

PART = 0.1
"""Of the smallest error that is shown: how good what it is measured against has to be."""


@dataclass(frozen=True)
class Refined:
    """What the errors of a knob are measured against."""

    shot: Shot
    change: float
    """Rms that its last refinement changed, relative to full signal."""


def refine_reference(
    base: Shot, shown: Sequence[Shot], finer: Sequence[Camera], full: float, workers: int
) -> Refined:
    """Return `base` with one knob finer, until that changes little beside the least error.

    finer: cameras to try, from coarse to fine; full: full signal [electrons]. What is `base` itself
    has no error to be shown.
    """
    best, change = base.mean, 0.0
    others = [shot.mean for shot in shown if shot is not base]
    for camera in finer if others else ():
        mean = ablation.mean_raw(prepare(camera, workers)[0])
        change = rms(mean - best) / full
        best = mean
        least = min(rms(other - best) for other in others) / full
        if change <= max(PART * least, FLOOR):
            break
    return Refined(replace(base, mean=best), change)


def is_same_camera(knob: Knob, value: Any, case: Camera, base: Prepared) -> bool:
    """Return whether a knob at this value makes the camera of `base`, computed already."""
    if knob.name == "spectral_rank" and value >= base.spectrum.planes:
        return True  # it takes no more of them by itself
    return camera_settings(case) == camera_settings(base.camera)
