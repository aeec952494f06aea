"""Which effects on the light a scene calls for, decided before any light is computed.

An effect is left out where a bound says that the light at the pixels changes by next to nothing
without it, as long as the bounds of all that are left out together stay within their share of the
tolerance. Each kind of scene bounds what a blur changes of it (`scenes.blur_change`); gains and
veiling glare have bounds of their own. Of the sets that may go, the one is left out that saves most
time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace
from itertools import combinations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.effects.base import Effect, SignalLevels, of_kind
from vcam_cli.effects.blurs import Blur, FieldTransfer, SeparableTransfer
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.effects.pixel_signal import (
    ColumnSpread,
    Gain,
    NeighborSharing,
    Transport,
    VeilingGlare,
)
from vcam_cli.effects.warps import StillWarp, Warp
from vcam_cli.image_formation.estimates.edge_changes import exact_changes, has_straight_edges
from vcam_cli.image_formation.estimates.light_cost import FIRST, LightCost
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene
from vcam_cli.scenes.blur_change import BlurLoss
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.waves import WaveScene

OMITTED_SHARE = 0.5
"""Part of the mean's tolerance for all effects that are left out; those on electrons may use what
those on the light leave of it."""
LEVEL_SHARE = 0.5
"""Part of the tolerance by which a gain may change the light of any pixel, relative to it: shot
noise has the variance of the signal, and is promised at percentiles of the light. What spreads
light is judged by what it adds to the darkest pixel."""
PERCENTILES = (1, 10, 50, 90, 99)
"""Percentiles of the scene's own light at which noise is promised."""
PLACES = 33
"""Places along each side of the array at which a gain, which is smooth, is looked at."""
BLURS = (Blur, SeparableTransfer, FieldTransfer, Warp)
"""Kinds of effects that blur the light, or displace it."""
KINDS = (*BLURS, Gain, VeilingGlare, NeighborSharing, ColumnSpread, Transport)
"""Kinds of effects on the light, and on the charge that it makes."""
EXACT, EXACT_OVER_FIELD = 10e-3, 20e-3
"""Time that exact sums take of what a blur changes of edges, and one that changes over the field
[s]: one that saves less is kept instead."""
LOOSEST, LOOSEST_OVER_FIELD = 8.0, 24.0
"""Bounds over exact sums, at most, of edges that lie anywhere to the pixels: larger ones stay. Of
blurs over the field the bounds are those of the steepest wavefront everywhere."""
DARKER = 0.67
"""Full signal over what is assumed of it below which a sampled image is formed again: it errs by
0.62 to 0.74 of the tolerance, and may by `USED_SHARE`."""
MOST_TRIED = 10
"""Number of effects up to which all subsets are tried; beyond it, those that change least."""


@dataclass(frozen=True)
class LightPlan:
    """What becomes of the effects on the light."""

    omitted: tuple[Effect, ...] = ()
    """Effects that are left out."""
    idle: tuple[Effect, ...] = ()
    """Effects that could be left out, but would save nothing beside those that stay."""
    shares: dict[str, float] = field(default_factory=dict)
    """Bound on the rms change by leaving out each effect, where there is one, relative to full
    signal."""
    saved: dict[str, float] = field(default_factory=dict)
    """Core seconds that each omitted effect would take if it were simulated beside those that act
    [s]."""
    saved_together: float = 0.0
    """Core seconds that all of them would take [s]."""
    of_all: float = 0.0
    """Core seconds of a sampled image with all effects [s]; 0 where nothing is left out, and of
    light in closed form."""

    @property
    def share(self) -> float:
        """Sum of the changes by the omitted effects, relative to full signal."""
        return sum(self.shares[effect.name] for effect in self.omitted)

    @property
    def on_axis(self) -> float:
        """Factor on the signal on the axis of the gains that are left out."""
        return math.prod((gain.on_axis for gain in of_kind(self.omitted, Gain)), start=1.0)

    def formed(self, times: int, darkness: float) -> LightPlan:
        """Return the plan with what is saved of light that was formed.

        Parameters
        ----------
        times : int
            How often it was formed.
        darkness : float
            Full signal over what was assumed of it.

        Returns
        -------
        LightPlan
            The plan.
        """
        more = max((2 if darkness < DARKER else 1) - times, 0)
        again = (times - 1) * self.saved_together + more * self.of_all
        saved = self.saved_together + FIRST * again
        return replace(self, saved_together=saved)

    def reduced(self, path: OpticalPath) -> OpticalPath:
        """Return the path without the omitted effects.

        Parameters
        ----------
        path : OpticalPath
            The path with all effects.

        Returns
        -------
        OpticalPath
            The path without them.
        """
        path = path.with_effects([e for e in path.effects if e not in self.omitted])
        on_axis = self.on_axis or 1.0
        transfer = replace(path.transfer, weights=path.transfer.weights / on_axis)
        full = min(path.full / on_axis, path.ceiling)
        if not self.omitted:
            return path
        return replace(path, transfer=transfer, full=full, omitted_share=self.share)


