"""What accuracy costs: error against a converged reference and seconds, knob by knob.

Errors are of the mean raw signal, relative to full signal, against the camera with everything on,
in 64 bits, every knob finer than `accuracy: reference` has it. Seconds are of a whole frame, from
the scene to its render and metrics, without files: the median of repeated runs in this process,
taken in turns, so that whatever slows the machine for a while slows all of them.

Points of a knob are the camera of the file with this one knob changed. An effect left out is
judged with all else converged, so that its error is its own; its seconds are the file's camera's
without it.
"""

from __future__ import annotations

import math
import statistics
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import geometry
from vcam_cli.camera.settings import PRESETS, Accuracy
from vcam_cli.effects.base import Code, Draw
from vcam_cli.engine import memory
from vcam_cli.engine.optics import MARGIN
from vcam_cli.engine.parallel import available_workers
from vcam_cli.engine.prepare import Prepared
from vcam_cli.engine.stages import Observer, Silent
from vcam_cli.studies import ablation
from vcam_cli.studies.ablation import Ablation
from vcam_cli.studies.simulate import prepare, simulate

COLUMNS = (
    "knob",
    "setting",
    "rms_error",
    "max_error",
    "rms_electrons",
    "seconds",
    "seconds_spread",
)
"""Of accuracy.csv."""
KNOBS: dict[str, dict[str, Any]] = {
    "wavelength_step": {f"{nm:g} nm": f"{nm:g} nm" for nm in (40, 20, 10, 5, 2.5)},
    "oversampling": {str(n): n for n in (1, 2, 4, 8, 16)},
    "table_size": {str(n): n for n in (256, 1024, 4096, 32768)},
    "float_width": {"32": 32, "64": 64},
}
"""Knob -> setting -> its value in the file."""
ROUNDS, ENOUGH = 5, 1.5
"""Runs of a setting; after two, no further one begins when it has taken so long [s]."""
CONVERGED = 2e-5
"""Tolerance of the reference."""
WORTH = 0.9
"""Part of the seconds below which another setting is recommended."""
MOST_BYTES = 4e9
"""Memory beyond which a chart is not sampled more finely for the reference."""
MOST_SAMPLES = 1 << 24
"""Samples of a plane beyond which no setting of the oversampling is tried."""


@dataclass(frozen=True)
class Point:
    """One setting of one knob."""

    knob: str
    setting: str
    rms_error: float
    """Of the mean raw, relative to full signal."""
    max_error: float
    """Largest of any pixel, relative to full signal."""
    rms_electrons: float
    """[electrons]"""
    seconds: float
    """Median [s]"""
    seconds_spread: float
    """Slowest less fastest run [s]"""
    predicted: float | None
    """Rms of what the plan expects the settings to lose of the spectrum, relative."""
    left_out: tuple[str, ...]
    """Effects that its plan leaves out."""
    variance_lost: float
    """Largest share of the temporal or fixed-pattern variance that they had."""

    @property
    def row(self) -> tuple[str | float, ...]:
        """As in accuracy.csv."""
        return tuple(getattr(self, name) for name in COLUMNS)


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


@dataclass(frozen=True)
class Recommendation:
    """The fastest setting that keeps what the file asks for."""

    line: str
    """For the camera file."""
    sentence: str


@dataclass(frozen=True)
class Study:
    """Everything `vcam accuracy` shows."""

    camera: Camera
    reference: Reference
    points: tuple[Point, ...]
    effects: tuple[Ablation, ...]
    recommendation: Recommendation

    def report(self) -> dict[str, Any]:
        """As accuracy.json shows it."""
        return {
            "name": self.camera.name,
            "tolerance": self.camera.accuracy.tolerance,
            "reference": vars(self.reference),
            "points": [vars(p) for p in self.points],
            "effects": [{**vars(e), "ratio": e.ratio} for e in self.effects],
            "recommendation": vars(self.recommendation),
            "notes": [
                "Errors are of the mean raw signal against the reference, relative to full signal.",
                "Noise and rounding change no mean: their contribution is a share of the variance"
                " at 1, 10 and 100 % of full signal, the largest of the three.",
                "An effect left out is measured with everything else on and converged.",
            ],
        }


