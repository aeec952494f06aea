"""All that comes before a frame is taken: the light in every pixel, the exposure time, the plan.

This is the linear half of the engine in one short function; each line is a module beside this one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.electrical import Electrical, electrical
from vcam_cli.camera.geometry import Geometry, geometry
from vcam_cli.effects.base import Charge, Outlook
from vcam_cli.engine import bandwidth, cost, exposure, memory, optics, pixelwise, plan
from vcam_cli.engine.mosaic import Mosaic, mosaic
from vcam_cli.engine.settings import Settings, settings
from vcam_cli.engine.stages import Stages
from vcam_cli.engine.transfer import Transfer
from vcam_cli.engine.ways import Followed, Optics
from vcam_cli.errors import bad
from vcam_cli.scenes.base import SampledScene, WaveScene
from vcam_cli.scenes.build import build


@dataclass(frozen=True)
class Prepared:
    """A camera ready to take its frame."""

    camera: Camera
    geometry: Geometry
    electrical: Electrical
    settings: Settings
    mosaic: Mosaic
    scene: WaveScene | SampledScene
    transfer: Transfer
    """Of the scene's components."""
    white_rate: NDArray
    """(C,) Photo-electrons per second of the perfect white on the axis, in every color [e/s]."""
    rate: NDArray
    """(rows, columns) Photo-electrons per second of every pixel [e/s]."""
    spectrum: Followed
    """How far the scene's spectrum was followed."""
    exposure_time: float
    """[s]"""
    plan: plan.Plan

    @property
    def dark_rate(self) -> float:
        """Dark electrons per second that are simulated [e/s]."""
        return sum(e.rate() for e in self.plan.active if isinstance(e, Charge))


def prepare(camera: Camera, picture: NDArray | None, workers: int, stages: Stages) -> Prepared:
    """Brings the light of the scene to the pixels, times the exposure, decides what will run.

    picture: samples of the scene's image file, (h, w, channels), linear light; None for charts.
    Raises BadInput where the camera contradicts itself, CannotDo where memory does not suffice.
    """
    g, e = geometry(camera), electrical(camera)
    knobs = settings(camera)
    colors = mosaic(camera)
    needed = memory.of_frame(g, knobs, len(colors.colors), bool(camera.quality))
    memory.require(needed, g)
    stages.watch.expect(cost.at_first_sight(camera, g, colors, knobs, workers))

    @cache
    def scene_at(oversampling: int) -> WaveScene | SampledScene:
        view = optics.view(g, knobs, oversampling)
        return build(camera.scene, view, picture, camera.display.primaries)

    with stages("scene"):
        scene = scene_at(bandwidth.first_guess(g, knobs))
    with stages("optics"):
        effects = plan.optical(camera, g)
        both = _transfer(camera, g, knobs, (*scene.spectra, scene.white), colors, effects)
        transfer = replace(both, weights=both.weights[:-1])
        white_rate = both.level[-1]
        _refuse_too_much(float(white_rate.max()))
        ceiling = exposure.ceiling(camera, float(white_rate.max()), e.saturation)
        light = Optics(transfer, g, knobs, colors, effects, workers, ceiling)
        found = optics.photo_rate(light, scene_at)
    with stages("exposure"):
        rate, white = found.values, float(white_rate.max())
        dark = sum(x.rate() for x in plan.wanted(camera, g) if isinstance(x, Charge))
        time = exposure.exposure_time(camera, rate, white, dark, e.saturation)
        peak = (float(rate.max()) + dark) * time
        _refuse_too_much(max(peak, white * time))
        needed = max(needed, memory.of_followed(found.spectrum, g, knobs))
        outlook = Outlook(full_signal=max(1.0, min(e.full_well, peak)), time=time)
        here = pixelwise.changes(rate, g, plan.wanted(camera, g), effects, time)
        decided = plan.make(camera, g, knobs, outlook, needed, found.spectrum.changes | here)
        core = decided.seconds + cost.linear(g, colors, found.spectrum)
        core += cost.after(camera, g, colors)
        core += cost.irradiance(camera, g, knobs, found.spectrum)
        decided = replace(decided, seconds=core * cost.slowness() / cost.threads(workers))
        stages.watch.expect(decided.seconds)
    return Prepared(
        camera=camera,
        geometry=g,
        electrical=e,
        settings=knobs,
        mosaic=colors,
        scene=scene,
        transfer=transfer,
        white_rate=white_rate,
        rate=rate,
        spectrum=found.spectrum,
        exposure_time=time,
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


def _transfer(camera, g, knobs, spectra, colors, effects) -> Transfer:
    """The scene's transfer; spectra that do not cover the wavelengths are the user's error."""
    try:
        return optics.scene_transfer(camera, g, knobs, spectra, colors, effects)
    except ValueError as error:
        raise bad(
            "scene.wavelengths", str(error), "narrow the wavelengths, or extend the spectrum"
        ) from None