def light_plan(path: OpticalPath, scene: AnyScene) -> LightPlan:
    """Decide which of the optional effects of a path its scene does not call for.

    Parameters
    ----------
    path : OpticalPath
        Lens and pixels with all effects that are wanted; `optional` names those that may go.
    scene : AnyScene
        Scene before the lens.

    Returns
    -------
    LightPlan
        Skipped effects, and the largest change by each effect.
    """
    candidates = of_kind(path.optional, *KINDS)
    if not candidates:
        return LightPlan()
    cost = LightCost(path, scene)
    if path.transfer.is_dark or _is_full(path):
        none = dict.fromkeys((e.name for e in candidates), 0.0)
        return LightPlan(candidates, (), none, *_saved(cost, candidates))
    budget = OMITTED_SHARE * path.settings.tolerance
    shares = _blur_shares(cost, budget)
    shares |= {e: _share(path, scene, e) for e in candidates if e not in shares}
    small = sorted((e for e in candidates if shares[e] <= budget), key=shares.__getitem__)
    omitted = _best_set(cost, small[:MOST_TRIED], shares, budget)
    known = {e.name: share for e, share in shares.items() if math.isfinite(share)}
    idle = tuple(e for e in small if e not in omitted)
    of_all = cost.of_all if omitted else 0.0
    return LightPlan(omitted, idle, known, *_saved(cost, omitted), of_all)


def _saved(cost: LightCost, omitted: Collection[Effect]) -> tuple[dict[str, float], float]:
    """Return the core seconds that omitted effects save, each beside those that act, and all."""
    saved = cost.saved(omitted)
    each = {e.name: saved - cost.saved([o for o in omitted if o is not e]) for e in omitted}
    return each, saved


def _is_full(path: OpticalPath) -> bool:
    """Return whether all pixels are full, whatever the effects on the light are."""
    if path.fullness < 1:  # by white on the axis
        return False
    return path.fullness * _range_of_gains(path, of_kind(path.effects, Gain))[0] >= 1


def _blur_shares(cost: LightCost, budget: float) -> dict[Effect, float]:
    """Return a bound on what each blur of a path changes, relative to full signal."""
    path, scene = cost.path, cost.scene
    transfer = path.transfer
    spreads = {e: e.spread(transfer.wavelengths) for e in of_kind(path.effects, *BLURS)}
    losses = {
        e: BlurLoss(
            *_spread_light(transfer.weights, spread),
            e.largest_loss,
            e.is_even,
            e.is_uniform,
            path.averaged_width if e in of_kind(spreads, StillWarp) else 0.0,
        )
        for e, spread in spreads.items()
        if spread is not None
    }
    if not losses or path.layers:  # what layers hide of each other has no bound
        return dict.fromkeys(losses, math.inf)
    flat = scene.flat if isinstance(scene, LayeredScene | DepthScene) else scene
    given = list(losses.values())
    if has_straight_edges(flat):
        # A blur over the field as if it were everywhere as where it is most: see below.
        given = [replace(loss, is_uniform=True) for loss in given]
    bounds = flat.change_bounds(given, path.geometry, path.ceiling, budget)
    # Pixels that are read as one have less than the brightest of them.
    bounds = replace(bounds, full=min(bounds.full, path.full))
    shares: dict[Effect, float] = dict(zip(losses, bounds.shares(), strict=True))
    if has_straight_edges(flat):  # such a bound says whether exact sums pay, no more
        exact = _edge_shares(cost, flat, shares, bounds.full, budget)
        varied = [e for e, loss in losses.items() if shares[e] > 0 and not loss.is_uniform]
        shares |= dict.fromkeys(varied, math.inf) | exact
    # Points in place of averages alias what detail there is: only of even light is that nothing.
    detailed = [e for e in of_kind(shares, PixelAperture) if shares[e] > 0]
    return shares | dict.fromkeys(detailed, math.inf)


def _edge_shares(
    cost: LightCost,
    scene: ChartScene,
    shares: Mapping[Effect, float],
    full: float,
    budget: float,
) -> dict[Effect, float]:
    """Return what blurs change of straight edges, summed exactly where that may pay.

    Beside a blur over the field that stays, no other one saves as much as its sum takes.
    """
    path, exact = cost.path, dict[Effect, float]()
    for over_field in of_kind(shares, FieldTransfer):
        worth_it = shares[over_field] <= LOOSEST_OVER_FIELD * budget
        if not (worth_it and cost.saved((over_field,)) > EXACT_OVER_FIELD):
            return {}
        exact |= exact_changes(path, scene, [over_field])
        if exact.get(over_field, math.inf) > budget * full:
            return {}
        others = path.with_effects([e for e in path.effects if e is not over_field])
        cost = LightCost(others, cost.scene)
    loose = [e for e in of_kind(shares, Blur) if budget < shares[e] <= LOOSEST * budget]
    exact |= exact_changes(path, scene, [e for e in loose if cost.saved((e,)) > EXACT])
    return {blur: change / full for blur, change in exact.items()}


