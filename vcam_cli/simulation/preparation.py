"""All that comes before a frame is taken: the light in every pixel, the exposure time, the plan.

This is the linear half of the engine in one short function; each line is a module beside this one.
"""

from __future__ import annotations

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
from vcam_cli.errors import bad
from vcam_cli.image_formation import bandwidth, memory_model, photon_rate, pixelwise
from vcam_cli.image_formation.optical_path import OpticalPath, SpectrumReport
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.image_formation.settings import Settings, settings
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.progress import Stages
from vcam_cli.readout import auto_exposure, exposure, sample_times
from vcam_cli.readout.layout import Layout, layout
from vcam_cli.scenes.base import Scene
from vcam_cli.scenes.build import build
from vcam_cli.simulation import cost_model, plan


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
    """Of the scene's components, to one pixel of the lattice."""
    white_rate: NDArray
    """(C,) Photo-electrons per second of the perfect white on the axis, in every color [e/s]."""
    rate: NDArray
    """(rows, columns) Photo-electrons per second of every pixel, as they are read out [e/s].

    (C, rows, columns) of stacked pixels. Of pixels that are read as one: where charges are joined,
    this and the other rates are those of the sum; else of every pixel, before they are joined.
    """
    spectrum: SpectrumReport
    """How far the scene's spectrum was followed."""
    exposure_time: float
    """[s]"""
    times: tuple[float, ...]
    """(N,) of the samples of one integration, rising [s]; () of a single exposure."""
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
    """Brings the light of the scene to the pixels, times the exposure or its samples, decides what
    will run.

    picture: samples of the scene's image file, (h, w, channels), linear light; None for charts.
    lights: what keeps the light for further cameras, where there are any.
    Raises BadInput where the camera contradicts itself, CannotDo where memory does not suffice.
    """
    g, e = geometry(camera), electrical(camera)
    knobs = settings(camera)
    place = layout(camera, g)
    colors, lattice, knobs = place.mosaic, place.lattice, place.settings(knobs)
    joins = place.binning_groups
    count = camera.exposure.count * (len(colors.colors) if place.full_color else 1)
    needed = memory_model.frame_bytes(
        lattice, knobs, len(colors.colors), bool(camera.quality), count
    )
    memory.require(needed, g.rows, g.columns)  # what was read of the scene is there already
    read = getattr(picture, "nbytes", 0)
    stages.watch.expect(cost_model.first_estimate(camera, g, colors, workers))

    effects = plan.mean_signal_effects(camera, g)
    with stages("scene"):
        band = camera.scene.wavelengths
        margin = bandwidth.margin(lattice, effects, (band.start, band.stop), knobs)
        view = photon_rate.view(lattice, knobs, margin)
        scene = build(camera.scene, view, picture, camera.display.primaries)
    with stages("optics"):
        spectra = (*scene.spectra, scene.white)
        see = partial(_transfer, camera, g, knobs, spectra, colors, effects)
        both = see() if rate_cache is None else rate_cache.transfer(camera, see)
        # Kept light came with another camera's effects, which are equal but not the same.
        transfer = replace(both.with_effects(effects), weights=both.weights[:-1])
        white_rate = both.level[-1]
        _refuse_too_much(float(white_rate.max()))
        ceiling = auto_exposure.ceiling(
            camera, float(white_rate.max()), e.saturation / joins.summed_charges
        )
        white_rate = white_rate * joins.summed_charges
        light = OpticalPath(transfer, lattice, knobs, colors, effects, workers, ceiling)
        bring = partial(photon_rate.photo_rate, light, scene, place.planes)
        found = bring() if rate_cache is None else rate_cache.rate(camera, ceiling, bring)
        taken = place.select_pixels(found.values)
    with stages("exposure"):
        white = float(white_rate.max())
        present = plan.enabled_effects(camera, g)
        dark = exposure.mean_dark(1.0, present)
        rate = joins.collect(_arriving(taken, dark / joins.summed_charges, effects))
        taken = joins.collect(taken)
        times = sample_times.choose_sample_times(camera, rate, e, present, quantizer(camera, g))
        time = (
            times[-1]
            if times
            else auto_exposure.exposure_time(camera, rate, white, dark, e.saturation)
        )
        peak = (float(rate.max()) + dark) * time
        _refuse_too_much(max(peak, white * time))
        needed = max(needed, found.spectrum.memory) + read
        full = max(1.0, min(e.full_well, peak))
        signal = SignalLevels(full, time, dark * time, camera.array.binning)
        here = _on_pixels(place, joins.collect(found.values), present, effects, time)
        if transports := [transport.name for transport in of_kind(present, Transport)]:
            well = min(e.full_well / time - dark, MOST_ELECTRONS)
            moved = _rms(np.minimum(rate, well) - np.minimum(taken, well))
            here |= dict.fromkeys(transports, moved)
        decided = plan.make(camera, g, knobs, signal, needed, found.spectrum.changes | here)
        core = decided.seconds + cost_model.image_seconds(lattice, colors, found.spectrum)
        core += cost_model.output_seconds(camera, g, colors) + cost_model.sample_seconds(
            camera, g, decided.active
        )
        core += cost_model.irradiance_seconds(camera, g, knobs, found.spectrum)
        decided = replace(
            decided, seconds=core * cost_model.slowness() / cost_model.threads(workers)
        )
        stages.watch.expect(decided.seconds)
    return Prepared(
        camera=camera,
        geometry=g,
        electrical=e,
        settings=knobs,
        mosaic=place.raw_mosaic,
        layout=place,
        scene=scene,
        transfer=transfer,
        white_rate=white_rate,
        rate=rate,
        spectrum=found.spectrum,
        exposure_time=time,
        times=times,
        plan=decided,
    )


