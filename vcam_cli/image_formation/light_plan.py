"""Which effects on the light a scene calls for, decided before any light is computed.

An effect that changes the light at the pixels by next to nothing is left out, as long as all that
are left out together stay within their share of the tolerance: transfer functions of a scene with
little detail, gains and veiling glare whose change of the surveyed light is small. What is left out
saves its work; without any blur, the light is a mean over the photodetectors, and no spectrum is
computed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import (
    Blur,
    Effect,
    FieldTransfer,
    Gain,
    ImageMotion,
    RadialTransfer,
    SeparableTransfer,
    SignalLevels,
    Transport,
    VeilingGlare,
    of_kind,
)
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.effects.temporal.sub_exposed_motion import SubExposedMotion
from vcam_cli.image_formation.estimates.scene_detail import (
    SceneDetail,
    change_by_omission,
    scene_detail,
    transfer_functions,
)
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene

OMITTED_SHARE = 0.5
"""Part of the mean's tolerance for all effects that are left out; those on electrons may use what
those on the light leave of it."""
LEVEL_SHARE = 0.5
"""Part of the tolerance by which they may shift a percentile of the light, relative to it: shot
noise has the variance of the signal."""
PERCENTILES = (1, 10, 50, 90, 99)
"""Percentiles of the scene's own light at which noise is promised."""
PLACES = 33
"""Places along each side of the array at which the least gain is sought."""
BLURS = (Blur, SeparableTransfer, FieldTransfer, SubExposedMotion)
"""Kinds of effects that blur the light."""
KINDS = (*BLURS, Gain, VeilingGlare, Transport)
"""Kinds of effects on the light, and on the charge that it makes."""


@dataclass(frozen=True)
class LightPlan:
    """What becomes of the effects on the light."""

    omitted: tuple[Effect, ...] = ()
    """Effects that are left out."""
    bounding: tuple[Effect, ...] = ()
    """Blurs that seemed to count for little, but stay: without them the spectrum of others would
    reach further."""
    shares: dict[str, float] = field(default_factory=dict)
    """Estimated rms change by leaving out each omitted effect, and motion, which is more than its
    blur; relative to full signal."""

    @property
    def share(self) -> float:
        """Sum of the changes by the omitted effects, relative to full signal."""
        return sum(self.shares[effect.name] for effect in self.omitted)

    @property
    def on_axis(self) -> float:
        """Factor on the signal on the axis of the gains that are left out."""
        return math.prod((gain.on_axis for gain in of_kind(self.omitted, Gain)), start=1.0)

    def reduced(self, path: OpticalPath) -> OpticalPath:
        """Return the path without the omitted effects."""
        if not self.omitted:
            return replace(path, optional=())
        kept = tuple(effect for effect in path.effects if effect not in self.omitted)
        gone = {effect.name for effect in self.omitted}
        layers = tuple(layer.without_effects(gone) for layer in path.layers)
        transfer = path.transfer.with_effects(kept)
        transfer = replace(transfer, weights=transfer.weights / (self.on_axis or 1.0))
        return replace(path, transfer=transfer, effects=kept, optional=(), layers=layers)


def light_plan(path: OpticalPath, scene: AnyScene) -> LightPlan:
    """Decide which of the optional effects of a path its scene does not call for.

    Parameters
    ----------
    path : OpticalPath
        Lens and pixels with all effects that are wanted; `optional` names those that may go.
    scene : AnyScene
        Scene before the lens.
    """
    candidates = of_kind(path.optional, *KINDS)
    if not candidates:
        return LightPlan()
    # The least gain is at most that of the axis.
    if path.transfer.is_dark or (path.fullness >= 1 and path.fullness * _least_gain(path) >= 1):
        return LightPlan(candidates, shares=dict.fromkeys((e.name for e in candidates), 0.0))
    budget = OMITTED_SHARE * path.settings.tolerance
    functions: dict[Effect, NDArray] = {}
    displacing = tuple(e for e in of_kind(candidates, ImageMotion) if e.needs_survey)

    # Beside a lens that counts, the pixel's average stays whatever the scene has for it.
    decisive = blurs = of_kind(candidates, *BLURS)
    if of_kind(blurs, Blur, FieldTransfer):
        decisive = of_kind(blurs, Blur, FieldTransfer, SubExposedMotion)

    # Of transfers of |f| some save nothing as long as others stay.
    radial = of_kind(decisive, RadialTransfer)
    groups: list[Sequence[Effect]] = [(blur,) for blur in decisive if blur not in radial]
    groups += [radial] if radial else []

    def nothing_is_saved(found: SceneDetail) -> bool:
        if displacing or found.even or not found.brightest:
            return False
        if not functions:
            functions.update(transfer_functions(path, found))
        return all(_joint_share(found, functions, group, {}) > budget for group in groups)

    surveyed = scene.flat if isinstance(scene, LayeredScene | DepthScene) else scene
    detail = scene_detail(path, surveyed, nothing_is_saved)
    if detail is not None and not functions:
        functions.update(transfer_functions(path, detail))
    shares = {effect: _share(detail, functions, effect) for effect in candidates}
    chosen: list[Effect] = []
    # Without the pixel's average alone nothing is saved: it goes if the others leave room.
    averages = of_kind(candidates, PixelAperture)
    for group in ([e for e in candidates if e not in averages], averages):
        for effect in sorted(group, key=shares.__getitem__):
            together = [*chosen, effect]
            if _joint_share(detail, functions, together, shares) > budget:
                break
            if _levels_stay(path, detail, effect):
                chosen = together
    bounding = _bounding_blurs(path, chosen)
    omitted = tuple(effect for effect in chosen if effect not in bounding)
    told = (*omitted, *displacing)
    return LightPlan(omitted, bounding, {effect.name: shares[effect] for effect in told})


