"""The scene before a camera, and its light on the lattice: the linear half of a frame."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.pixel_signal import ColumnSpread, NeighborSharing, TemporalGain, Transport
from vcam_cli.effects.signal_chain import SIGMAS, NoiseSource, full_well
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.errors import bad
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.estimates import bandwidth, memory_model
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.pixel_response import scene_transfer
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.readout import auto_exposure, exposure
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene, HarmonicScene, SampledScene
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.sampled_chart import sampled_chart
from vcam_cli.scenes.waves import WaveScene
from vcam_cli.simulation import cost_model
from vcam_cli.simulation.run import Run
from vcam_cli.simulation.scene_files import (
    ScenePicture,
    build_scene,
    layer_optics,
    reading_bytes,
    scene_bytes,
)
from vcam_cli.solve.solved import Solved

ASSUMED = 0.9
"""Full signal over the scene's brightest light, as assumed before there is any signal."""
PLACES = 64
"""Places along each side of a picture at which its colors are looked at."""
DARKER = 4.0
"""Full signal that a margin was made for over that of the array, above which it is widened: it errs
by no more than this times its share of the tolerance, `bandwidth.MARGIN_SHARE`."""
OVERFULL = 2.0
"""Full wells of light above which a pixel counts as full, if six standard deviations of its noise
leave it so."""
SAMPLES = 4
"""Samples of a chart over a pixel pitch where it is simulated as it is written, unless the camera
says: the contrast sensitivity chart errs by 0.35 % of full signal at most, by a quarter of that
with twice as many."""
WRITTEN_MARGIN = 32
"""Pixels around the array, at most, that are written of a chart. The margin of standard accuracy is
12 to 24; that of `reference` may be 900, and such a chart is mirrored at the array's border."""
MOST_ELECTRONS = 1e25
"""More than any pixel ever meets, and far from where 32-bit numbers end."""


@dataclass(frozen=True)
class SceneLight:
    """A scene before a camera, and the way of its light to the lattice."""

    solved: Solved
    scene: AnyScene
    transfer: Transfer
    """Transfer of the scene's components to one pixel of the lattice."""
    white_rate: Array
    """Photo-electrons per second (C,) of the perfect white on the axis, in every color [e/s]."""
    path: OpticalPath
    """Lens, pixels and settings through which the scene is seen."""
    memory: int
    """Memory of a frame, or of reading its scene, without the scene [bytes]."""
    picture_memory: int
    """Memory of what was read of the scene [bytes]."""
    light_key: str
    """That of the camera."""
    overexposure: float = 1.0
    """Brightest light beside the array over full signal that the scene's margin is wide enough
    for."""


def scene_light(solved: Solved, picture: ScenePicture, run: Run) -> SceneLight:
    """Put a scene before a camera.

    Parameters
    ----------
    solved : Solved
        The camera.
    picture : ScenePicture
        What the scene's files hold.
    run : Run
        How it is computed.

    Returns
    -------
    SceneLight
        The scene, and the way of its light.

    Raises
    ------
    BadInput
        For spectra that do not cover the wavelengths, and more light than any unit could mean.
    CannotDo
        Where memory does not suffice.
    """
    frame_bytes = _require_memory(solved)
    run.stages.watch.expect(cost_model.first_estimate(solved, run.workers))
    effects = solved.effects.mean_signal
    with run.stages("scene"):
        scene = _scene(solved, picture, effects)
    with run.stages("optics"):
        transfer, white_rate = _transfer(solved, scene, effects, run.rate_cache)
        path = OpticalPath(
            transfer=transfer,
            geometry=solved.layout.lattice,
            settings=solved.settings,
            mosaic=solved.layout.mosaic,
            effects=effects,
            workers=run.workers,
            device=run.device,
            optional=solved.effects.optional(effects),
        )
        read = scene_bytes(picture)
        key = solved.light_key
        while_read = memory_model.BASE + reading_bytes(picture)
        most = max(frame_bytes, while_read)
        seen = SceneLight(solved, scene, transfer, white_rate, path, most, read, key)
        return exposed_as(seen, solved, picture)