def accuracy(camera: Camera, workers: int | None = None, watch: Observer | None = None) -> Study:
    """Measures `camera` along every knob, with every preset, without every effect.

    workers: threads, default all processors. watch: told of stages. Raises BadInput, CannotDo.
    """
    workers = workers or available_workers()
    watch = watch or Silent()
    cases = _cases(camera)
    effects = {n: _without(camera, n) for n in ablation.wanted(camera)}
    first = {repr(case): case for _, _, case in cases}
    signals: dict[str, NDArray] = {}
    frames: dict[str, Prepared] = {}
    watch.begin("errors of the settings")
    for i, (key, case) in enumerate(first.items()):
        watch.step(i, len(first))
        frame = _prepared(case, workers)
        signals[key] = ablation.mean_raw(frame)
        frames[key] = replace(frame, rate=np.empty((0, 0)))  # only its plan is used again
    watch.begin("converged reference")
    found = converged(camera, frames[repr(_with(camera, preset="reference"))], workers)
    truth, full = ablation.mean_raw(found), ablation.full_signal(found)
    errors = {key: _error(signal - truth) for key, signal in signals.items()}
    signals.clear()
    watch.begin("effects left out")
    changed = changes(camera, found.exposure_time, tuple(effects), workers)
    shares = ablation.variance_shares(found, full, workers)
    timed = first | {repr(case): case for case in effects.values()}
    watch.begin("seconds of the settings")
    seconds = _seconds(timed, workers, watch)
    points = [
        _point(knob, setting, errors[repr(case)], full, seconds[repr(case)], frames[repr(case)])
        for knob, setting, case in cases
    ]
    points += [
        _point(f"effect:{name}", "off", changed[name], full, seconds[repr(case)], None)
        for name, case in effects.items()
    ]
    base = repr(camera)
    measured = tuple(
        _ablation(d, changed, shares, full, _median(seconds, base, repr(effects[d.name])))
        for d in frames[base].plan.decisions
        if d.name in effects
    )
    reference = Reference(
        full_signal=full,
        exposure_time=found.exposure_time,
        oversampling=found.spectrum.oversampling,
        lost=found.spectrum.lost * found.exposure_time / full,
        settings=found.settings.report(),
    )
    advice = recommend(camera, tuple(points))
    return Study(camera, reference, tuple(points), measured, advice)


# --- the reference -------------------------------------------------------------------------------


def converged(camera: Camera, coarse: Prepared, workers: int) -> Prepared:
    """The camera with everything on and every knob finer than its reference.

    coarse: the camera at `accuracy: reference`. Where its scene has a spectrum, it is followed
    half as far again as there, as long as memory is not the limit.
    """
    everything = ablation.switched(camera, "all")
    knobs: dict[str, Any] = {"wavelength_step": "1 nm", "table_size": 1 << 16, "float_width": 64}
    knobs["field_zones"] = 8
    reached = coarse.spectrum.oversampling
    if reached:
        samples = min(MOST_BYTES, memory.available() / 2) / 8 / max(1, coarse.spectrum.planes)
        most = int(math.sqrt(samples / _pixels(coarse)))
        wanted = min(math.ceil(1.5 * reached), 64)
        knobs["oversampling"] = max(math.ceil(reached), min(wanted, most))
    return _prepared(_with(everything, tolerance=CONVERGED, **knobs), workers)


def _pixels(ready: Prepared) -> int:
    """Pixels, with the margin that charts have."""
    return (ready.geometry.rows + 2 * MARGIN) * (ready.geometry.columns + 2 * MARGIN)


