"""What settings are compared with: the camera with everything on, converged.

Why an estimate of its own error stands beside it: edges of a chart are good to the power 5/2 of the
cells per pixel, and the last digit costs more memory than there is. The
change of the last refinement estimates the remaining error; it does not change errors ten times
larger.
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Any

import numpy as np

from vcam_cli import memory
from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.knobs import CONVERGED, FINEST, with_accuracy
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.signal_chain import NoiseSource, Quantizer
from vcam_cli.floats import rms
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.simulate import prepare

FURTHER = 2.5
"""How much further than `accuracy: reference` a spectrum is followed: its error falls tenfold."""
FINEST_CELLS = 256
"""Largest oversampling that a camera file may set."""
FINEST_OF_RECTANGLES = 64
"""How far a chart is followed whose spectrum is known [pixel Nyquist]."""
ORDER = 2.5
"""Power of the oversampling with which the error of a painted edge falls."""
CHANGES_PART = 0.2
"""Part of the tolerance to which it is measured what effects change,"""
LEAST_OF_CHANGES = 0.001
"""and the least that it takes: at that of the reference some effects take minutes."""
MOST_TERMS = 1e8
"""Terms that measuring to the tolerance itself filters: where they are more, that is enough."""
MOST_BYTES = 4e9
"""Memory beyond which a chart is not sampled more finely for the reference."""


@dataclass(frozen=True)
class Reference:
    """What everything is compared with."""

    full_signal: float
    """[electrons]"""
    exposure_time: float
    """[s]"""
    oversampling: float
    """Pixel Nyquist frequencies the spectrum was followed to; 0: closed form."""
    lost: float
    """Estimated rms that even the reference misses, relative to full signal."""
    settings: dict[str, Any]
    changes: dict[str, float] = field(default_factory=dict)
    """Knob -> rms that its last refinement changed, relative to full signal."""


def finest_camera(camera: Camera, coarse: Prepared, most_bytes: float = 0) -> Camera:
    """Return the camera with everything on and every knob finer than its reference.

    coarse: the camera at `accuracy: reference`. Where its scene has a spectrum, it is followed
    to two and a half times that frequency, or painted on an odd multiple of its cells that fits a
    number of bytes; 0: `MOST_BYTES`. A chart whose spectrum is known is followed to
    `FINEST_OF_RECTANGLES`.
    """
    knobs: dict[str, Any] = dict(FINEST)
    reached = sampling(coarse)
    if reached:
        samples = (
            min(most_bytes or MOST_BYTES, memory.available() / 2)
            / 8
            / max(1, coarse.spectrum.planes)
        )
        most = int(math.sqrt(samples / _pixels(coarse)))
        wanted = min(math.ceil(FURTHER * reached) | 1, FINEST_CELLS - 1)
        if _is_closed(coarse):
            wanted = most = FINEST_OF_RECTANGLES
        knobs["oversampling"] = min(max(math.ceil(reached), min(wanted, most)), FINEST_CELLS)
    return with_accuracy(ablation.with_effects(camera, "all"), tolerance=CONVERGED, **knobs)


def prepare_converged(
    camera: Camera, coarse: Prepared, workers: int, most_bytes: float = 0
) -> Prepared:
    """Return the camera of `finest_camera` with its light on the pixels."""
    return prepare(finest_camera(camera, coarse, most_bytes), workers)[0]


def describe_reference(found: Prepared, coarse: Prepared, full: float, change: float) -> Reference:
    """Return the reference, and how good it is itself.

    found: the camera converged; coarse: at `accuracy: reference`; full: full signal; change: rms
    of the difference of their signals [electrons].
    """
    left = found.spectrum.lost_rms * found.exposure_time
    chart = isinstance(found.scene, ChartScene) and not _is_closed(found)
    if chart and sampling(found) > sampling(coarse):
        left = change / ((sampling(found) / sampling(coarse)) ** ORDER - 1)
    return Reference(
        full_signal=full,
        exposure_time=found.exposure_time,
        oversampling=found.spectrum.oversampling,
        lost=left / full,
        settings=found.settings.report(),
    )


def effect_changes(
    camera: Camera, exposure_time: float, names: tuple[str, ...], workers: int
) -> dict[str, Array]:
    """Return the change of the mean raw by leaving out each effect: (rms, largest) [e].

    In 64 bits, to a part of the camera's tolerance: without an effect other cells and frequencies
    are chosen, so that what they miss differs. Where that would take too long it is measured to
    the tolerance itself.
    """
    fixed = ablation.with_exposure_time(camera, exposure_time)
    coarse = camera.accuracy.tolerance
    fine = min(coarse, max(coarse * CHANGES_PART, LEAST_OF_CHANGES))

    def light(tolerance: float, *without: str) -> Prepared:
        exact = with_accuracy(fixed, tolerance=tolerance, float_width=64)
        return prepare(ablation.with_effects(exact, "all", *without), workers)[0]

    def is_quick(ready: Prepared) -> bool:
        spectrum = ready.spectrum
        return spectrum.terms * spectrum.planes * spectrum.filters <= MOST_TERMS

    whole = {coarse: light(coarse)}
    noise = {e.name for e in of_kind(whole[coarse].plan.active, NoiseSource, Quantizer)}
    out = {name: np.zeros(2) for name in names}
    for name in names:
        if name in noise:  # drawn after the mean is known
            continue
        tolerance, found = coarse, light(coarse, name)
        if fine < coarse and is_quick(found):
            tolerance, found = fine, light(fine, name)
            whole[fine] = whole.get(fine) or light(fine)
        change = ablation.mean_raw(found) - ablation.mean_raw(whole[tolerance])
        out[name] = rms_and_largest(change)
    return out


def sampling(ready: Prepared) -> float:
    """Return cells per pixel pitch of a painted chart, else the last frequency [pixel Nyquist]."""
    return ready.spectrum.cells_per_pixel or ready.spectrum.oversampling


def rms_and_largest(difference: Array) -> Array:
    """Return the rms and the largest of a difference of signals, (2,) [electrons]."""
    return np.array([rms(difference), float(np.abs(difference).max())])


def _is_closed(ready: Prepared) -> bool:
    """Return whether the scene is a chart of even rectangles: its spectrum is a closed form."""
    return isinstance(ready.scene, ChartScene) and not ready.scene.is_painted


def _pixels(ready: Prepared) -> float:
    """Area of what is sampled of the scene, in pixels."""
    if cells := ready.spectrum.cells_per_pixel:
        return ready.spectrum.cells / cells**2
    return ready.geometry.rows * ready.geometry.columns