MOST_ELECTRONS = 1e25
"""More than any pixel ever meets, and far from where 32-bit numbers end."""


def _refuse_too_much(electrons: float) -> None:
    if not electrons < MOST_ELECTRONS:
        raise bad(
            "scene",
            f"light and dark current would make {electrons:.3g} electrons in a pixel",
            "look for a wrong unit in the light level, the dark current or the exposure",
        )


def _on_pixels(
    place: Layout, light: NDArray, present: Sequence[Effect], running: Sequence[Effect], time: float
) -> dict[str, float]:
    """Rms change of the mean raw by what acts on pixels, in the color where it is most [e/s]."""
    geometry, mosaic = place.charge_pixels
    mosaics = [Mosaic(((color,),)) for color in mosaic.colors]
    parts = zip(light, mosaics, strict=True) if place.planes else [(light, mosaic)]
    found: dict[str, float] = {}
    for plane, colors in parts:
        here = pixelwise.changes_by_omission(plane, geometry, colors, present, running, time)
        found = {name: max(change, found.get(name, 0.0)) for name, change in here.items()}
    return found


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.square(values, dtype=np.float64).mean()))


def _arriving(rate: NDArray, dark: float, effects: Sequence[Effect]) -> NDArray:
    """Photo-electrons per second that arrive where charge is transported [e/s].

    Such that with the dark rate they are what arrives of both. Before the exposure is timed, since
    transport is linear: what is automatic sees the picture as it is read.
    """
    for transport in of_kind(effects, Transport):
        signal = rate + rate.dtype.type(dark)
        planes = signal.reshape(-1, *signal.shape[-2:])
        signal = np.array([transport.transport(plane) for plane in planes]).reshape(rate.shape)
        signal -= rate.dtype.type(dark)
        rate = signal
    return rate


def _transfer(camera, g, knobs, spectra, colors, effects) -> Transfer:
    """The scene's transfer; spectra that do not cover the wavelengths are the user's error."""
    try:
        return photon_rate.scene_transfer(camera, g, knobs, spectra, colors, effects)
    except ValueError as error:
        raise bad(
            "scene.wavelengths", str(error), "narrow the wavelengths, or extend the spectrum"
        ) from None
