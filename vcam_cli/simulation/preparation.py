"""All that comes before a frame is taken: the light in every pixel, the exposure time, the plan.

`prepare` is the linear half of the engine from top to bottom; what it calls are other modules.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vcam_cli import memory
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import (
    Effect,
    ImageMotion,
    TemporalGain,
    Transport,
    of_kind,
)
from vcam_cli.effects.signal_chain import SIGMAS, Limit, NoiseSource, full_well
from vcam_cli.errors import bad
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.estimates import bandwidth, memory_model
from vcam_cli.image_formation.optical_path import OpticalPath, SpectrumReport
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.image_formation.settings import Settings
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.progress import Stages
from vcam_cli.quality import scielab
from vcam_cli.quality.display import display_screen
from vcam_cli.readout import auto_exposure, exposure
from vcam_cli.readout.layout import Layout
from vcam_cli.scenes.base import ChartScene, HarmonicScene
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.waves import WaveScene
from vcam_cli.simulation import cost_model, exposed_light, plan
from vcam_cli.simulation.scene_files import ScenePicture, build_scene, layer_optics, scene_bytes
from vcam_cli.simulation.setup import CameraSetup, camera_setup

ASSUMED = 0.9
"""Full signal over the scene's brightest light, as assumed before there is any signal."""
OVERFULL = 2.0
"""Full wells of light from which on a pixel counts as full, if six standard deviations of its noise
leave it so."""


@dataclass(frozen=True)
class Prepared:
    """A camera ready to take its frame."""

    camera: Camera
    geometry: Geometry
    electrical: Electrical
    settings: Settings
    mosaic: Mosaic
    layout: Layout
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
    base_iso: float
    """ISO speed at gain 1; 0 of a camera that sees nothing of daylight."""
    times: tuple[float, ...]
    """Times (N,) of the samples of one integration, rising [s]; () of a single exposure."""
    plan: plan.Plan
    step_rates: tuple[Array, ...]
    """Rates (N, ...) as `rate` between each sample and the one before, where light changes with
    time [e/s]; () elsewhere."""
    full_charge: Array | None
    """Electrons that every node is read with if it is full, in the shape of `rate`, where transfer
    defers some of them [electrons]; None elsewhere: all of the full well."""

    @property
    def held_electrons(self) -> Array:
        """Noise-free signal of every node, at most that of a full one [electrons]."""
        mean = exposure.mean_electrons(self.rate, self.exposure_time, self.plan.active)
        if self.full_charge is not None:
            mean = np.minimum(mean, self.full_charge)
        clipped: Array = np.minimum(mean, mean.dtype.type(full_well(self.plan.active)))
        return clipped

    @property
    def dark_rate(self) -> float:
        """Dark electrons per second that are simulated [e/s]."""
        return exposure.mean_dark(1.0, self.plan.active)


