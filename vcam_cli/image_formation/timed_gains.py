"""Gains of the light that depend on when a line is exposed: applied once the time is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import Effect, SignalLevels, of_kind
from vcam_cli.effects.pixel_signal import TemporalGain
from vcam_cli.image_formation.light_plan import OMITTED_SHARE, LightPlan


def light_plan(
    plan: LightPlan,
    effects: Sequence[Effect],
    optional: Sequence[Effect],
    time: float,
    tolerance: float,
) -> LightPlan:
    """Return the plan without those gains, too, that hardly change an exposure of this time.

    Their changes are bounds, and no larger in any pixel than the share of all light's effects
    relative to its signal: so neither are those of the scene's levels.

    Parameters
    ----------
    plan : LightPlan
        Effects that are skipped already.
    effects, optional : sequence of Effect
        Effects that act, and those that may be left out.
    time : float
        Exposure time [s].
    tolerance : float
        Error allowed, relative to full signal.

    Returns
    -------
    LightPlan
        The plan with the gains that are left out.
    """
    for effect in of_kind(effects, TemporalGain):
        change = effect.mean_error(SignalLevels(full_signal=1.0, time=time))
        if effect not in optional or change is None:
            continue
        if plan.share + change <= OMITTED_SHARE * tolerance:
            shares = {**plan.shares, effect.name: change}
            plan = replace(plan, omitted=(*plan.omitted, effect), shares=shares)
    return plan


def apply(
    light: Array, gains: Sequence[TemporalGain], lattice: Geometry, start: float, stop: float
) -> Array:
    """Return the mean light from `start` to `stop` after a line's exposure begins.

    Parameters
    ----------
    light : Array
        Mean light over all times (..., rows, columns) [e/s]; it is not changed.
    gains : sequence of TemporalGain
        Gains that act.
    lattice : Geometry
        Geometry of the light's rows and columns.
    start, stop : float
        Times [s].

    Returns
    -------
    Array
        Light of the same shape and float type [e/s].
    """
    x, y = pixel_centers(lattice)
    for gain in gains:
        light = light * gain.gain(x, y, start, stop).astype(light.dtype)
    return light
