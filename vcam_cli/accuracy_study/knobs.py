"""The knobs of the engine's accuracy: their settings to compare, and which of them a camera has."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.simulation import Accuracy
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import FieldTransfer
from vcam_cli.records import dataclass
from vcam_cli.simulation.preparation import Prepared

CONVERGED = 2e-5
"""Tolerance of the reference."""
MOST_SAMPLES = 1 << 24
"""Samples of a plane beyond which no setting of the oversampling is tried."""


@dataclass(frozen=True)
class Knob:
    """One key of the camera file's `accuracy` mapping."""

    name: str
    settings: dict[str, Any]
    """As the table shows it -> as the file has it, from coarse to fine."""
    finest: Any
    """What its own errors are measured against; None: what the engine takes by itself."""
    absent: Callable[[Prepared], str]
    """Why a camera has none of it; empty where it has."""
    refinements: tuple[dict[str, Any], ...] = ()
    """Keys of `accuracy`: refinements tried until their change is a tenth of its least error."""
    companions: dict[str, Any] = field(default_factory=dict)
    """Keys that a coarser setting needs finer than others do, for its error to be its own."""


def _no_spectrum(ready: Prepared) -> str:
    followed = ready.spectrum.oversampling > 0
    return "" if followed else "the scene has a closed form and needs no samples"


def _no_blur(ready: Prepared) -> str:
    blurs = ready.transfer.effects or _no_field_blur(ready) == ""
    return "" if blurs else "no blur depends on wavelength"


def _no_table(ready: Prepared) -> str:
    return _no_spectrum(ready) or _no_blur(ready)


def _no_rank(ready: Prepared) -> str:
    if len(ready.scene.spectra) < 2:
        return "the whole scene has one spectrum"
    return _no_spectrum(ready)


def _no_field_blur(ready: Prepared) -> str:
    there = of_kind(ready.plan.active, FieldTransfer)
    return "" if there else "the lens's blur is the same all over the field"


def _no_sub_exposures(ready: Prepared) -> str:
    taken = ready.spectrum.sub_exposures
    return "" if taken > 1 else "no motion needs sub-exposures"


def _no_effect(name: str, without: str) -> Callable[[Prepared], str]:
    def absent(ready: Prepared) -> str:
        return "" if any(e.name == name for e in ready.plan.active) else without

    return absent


def _by_label(*values: Any) -> dict[str, Any]:
    return {str(value): value for value in values}


KNOBS: tuple[Knob, ...] = (
    Knob(
        "wavelength_step",
        _by_label("80 nm", "20 nm", "10 nm", "5 nm"),
        "1 nm",
        _no_blur,
        ({"wavelength_step": "0.5 nm"}, {"wavelength_step": "0.25 nm"}),
    ),
    Knob("oversampling", _by_label(1, 2, 3, 4, 8), None, _no_spectrum),
    Knob(
        "table_size",
        _by_label(64, 512, 4096),
        1 << 14,
        _no_table,
        ({"table_size": 1 << 15}, {"table_size": 1 << 17}),
    ),
    Knob(
        "vignetting_points",
        _by_label(5, 9, 17, 33),
        65,
        _no_effect("pixel_vignetting", "no tunnel above the photodetector is described"),
        ({"vignetting_points": 129},),
    ),
    # As many as a tenth of the tolerance requires.
    Knob("spectral_rank", _by_label(2, 3, 4, 6), None, _no_rank, ({"tolerance": CONVERGED / 10},)),
    Knob(
        "field_zones",
        _by_label(2, 3, 4, 6),
        8,
        _no_field_blur,
        ({"field_zones": 16}, {"field_zones": 32}),
    ),
    Knob("sub_exposures", _by_label(1, 2, 3, 4, 6), None, _no_sub_exposures),
    Knob(
        "shot_noise",
        _by_label("gaussian", "exact"),
        "exact",
        _no_effect("shot_noise", "shot noise is not simulated"),
    ),
    Knob("float_width", _by_label(32, 64), 64, lambda _: ""),
)
"""All of them, each from its coarsest setting to finer ones."""
FINEST: dict[str, Any] = {k.name: k.finest for k in KNOBS if k.finest is not None}


def applicable_knobs(ready: Prepared) -> tuple[list[Knob], dict[str, str]]:
    """Return the knobs that a camera has, and of the others why it has not: name -> reason.

    ready: the camera with everything on.
    """
    why = {knob.name: knob.absent(ready) for knob in KNOBS}
    return [k for k in KNOBS if not why[k.name]], {n: text for n, text in why.items() if text}


def settings_to_try(knob: Knob, ready: Prepared) -> dict[str, Any]:
    """Return the settings of a knob that differ for this camera, and that its size allows."""
    if knob.name == "oversampling":
        most = math.sqrt(MOST_SAMPLES / (ready.geometry.rows * ready.geometry.columns))
        return {s: v for s, v in knob.settings.items() if v <= max(2, most)}
    if knob.name == "spectral_rank":
        return {s: v for s, v in knob.settings.items() if v <= len(ready.scene.spectra)}
    return knob.settings


def with_accuracy(camera: Camera, **accuracy: Any) -> Camera:
    """Return the camera with another `accuracy` mapping; a preset goes before a tolerance."""
    given = {k: v for k, v in accuracy.items() if v is not None}
    if given.get("preset"):
        given.pop("tolerance", None)
    return camera.model_copy(update={"accuracy": Accuracy.model_validate(given)})


def with_knobs(camera: Camera, **knobs: Any) -> Camera:
    """Return the camera with some knobs set beside what its file says of accuracy."""
    return with_accuracy(camera, **{**camera.accuracy.model_dump(mode="json"), **knobs})
