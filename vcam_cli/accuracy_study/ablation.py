"""What each effect does, measured: the plan's estimates are held to this.

Of an effect that changes the mean signal: rms over the array of (mean raw with everything on -
mean raw without it), relative to full signal. Of noise, which changes no mean: its share of the
variance, from draws with and without it at the lowest, the middle and the highest of those
percentiles of the scene's own signal at which noise is promised. Every draw has random numbers of
its own, so that the difference of two frames is the effect and nothing else.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.noise.fpn_maps import PatternMaps
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.pixel_signal import Charge
from vcam_cli.effects.signal_chain import NoiseSource, Quantizer, full_well, noise_sources
from vcam_cli.readout import binned_readout, exposure
from vcam_cli.records import dataclass
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.solve.effects import camera_effects

FLAT = (4, 1 << 16)
"""Rows and columns of the fields that noise is measured on: many columns, since some of it is the
same along a whole column. A variance is good to sqrt(2 / columns) = 0.6 % then."""
SQUARE = (1 << 10, 1 << 10)
"""The same where some of it is the same along a whole row too: good to 4 %."""
HOT = 2.0
"""Full wells beyond which the charge of a pixel is that of a hot one."""


@dataclass(frozen=True)
class Ablation:
    """One effect: what the plan expected of leaving it out, and what that did."""

    name: str
    state: str
    """on | off, in the camera as its file has it"""
    by: str
    """user | plan"""
    predicted: float | None
    measured: float
    unit: str
    """What both are relative to."""
    seconds_saved: float
    """Time a frame takes less without it [s]; below 0: more."""

    @property
    def ratio(self) -> float | None:
        """Predicted over measured; None where there is nothing to compare."""
        if self.predicted is None or self.measured <= 0:
            return None
        return self.predicted / self.measured


def with_effects(camera: Camera, every: str, *left_out: str) -> Camera:
    """Return the camera with what its file wants on `auto` or `on`, without the effects left out.

    What the file itself switches off stays off.
    """
    own = camera.effects if isinstance(camera.effects, dict) else {}
    off = {*left_out, *(name for name, wish in own.items() if wish == "off")}
    if every == "auto":
        return camera.model_copy(update={"effects": dict.fromkeys(sorted(off), "off") or "auto"})
    found = {n for n, e in camera_effects(camera, geometry(camera)).found.items() if e}
    states = {name: "off" if name in off else "on" for name in sorted(found | off)}
    return camera.model_copy(update={"effects": states})


def wanted_effects(camera: Camera) -> list[str]:
    """Return the names of effects that the file has and does not switch off, in their order."""
    names = {e.name for e in camera_effects(camera, geometry(camera)).enabled}
    return [kind.name for kind in ORDER if kind.name in names]


def with_exposure_time(camera: Camera, time: float, gain: float | None = None) -> Camera:
    """Return the camera with its exposure time fixed [s]: an effect left out must not change it.

    Its gain is the file's where none is given.
    """
    return camera.model_copy(update={"exposure": camera.exposure.single(time, gain)})


def mean_raw(ready: Prepared) -> Array:
    """Return every pixel's noise-free signal, clipped at the full well, float64 [electrons]."""
    return ready.held_electrons.astype(np.float64)


def full_signal(ready: Prepared) -> float:
    """Return the largest noise-free mean signal, at most the full well, at least 1 [electrons]."""
    return full_signal_of(ready, mean_raw(ready))


def full_signal_of(ready: Prepared, mean: Array) -> float:
    """Return the full signal of a camera whose `mean_raw` is known [electrons]."""
    return max(1.0, min(ready.chain.metered.full_well, float(mean.max())))


def variance_shares(ready: Prepared, full: float, workers: int) -> dict[str, float]:
    """Return the largest share that each draw, and the ADC's rounding, has of a variance.

    It is the variance of what is new in every frame, or of what stays with the sensor, as the draw.

    Parameters
    ----------
    ready : Prepared
        The camera with everything on.
    full : float
        Its full signal [electrons].
    workers : int
        Number of threads; results do not depend on it.

    Returns
    -------
    dict
        Name of an effect -> its share [dimensionless].
    """
    active, group = ready.plan.active, ready.layout.binning_groups.binning
    row_noise = [source.split()[2] for source in of_kind(active, NoiseSource)]
    shape = SQUARE if any(row_noise) else FLAT
    for maps in of_kind(active, PatternMaps):
        shape = maps.shape  # measured pixels are those of the array
    shape = (shape[0] + -shape[0] % group.rows, shape[1] + -shape[1] % group.columns)
    levels = np.unique(ready.plan.levels)[[0, len(set(ready.plan.levels)) // 2, -1]]
    fields = [np.full(shape, level) for level in levels]
    shares = {}
    for scope in ("frame", "sensor"):
        here = noise_sources(active, scope)
        everything = [_draw_field(ready, field, here, workers) for field in fields]
        for effect in here:
            others = tuple(e for e in here if e is not effect)
            shares[effect.name] = max(
                np.mean((charge - _draw_field(ready, field, others, workers)) ** 2)
                / _variance(charge)
                for charge, field in zip(everything, fields, strict=True)
            )
        if scope == "frame":
            for adc in of_kind(active, Quantizer):
                shares[adc.name] = max(
                    _rounding_share(adc, charge, group.conversions) for charge in everything
                )
    return {name: float(share) for name, share in shares.items()}


def _rounding_share(adc: Quantizer, electrons: Array, times: int) -> float:
    """Mean square of the averaged rounding error over the total variance."""
    line = adc.response(electrons.copy())
    ends = electrons.mean() * np.array([1.0, 1.001]) + np.array([0.0, 1.0])
    per_code = float(np.diff(ends)[0] / np.diff(adc.response(ends.copy()))[0])
    error = float(np.mean((np.rint(line) - line) ** 2)) * per_code**2 / times
    return error / max(error + float(np.var(electrons)), 1e-300)


def _variance(charge: Array) -> float:
    return max(float(np.var(charge)), 1e-300)


def _draw_field(
    ready: Prepared, field: Array, draws: tuple[NoiseSource, ...], workers: int
) -> Array:
    """Return a flat field [electrons], dark signal included, with these draws in it, never clipped.

    Hot pixels are full, as they are read. Of pixels that are read as one, their mean.
    """
    seed, adc = ready.solved.seed, ready.solved.adc
    seeds = {"sensor": seed.sensor, "frame": seed.frame}
    charges = of_kind(ready.plan.active, Charge)
    rate = field / ready.exposure_time - sum(e.rate() for e in charges)
    effects = (*charges, *draws)
    take = partial(exposure.capture, adc=adc, seeds=seeds, workers=workers)
    sharing = ready.sharing
    couple = None if sharing is None or sharing.after is None else sharing.coupled
    groups = replace(ready.layout.binning_groups, step=(1, 1))  # all of its pixels are alike
    time = ready.exposure_time
    found = binned_readout.read(groups, rate, time, effects, take, adc.bits, settle=couple)[0]
    found = found / groups.summed_codes
    if any(draw.fills_wells for draw in draws):
        full = full_well(ready.plan.active)
        found[found > HOT * full] = full
    return found
