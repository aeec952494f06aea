"""The plan: which effects run, which do not, and why.

The section keys of a camera file say what exists; `effects` says what the user wants simulated;
what is left to the plan is decided by two promises, with tolerance T:

- mean: leaving effects out changes the mean raw by at most T of full signal (rms over the array);
- variance: at 1, 10 and 100 % of full signal, temporal and fixed-pattern variance each stay
  within 2 T of everything on.

Why two: a read noise of 5 electrons is 0.06 % of full signal and most of the variance in the
shadows. One number cannot serve both. Three quarters of the mean's tolerance are kept for the
settings.

What costs next to nothing stays on: transfer functions beside the transform they multiply into,
charges, which are an addition. Leaving them out would gain no time, and only lose truth.

What each contributes is estimated from the scene itself, and never below the truth by more than a
tenth: `vcam accuracy` shows the estimates beside the measurement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.geometry import geometry as solve
from vcam_cli.effects.base import Charge, Effect, SignalLevels, of_kind
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.signal_chain import LEVELS, NoiseSource, noise_sources, total_variance
from vcam_cli.errors import BadInput, Collector
from vcam_cli.image_formation.settings import Settings

MEAN_SHARE = 0.25
"""Part of the mean's tolerance for the gains that are left out."""


@dataclass(frozen=True)
class Decision:
    """What becomes of one effect."""

    name: str
    state: str
    """Whether it is simulated: "on" or "off"."""
    by: str
    """Who decided that: "user", "plan" or "camera"."""
    reason: str
    """What it does, or why it is off."""
    contribution: float | None
    """The largest share that leaving it out would change, in `unit`."""
    unit: str
    """What the contribution is a share of."""
    seconds: float
    """Time that it takes on one core [s]."""


@dataclass(frozen=True)
class Plan:
    """Decisions in the order of action, the effects that run, and what that will cost."""

    decisions: tuple[Decision, ...]
    active: tuple[Effect, ...]
    settings: Settings
    seconds: float
    memory_bytes: int

    def report(self) -> dict:
        """Return the plan as `run.json` and `--json` show it."""
        return {
            "effects": [asdict(d) for d in self.decisions],
            "settings": self.settings.report(),
            "seconds": self.seconds,
            "memory_bytes": self.memory_bytes,
        }


def camera_effects(camera: Camera, geometry: Geometry) -> dict[str, Effect | None]:
    """Return every effect with a camera's numbers, by name, or None where it does not have it.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Geometry of its array.

    Returns
    -------
    dict
        Name of an effect -> the effect, in the order of action.

    Raises
    ------
    BadInput
        For `on` for something that the file does not describe.
    """
    found = {kind.name: kind.from_camera(camera, geometry) for kind in ORDER}
    if isinstance(camera.effects, dict):
        problems = Collector()
        absent = {kind.name: kind.absent for kind in ORDER}
        for name, wish in camera.effects.items():
            if wish == "on" and found.get(name) is None:
                why = absent.get(name, "the file describes nothing of the kind")
                problems.add(
                    ("effects", name),
                    f"on, but there is nothing to simulate: {why}",
                    "describe it in its section, or remove this line",
                )
        problems.raise_if_any()
    return found


def check(camera: Camera) -> None:
    """Refuse `effects` that ask for what the file does not describe (BadInput, with its place)."""
    try:
        camera_effects(camera, solve(camera))
    except BadInput as error:
        raise error.with_places(camera.locate) from None


def enabled_effects(camera: Camera, geometry: Geometry) -> tuple[Effect, ...]:
    """Return the effects that the camera has and the user has not switched off."""
    found = camera_effects(camera, geometry).values()
    return tuple(e for e in found if e is not None and _wish(camera, e) != "off")


def mean_signal_effects(camera: Camera, geometry: Geometry) -> tuple[Effect, ...]:
    """Return the effects on the mean signal that run, as far as no signal level decides it.

    Charges and noise are not among them.
    """
    present = enabled_effects(camera, geometry)
    later = {*of_kind(present, Charge, NoiseSource), *_negligible_light(camera, present)}
    return tuple(e for e in present if e not in later)