def exposed_as(seen: SceneLight, solved: Solved, picture: ScenePicture) -> SceneLight:
    """Return a scene whose light is formed as exactly as an exposure needs it.

    Parameters
    ----------
    seen : SceneLight
        The scene before a camera of the same light.
    solved : Solved
        The camera of the exposure.
    picture : ScenePicture
        What the scene's files hold.

    Returns
    -------
    SceneLight
        The scene before this camera.
    """
    effects, scene = seen.path.effects, seen.scene
    levels = _levels(solved, seen)
    overexposure = max(_rate_around(seen) / levels.ceiling, 1.0)
    if overexposure > 1:
        scene = _scene(solved, picture, effects, overexposure)
    path = replace(
        seen.path,
        ceiling=levels.ceiling,
        full=levels.full,
        fullness=levels.fullness,
        layers=layer_optics(solved, effects, scene),
    )
    return replace(seen, solved=solved, scene=scene, path=path, overexposure=overexposure)


@dataclass(frozen=True)
class _Levels:
    """Levels of light as `OpticalPath` has them."""

    ceiling: float
    full: float
    fullness: float


def _levels(solved: Solved, seen: SceneLight) -> _Levels:
    """Return the levels that an exposure of a scene sets."""
    scene, white_rate = seen.scene, seen.white_rate
    brightest, charges = float(white_rate.max()), solved.layout.binning_groups.summed_charges
    ceiling, full = (
        auto_exposure.ceiling(solved.exposure, brightest, saturation / charges)
        for saturation in (solved.electrical.saturation, solved.chain.metered.saturation)
    )
    share = _share_of_white(scene, seen.path.transfer.level)
    full = min(ASSUMED * _brightest(scene) * share * brightest, full)
    return _Levels(ceiling, full, _fullness(solved, scene, float(white_rate.min())))


def rate_of_full(seen: SceneLight, solved: Solved) -> float:
    """Return the rate at which a camera's pixels are full, before a scene of another's light.

    Parameters
    ----------
    seen : SceneLight
        Scene before a camera of the same light.
    solved : Solved
        The camera.

    Returns
    -------
    float
        Photo-electrons per second [e/s], as `OpticalPath.ceiling`.
    """
    return _levels(solved, seen).ceiling


def formed_light(
    seen: SceneLight, picture: ScenePicture, run: Run
) -> tuple[SceneLight, photon_rate.Rate]:
    """Return the light of the whole exposure on the lattice.

    Margins are first as wide as white beside the array needs. Before an array that turns out much
    darker, the tails of what lies beside it are a larger part of full signal: it gets wider ones.
    So it is with all errors where pixels are read as one: their largest signal is lower than that
    of single pixels, by which `photo_rate` judges.

    Parameters
    ----------
    seen : SceneLight
        The scene before its camera.
    picture : ScenePicture
        What the scene's files hold.
    run : Run
        How it is computed.

    Returns
    -------
    seen : SceneLight
        The scene, its margin wide enough.
    light : Rate
        Photo-electrons per second in every place of the lattice [e/s].
    """
    while True:
        form = partial(photon_rate.photo_rate, seen.path, seen.scene, seen.solved.layout.planes)
        with run.stages("optics"):
            if run.rate_cache is None:
                light = form()
            else:
                key = seen.light_key + run.device.key
                light = run.rate_cache.rate(key, seen.path.ceiling, form)
            full = _largest_signal(seen, light.values)
            better = _widened(_with_full_signal(full, seen, light), picture, full)
        if better is seen:
            return seen, light
        seen = better


def _largest_signal(seen: SceneLight, light: Array) -> float:
    """Return the largest mean light of pixels that are read as one, at most what fills them [e/s].

    `light` is that of every place of the lattice [e/s].
    """
    layout, ceiling = seen.solved.layout, seen.path.ceiling
    groups = layout.binning_groups
    if groups.count > 1:
        light = layout.select_pixels(light)
        if groups.summed_charges == 1:  # each pixel has a well of its own
            light = np.minimum(light, light.dtype.type(ceiling))
        light = groups.sums(light) / light.dtype.type(groups.count)
    return min(float(light.max(initial=0.0)), ceiling)


