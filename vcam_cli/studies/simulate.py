"""One camera from its model to all its results, in memory: what `vcam run` writes to files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import pixel_centers
from vcam_cli.engine.frame import Frame, expose, figures
from vcam_cli.engine.parallel import available_workers
from vcam_cli.engine.prepare import Prepared
from vcam_cli.engine.prepare import prepare as bring_light
from vcam_cli.engine.stages import Observer, Silent, Stages
from vcam_cli.errors import BadInput
from vcam_cli.processing import Context, Patches, Processed, process
from vcam_cli.quality import display
from vcam_cli.quality.mse import mse, psnr_db
from vcam_cli.quality.scielab import cielab_map, s_cielab_map


@dataclass(frozen=True)
class Result:
    """A simulated photograph. Arrays are (rows, columns) unless they say otherwise."""

    frame: Frame
    processed: Processed
    stages: Stages
    notes: tuple[str, ...] = ()

    @property
    def dn(self) -> NDArray:
        """Raw digital numbers, whole. [DN]"""
        return self.frame.dn

    @property
    def electrons(self) -> NDArray:
        """Raw signal before the ADC, noisy, clipped above at the full well. [electrons]"""
        return self.frame.electrons

    @property
    def volts(self) -> NDArray:
        """Raw signal at the ADC's input. [V]"""
        e = self.frame.electrical
        return self.electrons * self.electrons.dtype.type(e.conversion_gain * e.analog_gain)

    @property
    def mean_electrons(self) -> NDArray:
        """Noise-free signal, photo + dark, before saturation. [electrons]"""
        return self.frame.mean_electrons

    @property
    def exposure_time(self) -> float:
        """[s]"""
        return self.frame.exposure_time

    @property
    def x(self) -> NDArray:
        """Centers of the columns, right of the array's center, (columns,) [m]."""
        return pixel_centers(self.frame.geometry)[0]

    @property
    def y(self) -> NDArray:
        """Centers of the rows, below the array's center, (rows,) [m]."""
        return pixel_centers(self.frame.geometry)[1]

    @cached_property
    def render(self) -> NDArray:
        """Codes of the render after `processing`: (rows, columns) or (rows, columns, 3)."""
        with self.stages("processing"):
            return self.processed.encode(self.frame.camera.output.render or 8)

    @cached_property
    def linear(self) -> NDArray:
        """The render in linear light, perfect white = 1: (rows, columns, channels)."""
        with self.stages("processing"):
            return self.processed.linear

    @cached_property
    def ideal(self) -> NDArray:
        """The scene point-sampled in the same colors and scale: (rows, columns, channels)."""
        with self.stages("ideal"):
            return self.processed.ideal(self.frame.ideal_dn())

    @cached_property
    def s_cielab(self) -> NDArray:
        """S-CIELAB Delta E of the render from the ideal image on the camera's `display`."""
        image, ideal, screen = self.linear, self.ideal, self._screen
        with self.stages("quality"):
            return s_cielab_map(image, ideal, screen, workers=self.processed.workers)

    @property
    def _screen(self) -> display.Screen:
        return display.screen(self.frame.camera.display, self.frame.geometry.columns)

    @cached_property
    def metrics(self) -> list[tuple[str, float, str]]:
        """(metric, value, unit): those every run has, then those that `quality` asks for."""
        out = figures(self.frame)
        if {"mse", "psnr"} & set(self.frame.camera.quality):
            image, ideal = self.linear, self.ideal
            with self.stages("quality"):
                error = mse(image, ideal)
                out += [("mse", error, ""), ("psnr_db", psnr_db(image, ideal), "dB")]
        if "cielab" in self.frame.camera.quality:
            image, ideal = self.linear, self.ideal
            with self.stages("quality"):
                each = cielab_map(image, ideal, self._screen, workers=self.processed.workers)
                out.append(("mean_delta_e", float(each.mean(dtype=float)), ""))
        if "s-cielab" in self.frame.camera.quality:
            out.append(("mean_s_cielab", float(self.s_cielab.mean(dtype=float)), ""))
        return out


def simulate(camera: Camera, workers: int | None = None, watch: Observer | None = None) -> Result:
    """Simulates `camera` looking at its scene.

    workers: threads, default all processors; results do not depend on it. watch: told of stages,
    here and while the result's properties are computed. Raises BadInput (with positions in the
    camera's file) and CannotDo.
    """
    try:
        stages = Stages(watch=watch or Silent())
        return _simulate(camera, workers or available_workers(), stages)
    except BadInput as error:
        raise error.located(camera.locate) from None


def prepare(
    camera: Camera, workers: int | None = None, watch: Observer | None = None
) -> tuple[Prepared, tuple[str, ...]]:
    """The camera ready to take its frame, and notes for the user: what `vcam plan` shows."""
    try:
        stages = Stages(watch=watch or Silent())
        picture, notes = _picture(camera, stages)
        return bring_light(camera, picture, workers or available_workers(), stages), notes
    except BadInput as error:
        raise error.located(camera.locate) from None


def _picture(camera: Camera, stages: Stages) -> tuple[NDArray | None, tuple[str, ...]]:
    """Samples of the scene's image file and notes about them; None where there is no file."""
    source = camera.scene.source
    if source.kind != "image":
        return None, ()
    from vcam_cli.files.images import read_picture

    with stages("read"):
        path = ("scene", "source", "file")
        read = read_picture(source.file, source.encoding, source.white, path)
    return read.data, read.notes


def _simulate(camera: Camera, workers: int, stages: Stages) -> Result:
    picture, notes = _picture(camera, stages)
    frame = expose(camera, picture, workers, stages)
    context = Context(
        pattern=frame.mosaic.block,
        colors=frame.mosaic.colors,
        white_dn=frame.white_dn,
        black_dn=frame.black_dn,
        linearize=None if frame.electrical.reference is None else frame.code.linear,
        saturated_dn=frame.saturated_dn,
        patches=lambda: _patches(frame),
    )
    with stages("balance"):
        processed = process(frame.dn, context, camera.processing, workers=workers)
    return Result(frame, processed, stages, notes + processed.notes)


def _patches(frame: Frame) -> Patches:
    """The ColorChecker that color correction is fitted to."""
    band = frame.camera.scene.wavelengths
    return Patches(frame.patches_dn(), frame.scene.white, band.start, band.stop)
