"""A camera ready to take its frame: the light in every pixel, the exposure time, the plan."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import Overflow, Retention
from vcam_cli.effects.signal_chain import Limit, full_well
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.estimates.memory_model import half_image_bytes
from vcam_cli.image_formation.neighbor_sharing import Sharing
from vcam_cli.image_formation.optical_path import SpectrumReport
from vcam_cli.image_formation.settings import Settings
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.readout import exposure
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.layout import Layout
from vcam_cli.records import dataclass
from vcam_cli.scenes.layered import AnyScene
from vcam_cli.simulation import cost_model, phase_memory, plan
from vcam_cli.simulation.exposed_light import ExposedLight
from vcam_cli.simulation.run import Run
from vcam_cli.simulation.scene_light import SceneLight
from vcam_cli.solve.solved import Solved


@dataclass(frozen=True)
class Prepared:
    """A camera ready to take its frame."""

    solved: Solved
    """The camera, at the gain of its exposure."""
    scene: AnyScene
    transfer: Transfer
    """Transfer of the scene's components to one pixel of the lattice."""
    white_rate: Array
    """Photo-electrons per second (C,) of the perfect white on the axis, in every color [e/s]."""
    rate: Array
    """Photo-electrons per second (rows, columns) of every pixel, as they are read out [e/s].

    Stacked pixels have (C, rows, columns). Of pixels that are read as one: where charges are
    joined, this and the other rates are those of the sum; else of every pixel, before they are
    joined.
    """
    spectrum: SpectrumReport
    """How far the scene's spectrum was followed."""
    exposure_time: float
    """Exposure time [s]."""
    exposure_limit: str
    """Limit that stopped an automatic exposure, as in `ExposureSettings`."""
    times: tuple[float, ...]
    """Times (N,) of the samples of one integration, rising [s]; () of a single exposure."""
    plan: plan.Plan
    step_rates: tuple[Array, ...]
    """Rates (N, ...) as `rate` between each sample and the one before, where light changes with
    time [e/s]; () elsewhere."""
    full_charge: Array | None
    """Electrons that every node is read with if it is full, in the shape of `rate`, where transfer
    defers some of them [electrons]; None elsewhere: all of the full well."""
    halves: tuple[Array, Array] | None
    """Photo-electrons per second (rows, columns) of the pixels' left and right halves [e/s]; None
    of pixels that do not tell the halves of the lens apart."""
    sharing: Sharing | None
    """What pixels give to their neighbors; None where they give nothing."""
    estimated_places: int = field(default=0, kw_only=True)
    """Places of the coarse lattice whose light all rates are, in a plan that formed no image; 0
    where they are the pixels'."""

    @property
    def camera(self) -> Camera:
        """What its file says, for records and for who makes other cameras of it."""
        return self.solved.camera

    @property
    def geometry(self) -> Geometry:
        """Geometry of its array, lens and scene."""
        return self.solved.geometry

    @property
    def electrical(self) -> Electrical:
        """Its circuit."""
        return self.solved.electrical

    @property
    def settings(self) -> Settings:
        """Settings of image formation."""
        return self.solved.settings

    @property
    def layout(self) -> Layout:
        """Where its pixels are."""
        return self.solved.layout

    @property
    def mosaic(self) -> Mosaic:
        """Mosaic of the raw frame."""
        return self.solved.layout.raw_mosaic

    @property
    def base_iso(self) -> float:
        """ISO speed at gain 1; 0 of a camera that sees nothing of daylight."""
        return self.solved.base_iso

    @cached_property
    def chain(self) -> ReadoutChain:
        """The way from electrons to codes and back, with what runs of its noise."""
        return self.solved.chain.with_effects(self.plan.active)

    @property
    def held_electrons(self) -> Array:
        """Noise-free signal of every node, at most that of a full one [electrons]."""
        mean = exposure.mean_electrons(self.rate, self.exposure_time, self.plan.active)
        if self.full_charge is not None:
            mean = np.minimum(mean, self.full_charge)
        if (settle := self.settle) is not None:
            return settle(mean) if mean.ndim == 2 else np.array([settle(plane) for plane in mean])
        clipped: Array = np.minimum(mean, mean.dtype.type(full_well(self.plan.active)))
        return clipped

    @property
    def settle(self) -> Callable[[Array], Array] | None:
        """What sense nodes show of the charges of a whole array (rows, columns) [electrons].

        None where every pixel shows its own.
        """
        overflows, well = of_kind(self.plan.active, Overflow), full_well(self.plan.active)
        couples = self.sharing is not None and self.sharing.after is not None
        if not couples and not (overflows and math.isfinite(well)):
            return None

        def settled(charge: Array) -> Array:
            for overflow in overflows if math.isfinite(well) else ():
                charge = overflow.settled(charge)
            held: Array = np.minimum(charge, charge.dtype.type(well))
            return held if self.sharing is None else self.sharing.coupled(held)

        return settled

    def after(self, before: Prepared) -> Prepared:
        """Return it as the next one of a sequence: with the charge that stayed in its pixels.

        Parameters
        ----------
        before : Prepared
            The frame before it.

        Returns
        -------
        Prepared
            The same camera, whose light has charge of the frame before in it; itself where none
            stays.
        """
        held = before.held_electrons
        rate, kind = self.rate, self.rate.dtype.type
        for lag in of_kind(self.plan.active, Retention):
            own = exposure.mean_electrons(rate, self.exposure_time, self.plan.active)
            rate = rate + kind(lag.share / self.exposure_time) * (held - own)
        return replace(self, rate=rate)

    @property
    def dark_rate(self) -> float:
        """Dark electrons per second that are simulated [e/s]."""
        return exposure.mean_dark(1.0, self.plan.active)