def _negligible_light(camera: Camera, present: Sequence[Effect]) -> set[Effect]:
    """Return the effects on the mean signal that take time and together change little.

    The smallest first, as many as fit into the share. Charges are an addition, and most transfers
    multiply into one that is there anyway. Glare and transport cost less than a draw, and of a lamp
    in the picture, far beyond its full well, they light all of it: no bound is known beforehand.
    """
    one = SignalLevels(full_signal=1.0, time=1.0)
    costly = [e for e in present if e.costly and e.removable and _wish(camera, e) == "auto"]
    errors = {e: error for e in costly if (error := e.mean_error(one)) is not None}
    left = MEAN_SHARE * camera.accuracy.tolerance
    negligible: set[Effect] = set()
    for effect in sorted(errors, key=errors.__getitem__):
        left -= errors[effect]
        if left < 0:
            break
        negligible.add(effect)
    return negligible


def make(
    camera: Camera,
    geometry: Geometry,
    settings: Settings,
    signal: SignalLevels,
    memory_bytes: int,
    changes: Mapping[str, float],
) -> Plan:
    """Decide on every effect of a camera for the signal that is expected.

    Parameters
    ----------
    camera : Camera
        The camera.
    geometry : Geometry
        Geometry of its array.
    settings : Settings
        Settings of image formation.
    signal : SignalLevels
        What is known of the signal.
    memory_bytes : int
        Memory that the frame takes [bytes].
    changes : mapping
        Name of an effect -> rms change of the signal by leaving it out, where it is known [e/s].

    Returns
    -------
    Plan
        The decisions, and the effects that run.
    """
    found = camera_effects(camera, geometry)
    present = list(enabled_effects(camera, geometry))
    tolerance = camera.accuracy.tolerance
    dropped = _negligible_light(camera, present)
    candidates = [e for e in present if e.removable and _wish(camera, e) == "auto"]
    dropped |= _negligible_variance(candidates, present, signal, tolerance)
    pixels = geometry.rows * geometry.columns
    decisions, active = [], []
    for kind in ORDER:
        effect = found[kind.name]
        change = changes.get(kind.name)
        change = None if change is None else change * signal.time
        decision = _decide(kind, effect, camera, effect in dropped, present, signal, pixels, change)
        decisions.append(decision)
        if effect is not None and decision.state == "on":
            active.append(effect)
    seconds = sum(d.seconds for d in decisions)
    return Plan(tuple(decisions), tuple(active), settings, seconds, memory_bytes)


def _wish(camera: Camera, effect: Effect) -> str:
    """Return what the file wants of an effect it describes: on, off or auto."""
    if camera.effects == "all":
        return "on"
    if camera.effects == "auto":
        return "auto"
    return camera.effects.get(effect.name, "auto")


def _negligible_variance(
    candidates: list[Effect], present: list[Effect], signal: SignalLevels, tolerance: float
) -> set[Effect]:
    """Return the noise sources whose absence changes no variance by 2 T or more, at any level."""
    negligible: set[Effect] = set()
    for scope in ("frame", "sensor"):
        everything = total_variance(noise_sources(present, scope), signal)
        missing = np.zeros(len(LEVELS))
        variances = {e: total_variance([e], signal) for e in noise_sources(candidates, scope)}
        for effect in sorted(variances, key=lambda e: float(variances[e].max())):
            missing = missing + variances[effect]
            # Half of it: the other is kept for what the levels in between may ask.
            if np.any(missing > tolerance * everything):
                break
            negligible.add(effect)
    return negligible


def _decide(
    kind: type[Effect],
    effect: Effect | None,
    camera: Camera,
    dropped: bool,
    present: list[Effect],
    signal: SignalLevels,
    pixels: int,
    change: float | None,
) -> Decision:
    """Return the line of the plan on one effect; `change` is the rms by leaving it out [e]."""
    if effect is None:
        return Decision(kind.name, "off", "camera", kind.absent, None, "", 0.0)
    contribution: float | None
    if change is None:
        contribution, unit = effect.contribution(signal, present)
    else:
        # A pixel that is full shows no change beyond the well.
        contribution, unit = min(change / signal.full_signal, 1.0), "of full signal"
    seconds = kind.seconds_per_pixel * pixels
    wish = _wish(camera, effect)
    if wish == "off":
        return Decision(kind.name, "off", "user", "switched off in effects", contribution, unit, 0)
    what = effect.describe()
    if dropped:
        reason = f"{what}: leaving it out changes less than {camera.accuracy.tolerance:.3g} allows"
        return Decision(kind.name, "off", "plan", reason, contribution, unit, 0.0)
    by = "user" if wish == "on" else "plan"
    return Decision(kind.name, "on", by, what, contribution, unit, seconds)
