"""The plan: which effects run, which do not, and why.

The section keys of a camera file say what exists; `effects` says what the user wants simulated;
the plan decides on the other effects by two promises, with tolerance T:

- mean: all that is left out changes the mean raw by at most T / 2 of full signal, rms over the
  array; with the errors of the settings, added in squares, it stays within T;
- variance: at the 1st, 10th, 50th, 90th and 99th percentile of the scene's own signal, temporal and
  fixed-pattern variance each stay within 2 T of everything on.

Why two: a read noise of 5 electrons is 0.06 % of full signal and most of the variance in the
shadows. One number cannot serve both; and a scene without shadows does not call for it.

Effects on the light are decided first, on bounds (`image_formation.light_plan`); all others here,
with the light at hand. Of the sets that keep the promises the one is left out that saves most time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, field, replace
from functools import cached_property
from itertools import chain, combinations
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect, SignalLevels, of_kind
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.pixel_signal import Charge, Overflow, Transport
from vcam_cli.effects.signal_chain import (
    ElectronEffect,
    Limit,
    NoiseSource,
    Quantizer,
    noise_sources,
    total_variance,
)
from vcam_cli.image_formation.light_plan import OMITTED_SHARE, LightPlan
from vcam_cli.image_formation.settings import Settings
from vcam_cli.records import dataclass
from vcam_cli.solve.effects import CameraEffects

VARIANCE_SHARE = 0.8
"""Part of the variance's tolerance for them; the rest is for percentiles that are estimated."""

MOST_TRIED = 8
"""Effects on electrons whose subsets are all tried; of more, those that change least."""
WELL_KNOWN = 10
"""Signal levels over what light may err by, above which that is neglected: variances follow squares
of the level at most, and keep a fifth of what they may change by."""


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
    allowed: float | None
    """The share that all that is left out may change together, in `unit`."""
    unit: str
    """What the contribution is a share of."""
    seconds: float
    """Time that it takes on one core [s]."""
    saved: float = 0.0
    """Time that leaving it out, or its parts that are skipped, saves on one core [s]."""
    free: bool = False
    """Whether it could be left out, but would save nothing."""


@dataclass(frozen=True)
class Plan:
    """Decisions in the order of action, the effects that run, and what that will cost."""

    decisions: tuple[Decision, ...]
    active: tuple[Effect, ...]
    settings: Settings
    seconds: float
    memory_bytes: int
    seconds_of_all: float = 0.0
    """Estimated time with everything on [s]."""
    levels: tuple[float, ...] = ()
    """Noise-free signals of the scene at which noise is promised [electrons]."""

    def report(self) -> dict[str, Any]:
        """Return the plan as `run.json` and `--json` show it."""
        return {
            "effects": [asdict(d) for d in self.decisions],
            "settings": self.settings.report(),
            "seconds": self.seconds,
            "seconds_of_all": self.seconds_of_all,
            "memory_bytes": self.memory_bytes,
        }


def make(
    effects: CameraEffects,
    tolerance: float,
    pixels: int,
    settings: Settings,
    light: LightPlan,
    signal: SignalLevels,
    memory_bytes: int,
    changes: Mapping[str, float],
) -> Plan:
    """Decide every effect of a camera for the signal that is expected.

    Parameters
    ----------
    effects : CameraEffects
        Effects of the camera, and what its file wants of them.
    tolerance : float
        Error of the mean signal that the file allows, relative to full signal.
    pixels : int
        Number of pixels.
    settings : Settings
        Settings of image formation.
    light : LightPlan
        What was decided of the effects on the light.
    signal : SignalLevels
        The signal.
    memory_bytes : int
        Estimated memory [bytes].
    changes : mapping
        Name of an effect -> rms change of the signal by leaving it out, where known [e/s].
    """
    present = effects.enabled
    known = {name: min(c * signal.time / signal.full_signal, 1.0) for name, c in changes.items()}
    left_out = {effect.name: light.shares[effect.name] for effect in light.omitted}
    shares = light.shares | known | left_out
    variances = _SceneVariances(present, with_level_errors(signal, tolerance), tolerance)
    omitted = {*light.omitted, *_negligible(effects, variances, light, shares)}
    on = tuple(effect for effect in present if effect not in omitted)
    active, idle = _without_idle_draws(effects, on, tuple(omitted), variances)
    running = {effect.name: effect for effect in active}
    weigh = _Weighing(present, signal, shares, pixels, running, idle, tolerance)
    decisions = [_decide(kind, effects, light, omitted, weigh) for kind in ORDER]
    seconds = sum(decision.seconds for decision in decisions)
    return Plan(tuple(decisions), active, settings, seconds, memory_bytes, levels=signal.levels)


