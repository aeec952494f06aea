"""Which setting to take: the fastest within the file's tolerance, and its error."""

from __future__ import annotations

import math
from typing import Any

from vcam_cli.accuracy_study import ablation
from vcam_cli.accuracy_study.knobs import KNOBS
from vcam_cli.accuracy_study.setting_errors import Point
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.simulation import PRESETS
from vcam_cli.records import dataclass

WORTH = 0.9
"""Part of the seconds below which another setting is recommended."""
SMALL_SAVING = 0.05
"""Part of the seconds that a knob has to save, beside the spread of its runs."""
SHARES = {"oversampling": 0.5}
"""Knob -> part of the tolerance that its own error may use up,"""
OTHERS = 0.1
"""and the same of the other knobs: all together stay within the tolerance."""
PLANNED = ("file", "preset", "tolerance", "combined")
"""Rows of settings with the effects that the plan keeps,"""
EVERYTHING = ("all",)
"""and with every effect on."""
PROMISED = ("preset", "tolerance", "file", "all")
"""Rows of settings that promise a tolerance by themselves."""


@dataclass(frozen=True)
class Recommendation:
    """The fastest setting that meets the file's tolerance and its own."""

    line: str
    """For the camera file, with `effects: all` two lines; empty where no setting meets its
    tolerance."""
    sentence: str
    missed: tuple[str, ...] = ()
    """A sentence for every setting whose measured error exceeds its own tolerance."""


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
    """Return the fastest setting that meets the tolerance T of the file, and its own.

    Parameters
    ----------
    camera : Camera
        The camera as its file has it.
    points : tuple of Point
        Measured settings; one has the knob "file".

    Returns
    -------
    Recommendation
        A setting other than the file's where it saves a tenth of the time. `effects: all` is
        recommended only where no plan meets T. Without a setting that does, the line is empty.
    """
    tolerance = camera.accuracy.tolerance
    own = next(p for p in points if p.knob == "file")
    judged = (p for p in points if p.knob in PROMISED and _misses(p))
    missed = tuple(dict.fromkeys(_missed(camera, p) for p in judged))
    for knobs in (PLANNED, EVERYTHING):
        meets = [p for p in points if p.knob in knobs and _meets(p, tolerance)]
        if meets:
            best = min(meets, key=lambda p: p.seconds)
            best = own if own in meets and not _faster(best, own) else best
            sentence = _sentence(_quoted(camera, best), best, own, tolerance)
            return Recommendation("\n".join(_yaml_lines(camera, best)), sentence, missed)
    return Recommendation("", _none_meets(camera, points, tolerance), missed)


def _meets(point: Point, tolerance: float) -> bool:
    """Whether a setting meets a tolerance and its own, with what the reference may be wrong by."""
    least = min(tolerance, math.inf if point.tolerance is None else point.tolerance)
    return point.rms_error + point.unsure <= least and point.variance_lost <= 2 * least


def _misses(point: Point) -> bool:
    """Whether a setting exceeds its own tolerance by more than the reference may be wrong."""
    if point.tolerance is None:
        return False
    of_mean = point.rms_error - point.unsure > point.tolerance
    return of_mean or point.variance_lost > 2 * point.tolerance


def _missed(camera: Camera, point: Point) -> str:
    """Return a sentence on a setting that exceeds its own tolerance."""
    assert point.tolerance is not None
    setting, promised = _quoted(camera, point), point.tolerance
    if point.rms_error - point.unsure > promised:
        return (
            f"{setting} misses its own tolerance: the rms error is {_percent(point.rms_error)} of"
            f" full signal, {point.rms_error / promised:.3g} times the tolerance of"
            f" {_percent(promised)}"
        )
    return (
        f"{setting} misses its own tolerance: the skipped noise is {_percent(point.variance_lost)}"
        f" of a variance, {point.variance_lost / (2 * promised):.3g} times the tolerance of"
        f" {_percent(2 * promised)}"
    )


def _none_meets(camera: Camera, points: tuple[Point, ...], tolerance: float) -> str:
    """Return a sentence on the least error where no setting meets the file's tolerance."""
    least = min((p for p in points if p.knob in PROMISED), key=lambda p: p.rms_error)
    return (
        f"none: no tested setting meets the {_percent(tolerance)} of the file and its own"
        f" tolerance; {_quoted(camera, least)} has the least rms error,"
        f" {_percent(least.rms_error)} of full signal."
    )


def _faster(one: Point, other: Point) -> bool:
    """Whether it saves a tenth of the time, and more than the spread of its runs."""
    spread = max(one.seconds_spread, other.seconds_spread) / 2
    return one.seconds < min(WORTH * other.seconds, other.seconds - spread)


def _sentence(setting: str, best: Point, own: Point, tolerance: float) -> str:
    """Return a sentence on the seconds of a setting and its error."""
    took = f"{_text(best.seconds)} s a frame"
    start = f"{setting}: {took} instead of {_text(own.seconds)} s"
    if best is own:
        start = f"keep {setting}: {took}, and no setting that meets its tolerance is much faster"
    error = (
        f"the rms error is {_percent(best.rms_error)} of full signal"
        f" ({best.rms_electrons:.3g} electrons; {_percent(best.max_error)} in the worst pixel)"
    )
    if best.mean_s_cielab is not None:
        error += f" and the mean S-CIELAB {best.mean_s_cielab:.2g}"
    error += f", within the tolerance of {_percent(tolerance)}"
    if best.left_out:
        noise = f", {_percent(best.variance_lost)} of a variance" if best.variance_lost else ""
        error += f"; the plan skips {' and '.join(best.left_out)}{noise}"
    return f"{start}; {error}."


def _quoted(camera: Camera, point: Point) -> str:
    """Return the setting as it is written in sentences."""
    return " with ".join(f"`{line}`" for line in _yaml_lines(camera, point))


def _yaml_lines(camera: Camera, point: Point) -> tuple[str, ...]:
    """Return the setting as lines of the camera file."""
    if point.knob in EVERYTHING:
        return f"accuracy: {point.setting}", f"effects: {_every_effect(camera)}"
    if point.knob in ("preset", "tolerance"):
        return (f"accuracy: {point.setting}",)
    own = camera.accuracy.to_yaml()
    if not isinstance(own, dict):
        own = {"preset" if own in PRESETS else "tolerance": own}
    if point.knob == "combined":
        own = {**own, **dict(part.split(": ") for part in point.setting.split(", "))}
    if set(own) <= {"preset"} or set(own) <= {"tolerance"}:
        return (f"accuracy: {next(iter(own.values()))}",)
    return (f"accuracy: {_mapping(own)}",)


def _every_effect(camera: Camera) -> str:
    """Return the value of `effects` that switches on what the file does not switch off."""
    states = ablation.with_effects(camera, "all").effects
    assert isinstance(states, dict)
    return _mapping(states) if "off" in states.values() else "all"


def _mapping(values: dict[str, Any]) -> str:
    return f"{{{', '.join(f'{name}: {value}' for name, value in values.items())}}}"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _text(seconds: float) -> str:
    return f"{seconds:.2g}" if seconds < 9.95 else f"{seconds:.0f}"
