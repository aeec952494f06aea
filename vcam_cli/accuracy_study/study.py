"""What accuracy costs: error against a converged reference and seconds, knob by knob.

Errors are of the mean raw signal, relative to full signal. Those of presets and tolerances are
against the camera with everything on, in 64 bits, every knob finer than `accuracy: reference` has
it. A knob's are its own: with all others converged, against the same with this one converged too;
only how far the spectrum is followed is then what the file's accuracy makes it. An effect left out
is judged with all else on. Seconds are of a whole frame, from the scene to its render and metrics,
without files: of the file's camera with this one thing changed.

With a graphics processor presets, tolerances and the file's camera are computed there, and so is
all that is timed. The reference and the errors of single knobs are the processor's: the errors of
presets include the device's.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict, field, replace
from typing import Any

from vcam_cli.accuracy_study import ablation, recommendation
from vcam_cli.accuracy_study.ablation import Ablation
from vcam_cli.accuracy_study.knobs import (
    CONVERGED,
    FINEST,
    Knob,
    applicable_knobs,
    settings_to_try,
    with_accuracy,
    with_knobs,
)
from vcam_cli.accuracy_study.measurements import Clock, Shot, settings_key
from vcam_cli.accuracy_study.recommendation import Recommendation
from vcam_cli.accuracy_study.reference import (
    FINEST_CELLS,
    Reference,
    describe_reference,
    effect_changes,
    finest_camera,
    rms_and_largest,
    sampling,
)
from vcam_cli.accuracy_study.refinement import Refined, is_same_camera, refine_reference
from vcam_cli.accuracy_study.setting_errors import COLUMNS, Point
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.simulation import PRESETS
from vcam_cli.devices.choice import open_device
from vcam_cli.floats import own_float_errors, rms
from vcam_cli.parallel import available_workers
from vcam_cli.progress import Observer, Silent
from vcam_cli.records import dataclass
from vcam_cli.simulation.shared import Shared
from vcam_cli.simulation.simulate import threads

__all__ = ["COLUMNS", "Point", "Study", "accuracy"]

Judged = tuple[Point, Camera]
"""A point whose time is still to come, and the camera that takes it."""
TOLERANCES = {"1 %": 0.01, "0.1 %": 0.001}
"""Those that are compared beside the presets."""


@dataclass(frozen=True)
class Study:
    """Everything `vcam accuracy` shows."""

    camera: Camera
    reference: Reference
    points: tuple[Point, ...]
    effects: tuple[Ablation, ...]
    absent: dict[str, str]
    """Knob that this camera does not have -> why."""
    recommendation: Recommendation
    device: str = "cpu"
    """Device of the presets' frames, and of what is timed."""

    def report(self) -> dict[str, Any]:
        """Return what accuracy.json holds."""
        return {
            "name": self.camera.name,
            "tolerance": self.camera.accuracy.tolerance,
            "device": self.device,
            "reference": asdict(self.reference),
            "points": [{**asdict(p), "tolerance_spent": p.tolerance_spent} for p in self.points],
            "effects": [{**asdict(e), "ratio": e.ratio} for e in self.effects],
            "absent": self.absent,
            "recommendation": asdict(self.recommendation),
            "notes": [
                "Errors are of the mean raw signal against the reference, relative to full signal.",
                "A knob's error is its own, with all others converged.",
                "tolerance_spent is the error over the tolerance, where a setting promises one.",
                "mean_s_cielab is between renders without noise; with noise for skipped effects and"
                " for shot_noise.",
                "Noise and rounding do not change the mean: their contribution is the largest share"
                " of the variance at the 1st to 99th percentile of the signal.",
                "An effect is skipped with everything else on.",
            ],
        }


@own_float_errors
def accuracy(
    camera: Camera,
    workers: int | None = None,
    watch: Observer | None = None,
    device: str = "cpu",
) -> Study:
    """Measure a camera along every knob, with every preset, without every effect.

    workers: threads, default all processors, and for what is timed those that a frame takes.
    watch: told of stages. device: as that of `simulate`. Raises BadInput, CannotDo.
    """
    label = open_device(device).label
    clock = Clock(workers or threads(camera), device)
    measured = _Measurement(camera, clock, workers or available_workers(), watch or Silent())
    return replace(measured.study(), device=label)


