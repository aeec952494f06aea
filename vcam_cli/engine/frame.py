"""One simulated frame: from a camera and its picture file's samples to raw numbers.

This is the whole engine in one short function; each line is a module beside this one.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.electrical import Electrical, electrical
from vcam_cli.camera.geometry import Geometry, geometry, pixel_centers
from vcam_cli.effects.base import Charge, Code, Draw, Outlook
from vcam_cli.effects.quantization import Quantization
from vcam_cli.engine import bandwidth, capture, exposure, memory, optics, plan
from vcam_cli.engine.mosaic import Mosaic, mosaic
from vcam_cli.engine.parallel import available_workers
from vcam_cli.engine.settings import Settings, settings
from vcam_cli.engine.transfer import Transfer
from vcam_cli.engine.ways import Optics
from vcam_cli.errors import bad
from vcam_cli.physics import readout
from vcam_cli.scenes.base import SampledScene, WaveScene
from vcam_cli.scenes.build import build


@dataclass
class Stages:
    """Seconds that each stage took, in the order in which they ran."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        start = clock.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + clock.perf_counter() - start


@dataclass(frozen=True)
class Frame:
    """A raw frame and all that is known of how it came about."""

    camera: Camera
    geometry: Geometry
    electrical: Electrical
    settings: Settings
    plan: plan.Plan
    mosaic: Mosaic
    scene: WaveScene | SampledScene
    transfer: Transfer
    """Of the scene's components."""
    white_rate: NDArray
    """(C,) Photo-electrons per second of the perfect white on the axis, in every color [e/s]."""
    dark_rate: float
    """[e/s]"""
    exposure_time: float
    """[s]"""
    oversampling: float
    """Pixel Nyquist frequencies that the scene's spectrum was followed to; 0: in closed form."""
    mean_electrons: NDArray
    """(rows, columns) noise-free signal before saturation [electrons]"""
    electrons: NDArray
    """(rows, columns) noisy signal, clipped at the full well [electrons]"""
    dn: NDArray
    """(rows, columns) [DN]"""

    @property
    def black_dn(self) -> float:
        """Mean dark signal and offset of the ADC [DN]."""
        dark = self.dark_rate * self.exposure_time
        return self.electrical.offset + dark / self.electrical.electrons_per_dn

    def to_dn(self, electrons: NDArray) -> NDArray:
        """The ADC's line before rounding and clipping [DN]."""
        return electrons * (1 / self.electrical.electrons_per_dn) + self.electrical.offset

    @property
    def white_dn(self) -> NDArray:
        """(C,) perfect white on the axis, noise-free, dark included, not clipped [DN]."""
        electrons = (self.white_rate + self.dark_rate) * self.exposure_time
        return np.asarray(self.to_dn(electrons))

    def ideal_dn(self) -> NDArray:
        """The scene point-sampled at the pixels' centers, all colors everywhere [DN].

        (C, rows, columns); no blur, no falloff, no noise; black included.
        """
        x, y = pixel_centers(self.geometry)
        photo = self.scene.at(x, y, self.transfer.level.T * self.exposure_time)
        return self.to_dn(photo + self.dark_rate * self.exposure_time)


def expose(camera: Camera, picture: NDArray | None, workers: int | None, stages: Stages) -> Frame:
    """Simulates one frame of `camera`.

    picture: samples of the scene's image file, (h, w, channels), linear light; None for charts.
    Raises BadInput where the camera contradicts itself, CannotDo where memory does not suffice.
    """
    workers = workers or available_workers()
    g, e = geometry(camera), electrical(camera)
    knobs = settings(camera)
    colors = mosaic(camera)
    needed = memory.of_frame(g, knobs, len(colors.colors), bool(camera.quality))
    memory.require(needed, g)

    def scene_at(oversampling: int) -> WaveScene | SampledScene:
        return build(camera.scene, optics.view(g, knobs, oversampling), picture)

    with stages("scene"):
        scene = scene_at(bandwidth.first_guess(g, knobs))
    with stages("optics"):
        effects = plan.optical(camera, g)
        both = _transfer(camera, g, knobs, (*scene.spectra, scene.white), colors, effects)
        transfer = replace(both, weights=both.weights[:-1])
        white_rate = both.level[-1]
        found = optics.photo_rate(Optics(transfer, g, knobs, colors, effects, workers), scene_at)
        rate = found.values
    with stages("exposure"):
        dark = sum(x.rate() for x in plan.wanted(camera, g) if isinstance(x, Charge))
        time = exposure.exposure_time(camera, rate, float(white_rate.max()), dark, e.saturation)
        peak = (float(rate.max()) + dark) * time
        outlook = Outlook(full_signal=max(1.0, min(e.full_well, peak)), time=time)
        decided = plan.make(camera, g, knobs, outlook, needed, found.spectrum.changes)
    with stages("capture"):
        active = tuple(x for x in decided.active if not isinstance(x, Code))
        code = Quantization.of(camera, g)
        seeds = {"sensor": camera.seed.sensor, "frame": camera.seed.frame}
        electrons, dn = capture.capture(rate, time, active, code, seeds, workers)
        mean = capture.mean_electrons(rate, time, active)
    return Frame(
        camera=camera,
        geometry=g,
        electrical=e,
        settings=knobs,
        plan=decided,
        mosaic=colors,
        scene=scene,
        transfer=transfer,
        white_rate=white_rate,
        dark_rate=sum(x.rate() for x in active if isinstance(x, Charge)),
        exposure_time=time,
        oversampling=found.spectrum.oversampling,
        mean_electrons=mean,
        electrons=electrons,
        dn=dn,
    )


def _transfer(camera, g, knobs, spectra, colors, effects) -> Transfer:
    """The scene's transfer; spectra that do not cover the wavelengths are the user's error."""
    try:
        return optics.scene_transfer(camera, g, knobs, spectra, colors, effects)
    except ValueError as error:
        raise bad(
            "scene.wavelengths", str(error), "narrow the wavelengths, or extend the spectrum"
        ) from None


def figures(frame: Frame) -> list[tuple[str, float, str]]:
    """The metrics every run has: (metric, value, unit). Eqs 3.1 and 3.2 for DR and SNR.

    These two are of the camera that the file describes, whatever the plan left out of the frame.
    """
    e = frame.electrical
    wanted = plan.wanted(frame.camera, frame.geometry)
    draws = [x for x in wanted if isinstance(x, Draw) and x.scope == "frame"]
    floor = sum(x.variance(0.0) for x in draws)
    dark = sum(x.rate() for x in wanted if isinstance(x, Charge)) * frame.exposure_time
    saturated = (frame.electrons >= e.full_well) | (frame.dn >= e.highest_code)
    return [
        ("exposure_time", frame.exposure_time, "s"),
        ("mean_electrons", float(frame.electrons.mean(dtype=np.float64)), "e"),
        ("saturated_fraction", float(saturated.mean()), ""),
        ("snr_db", float(readout.snr_db(0.2 * e.full_well, dark, floor)), "dB"),
        ("dynamic_range_db", float(readout.dynamic_range_db(e.full_well, dark, floor)), "dB"),
        ("well_capacity", e.full_well, "e"),
    ]
