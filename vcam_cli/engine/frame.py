"""One simulated frame: from a camera and its picture file's samples to raw numbers.

`prepare.py` brings the light to the pixels and plans the rest; here the frame is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import pixel_centers
from vcam_cli.effects.base import Charge, Code, Draw
from vcam_cli.effects.quantization import Quantization
from vcam_cli.engine import capture, optics, plan
from vcam_cli.engine.parallel import available_workers
from vcam_cli.engine.prepare import Prepared, prepare
from vcam_cli.engine.stages import Stages
from vcam_cli.physics import readout
from vcam_cli.spectra import colorchecker


@dataclass(frozen=True)
class Frame(Prepared):
    """A raw frame and all that is known of how it came about."""

    electrons: NDArray
    """(rows, columns) noisy signal, clipped at the full well [electrons]"""
    dn: NDArray
    """(rows, columns) [DN]"""

    @property
    def mean_electrons(self) -> NDArray:
        """(rows, columns) noise-free signal before saturation, photo + dark [electrons]"""
        return capture.mean_electrons(self.rate, self.exposure_time, self.plan.active)

    @property
    def code(self) -> Code:
        """The ADC."""
        return Quantization.of(self.camera, self.geometry)

    @property
    def black_dn(self) -> float:
        """Code of the mean dark signal, offset included [DN]."""
        return float(self.to_dn(np.array([self.dark_rate * self.exposure_time]))[0])

    def to_dn(self, electrons: NDArray) -> NDArray:
        """The ADC's curve before rounding and clipping [DN]."""
        return self.code.line(electrons)

    @property
    def white_dn(self) -> NDArray:
        """(C,) perfect white on the axis, noise-free, dark included, not clipped [DN]."""
        electrons = (self.white_rate + self.dark_rate) * self.exposure_time
        return np.asarray(self.to_dn(electrons))

    @property
    def saturated_dn(self) -> float:
        """The lowest code of a saturated pixel: of a full well, or the ADC's highest [DN]."""
        full = float(np.rint(self.to_dn(np.array([self.electrical.full_well], float))[0]))
        return min(full, float(self.electrical.highest_code))

    def patches_dn(self) -> NDArray:
        """(C, 24) a ColorChecker in the light of the scene, on the axis, as `white_dn` [DN]."""
        lit = [self.scene.white.times(reflectance) for _, reflectance in colorchecker()]
        seen = optics.scene_transfer(
            self.camera, self.geometry, self.settings, lit, self.mosaic, ()
        )
        return self.to_dn((seen.level.T + self.dark_rate) * self.exposure_time)

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
    ready = prepare(camera, picture, workers, stages)
    with stages("capture"):
        active = tuple(x for x in ready.plan.active if not isinstance(x, Code))
        code = Quantization.of(camera, ready.geometry)
        seeds = {"sensor": camera.seed.sensor, "frame": camera.seed.frame}
        electrons, dn = capture.capture(
            ready.rate, ready.exposure_time, active, code, seeds, workers
        )
    known = {field.name: getattr(ready, field.name) for field in fields(ready)}
    return Frame(**known, electrons=electrons, dn=dn)


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