@dataclass
class _Measurement:
    """The camera on the bench."""

    camera: Camera
    clock: Clock
    workers: int
    watch: Observer

    full: float = 1.0
    """Full signal [electrons]"""
    changes: dict[str, float] = field(default_factory=dict)
    """Knob -> what its last refinement changed, relative to full signal."""

    def study(self) -> Study:
        """Return all of it; the reference is made first, then what is compared with it."""
        self.watch.begin("converged reference")
        coarse = self.clock.timed_shot(with_accuracy(self.camera, preset="reference"))
        truth = self.clock.shot(finest_camera(self.camera, coarse.ready))
        self.full = ablation.full_signal_of(truth.ready, truth.mean)
        change = rms(truth.mean - coarse.mean)
        reference = describe_reference(truth.ready, coarse.ready, self.full, change)
        self.watch.begin("errors of presets and tolerances")
        own = self.clock.timed_shot(self.camera)
        totals = self._settings(coarse, own, truth)
        del coarse
        self.watch.begin("errors of the knobs")
        knobs, absent = applicable_knobs(truth.ready)
        judged = self._knobs(knobs, own, truth, reference)
        reference = replace(reference, lost=math.hypot(reference.lost, *self.changes.values()))
        reference = replace(reference, changes=self.changes)
        judged = [(replace(p, unsure=reference.lost), c) for p, c in totals] + judged
        self.watch.begin("effects left out")
        effects = self._effects(own, truth, reference)
        self.watch.begin("seconds of the settings")
        self.clock.run_all(self.watch, self.camera)
        points = self._measure_times([*judged, *effects])
        shares = ablation.variance_shares(truth.ready, self.full, self.workers)
        ablations = tuple(self._ablation(own, point, shares) for point in points if point.effect)
        points += self._combine_knobs(points, truth, reference)
        advice = recommendation.recommend(self.camera, points)
        return Study(self.camera, reference, points, ablations, absent, advice)

    # --- what is compared ------------------------------------------------------------------------

    def _settings(self, coarse: Shot, own: Shot, truth: Shot) -> list[Judged]:
        """Presets, planned and with every effect on, tolerances, and the file as it is."""
        presets = {name: with_accuracy(self.camera, preset=name) for name in PRESETS}
        cases = [("preset", name, camera) for name, camera in presets.items()]
        for text, value in TOLERANCES.items():
            cases.append(("tolerance", text, with_accuracy(self.camera, tolerance=value)))
        for every, (name, camera) in itertools.product(("auto", "all"), presets.items()):
            cases.append((every, name, ablation.with_effects(camera, every)))
        cases.append(("file", "as it is", self.camera))
        known = {settings_key(presets["reference"]): coarse, settings_key(self.camera): own}
        points: dict[str, Point] = {}
        out = []
        for i, (knob, setting, case) in enumerate(cases):
            self.watch.step(i, len(cases))
            key, allowed = settings_key(case), case.accuracy.tolerance
            if key not in points:
                shot = known.get(key) or self.clock.timed_shot(case)
                points[key] = self._point(knob, setting, shot, truth)
            point = replace(points[key], knob=knob, setting=setting, tolerance=allowed)
            out.append((point, case))
        return out

    def _knobs(
        self, knobs: list[Knob], own: Shot, truth: Shot, reference: Reference
    ) -> list[Judged]:
        """Return the knobs, each with its own error."""
        fixed: dict[str, Any] = {"tolerance": CONVERGED, **FINEST}
        if reached := sampling(own.ready):
            fixed["oversampling"] = min(math.ceil(reached), FINEST_CELLS)
        everything = ablation.with_effects(self.camera, "all")
        shared = Shared()  # of models of noise the light is the same
        base = self.clock.shot(with_accuracy(everything, **fixed), shared)
        out = []
        for i, knob in enumerate(knobs):
            self.watch.step(i, len(knobs))
            shots = {}
            for setting, value in settings_to_try(knob, truth.ready).items():
                beside = {} if value == knob.finest else knob.companions
                case = with_accuracy(everything, **{**fixed, **beside, knob.name: value})
                alike = is_same_camera(knob, value, case, base.ready)
                shots[setting] = base if alike else self.clock.shot(case, shared)
            best = Refined(truth, reference.lost)
            if knob.name != "oversampling":
                again = [
                    with_accuracy(everything, **{**fixed, **more}) for more in knob.refinements
                ]
                best = refine_reference(base, list(shots.values()), again, self.full, self.workers)
                self.changes[knob.name] = best.change
            for setting, value in settings_to_try(knob, truth.ready).items():
                case = with_knobs(self.camera, **{knob.name: value})
                self.clock.add(case)
                point = self._point(knob.name, setting, shots[setting], best.shot)
                out.append((replace(point, unsure=best.change), case))
        return out

    def _effects(self, own: Shot, truth: Shot, reference: Reference) -> list[Judged]:
        """Return the effects, each left out."""
        names = ablation.wanted_effects(self.camera)
        moved = effect_changes(self.camera, reference.exposure_time, tuple(names), self.workers)
        out = []
        for i, name in enumerate(names):
            self.watch.step(i, len(names))
            case = without_effect(self.camera, name)
            point = self._point(
                f"effect:{name}", "off", self.clock.timed_shot(case), own, moved[name]
            )
            out.append((replace(point, predicted=None, left_out=(), variance_lost=0.0), case))
        return out

    def _combine_knobs(
        self, points: tuple[Point, ...], truth: Shot, reference: Reference
    ) -> tuple[Point, ...]:
        """Return the camera with all knobs coarser that need not be finer, if there are any."""
        knobs = recommendation.coarser_knobs(self.camera, points)
        if not knobs:
            return ()
        case = with_knobs(self.camera, **knobs)
        text = ", ".join(f"{name}: {value}" for name, value in knobs.items())
        point = self._point("combined", text, self.clock.timed_shot(case), truth)
        point = replace(point, unsure=reference.lost, tolerance=case.accuracy.tolerance)
        self.clock.run_all(self.watch, self.camera)
        return self._measure_times([(point, case)])

    # --- as it is shown --------------------------------------------------------------------------

    def _point(
        self, knob: str, setting: str, shot: Shot, other: Shot, moved: Array | None = None
    ) -> Point:
        """Return the errors of a shot beside another, its time still unknown.

        moved: (rms, largest) [electrons]; default the difference of the two.
        """
        if moved is None:
            moved = rms_and_largest(shot.mean - other.mean)
        noisy = knob.startswith("effect:") or knob == "shot_noise"
        return Point(
            knob=knob,
            setting=setting,
            rms_error=float(moved[0]) / self.full,
            max_error=float(moved[1]) / self.full,
            rms_electrons=float(moved[0]),
            seconds=math.nan,
            seconds_spread=math.nan,
            mean_s_cielab=shot.color_difference(other, self.workers, noisy),
            predicted=shot.expected_loss / self.full,
            left_out=shot.left_out,
            variance_lost=shot.variance_lost,
        )

    def _measure_times(self, judged: list[Judged]) -> tuple[Point, ...]:
        """Return the points with their seconds."""
        taken = ((point, self.clock.seconds(case)) for point, case in judged)
        return tuple(replace(p, seconds=median, seconds_spread=s) for p, (median, s) in taken)

    def _ablation(self, own: Shot, point: Point, shares: dict[str, float]) -> Ablation:
        """Return the plan's line of an effect beside what was measured."""
        d = next(d for d in own.ready.plan.decisions if d.name == point.effect)
        variance = d.unit.endswith("variance")
        return Ablation(
            name=point.effect,
            state=d.state,
            by=d.by,
            predicted=d.contribution,
            measured=shares[d.name] if variance else point.rms_error,
            unit=d.unit or "of full signal",
            seconds_saved=self.clock.seconds(self.camera)[0] - point.seconds,
        )


def without_effect(camera: Camera, name: str) -> Camera:
    """Return the file's camera with one effect switched off."""
    if camera.effects == "all":
        return ablation.with_effects(camera, "all", name)
    own = camera.effects if isinstance(camera.effects, dict) else {}
    return camera.model_copy(update={"effects": {**own, name: "off"}})