def _with_full_signal(full: float, seen: SceneLight, light: photon_rate.Rate) -> SceneLight:
    """Return the scene with the full signal by which light is to be formed; itself where it was.

    `full` is that of pixels that are read as one [e/s].
    """
    path = seen.path
    if seen.solved.layout.binning_groups.count == 1:  # `photo_rate` has judged by the same
        return seen
    alone = min(float(light.values.max(initial=0.0)), path.ceiling)
    known = full * (1 + path.settings.tolerance)  # no better than by what light may err
    if full == 0 or known >= min(alone, path.full):  # and by these
        return seen
    if _is_exact(light, path, alone, full):
        return seen
    return replace(seen, path=replace(path, full=full), light_key=f"{seen.light_key} {full}")


def _is_exact(light: photon_rate.Rate, path: OpticalPath, judged: float, full: float) -> bool:
    """Return whether light errs by less than a full signal allows.

    `judged` is the higher one by which it was formed [e/s].
    """
    omitted = replace(path, omitted_share=light.plan.share * judged / full)
    return light.spectrum.lost_rms < omitted.usable_error * full


def scene_for_exposure(
    chosen: auto_exposure.ExposureSettings,
    seen: SceneLight,
    light: photon_rate.Rate,
    picture: ScenePicture,
) -> SceneLight:
    """Return the scene as it is to be formed for the time that an automatic exposure chose.

    Before the light was known, the perfect white told at what rate pixels are full. Where they are
    full at a lower one, the light may err by less.

    Parameters
    ----------
    chosen : ExposureSettings
        The time and the gain.
    seen : SceneLight
        The scene before its camera.
    light : Rate
        Its light on the lattice.
    picture : ScenePicture
        What the scene's files hold.

    Returns
    -------
    SceneLight
        The scene; itself where its light is exact enough.
    """
    solved = seen.solved
    if not solved.exposure.is_timed_by_scene:
        return seen
    judged, timed = _largest_signal(seen, light.values), solved.at_gain(chosen.gain)
    charge = judged * chosen.time * solved.layout.binning_groups.summed_charges
    if charge <= timed.electrical.saturation:  # no pixel is full
        return seen
    timed = timed.with_exposure(solved.exposure.single(chosen.time, chosen.gain))
    better = exposed_as(seen, timed, picture)
    full = _largest_signal(better, light.values)
    if full >= judged or _is_exact(light, seen.path, judged, full):
        return seen
    return replace(better, solved=solved, light_key=f"{seen.light_key} {better.path.ceiling}")


def _widened(seen: SceneLight, picture: ScenePicture, full: float) -> SceneLight:
    """Return the scene with the margin that its light needs; itself where it has that.

    Layers predict themselves what their margins change.
    """
    around, time = _rate_around(seen), seen.solved.exposure.time
    if around == 0 or not isinstance(seen.scene, SampledScene):
        return seen
    full = max(full, 1 / time if time else 0.0)  # as defined, at least one electron
    overexposure = around / full if full > 0 else math.inf
    if overexposure <= DARKER * seen.overexposure:
        return seen
    scene = _scene(seen.solved, picture, seen.path.effects, overexposure)
    if not isinstance(scene, SampledScene) or scene.shape == seen.scene.shape:
        return seen
    key = f"{seen.light_key} {scene.shape}"
    return replace(seen, scene=scene, light_key=key, overexposure=overexposure)


