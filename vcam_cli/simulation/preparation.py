"""All that comes before a frame is taken: the light in every pixel, the exposure time, the plan.

`prepare` is the linear half of the engine from top to bottom; what it calls are other modules.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcam_cli import memory
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import Electrical, electrical
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import Effect, SignalLevels, Transport, of_kind
from vcam_cli.effects.order import quantizer
from vcam_cli.effects.signal_chain import Limit, NoiseSource, extreme_signal
from vcam_cli.errors import bad
from vcam_cli.image_formation import bandwidth, memory_model, photon_rate, pixelwise
from vcam_cli.image_formation.light_plan import PERCENTILES
from vcam_cli.image_formation.optical_path import OpticalPath, SpectrumReport
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.image_formation.settings import Settings, settings
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.progress import Stages
from vcam_cli.quality import scielab
from vcam_cli.quality.display import display_screen
from vcam_cli.readout import auto_exposure, exposure, iso_speed, sample_times
from vcam_cli.readout.layout import Layout, layout
from vcam_cli.scenes.base import ChartScene, Scene
from vcam_cli.scenes.build import build
from vcam_cli.simulation import cost_model, plan

MOST_ELECTRONS = 1e25
"""More than any pixel ever meets, and far from where 32-bit numbers end."""


@dataclass(frozen=True)
class Prepared:
    """A camera ready to take its frame."""

    camera: Camera
    geometry: Geometry
    electrical: Electrical
    settings: Settings
    mosaic: Mosaic
    layout: Layout
    scene: Scene
    transfer: Transfer
    """Transfer of the scene's components to one pixel of the lattice."""
    white_rate: NDArray
    """Photo-electrons per second (C,) of the perfect white on the axis, in every color [e/s]."""
    rate: NDArray
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
    base_iso: float
    """ISO speed at gain 1; 0 of a camera that sees nothing of daylight."""
    times: tuple[float, ...]
    """Times (N,) of the samples of one integration, rising [s]; () of a single exposure."""
    plan: plan.Plan

    @property
    def dark_rate(self) -> float:
        """Dark electrons per second that are simulated [e/s]."""
        return exposure.mean_dark(1.0, self.plan.active)


def prepare(
    camera: Camera,
    picture: NDArray | None,
    workers: int,
    stages: Stages,
    rate_cache: RateCache | None = None,
) -> Prepared:
    """Bring the light of a scene to the pixels, time the exposure and plan what will run.

    Parameters
    ----------
    camera : Camera
        The camera.
    picture : NDArray or None
        Samples of the scene's image file (h, w, channels) in linear light; None for charts.
    workers : int
        Number of threads.
    stages : Stages
        Observer of the stages.
    rate_cache : RateCache, optional
        Cache of the light for further cameras.

    Returns
    -------
    Prepared
        The camera, ready to take its frame.

    Raises
    ------
    BadInput
        Where the camera contradicts itself.
    CannotDo
        Where memory does not suffice.
    """
    solved = geometry(camera)
    place = layout(camera, solved)
    base_iso = iso_speed.base_iso(camera, solved, place)
    camera = iso_speed.set_gain(camera, base_iso)
    circuit = electrical(camera)
    knobs = place.settings(settings(camera))
    frame_bytes = _require_memory(camera, place, knobs, solved)
    stages.watch.expect(cost_model.first_estimate(camera, solved, place.mosaic, workers))

    effects = plan.mean_signal_effects(camera, solved)
    with stages("scene"):
        band = camera.scene.wavelengths
        margin = partial(bandwidth.margin, place.lattice, effects, (band.start, band.stop), knobs)

        def scene_within(pixels: int) -> Scene:
            view = photon_rate.view(place.lattice, knobs, pixels)
            return build(camera.scene, view, picture, camera.display.primaries)

        scene = scene_within(margin())
    with stages("optics"):
        transfer, white_rate = _transfer(camera, solved, place, scene, effects, knobs, rate_cache)
        summed = place.binning_groups.summed_charges
        ceiling = auto_exposure.ceiling(
            camera, float(white_rate.max()), circuit.saturation / summed
        )
        overexposure = _brightest(scene) * float(white_rate.max()) / ceiling
        if overexposure > 1:  # of what lies beside the array, too
            scene = scene_within(margin(overexposure))
        optional = plan.optional_effects(camera, effects)
        path = OpticalPath(
            transfer, place.lattice, knobs, place.mosaic, effects, workers, ceiling, optional
        )
        photo_rate = partial(photon_rate.photo_rate, path, scene, place.planes)
        light = photo_rate() if rate_cache is None else rate_cache.rate(camera, ceiling, photo_rate)
        effects = tuple(effect for effect in effects if effect not in light.plan.omitted)
        white_rate = white_rate * summed / (light.plan.on_axis or 1.0)
    with stages("exposure"):
        exposed = _expose(camera, solved, circuit, place, light, white_rate, effects)
        camera = camera.with_exposure_gain(exposed.settings.gain)
        needed = max(frame_bytes, light.spectrum.memory) + getattr(picture, "nbytes", 0)
        changes = light.spectrum.changes | exposed.changes
        decided = plan.make(camera, solved, knobs, light.plan, exposed.signal, needed, changes)
        decided = _with_seconds(camera, solved, place, knobs, light, decided, workers)
        stages.watch.expect(decided.seconds)
    return Prepared(
        camera=camera,
        geometry=solved,
        electrical=electrical(camera),
        settings=knobs,
        mosaic=place.raw_mosaic,
        layout=place,
        scene=scene,
        transfer=transfer,
        white_rate=white_rate,
        rate=exposed.rate,
        spectrum=light.spectrum,
        exposure_time=exposed.signal.time,
        exposure_limit=exposed.settings.limit,
        base_iso=base_iso,
        times=exposed.times,
        plan=decided,
    )


