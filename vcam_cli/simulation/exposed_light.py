"""The light of a timed exposure: its time and gain, and what arrives of it where charge is read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import Effect, SignalLevels, of_kind
from vcam_cli.effects.pixel_signal import ColumnSpread, NeighborSharing, TemporalGain, Transport
from vcam_cli.effects.signal_chain import Limit, NoiseSource, extreme_signal
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.floats import rms
from vcam_cli.image_formation import photon_rate, pixelwise, timed_gains
from vcam_cli.image_formation.light_plan import PERCENTILES, LightPlan
from vcam_cli.image_formation.neighbor_sharing import Sharing, array_sharing
from vcam_cli.readout import auto_exposure, exposure, sample_times
from vcam_cli.readout.binning import BinningGroups
from vcam_cli.readout.layout import Layout
from vcam_cli.records import dataclass
from vcam_cli.simulation.scene_light import (
    MOST_ELECTRONS,
    SceneLight,
    light_during,
    refuse_too_much,
)


@dataclass(frozen=True)
class ExposedLight:
    """The light of a timed exposure, as it is read out."""

    rate: Array
    """Photo-electrons per second of every node (..., rows, columns) [e/s]."""
    times: tuple[float, ...]
    """Times of the samples of one integration, rising [s]; () of a single exposure."""
    signal: SignalLevels
    settings: auto_exposure.ExposureSettings
    changes: dict[str, float]
    """Effect on pixels or charge -> rms change of the mean signal by leaving it out [e/s]."""
    light_plan: LightPlan
    """That of the light, with the effects skipped now that the exposure time is known."""
    step_rates: tuple[Array, ...]
    """As `Prepared.step_rates`."""
    full_charge: Array | None
    """As `Prepared.full_charge`."""
    white_rate: Array
    """As `Prepared.white_rate`."""
    halves: tuple[Array, Array] | None
    """As `Prepared.halves`."""
    sharing: Sharing | None
    """As `Prepared.sharing`."""
    effects: tuple[Effect, ...]
    """Effects that act before electrons are counted and are not left out of the light."""
    memory: int = 0
    """Memory in which the light of half a lens was formed beside that of all of it [bytes]."""


def expose(seen: SceneLight, light: photon_rate.Rate, is_planned: bool = True) -> ExposedLight:
    """Return the light of an exposure whose time is given or chosen for the scene.

    Parameters
    ----------
    seen : SceneLight
        The scene before its camera, at the gain that its file gives.
    light : Rate
        Light of the whole exposure.
    is_planned : bool, optional
        Whether a plan needs what effects change, and the levels of the scene.

    Raises
    ------
    BadInput
        For more light than any unit could have meant.
    """
    solved, path = seen.solved, seen.path
    layout, circuit, enabled = solved.layout, solved.electrical, solved.effects.enabled
    effects = tuple(effect for effect in path.effects if effect not in light.plan.omitted)
    groups = layout.binning_groups
    sharing = array_sharing(
        *(of_kind(effects, NeighborSharing), solved.response, seen.scene.white),
        *(layout.mosaic, layout.planes),
    )
    white_rate = seen.white_rate * groups.summed_charges / (light.plan.on_axis or 1.0)
    smears = of_kind(effects, ColumnSpread)
    if sharing is not None:
        white_rate = sharing.matrix @ white_rate
    for smear in smears:
        white_rate = smear.color_matrix(layout.mosaic, layout.planes) @ white_rate
    white = float(white_rate.max())
    dark = exposure.mean_dark(1.0, enabled)
    pixel_dark = dark / groups.summed_charges
    made = layout.select_pixels(light.values)
    shared = made if sharing is None else sharing.arriving(made)
    collected = _smeared(shared, smears)
    rate = groups.collect(_transported(collected, pixel_dark, effects))
    asked = solved.limited_exposure
    times = sample_times.choose_sample_times(asked, rate, solved.chain)
    chosen = auto_exposure.exposure_settings(asked, rate, white, dark, solved.chain.metered)
    if times:
        chosen = replace(chosen, time=times[-1])
    time = chosen.time
    # A full well holds no more, whatever falls on it.
    full_rate = circuit.full_well / time if of_kind(enabled, Limit) else math.inf
    light_plan = timed_gains.light_plan(
        light.plan, effects, path.optional, time, solved.settings.tolerance
    )
    timed = tuple(e for e in of_kind(effects, TemporalGain) if e not in light_plan.omitted)

    def select(values: Array, start: float, stop: float) -> Array:
        if timed:
            values = timed_gains.apply(values, timed, layout.lattice, start, stop)
        if values is light.values:
            return collected
        selected = layout.select_pixels(values)
        return _smeared(selected if sharing is None else sharing.arriving(selected), smears)

    def collect(values: Array, start: float, stop: float) -> Array:
        lit = select(values, start, stop)
        return groups.collect(_transported(lit, pixel_dark, effects, full_rate))

    rate = collect(light.values, 0.0, time)
    full_charge = None
    if of_kind(effects, Transport) and math.isfinite(full_rate):
        lit = select(light.values, 0.0, time)
        full_charge = _full_charge(groups, lit, rate, pixel_dark, effects, full_rate) * time
    moving = of_kind(effects, ImageMotion)
    steps = pairwise((0.0, *times)) if timed or moving else ()
    halves, memory = None, 0
    if (phase := solved.pixel.phase_detection) is not None:
        from vcam_cli.image_formation import half_images

        whole, defocus = light.plan.reduced(path), solved.geometry.focus_shift
        radius = (solved.optics.defocus + defocus) / (2 * solved.geometry.working_f_number)

        def of_half(half: int) -> Array:
            nonlocal memory
            part = half_images.half_path(whole, radius, half)
            formed = photon_rate.photo_rate(part, seen.scene)
            memory = max(memory, light.values.nbytes + 2 * rate.nbytes + formed.spectrum.memory)
            return collect(formed.values, 0.0, time)

        halves = half_images.half_rates(rate, phase.separation, of_half)
        if phase.masked is not None:
            rate = half_images.masked(rate, halves, phase.masked)
    step_rates = tuple(
        collect(light_during(seen, light, start, stop), start, stop) for start, stop in steps
    )
    peak = (float(rate.max()) + dark) * time
    # A second photodiode has a dark current of its own.
    darkest = max([dark, *(exposure.mean_dark(1.0, b.effects) for b in solved.chain.branches)])
    refuse_too_much(max(peak, white * time, darkest, darkest * time))
    full = max(1.0, min(solved.chain.metered.full_well, peak))
    alone = not times and solved.binning is None
    signal = SignalLevels(
        full,
        time,
        dark * time,
        solved.binning,
        _levels(layout, rate, dark, time, circuit.full_well) if is_planned else (),
        extreme_signal(of_kind(enabled, NoiseSource), peak, dark * time) if alone else math.inf,
    )
    exposed = ExposedLight(
        *(rate, times, signal, chosen, {}, light_plan, step_rates, full_charge),
        white_rate=white_rate,
        halves=halves,
        sharing=sharing,
        effects=effects,
        memory=memory,
    )
    if not is_planned:
        return exposed
    lit = timed_gains.apply(light.values, timed, layout.lattice, 0.0, time)
    changes = _pixel_changes(layout, groups.collect(lit), enabled, effects, time)
    for effect in timed:
        others = tuple(e for e in timed if e is not effect)
        without = timed_gains.apply(light.values, others, layout.lattice, 0.0, time)
        changes[effect.name] = rms(np.subtract(lit, without))
    if sharing is not None:
        [giving] = of_kind(effects, NeighborSharing)
        changes[giving.name] = rms(np.subtract(sharing.coupled(shared), made))
    changes |= dict.fromkeys((s.name for s in smears), rms(np.subtract(collected, shared)))
    if transports := [transport.name for transport in of_kind(enabled, Transport)]:
        well = min(circuit.full_well / time - dark, MOST_ELECTRONS)
        most = well if full_charge is None else full_charge / time - dark
        deferred = np.minimum(rate, most) - np.minimum(groups.collect(collected), well)
        changes |= dict.fromkeys(transports, rms(deferred))
    return replace(exposed, changes=changes)


def _levels(
    layout: Layout, rate: Array, dark: float, time: float, well: float
) -> tuple[float, ...]:
    """Return the signals of the scene at which noise is promised, with the dark [electrons].

    They are those of the raw frame: means of pixels that are read as one.
    """
    groups = layout.binning_groups
    if groups.summed_charges == 1:  # else the nodes are the pixels of the raw frame already
        rate = groups.sums(rate) / rate.dtype.type(groups.count)
    if rate.ndim == 3:
        levels = [pixelwise.percentiles(plane, None, PERCENTILES) for plane in rate]
    else:
        levels = [pixelwise.percentiles(rate, layout.color_at, PERCENTILES)]
    signal = (np.concatenate(levels).astype(float) + dark) * time
    return tuple(np.minimum(signal, well).ravel().tolist())


def _pixel_changes(
    layout: Layout,
    light: Array,
    present: Sequence[Effect],
    running: Sequence[Effect],
    time: float,
) -> dict[str, float]:
    """Return the rms change of the mean raw by leaving out each effect on pixels [e/s].

    It is that of the color where it is most.
    """
    geometry, mosaic = layout.charge_pixels
    mosaics = [Mosaic(((color,),)) for color in mosaic.colors]
    parts = zip(light, mosaics, strict=True) if layout.planes else [(light, mosaic)]
    largest: dict[str, float] = {}
    for plane, colors in parts:
        changes = pixelwise.changes_by_omission(plane, geometry, colors, present, running, time)
        largest = {name: max(change, largest.get(name, 0.0)) for name, change in changes.items()}
    return largest


def _smeared(light: Array, smears: Sequence[ColumnSpread]) -> Array:
    """Return the light of pixels (..., rows, columns) with what packets catch of it [e/s]."""
    for smear in smears:
        light = smear.spread(light)
    return light


def _transported(
    rate: Array, dark: float, effects: Sequence[Effect], full_rate: float = math.inf
) -> Array:
    """Return the photo-electrons per second that arrive where charge is transported [e/s].

    With the dark rate [e/s] they are what arrives of both. Light beyond `full_rate` [e/s], which
    the well does not hold, is not transported: it stays in the pixel's mean signal, so that noise
    does not lift a full pixel off `_full_charge`. Below that transport is linear, so that an
    exposure can be timed by the picture as it is read.
    """
    for transport in of_kind(effects, Transport):
        signal = rate + rate.dtype.type(dark)
        beyond = signal - np.minimum(signal, signal.dtype.type(min(full_rate, MOST_ELECTRONS)))
        signal -= beyond
        planes = signal.reshape(-1, *signal.shape[-2:])
        signal = np.array([transport.transport(plane) for plane in planes]).reshape(rate.shape)
        signal += beyond
        signal -= rate.dtype.type(dark)
        rate = signal
    return rate


def _full_charge(
    groups: BinningGroups,
    lit: Array,
    arrived: Array,
    dark: float,
    effects: Sequence[Effect],
    full_rate: float,
) -> Array:
    """Return the electrons per second that a pixel is read with if its well is full [e/s].

    A full well arrives without what it defers, and with what earlier packets have deferred.

    Parameters
    ----------
    groups : BinningGroups
        Pixels that are read as one.
    lit : Array
        Photo-electrons per second that every pixel collects (..., rows, columns) [e/s].
    arrived : Array
        Those that are read, as `_transported` returns them, of groups where charge is joined [e/s].
    dark : float
        Dark rate of a pixel [e/s].
    effects : sequence of Effect
        Effects; transports are used.
    full_rate : float
        Rate that fills a well [e/s].
    """
    kind = lit.dtype.type
    beyond = np.maximum(lit + kind(dark - full_rate), kind(0))
    # Mean charge of a full pixel's own packet is the well: what else it reads was deferred to it.
    found = arrived + kind(dark * groups.summed_charges) - groups.collect(beyond)
    if groups.summed_charges > 1:
        # Of joined pixels some may be full and others not: their mean is then the most.
        full = kind(full_rate)
        joined: Array = np.where(groups.collect(beyond) > 0, np.minimum(found, full), full)
        return joined
    shares = [each.timely_share(*lit.shape[-2:]) for each in of_kind(effects, Transport)]
    room = np.maximum(kind(full_rate - dark) - lit, kind(0))
    share = math.prod(shares[1:], start=shares[0]).astype(kind)
    limited: Array = np.minimum(found + share * room, kind(full_rate))
    return limited