def light_during(seen: SceneLight, light: photon_rate.Rate, start: float, stop: float) -> Array:
    """Return the light during a part of the exposure.

    It is that of the whole exposure where nothing is simulated to move.

    Parameters
    ----------
    seen : SceneLight
        Scene and its light path.
    light : photon_rate.Rate
        Light of the whole exposure.
    start, stop : float
        Times after a line's exposure begins [s].

    Returns
    -------
    Array
        Rates in the shape of `light.values` [e/s].
    """
    whole = light.plan.reduced(seen.path)
    if not of_kind(whole.effects, ImageMotion) and not any(
        of_kind(layer.effects, ImageMotion) for layer in whole.layers
    ):
        return light.values
    effects = tuple(effect.part_of_exposure(start, stop) for effect in whole.effects)
    layers = tuple(layer.part_of_exposure(start, stop) for layer in whole.layers)
    part = replace(
        whole, effects=effects, transfer=whole.transfer.with_effects(effects), layers=layers
    )
    return photon_rate.photo_rate(part, seen.scene, seen.solved.layout.planes).values


def refuse_too_much(electrons: float) -> None:
    """Refuse light far beyond any camera's.

    Parameters
    ----------
    electrons : float
        Electrons in a pixel or a second.

    Raises
    ------
    BadInput
        For more than `MOST_ELECTRONS`, or NaN.
    """
    if not electrons < MOST_ELECTRONS:
        raise bad(
            "scene",
            f"light and dark current would make {electrons:.3g} electrons in a pixel or a second",
            "look for a wrong unit in the light level, the dark current or the exposure",
        )


def _brightest(scene: AnyScene) -> float:
    """Return a scene's brightest light, relative to white."""
    flat = scene.flat if isinstance(scene, DepthScene) else scene
    return flat.chart.brightest if isinstance(flat, HarmonicScene) else flat.brightest


