"""Which setting to take: the fastest that keeps what the file asks for, and what it loses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vcam_cli.accuracy.knobs import KNOBS
from vcam_cli.accuracy.setting_errors import Point
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.simulation import PRESETS

WORTH = 0.9
"""Part of the seconds below which another setting is recommended."""
SMALL_SAVING = 0.05
"""Part of the seconds that a knob has to save, beside the spread of its runs."""
SHARES = {"oversampling": 0.5}
"""Knob -> part of the tolerance that its own error may use up,"""
OTHERS = 0.1
"""and the same of the other knobs: all together stay within the tolerance."""


@dataclass(frozen=True)
class Recommendation:
    """The fastest setting that keeps what the file asks for."""

    line: str
    """For the camera file."""
    sentence: str


def coarser_knobs(camera: Camera, points: tuple[Point, ...]) -> dict[str, Any]:
    """Return knobs that save time where they are coarser than the file's: name -> value."""
    own = next(p for p in points if p.knob == "file")
    out: dict[str, Any] = {}
    for knob in KNOBS:
        if knob.name == "shot_noise":
            continue  # another model, not a coarser one
        allowed = SHARES.get(knob.name, OTHERS) * camera.accuracy.tolerance
        here = [p for p in points if p.knob == knob.name and p.rms_error <= allowed]
        best = min(here, key=lambda p: p.seconds, default=own)
        if own.seconds - best.seconds > max(SMALL_SAVING * own.seconds, best.seconds_spread / 2):
            out[knob.name] = knob.settings[best.setting]
    return out


def recommend(camera: Camera, points: tuple[Point, ...]) -> Recommendation:
    """Return the fastest setting that keeps the tolerance T of the file, for mean and variance.

    Something else than the file has is worth a change where it saves a tenth of the time. Where
    nothing keeps T: what has the least error.
    """
    tolerance = camera.accuracy.tolerance
    own = next(p for p in points if p.knob == "file")
    others = [p for p in points if p.knob in ("preset", "tolerance", "combined")]
    keeps = [
        p for p in (own, *others) if p.rms_error <= tolerance and p.variance_lost <= 2 * tolerance
    ]
    best = min(keeps, key=lambda p: p.seconds, default=None)
    if best is None:
        best = min((own, *others), key=lambda p: p.rms_error)
    elif own in keeps and not _faster(best, own):
        best = own
    line = _yaml_line(camera, best)
    return Recommendation(line, _sentence(line, best, own, tolerance))


def _faster(one: Point, other: Point) -> bool:
    """Whether it saves a tenth of the time, and more than the spread of its runs."""
    spread = max(one.seconds_spread, other.seconds_spread) / 2
    return one.seconds < min(WORTH * other.seconds, other.seconds - spread)


def _sentence(line: str, best: Point, own: Point, tolerance: float) -> str:
    """Return a sentence on the seconds of a setting and the error that it leaves."""
    within = "within" if best.rms_error <= tolerance else "beyond"
    took = f"{_text(best.seconds)} s a frame"
    start = f"keep `{line}`: {took}, and nothing much faster holds what it asks for"
    if best is not own:
        start = f"`{line}`: {took} instead of {_text(own.seconds)} s"
    loses = (
        f"it loses {_percent(best.rms_error)} of full signal rms"
        f" ({best.rms_electrons:.3g} electrons; {_percent(best.max_error)} in the worst pixel)"
    )
    if best.mean_s_cielab is not None:
        loses += f" and a mean S-CIELAB of {best.mean_s_cielab:.2g}"
    loses += f", {within} the {_percent(tolerance)} asked for"
    if best.left_out:
        noise = f", {_percent(best.variance_lost)} of a variance" if best.variance_lost else ""
        loses += f"; its plan leaves out {' and '.join(best.left_out)}{noise}"
    return f"{start}; {loses}."


def _yaml_line(camera: Camera, point: Point) -> str:
    """Return the setting as a line of the camera file."""
    if point.knob in ("preset", "tolerance"):
        return f"accuracy: {point.setting}"
    own = camera.accuracy.to_yaml()
    if not isinstance(own, dict):
        own = {"preset" if own in PRESETS else "tolerance": own}
    if point.knob == "combined":
        own = {**own, **dict(part.split(": ") for part in point.setting.split(", "))}
    if set(own) <= {"preset"} or set(own) <= {"tolerance"}:
        return f"accuracy: {next(iter(own.values()))}"
    return f"accuracy: {{{', '.join(f'{k}: {v}' for k, v in own.items())}}}"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _text(seconds: float) -> str:
    return f"{seconds:.2g}" if seconds < 9.95 else f"{seconds:.0f}"