def _spread_light(weights: Array, spread: Array) -> tuple[Array, Array]:
    """Return weights (K, C, J) and spreads (J,), of one wavelength where all spread alike."""
    if spread.min() < spread.max():
        return weights, spread
    return weights.sum(axis=2, keepdims=True), spread[:1]


def _share(path: OpticalPath, scene: AnyScene, effect: Effect) -> float:
    """Return a bound on what a gain, glare, sharing or transport changes; inf for none."""
    gains = of_kind([effect], Gain)
    share = _mean_error_of_gain(gains[0]) if gains else _mean_error(effect)
    for gain in gains:
        low, high = _range_of_gains(path, (gain,))
        if max(abs(1 - low), abs(1 - high)) > LEVEL_SHARE * path.settings.tolerance:
            return math.inf
    spread = [glare.fraction for glare in of_kind([effect], VeilingGlare)]
    shared = of_kind([effect], NeighborSharing)
    if shared and len(path.mosaic.colors) > 1:  # of even light, too, each color changes others
        return math.inf
    spread += [sharing.largest_share for sharing in shared]
    columns = of_kind([effect], ColumnSpread)
    # What wells do not hold smears, too: where light is beyond them, or their time is not known.
    brightest = _range_of_light(scene)[1] * float(path.transfer.level.sum(axis=0).max())
    if columns and (len(path.mosaic.colors) > 1 or not brightest < path.ceiling < math.inf):
        return math.inf
    spread += [smear.share for smear in columns]
    for fraction in spread:
        before = path.effects[: path.effects.index(effect)]
        low, high = _range_of_gains(path, of_kind(before, Gain))
        darkest, brightest = _range_of_light(scene)
        least, moved = low * darkest, fraction * (high * brightest - low * darkest)
        share = 0.0 if moved == 0 else moved / least if least > 0 else math.inf  # of the darkest
    return share


def _mean_error(effect: Effect) -> float:
    """Return a bound on what an effect changes of the mean signal, over it; inf for none."""
    share = effect.mean_error(SignalLevels(full_signal=1.0, time=1.0))
    return math.inf if share is None else share


_mean_error_of_gain = remembered(16)(_mean_error)
"""Gains do not depend on the scene: a camera that meters it at rest asks twice."""


def _range_of_gains(path: OpticalPath, gains: Collection[Gain]) -> tuple[float, float]:
    """Return the least and the largest product of gains over the array, 1 on the axis."""
    g = path.geometry
    return _range_over_array(tuple(gains), g.sensor_width, g.sensor_height, path.mosaic.colors)


@remembered(16)
def _range_over_array(
    gains: tuple[Gain, ...], width: float, height: float, colors: tuple[str, ...]
) -> tuple[float, float]:
    """Return the same for an array of a size [m]."""
    x, y = (np.linspace(-size / 2, size / 2, PLACES) for size in (width, height))
    products = [np.ones((1, 1))] * (1 if all(gain.is_neutral for gain in gains) else len(colors))
    for gain in gains:
        axis = gain.on_axis or 1.0
        products = [
            product * gain.of_color(color).gain(x, y) / axis
            for color, product in zip(colors, products, strict=False)
        ]
    return float(min(p.min() for p in products)), float(max(p.max() for p in products))


def _range_of_light(scene: AnyScene) -> tuple[float, float]:
    """Return bounds on a scene's darkest and brightest light, over white; 0 and inf unknown."""
    if isinstance(scene, WaveScene):
        return scene.darkest, scene.brightest
    if isinstance(scene, ChartScene):
        return scene.chart.darkest, scene.chart.brightest
    return 0.0, math.inf


def _best_set(
    cost: LightCost, small: Sequence[Effect], shares: Mapping[Effect, float], budget: float
) -> tuple[Effect, ...]:
    """Return the effects without which most time is saved, and together within the budget.

    Of sets that save alike it is the one with the most effects, and of these the one that changes
    least.
    """

    def worth(omitted: tuple[Effect, ...]) -> tuple[float, int, float]:
        return round(cost.saved(omitted), 6), len(omitted), -sum(shares[e] for e in omitted)

    # Without a blur over the field the light takes a fraction of the time: it goes first.
    first = of_kind(small, FieldTransfer)
    others = [e for e in small if e not in first]
    sets = ((*first, *s) for n in range(len(others) + 1) for s in combinations(others, n))
    within = (s for s in sets if sum(shares[e] for e in s) <= budget)
    return max(within, key=worth)