def changes(
    camera: Camera, exposure_time: float, names: tuple[str, ...], workers: int
) -> dict[str, NDArray]:
    """What leaving out each effect does to the mean raw, everything else on.

    In 64 bits, and finer than most tolerances ask; what the settings still miss is missed with and
    without the effect.
    """
    fixed = ablation.exposed_for(camera, exposure_time)
    fixed = _with(fixed, tolerance=0.001, float_width=64)
    whole = _prepared(ablation.switched(fixed, "all"), workers)
    noise = {e.name for e in whole.plan.active if isinstance(e, Draw | Code)}
    truth, out = ablation.mean_raw(whole), {}
    for name in names:
        if name in noise:  # drawn after the mean is known
            out[name] = np.zeros(2)
        else:
            without = _prepared(ablation.switched(fixed, "all", name), workers)
            out[name] = _error(ablation.mean_raw(without) - truth)
    return out


def _error(difference: NDArray) -> NDArray:
    """(rms, largest) of a difference of signals [electrons]."""
    return np.array([ablation.rms(difference), float(np.abs(difference).max())])


# --- the cases -----------------------------------------------------------------------------------


def _cases(camera: Camera) -> list[tuple[str, str, Camera]]:
    """(knob, setting, camera) of everything that is compared."""
    cases = [("preset", name, _with(camera, preset=name)) for name in PRESETS]
    for name in ("auto", "all"):
        cases.append(("effects", name, ablation.switched(camera, name)))
    g = geometry(camera)
    most = math.sqrt(MOST_SAMPLES / (g.rows * g.columns))
    own = camera.accuracy.model_dump(mode="json")
    for knob, settings in KNOBS.items():
        for setting, value in settings.items():
            if knob != "oversampling" or value <= max(2, most):
                cases.append((knob, setting, _with(camera, **{**own, knob: value})))
    cases.append(("file", "as it is", camera))
    return cases


def _with(camera: Camera, **accuracy: Any) -> Camera:
    given = {k: v for k, v in accuracy.items() if v is not None}
    if given.get("preset"):
        given.pop("tolerance", None)
    return camera.model_copy(update={"accuracy": Accuracy.model_validate(given)})


def _without(camera: Camera, name: str) -> Camera:
    """The file's camera with one effect switched off."""
    if camera.effects == "all":
        return ablation.switched(camera, "all", name)
    own = camera.effects if isinstance(camera.effects, dict) else {}
    return camera.model_copy(update={"effects": {**own, name: "off"}})


def _prepared(camera: Camera, workers: int) -> Prepared:
    return prepare(camera, workers)[0]


# --- seconds -------------------------------------------------------------------------------------


def _seconds(cases: dict[str, Camera], workers: int, watch: Observer) -> dict[str, list[float]]:
    """Seconds of a frame of every camera, run in turns."""
    seconds: dict[str, list[float]] = {key: [] for key in cases}
    _frame(next(iter(cases.values())), workers)  # caches, and pages of memory
    for turn in range(ROUNDS):
        for i, (key, case) in enumerate(cases.items()):
            if turn >= 2 and sum(seconds[key]) > ENOUGH:
                continue
            watch.step(turn * len(cases) + i, ROUNDS * len(cases))
            start = time.perf_counter()
            _frame(case, workers)
            seconds[key].append(time.perf_counter() - start)
    return seconds


def _frame(camera: Camera, workers: int) -> None:
    """A frame from the scene to its render and metrics."""
    result = simulate(camera, workers)
    if camera.output.render:
        _ = result.render
    _ = result.metrics


def _median(seconds: dict[str, list[float]], base: str, other: str) -> float:
    """Time saved by the other [s]."""
    return statistics.median(seconds[base]) - statistics.median(seconds[other])


# --- what comes of it ----------------------------------------------------------------------------