def _least_gain(path: OpticalPath) -> float:
    """Return the least product of all gains over the array, relative to that on the axis."""
    g, least = path.geometry, 1.0
    x, y = (np.linspace(-size / 2, size / 2, PLACES) for size in (g.sensor_width, g.sensor_height))
    for gain in of_kind(path.effects, Gain):
        least *= float(gain.gain(x, y).min()) / (gain.on_axis or 1.0)
    return least


Functions = Mapping[Effect, NDArray]
"""Transfer functions at the frequencies of a scene's detail."""


def _share(detail: SceneDetail | None, functions: Functions, effect: Effect) -> float:
    """Return the share that leaving out one effect changes; inf where no bound is known.

    Without knowledge of the scene it is that of a scene of full contrast.
    """
    if detail is not None and detail.brightest and effect in functions:
        return change_by_omission(detail, functions, [effect]) / detail.brightest
    if detail is not None and detail.even and of_kind([effect], *BLURS):
        return 0.0
    bound = effect.mean_error(SignalLevels(full_signal=1.0, time=1.0))
    bound = math.inf if bound is None else bound
    if detail is None or not detail.brightest:
        return bound
    if of_kind([effect], Transport):
        return bound * min(1.0, 2 * _rms(detail.light) / detail.brightest)
    return min(bound, _rms(np.subtract(*_light_behind(detail, effect))) / detail.brightest)


def _joint_share(
    detail: SceneDetail | None,
    functions: Functions,
    effects: Sequence[Effect],
    shares: Mapping[Effect, float],
) -> float:
    """Return the same for several effects, as if what they change added up."""
    blurs = [effect for effect in effects if effect in functions]
    others = sum(shares[effect] for effect in effects if effect not in blurs)
    if not blurs or detail is None:
        return others
    return others + change_by_omission(detail, functions, blurs) / detail.brightest


def _light_behind(detail: SceneDetail, effect: Effect) -> tuple[NDArray, NDArray]:
    """Return the surveyed light behind a gain or veiling glare, and without it.

    The light that was surveyed has the gain of the axis in it.
    """
    behind = without = detail.light
    for gain in of_kind([effect], Gain):
        without = detail.light / (gain.on_axis or 1.0)
        behind = without * gain.gain(detail.x, detail.y)
    for glare in of_kind([effect], VeilingGlare):
        behind = without + glare.fraction * (without.mean() - without)
    return behind, without


def _rms(values: NDArray) -> float:
    return math.sqrt(float(np.mean(np.square(values))))


def _levels_stay(path: OpticalPath, detail: SceneDetail | None, effect: Effect) -> bool:
    """Return whether the percentiles of the light stay where they are without a gain or glare."""
    if detail is None or not of_kind([effect], Gain, VeilingGlare):
        return True
    before, after = np.percentile(_light_behind(detail, effect), PERCENTILES, axis=(1, 2)).T
    return bool(np.all(np.abs(after - before) <= LEVEL_SHARE * path.settings.tolerance * before))


def _bounding_blurs(path: OpticalPath, chosen: Collection[Effect]) -> tuple[Effect, ...]:
    """Return blurs that could go, but without which the spectrum of others would reach further.

    Where it is followed for another blur, transfers along the axes or of |f| alone cost nothing and
    end it earlier. Where no other blur has a last frequency, those that have one stay.
    """
    wavelength = float(path.transfer.wavelengths[-1])
    kept = [blur for blur in of_kind(path.effects, Blur) if blur not in chosen]
    if not (kept or path.field not in (None, *chosen)):
        return ()
    costless = of_kind(chosen, SeparableTransfer, RadialTransfer)
    if any(math.isfinite(blur.cutoff(wavelength)) for blur in kept):
        return costless
    others = [blur for blur in of_kind(chosen, Blur) if blur not in costless]
    return (*costless, *(blur for blur in others if math.isfinite(blur.cutoff(wavelength))))