def _brightest(scene: Scene) -> float:
    """Return the brightest light that a chart has beyond the array, relative to white; else 0."""
    return scene.chart.brightest if isinstance(scene, ChartScene) else 0.0


def _with_seconds(
    camera: Camera,
    solved: Geometry,
    place: Layout,
    knobs: Settings,
    light: photon_rate.Rate,
    decided: plan.Plan,
    workers: int,
) -> plan.Plan:
    """Return the plan with the seconds of the frame, and of one with everything on."""
    spectrum = light.spectrum
    seconds = cost_model.frame_seconds(camera, solved, place, knobs, spectrum, decided, workers)
    if light.plan.omitted and not spectrum.terms:
        spectrum = cost_model.usual_spectrum(place.lattice)
    whole = replace(decided, seconds=decided.seconds + sum(d.saved for d in decided.decisions))
    every = cost_model.frame_seconds(camera, solved, place, knobs, spectrum, whole, workers)
    return replace(decided, seconds=seconds, seconds_of_all=every)


def _require_memory(camera: Camera, place: Layout, knobs: Settings, solved: Geometry) -> int:
    """Return the bytes of a frame without its scene, and refuse one that does not fit.

    What was read of the scene is in memory already.
    """
    colors = len(place.mosaic.colors)
    samples = camera.exposure.count * (colors if place.full_color else 1)
    scattered = solved.rows * solved.columns if place.is_scattered else 0
    judged = bool(camera.quality)
    needed = memory_model.frame_bytes(place.lattice, knobs, colors, judged, samples, scattered)
    if "s-cielab" in camera.quality:
        shape = place.picture_shape
        screen = display_screen(camera.display, shape[1])
        # By one thread, which is all there are where memory is little.
        needed += scielab.needed_bytes(shape, screen, camera.display.filters, 1)
    memory.require(needed, solved.rows, solved.columns)
    return needed


def _transfer(
    camera: Camera,
    solved: Geometry,
    place: Layout,
    scene: Scene,
    effects: tuple[Effect, ...],
    knobs: Settings,
    rate_cache: RateCache | None,
) -> tuple[Transfer, NDArray]:
    """Return the transfer of the scene's components, and the rate (C,) of perfect white [e/s].

    Spectra that do not cover the wavelengths are the user's error.
    """
    compute = partial(
        photon_rate.scene_transfer,
        camera,
        solved,
        knobs,
        (*scene.spectra, scene.white),
        place.mosaic,
        effects,
    )
    try:
        whole = compute() if rate_cache is None else rate_cache.transfer(camera, compute)
    except ValueError as error:
        raise bad(
            "scene.wavelengths", str(error), "narrow the wavelengths, or extend the spectrum"
        ) from None
    white_rate = whole.level[-1]
    _refuse_too_much(float(white_rate.max()))
    # A cached transfer has another camera's effects, which are equal but not the same.
    return replace(whole.with_effects(effects), weights=whole.weights[:-1]), white_rate


@dataclass(frozen=True)
class _Exposed:
    """The light of a timed exposure, as it is read out."""

    rate: NDArray
    """Photo-electrons per second of every node (..., rows, columns) [e/s]."""
    times: tuple[float, ...]
    """Times of the samples of one integration, rising [s]; () of a single exposure."""
    signal: SignalLevels
    settings: auto_exposure.ExposureSettings
    changes: dict[str, float]
    """Effect on pixels or charge -> rms change of the mean signal by leaving it out [e/s]."""