def with_level_errors(signal: SignalLevels, tolerance: float) -> SignalLevels:
    """Return a signal with every level, and with low ones as low and as high as they may truly be.

    Levels are percentiles of light that errs by the tolerance, relative to full signal; relative
    to a low one that is much: shot noise may count there that would not. None is below the dark
    signal, or above full signal.
    """
    off, dark, full = tolerance * signal.full_signal, signal.dark, signal.full_signal
    low = [level for level in signal.levels if level < WELL_KNOWN * off]
    least = (max(level - off, min(level, dark)) for level in low)
    most = (min(level + off, max(level, full)) for level in low)
    return replace(signal, levels=tuple(sorted({*least, *signal.levels, *most})))


def _negligible(
    effects: CameraEffects,
    variances: _SceneVariances,
    light: LightPlan,
    shares: Mapping[str, float],
) -> tuple[Effect, ...]:
    """Return the effects on electrons that may go together, without which most time is saved."""
    present, signal = variances.present, variances.signal
    budget = OMITTED_SHARE * variances.tolerance - light.share
    # Late charge is some of the dark signal's: with transport, the two stay together.
    moved = any(transport not in light.omitted for transport in of_kind(present, Transport))
    kinds = (ElectronEffect, Overflow) if moved else (Charge, ElectronEffect, Overflow)
    rest = effects.optional(of_kind(present, *kinds))

    def mean_share(effect: Effect) -> float:
        if effect.name in shares and not of_kind([effect], Limit):
            return shares[effect.name]
        error = effect.mean_error(signal)
        return math.inf if error is None else error / signal.full_signal

    def use(effect: Effect) -> float:
        of_mean = mean_share(effect) / (OMITTED_SHARE * variances.tolerance)
        return max(of_mean, variances.share_lost([effect]))

    def worth(effects: tuple[Effect, ...]) -> tuple[float, int, float]:
        return (
            sum(e.pixel_seconds for e in effects),
            len(effects),
            -sum(uses[e] for e in effects),
        )

    uses = {effect: use(effect) for effect in rest}
    small = sorted((e for e in rest if uses[e] <= 1), key=uses.__getitem__)[:MOST_TRIED]
    sets = chain.from_iterable(combinations(small, count) for count in range(len(small) + 1))
    return next(
        together
        for together in sorted(sets, key=worth, reverse=True)
        if sum(map(mean_share, together)) <= budget and variances.share_lost(together) <= 1
    )


@dataclass(frozen=True)
class _SceneVariances:
    """Temporal and fixed-pattern variances at the scene's levels."""

    present: Sequence[Effect]
    """All effects that are wanted."""
    signal: SignalLevels
    tolerance: float
    _signals: dict[float, SignalLevels] = field(default_factory=dict)
    """Missing dark signal [electrons] -> the signal without it, of those requested before."""

    @cached_property
    def whole(self) -> Array:
        """With all effects: (2, levels) [electrons squared]."""
        return _of_scopes(self.present, self.signal)

    def share_lost(self, gone: Sequence[Effect], instead: Sequence[Effect] = ()) -> float:
        """Return the largest relative change without some effects, over what is allowed.

        Parameters
        ----------
        gone : sequence of Effect
            Effects that are left out of all.
        instead : sequence of Effect, optional
            What remains of them.
        """
        rates = [charge.rate() for charge in of_kind(gone, Charge)]
        if missing := math.fsum(rates) * self.signal.time:
            # Without a charge the dark signal and every level are lower, for all that is kept.
            names = {effect.name for effect in gone}
            kept = [effect for effect in self.present if effect.name not in names]
            lost = self.whole - _of_scopes([*kept, *instead], self._signal_without(missing))
        else:
            lost = _of_scopes(gone, self.signal) - _of_scopes(instead, self.signal)
        share = np.abs(lost) / np.maximum(self.whole, 1e-300)
        return float(share.max()) / (2 * VARIANCE_SHARE * self.tolerance)

    def _signal_without(self, missing: float) -> SignalLevels:
        if missing not in self._signals:
            dark = max(self.signal.dark - missing, 0.0)
            levels = tuple(max(level - missing, 0.0) for level in self.signal.weighed)
            self._signals[missing] = replace(self.signal, dark=dark, levels=levels)
        return self._signals[missing]