def plan_frame(
    seen: SceneLight, light: photon_rate.Rate, exposed: ExposedLight, run: Run
) -> Prepared:
    """Decide which effects run in a frame whose light and exposure time are known.

    Parameters
    ----------
    seen : SceneLight
        The scene before its camera.
    light : Rate
        Its light on the lattice.
    exposed : ExposedLight
        The same as it is read out.
    run : Run
        How it is computed.

    Returns
    -------
    Prepared
        The camera, ready to take its frame.
    """
    solved = seen.solved.at_gain(exposed.settings.gain)
    pixels, of_halves = solved.geometry.rows * solved.geometry.columns, 0
    if exposed.halves is not None:
        codes = exposure.codes_type(solved.chain.adc.bits)
        of_halves = half_image_bytes(pixels, solved.settings, np.dtype(codes).itemsize)
        if solved.output.phase:
            of_halves += phase_memory.written_bytes(solved)
    of_light = max(light.spectrum.memory, exposed.memory)
    decided = plan.make(
        solved.effects,
        solved.tolerance,
        pixels,
        solved.settings,
        exposed.light_plan,
        exposed.signal,
        max(seen.memory + of_halves, of_light) + seen.picture_memory,
        light.spectrum.changes | exposed.changes,
    )
    again = 2 if exposed.halves is not None else 0
    if of_kind(exposed.effects, ImageMotion):  # every sample has light of its own
        again += len(exposed.times)
    if again:
        once = cost_model.light_seconds(solved.layout, light.spectrum, run.workers)
        run = run.after(again * once, again)
    decided = _with_seconds(solved, light, decided, run)
    run.stages.watch.expect(decided.seconds)
    return _prepared(seen, light, exposed, solved, decided)


def whole_frame(seen: SceneLight, light: photon_rate.Rate, exposed: ExposedLight) -> Prepared:
    """Return a camera that is ready for a frame with all effects that are not switched off.

    Nothing is planned: the plan has no decisions, and no seconds.

    Parameters
    ----------
    seen, light, exposed
        As those of `plan_frame`.

    Returns
    -------
    Prepared
        The camera, ready to take its frame.
    """
    solved = seen.solved.at_gain(exposed.settings.gain)
    everything = plan.Plan((), solved.effects.enabled, solved.settings, 0.0, seen.memory)
    return _prepared(seen, light, exposed, solved, everything)


def _prepared(
    seen: SceneLight,
    light: photon_rate.Rate,
    exposed: ExposedLight,
    solved: Solved,
    decided: plan.Plan,
) -> Prepared:
    return Prepared(
        solved=solved,
        scene=seen.scene,
        transfer=seen.transfer,
        white_rate=exposed.white_rate,
        rate=exposed.rate,
        spectrum=light.spectrum,
        exposure_time=exposed.signal.time,
        exposure_limit=exposed.settings.limit,
        times=exposed.times,
        plan=decided,
        step_rates=exposed.step_rates,
        full_charge=exposed.full_charge if of_kind(decided.active, Limit) else None,
        halves=exposed.halves,
        sharing=exposed.sharing,
    )


def _with_seconds(
    solved: Solved, light: photon_rate.Rate, decided: plan.Plan, run: Run
) -> plan.Plan:
    """Return the plan with the seconds of the frame, and of one with everything on."""
    lights = 1 + run.earlier_lights
    saved = {name: lights * seconds for name, seconds in light.plan.saved.items()}
    decisions = tuple(
        replace(d, saved=saved[d.name]) if d.name in saved and d.state == "off" else d
        for d in decided.decisions
    )
    of_electrons = sum(d.saved for d in decisions if d.name not in saved)
    of_light = lights * light.plan.saved_together
    every = replace(decided, seconds=decided.seconds + of_electrons + of_light)
    seconds, of_all = (
        run.earlier + cost_model.frame_seconds(solved, light.spectrum, each, run.workers)
        for each in (decided, every)
    )
    return replace(decided, decisions=decisions, seconds=seconds, seconds_of_all=of_all)