def prepare(
    camera: Camera,
    picture: ScenePicture,
    workers: int,
    stages: Stages,
    rate_cache: RateCache | None = None,
    earlier: float = 0.0,
) -> Prepared:
    """Bring the light of a scene to the pixels, time the exposure and plan what will run.

    Parameters
    ----------
    camera : Camera
        The camera.
    picture : ScenePicture
        What the scene's files hold.
    workers : int
        Number of threads.
    stages : Stages
        Observer of the stages.
    rate_cache : RateCache, optional
        Cache of the light for further cameras.
    earlier : float
        Estimated time of what came before, such as the autofocus; the plan counts it [s].

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
    if not (camera.scene.moves and camera.exposure.is_timed_by_scene):
        return _prepare(camera, picture, workers, stages, rate_cache, earlier)
    with stages("metering"):
        metered = _prepare(standing_still(camera), picture, workers, Stages(), rate_cache)
    earlier += cost_model.light_seconds(metered.layout, metered.spectrum, workers)
    timed = _timed(camera, metered)
    ready = _prepare(timed, picture, workers, stages, rate_cache, earlier)
    timed = ready.camera.model_copy(update={"exposure": camera.exposure})
    return replace(ready, camera=timed, exposure_limit=metered.exposure_limit)


def standing_still(camera: Camera) -> Camera:
    """Return the camera as it meters and focuses: what moves stands where its file says."""
    source = camera.scene.source.standing_still()
    scene = camera.scene.model_copy(update={"source": source, "camera_motion": None})
    effects = camera.effects
    if isinstance(effects, dict):
        effects = {name: wish for name, wish in effects.items() if name != "motion"}
    return camera.model_copy(update={"scene": scene, "effects": effects})


def _timed(camera: Camera, metered: Prepared) -> Camera:
    """Return the camera with the times, and the gain, that it chose by what it metered."""
    if camera.exposure.schedule is not None:
        times = camera.exposure.model_copy(update={"captures": metered.times})
        return camera.model_copy(update={"exposure": times})
    gain = metered.camera.exposure_gain
    fixed = camera.exposure.single(metered.exposure_time, gain)
    return camera.model_copy(update={"exposure": fixed})


def _prepare(
    camera: Camera,
    picture: ScenePicture,
    workers: int,
    stages: Stages,
    rate_cache: RateCache | None,
    earlier: float = 0.0,
) -> Prepared:
    """Return the same where times are given, or nothing moves."""
    setup = camera_setup(camera)
    camera, layout = setup.camera, setup.layout
    frame_bytes = _require_memory(setup)
    stages.watch.expect(cost_model.first_estimate(camera, layout, workers))

    effects = plan.mean_signal_effects(camera, setup.geometry)
    with stages("scene"):
        scene = _scene(setup, picture, effects)
    with stages("optics"):
        transfer, white_rate = _transfer(setup, scene, effects, rate_cache)
        brightest, summed = float(white_rate.max()), layout.binning_groups.summed_charges
        saturation = setup.electrical.saturation / summed
        ceiling = auto_exposure.ceiling(camera, brightest, saturation)
        overexposure = _brightest_around(scene) * brightest / ceiling
        if overexposure > 1:  # of what lies beside the array, too
            scene = _scene(setup, picture, effects, overexposure)
        optional = plan.optional_effects(camera, effects)
        path = OpticalPath(
            transfer=transfer,
            geometry=layout.lattice,
            settings=setup.settings,
            mosaic=layout.mosaic,
            effects=effects,
            workers=workers,
            ceiling=ceiling,
            full=min(ASSUMED * _brightest(scene) * brightest, ceiling),
            fullness=_fullness(setup, scene, float(white_rate.min())),
            optional=optional,
            layers=layer_optics(camera, effects, scene),
        )
        photo_rate = partial(photon_rate.photo_rate, path, scene, layout.planes)
        light = photo_rate() if rate_cache is None else rate_cache.rate(camera, ceiling, photo_rate)
        effects = tuple(effect for effect in effects if effect not in light.plan.omitted)
        white_rate = white_rate * summed / (light.plan.on_axis or 1.0)
    with stages("exposure"):
        during = partial(_light_during, path, scene, layout, light)
        exposed = exposed_light.expose(setup, light, white_rate, effects, optional, during)
        setup = setup.at_gain(exposed.settings.gain)
        needed = max(frame_bytes, light.spectrum.memory) + scene_bytes(picture)
        changes = light.spectrum.changes | exposed.changes
        decided = plan.make(
            setup.camera,
            setup.geometry,
            setup.settings,
            exposed.light_plan,
            exposed.signal,
            needed,
            changes,
        )
        if of_kind(effects, ImageMotion):  # every sample of an integration has light of its own
            once = cost_model.light_seconds(layout, light.spectrum, workers)
            earlier += len(exposed.times) * once
        decided = _with_seconds(setup, light, decided, workers, earlier)
        stages.watch.expect(decided.seconds)
    return Prepared(
        camera=setup.camera,
        geometry=setup.geometry,
        electrical=setup.electrical,
        settings=setup.settings,
        mosaic=layout.raw_mosaic,
        layout=layout,
        scene=scene,
        transfer=transfer,
        white_rate=white_rate,
        rate=exposed.rate,
        spectrum=light.spectrum,
        exposure_time=exposed.signal.time,
        exposure_limit=exposed.settings.limit,
        base_iso=setup.base_iso,
        times=exposed.times,
        plan=decided,
        step_rates=exposed.step_rates,
        full_charge=exposed.full_charge if of_kind(decided.active, Limit) else None,
    )


def _light_during(
    path: OpticalPath,
    scene: AnyScene,
    layout: Layout,
    light: photon_rate.Rate,
    start: float,
    stop: float,
) -> Array:
    """Return the light from `start` to `stop` after a line's exposure begins [s], as `light` is.

    It is that of the whole exposure where nothing is simulated to move.
    """
    whole = light.plan.reduced(path)
    if not of_kind(whole.effects, ImageMotion) and not any(
        of_kind(layer.effects, ImageMotion) for layer in whole.layers
    ):
        return light.values
    effects = tuple(effect.part_of_exposure(start, stop) for effect in whole.effects)
    layers = tuple(layer.part_of_exposure(start, stop) for layer in whole.layers)
    part = replace(
        whole, effects=effects, transfer=whole.transfer.with_effects(effects), layers=layers
    )
    return photon_rate.photo_rate(part, scene, layout.planes).values


def _brightest(scene: AnyScene) -> float:
    """Return a scene's brightest light, relative to white."""
    flat = scene.flat if isinstance(scene, DepthScene) else scene
    return flat.chart.brightest if isinstance(flat, HarmonicScene) else flat.brightest


def _brightest_around(scene: AnyScene) -> float:
    """Return the brightest light that a chart has beyond the array, relative to white; else 0."""
    return _brightest(scene) if isinstance(scene, ChartScene | LayeredScene) else 0.0