def _of_scopes(effects: Sequence[Effect], signal: SignalLevels) -> Array:
    """Return the temporal and the fixed-pattern variance of effects (2, levels) [e squared]."""
    scopes = (noise_sources(effects, scope) for scope in ("frame", "sensor"))
    return np.array([total_variance(sources, signal) for sources in scopes])


def _without_idle_draws(
    effects: CameraEffects,
    on: Sequence[Effect],
    omitted: Sequence[Effect],
    variances: _SceneVariances,
) -> tuple[tuple[Effect, ...], dict[str, tuple[str, ...]]]:
    """Return the effects that run less draws that hardly add to a variance, and those, by effect.

    They share a tolerance with the whole effects that are left out.
    """
    lean, idle = dict[Effect, Effect](), dict[str, tuple[str, ...]]()
    for source in of_kind(on, NoiseSource):
        if source.parts and effects.wish(source) == "auto":
            gone, instead = (*omitted, *lean, source), tuple(lean.values())
            if names := _idle_parts(source, gone, instead, variances):
                lean[source], idle[source.name] = source.without_parts(names), names
    return tuple(lean.get(effect, effect) for effect in on), idle


def _idle_parts(
    source: NoiseSource,
    gone: Sequence[Effect],
    instead: Sequence[Effect],
    variances: _SceneVariances,
) -> tuple[str, ...]:
    """Return the parts of a source that may go together, those that add least first."""

    def share_lost(names: Sequence[str]) -> float:
        return variances.share_lost(gone, (*instead, source.without_parts(names)))

    out: tuple[str, ...] = ()
    lost = {name: share_lost([name]) for name in source.parts if getattr(source, name)}
    for name in sorted((n for n in lost if lost[n] <= 1), key=lost.__getitem__):
        if not out or share_lost([*out, name]) <= 1:
            out = (*out, name)
    return out


@dataclass(frozen=True)
class _Weighing:
    """Costs and errors of every effect when the plan decides on it."""

    present: Sequence[Effect]
    signal: SignalLevels
    shares: Mapping[str, float]
    pixels: int
    active: Mapping[str, Effect]
    """Name -> effect that runs, less those draws."""
    idle: Mapping[str, tuple[str, ...]]
    """Name of an effect -> its draws that are not called for."""
    tolerance: float

    def places(self, kind: type[Effect]) -> int:
        """Return how many pixels an effect acts on: those whose charge is joined count as one."""
        binning = self.signal.binning
        joined = binning is not None and binning.kind == "charge"
        if binning is None or not joined or not issubclass(kind, ElectronEffect | Quantizer):
            return self.pixels
        return self.pixels // binning.count

    def contribution(self, effect: Effect) -> tuple[float | None, str]:
        """Return how much leaving it out would change, and of what."""
        if effect.name in self.shares:
            return self.shares[effect.name], "of full signal"
        return effect.contribution(self.signal, self.present)


def _decide(
    kind: type[Effect],
    effects: CameraEffects,
    light: LightPlan,
    omitted: Collection[Effect],
    weigh: _Weighing,
) -> Decision:
    """One line of the plan."""
    effect = effects.found[kind.name]
    if effect is None:
        return Decision(kind.name, "off", "camera", kind.absent, None, None, "", 0.0)
    contribution, unit = weigh.contribution(effect)
    part = OMITTED_SHARE if unit == "of full signal" else 2.0
    allowed = None if contribution is None else part * weigh.tolerance
    weighed = contribution, allowed, unit
    wish, what = effects.wish(effect), effect.describe()
    seconds = effect.pixel_seconds * weigh.places(kind)
    if wish == "off":
        return Decision(kind.name, "off", "user", "switched off in effects", *weighed, 0.0)
    if effect in omitted:
        reason = f"{what}; skipped"
        return Decision(kind.name, "off", "plan", reason, *weighed, 0.0, saved=seconds)
    free = (
        effect in light.idle
        and contribution is not None
        and light.share + contribution <= OMITTED_SHARE * weigh.tolerance
    )
    if free:
        what += "; free: could be skipped, which would save no time"
    if idle := weigh.idle.get(kind.name):
        what += f"; skipped parts: {', '.join(idle)}"
    kept = weigh.active[kind.name].pixel_seconds * weigh.places(kind)
    by = "user" if wish == "on" else "plan"
    return Decision(kind.name, "on", by, what, *weighed, kept, seconds - kept, free)