def _point(
    knob: str,
    setting: str,
    error: NDArray,
    full: float,
    seconds: list[float],
    ready: Prepared | None,
) -> Point:
    decisions = () if ready is None else ready.plan.decisions
    out = [d for d in decisions if d.state == "off" and d.by == "plan"]
    lost = None if ready is None else ready.spectrum.lost * ready.exposure_time / full
    by_scope: dict[str, float] = {}
    for d in out:
        if d.unit.endswith("variance"):
            by_scope[d.unit] = by_scope.get(d.unit, 0.0) + (d.contribution or 0.0)
    return Point(
        knob=knob,
        setting=setting,
        rms_error=float(error[0]) / full,
        max_error=float(error[1]) / full,
        rms_electrons=float(error[0]),
        seconds=statistics.median(seconds),
        seconds_spread=max(seconds) - min(seconds),
        predicted=lost,
        left_out=tuple(d.name for d in out),
        variance_lost=max(by_scope.values(), default=0.0),
    )


def _ablation(decision, changed, shares, full: float, saved: float) -> Ablation:
    """The plan's line of an effect beside what was measured."""
    variance = decision.unit.endswith("variance")
    name = decision.name
    return Ablation(
        name=name,
        state=decision.state,
        by=decision.by,
        predicted=decision.contribution,
        measured=shares[name] if variance else float(changed[name][0]) / full,
        unit=decision.unit or "of full signal",
        seconds_saved=saved,
    )


def recommend(camera: Camera, points: tuple[Point, ...]) -> Recommendation:
    """The fastest setting that keeps the tolerance T of the file, for mean and variance.

    Something else than the file has is worth a change, and a knob more than a preset, where it
    saves a tenth of the time. Where nothing keeps T: what has the least error.
    """
    tolerance = camera.accuracy.tolerance
    own = next(p for p in points if p.knob == "file")
    presets = [p for p in points if p.knob == "preset"]
    knobs = [p for p in points if p.knob in KNOBS]

    def good(found: list[Point]) -> list[Point]:
        keeps = [p for p in found if p.rms_error <= tolerance and p.variance_lost <= 2 * tolerance]
        return sorted(keeps, key=lambda p: p.seconds)

    best = next(iter(good([own])), None)
    for found in (good(presets), good(knobs)):
        if found and (best is None or found[0].seconds < WORTH * best.seconds):
            best = found[0]
    if best is None:
        best = min((own, *presets, *knobs), key=lambda p: p.rms_error)
    line = _line(camera, best)
    kept = "within" if best.rms_error <= tolerance else "beyond"
    sentence = (
        f"`{line}` takes {_text(best.seconds)} s a frame (the file as it is"
        f" {_text(own.seconds)} s) and its mean raw is off by {best.rms_error:.2%} of full signal"
        f" rms, {best.max_error:.2%} at most, {kept} the {tolerance:.3g} that the file asks for"
    )
    if best is own:
        sentence = (
            f"keep `{line}`: nothing faster holds {tolerance:.3g} of full signal; a frame takes"
            f" {_text(best.seconds)} s and its mean raw is off by {best.rms_error:.2%} rms,"
            f" {best.max_error:.2%} at most"
        )
    if best.left_out:
        noise = f", {best.variance_lost:.2%} of a variance" if best.variance_lost else ""
        sentence += f"; its plan leaves out {' and '.join(best.left_out)}{noise}"
    return Recommendation(line, f"{sentence}.")


def _line(camera: Camera, point: Point) -> str:
    """The setting as a line of the camera file."""
    if point.knob == "preset":
        return f"accuracy: {point.setting}"
    own = camera.accuracy.written()
    if not isinstance(own, dict):
        own = {"preset" if own in PRESETS else "tolerance": own}
    if point.knob != "file":
        own = {**own, point.knob: point.setting}
    if set(own) <= {"preset"} or set(own) <= {"tolerance"}:
        return f"accuracy: {next(iter(own.values()))}"
    return f"accuracy: {{{', '.join(f'{k}: {v}' for k, v in own.items())}}}"


def _text(seconds: float) -> str:
    return f"{seconds:.2g}" if seconds < 9.95 else f"{seconds:.0f}"