def _expose(
    camera: Camera,
    solved: Geometry,
    circuit: Electrical,
    place: Layout,
    light: photon_rate.Rate,
    white_rate: NDArray,
    effects: Sequence[Effect],
) -> _Exposed:
    """Return the light of an exposure whose time is given or chosen for the scene."""
    groups, white = place.binning_groups, float(white_rate.max())
    enabled = plan.enabled_effects(camera, solved)
    dark = exposure.mean_dark(1.0, enabled)
    collected = place.select_pixels(light.values)
    rate = groups.collect(_transport(collected, dark / groups.summed_charges, effects))
    adc = quantizer(camera, solved)
    times = sample_times.choose_sample_times(camera, rate, circuit, enabled, adc)
    chosen = auto_exposure.expose(camera, rate, white, dark, circuit)
    if times:
        chosen = replace(chosen, time=times[-1])
    time = chosen.time
    if of_kind(enabled, Limit):  # a full well holds no more, whatever falls on it
        held = circuit.full_well / time
        rate = groups.collect(_transport(collected, dark / groups.summed_charges, effects, held))
    peak = (float(rate.max()) + dark) * time
    _refuse_too_much(max(peak, white * time, dark))
    changes = _pixel_changes(place, groups.collect(light.values), enabled, effects, time)
    if transports := [transport.name for transport in of_kind(enabled, Transport)]:
        well = min(circuit.full_well / time - dark, MOST_ELECTRONS)
        deferred = np.minimum(rate, well) - np.minimum(groups.collect(collected), well)
        changes |= dict.fromkeys(transports, _rms(deferred))
    full = max(1.0, min(circuit.full_well, peak))
    alone = not times and camera.array.binning is None
    signal = SignalLevels(
        full,
        time,
        dark * time,
        camera.array.binning,
        _levels(place, rate, dark, time, circuit.full_well),
        extreme_signal(of_kind(enabled, NoiseSource), peak, dark * time) if alone else math.inf,
    )
    return _Exposed(rate, times, signal, chosen, changes)


def _refuse_too_much(electrons: float) -> None:
    if not electrons < MOST_ELECTRONS:
        raise bad(
            "scene",
            f"light and dark current would make {electrons:.3g} electrons in a pixel or a second",
            "look for a wrong unit in the light level, the dark current or the exposure",
        )


def _levels(
    place: Layout, rate: NDArray, dark: float, time: float, well: float
) -> tuple[float, ...]:
    """Return the signals of the scene at which noise is promised, with the dark [electrons]."""
    mosaic, planes = place.charge_pixels[1], rate.ndim == 3
    mosaics = [Mosaic(((color,),)) for color in mosaic.colors] if planes else [mosaic]
    levels = [
        pixelwise.percentiles(plane, colors, PERCENTILES)
        for plane, colors in zip(rate if planes else [rate], mosaics, strict=True)
    ]
    signal = (np.concatenate(levels).astype(float) + dark) * time
    return tuple(np.minimum(signal, well).ravel().tolist())


def _pixel_changes(
    place: Layout, light: NDArray, present: Sequence[Effect], running: Sequence[Effect], time: float
) -> dict[str, float]:
    """Return the rms change of the mean raw by leaving out each effect on pixels [e/s].

    It is that of the color where it is most.
    """
    geometry, mosaic = place.charge_pixels
    mosaics = [Mosaic(((color,),)) for color in mosaic.colors]
    parts = zip(light, mosaics, strict=True) if place.planes else [(light, mosaic)]
    largest: dict[str, float] = {}
    for plane, colors in parts:
        changes = pixelwise.changes_by_omission(plane, geometry, colors, present, running, time)
        largest = {name: max(change, largest.get(name, 0.0)) for name, change in changes.items()}
    return largest


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.square(values, dtype=np.float64).mean()))


def _transport(
    rate: NDArray, dark: float, effects: Sequence[Effect], held: float = math.inf
) -> NDArray:
    """Return the photo-electrons per second that arrive where charge is transported [e/s].

    With the dark rate [e/s] they are what arrives of both. What a packet does not hold, beyond
    `held` [e/s] for the time of the exposure, stays where it is and is clipped there. Below that
    transport is linear, so that an exposure can be timed by the picture as it is read.
    """
    for transport in of_kind(effects, Transport):
        signal = rate + rate.dtype.type(dark)
        beyond = signal - np.minimum(signal, signal.dtype.type(min(held, MOST_ELECTRONS)))
        signal -= beyond
        planes = signal.reshape(-1, *signal.shape[-2:])
        signal = np.array([transport.transport(plane) for plane in planes]).reshape(rate.shape)
        signal += beyond
        signal -= rate.dtype.type(dark)
        rate = signal
    return rate