def _share_of_white(scene: AnyScene, level: Array) -> float:
    """Return the most light that a color has of white as bright as a picture's largest sample.

    Channels are seldom all bright in one place: pictures of leaves in three colors have two thirds
    and were formed twice, each time as long as once. Places of a grid tell; only time depends on
    it. `level` is the signal (K, C) of each channel [e/s].
    """
    if not isinstance(scene, ImageScene) or len(level) == 1:
        return 1.0
    if not isinstance(scene.picture, np.ndarray):  # samples stay in their file
        return 1.0
    rows, columns = (-(-n // PLACES) for n in scene.picture.shape[:2])
    some = scene.picture[::rows, ::columns].reshape(-1, len(level))
    white = float(some.max(initial=0.0)) * float(level.sum(axis=0).max())
    light = float((some @ level).max(initial=0.0))
    return light / white if 0 < light < white else 1.0


def _rate_around(seen: SceneLight) -> float:
    """Return the rate of the brightest light that is cut off beside the array [e/s].

    It is 0 where nothing is. Charts go on without end, and their light beyond the margin is not
    known better than that of the whole.
    """
    scene = seen.scene
    if isinstance(scene, DepthScene):  # errors of its layers are relative to white
        brightest = 1.0
    elif isinstance(scene, ImageScene):
        brightest = scene.brightest_cut
    else:
        charted = isinstance(scene, ChartScene | LayeredScene)
        brightest = _brightest(scene) if charted else 0.0
    return brightest * float(seen.white_rate.max())


def _fullness(solved: Solved, scene: AnyScene, white_rate: float) -> float:
    """Return the darkest light of a scene over the light that fills a pixel whatever its noise.

    `white_rate` is that of the perfect white in the color with least light [e/s]. It is 0 where
    the darkest light is not known, or more than one charge, sample or time decides what is full.
    """
    time, enabled = solved.exposure.time, solved.effects.enabled
    well = full_well(enabled)
    # Of full packets that are transferred, too, some charge is late; and the least light of the
    # color with least of it is not that of pixels that share it.
    shared = of_kind(enabled, TemporalGain, NeighborSharing, ColumnSpread, Transport)
    joined = solved.binning is not None or shared
    if time is None or joined or math.isinf(well) or not isinstance(scene, ChartScene | WaveScene):
        return 0.0
    darkest = scene.chart.darkest if isinstance(scene, ChartScene) else scene.darkest
    full = OVERFULL * well
    dark = exposure.mean_dark(1.0, enabled) * time
    variance = math.fsum(s.variance(full + dark, dark) for s in of_kind(enabled, NoiseSource))
    if full - SIGMAS * math.sqrt(variance) < well:
        return 0.0
    return darkest * white_rate * time / full


def _require_memory(solved: Solved) -> int:
    """Return the bytes of a frame without its scene, and refuse one that does not fit.

    What was read of the scene is in memory already.
    """
    layout, array = solved.layout, solved.geometry
    colors = len(layout.mosaic.colors)
    samples = solved.exposure.count * (colors if layout.full_color else 1)
    lamp = solved.scene.illuminant
    if solved.scene.moves or (lamp is not None and lamp.flicker is not None):
        samples *= 2  # each has a rate of its own
    scattered = array.rows * array.columns if layout.is_scattered else 0
    on_screen = 0
    if "s-cielab" in solved.quality:
        from vcam_cli.quality import scielab
        from vcam_cli.quality.display import display_screen

        shape = layout.picture_shape
        screen = display_screen(solved.display, shape[1])
        # By one thread, which is all there are where memory is little.
        on_screen = scielab.needed_bytes(shape, screen, solved.display.filters, 1)
    needed = memory_model.frame_bytes(
        layout.lattice,
        solved.settings,
        colors,
        bool(solved.quality),
        samples,
        scattered,
        _edge_pixels(solved),
        bool(of_kind(solved.effects.enabled, Transport)),
        on_screen,
        np.dtype(exposure.codes_type(solved.chain.adc.bits)).itemsize,
    )
    memory_model.require(needed, array)
    return needed


def _edge_pixels(solved: Solved) -> int:
    """Return the largest number of pixels that a slanted-edge response is computed from."""
    if not solved.has_edge:
        return 0
    pixels = solved.geometry.rows * solved.geometry.columns
    if solved.layout.full_color:
        return pixels
    block = [name for row in solved.layout.raw_mosaic.block for name in row]
    return pixels * max(map(block.count, block)) // len(block)


def _scene(
    solved: Solved,
    picture: ScenePicture,
    effects: tuple[Effect, ...],
    overexposure: float = 1.0,
) -> AnyScene:
    """Return the scene, a chart with its margin: wider where what lies beside it is overexposed."""
    band, lattice = solved.scene.wavelengths, solved.layout.lattice
    pixels = bandwidth.margin(
        lattice, effects, (band.start, band.stop), solved.settings, overexposure
    )
    view = photon_rate.view(lattice, solved.settings, pixels, effects)
    scene = build_scene(solved, view, picture, overexposure)
    if not solved.output.radiance or isinstance(scene, DepthScene | LayeredScene):
        return scene
    # A file of a chart is a picture of it: that one is simulated, so that it is what light was.
    per_pixel = solved.settings.oversampling or SAMPLES
    goes_on = solved.geometry.scene_scale > 0 and view.margin <= WRITTEN_MARGIN
    return sampled_chart(scene, view, per_pixel, goes_on)


def _transfer(
    solved: Solved,
    scene: AnyScene,
    effects: tuple[Effect, ...],
    rate_cache: RateCache | None,
) -> tuple[Transfer, Array]:
    """Return the transfer of the scene's components, and the rate (C,) of perfect white [e/s].

    Spectra that do not cover the wavelengths are the user's error.
    """
    compute = partial(
        scene_transfer,
        solved.response,
        (*scene.spectra, scene.white),
        effects,
        solved.settings.wavelength_step,
    )
    try:
        key = f"{solved.lens_key} {len(scene.spectra)}"
        whole = compute() if rate_cache is None else rate_cache.transfer(key, compute)
    except ValueError as error:
        raise bad(
            "scene.wavelengths", str(error), "narrow the wavelengths, or extend the spectrum"
        ) from None
    white_rate = whole.level[-1]
    refuse_too_much(float(white_rate.max()))
    # A cached transfer has another camera's effects, which are equal but not the same.
    return replace(whole.with_effects(effects), weights=whole.weights[:-1]), white_rate