def _fullness(setup: CameraSetup, scene: AnyScene, white_rate: float) -> float:
    """Return the darkest light of a scene over that which fills a pixel whatever its noise.

    `white_rate` is that of the perfect white in the color with least light [e/s]. It is 0 where
    the darkest light is not known, or more than one charge, sample or time decides what is full.
    """
    camera, time = setup.camera, setup.camera.exposure.time
    enabled = plan.enabled_effects(camera, setup.geometry)
    well = full_well(enabled)
    # Of full packets that are transferred, too, some charge is late.
    joined = camera.array.binning is not None or of_kind(enabled, TemporalGain, Transport)
    if time is None or joined or math.isinf(well) or not isinstance(scene, ChartScene | WaveScene):
        return 0.0
    darkest = scene.chart.darkest if isinstance(scene, ChartScene) else scene.darkest
    full = OVERFULL * well
    dark = exposure.mean_dark(1.0, enabled) * time
    variance = math.fsum(s.variance(full + dark, dark) for s in of_kind(enabled, NoiseSource))
    if full - SIGMAS * math.sqrt(variance) < well:
        return 0.0
    return darkest * white_rate * time / full


def _with_seconds(
    setup: CameraSetup,
    light: photon_rate.Rate,
    decided: plan.Plan,
    workers: int,
    earlier: float,
) -> plan.Plan:
    """Return the plan with the seconds of the frame, and of one with everything on."""
    known = (setup.camera, setup.geometry, setup.layout, setup.settings, light.spectrum)
    saved = light.plan.saved
    decisions = tuple(
        replace(d, saved=saved[d.name]) if d.name in saved and d.state == "off" else d
        for d in decided.decisions
    )
    of_electrons = sum(d.saved for d in decisions if d.name not in saved)
    every = replace(decided, seconds=decided.seconds + of_electrons + light.plan.saved_together)
    seconds, of_all = (
        earlier + cost_model.frame_seconds(*known, each, workers) for each in (decided, every)
    )
    return replace(decided, decisions=decisions, seconds=seconds, seconds_of_all=of_all)


def _require_memory(setup: CameraSetup) -> int:
    """Return the bytes of a frame without its scene, and refuse one that does not fit.

    What was read of the scene is in memory already.
    """
    camera, layout, array = setup.camera, setup.layout, setup.geometry
    colors = len(layout.mosaic.colors)
    samples = camera.exposure.count * (colors if layout.full_color else 1)
    lamp = camera.scene.illuminant
    if camera.scene.moves or (lamp is not None and lamp.flicker is not None):
        samples *= 2  # each has a rate of its own
    scattered = array.rows * array.columns if layout.is_scattered else 0
    judged = bool(camera.quality)
    needed = memory_model.frame_bytes(
        layout.lattice, setup.settings, colors, judged, samples, scattered
    )
    if "s-cielab" in camera.quality:
        shape = layout.picture_shape
        screen = display_screen(camera.display, shape[1])
        # By one thread, which is all there are where memory is little.
        needed += scielab.needed_bytes(shape, screen, camera.display.filters, 1)
    memory.require(needed, array.rows, array.columns)
    return needed


def _scene(
    setup: CameraSetup,
    picture: ScenePicture,
    effects: tuple[Effect, ...],
    overexposure: float = 1.0,
) -> AnyScene:
    """Return the scene, a chart with its margin: wider where what lies beside it is overexposed."""
    band, lattice = setup.camera.scene.wavelengths, setup.layout.lattice
    pixels = bandwidth.margin(
        lattice, effects, (band.start, band.stop), setup.settings, overexposure
    )
    return build_scene(setup.camera, photon_rate.view(lattice, setup.settings, pixels), picture)


def _transfer(
    setup: CameraSetup,
    scene: AnyScene,
    effects: tuple[Effect, ...],
    rate_cache: RateCache | None,
) -> tuple[Transfer, Array]:
    """Return the transfer of the scene's components, and the rate (C,) of perfect white [e/s].

    Spectra that do not cover the wavelengths are the user's error.
    """
    compute = partial(
        photon_rate.scene_transfer,
        setup.camera,
        setup.geometry,
        setup.settings,
        (*scene.spectra, scene.white),
        setup.layout.mosaic,
        effects,
    )
    try:
        whole = compute() if rate_cache is None else rate_cache.transfer(setup.camera, compute)
    except ValueError as error:
        raise bad(
            "scene.wavelengths", str(error), "narrow the wavelengths, or extend the spectrum"
        ) from None
    white_rate = whole.level[-1]
    exposed_light.refuse_too_much(float(white_rate.max()))
    # A cached transfer has another camera's effects, which are equal but not the same.
    return replace(whole.with_effects(effects), weights=whole.weights[:-1]), white_rate
