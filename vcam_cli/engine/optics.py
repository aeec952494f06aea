"""From the scene to the rate of photo-electrons in every pixel: the linear part.

All on-axis physics is one filter per scene component and color (`transfer.py`); slowly varying
factors multiply the result. Scenes known as waves are evaluated in closed form; pictures without
any optical blur are integrated as boxes; everything else goes through the cosine spectrum.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import Geometry
from vcam_cli.effects.base import Effect, Gain, RadialTransfer, SeparableTransfer
from vcam_cli.engine import bandwidth, memory, sampling
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.mosaic import Mosaic
from vcam_cli.engine.parallel import each
from vcam_cli.engine.settings import Settings
from vcam_cli.engine.transfer import Band, Tables, Transfer, tabulate, transfer
from vcam_cli.physics import radiometry
from vcam_cli.rng import blocks
from vcam_cli.scenes.base import SampledScene, View, WaveScene
from vcam_cli.spectra import Spectrum

MARGIN = 32
"""Pixels that a chart goes on beyond the array, at least: its far borders are mirrored, and the
light an Airy pattern throws further than this is below 1 % in any lens worth simulating."""

Rows = Callable[[slice], NDArray]


def view(geometry: Geometry, settings: Settings, oversampling: int) -> View:
    """The rectangle that a scene has to fill, with a margin that makes fast transform sizes."""
    return View(
        rows=geometry.rows,
        columns=geometry.columns,
        pitch_x=geometry.pitch_x,
        pitch_y=geometry.pitch_y,
        oversampling=oversampling,
        margin=_margin(geometry),
        scene_width=geometry.scene_width_on_sensor,
        dtype=settings.dtype,
    )


def _margin(geometry: Geometry) -> int:
    """Smallest margin from `MARGIN` on that gives both axes sizes with small prime factors."""

    def slow(margin: int) -> int:
        sizes = [n + 2 * margin for n in (geometry.rows, geometry.columns)]
        return sum(scipy.fft.next_fast_len(n, real=True) - n for n in sizes)

    return min(range(MARGIN, MARGIN + 33), key=lambda m: (slow(m), m))


def responses(camera: Camera, mosaic: Mosaic) -> list[Spectrum]:
    """Electrons per photon for each color: transmittance x filter x QE."""
    common = (
        camera.optics.transmittance.resolve(),
        (camera.pixel.photodetector.quantum_efficiency.spectrum.resolve()),
    )
    out = []
    for color in mosaic.colors:
        spec = camera.array.filters.get(color)
        filters = () if spec is None else (spec.resolve(),)
        out.append(common[0].times(common[1], *filters))
    return out


def scene_transfer(
    camera: Camera,
    geometry: Geometry,
    settings: Settings,
    spectra: Sequence[Spectrum],
    mosaic: Mosaic,
    effects: Sequence[Effect],
) -> Transfer:
    """H_kc of scene spectra [W / (sr m2 m)] in this camera, eq 2.18 and 2.23. [electrons / s]"""
    area = geometry.detector_area
    if camera.pixel.photodetector.quantum_efficiency.per_pixel:
        area = geometry.pixel_width * geometry.pixel_height
    irradiance = float(
        radiometry.irradiance_per_radiance(geometry.f_number, geometry.magnification)
    )
    wavelengths = camera.scene.wavelengths
    return transfer(
        spectra,
        responses(camera, mosaic),
        irradiance * area,
        Band(wavelengths.start, wavelengths.stop, settings.wavelength_step),
        [e for e in effects if isinstance(e, RadialTransfer)],
    )


@dataclass(frozen=True)
class Rate:
    """What the linear part gives."""

    values: NDArray
    """(rows, columns) [electrons / s]"""
    oversampling: float
    """Pixel Nyquist frequencies that the spectrum reached; 0 where none was needed."""
    lost: float
    """Estimated rms of what frequencies beyond add [electrons / s]"""


@dataclass(frozen=True)
class Linear:
    """Everything the linear part needs; `rate` computes it."""

    scene: WaveScene | SampledScene
    repaint: Callable[[int], WaveScene | SampledScene]
    """The same chart with another number of cells per pixel pitch."""
    exact: Transfer
    geometry: Geometry
    settings: Settings
    mosaic: Mosaic
    effects: tuple[Effect, ...]
    workers: int

    def rate(self) -> Rate:
        """Photo-electrons per second in every pixel, noise-free."""
        rows, oversampling, lost = self._rows()
        g = self.geometry
        out: NDArray = np.empty((g.rows, g.columns), self.settings.dtype)
        gains = [e for e in self.effects if isinstance(e, Gain)]
        x = ((np.arange(g.columns) + 0.5 - g.columns / 2) * g.pitch_x).astype(out.dtype)
        y = ((np.arange(g.rows) + 0.5 - g.rows / 2) * g.pitch_y).astype(out.dtype)

        def compute(block: slice) -> None:
            tile = out[block]
            self._assemble(rows, block, tile)
            np.maximum(tile, 0, out=tile)
            for effect in gains:
                tile *= effect.gain(x, y[block])

        each(compute, blocks(g.rows), self.workers)
        return Rate(out, oversampling, lost)

    def _assemble(self, rows: Sequence[Rows], block: slice, tile: NDArray) -> None:
        """Puts the values of each color where that color's pixels are."""
        period = len(self.mosaic.block)
        for phase in range(min(period, len(tile))):
            row = block.start + phase
            for color, columns in self.mosaic.in_row(row):
                tile[phase::period, columns] = rows[color](slice(row, block.stop, period))[
                    :, columns
                ]

    def _rows(self) -> tuple[list[Rows], float, float]:
        """For each color, a function from array rows (a slice) to their values.

        Also the oversampling it took, and the rms that is lost by no more of it [electrons / s].
        """
        if isinstance(self.scene, WaveScene):
            return self._waves(self.scene), 0.0, 0.0
        if self.scene.samples == "squares" and not self.exact.effects:
            return self._boxes(self.scene), 0.0, 0.0
        return self._filtered(self.scene)

    def _apertures(self) -> list[SeparableTransfer]:
        return [e for e in self.effects if isinstance(e, SeparableTransfer)]

    def _centers(self) -> tuple[NDArray, NDArray]:
        """Positions of the photodetectors' centers along x and y [m]."""
        g = self.geometry
        x = (np.arange(g.columns) + 0.5 - g.columns / 2) * g.pitch_x + g.detector_x
        y = (np.arange(g.rows) + 0.5 - g.rows / 2) * g.pitch_y + g.detector_y
        return x, y

    def _waves(self, scene: WaveScene) -> list[Rows]:
        """Each wave keeps its shape: its transfer is a number per color."""
        x, y = self._centers()
        parts = []
        for wave in scene.waves:
            frequency = np.array([np.hypot(wave.fx, wave.fy)])
            level = np.asarray(wave.weights) @ self.exact.at(frequency)[..., 0]
            for e in self._apertures():
                level = level * e.along_x(np.array([wave.fx])) * e.along_y(np.array([wave.fy]))
            ex = np.exp(1j * (2 * np.pi * wave.fx * x + wave.phase))
            parts.append((level, ex, np.exp(2j * np.pi * wave.fy * y)))

        def rows(color: int, s: slice) -> NDArray:
            total = np.zeros((len(y[s]), len(x)))
            for level, ex, ey in parts:
                total += level[color] * (ey[s, None] * ex[None, :]).real
            return total

        return [partial(rows, color) for color in range(len(self.mosaic.colors))]

    def _axes(self, scene: SampledScene, oversampling: float) -> tuple[Axis, Axis]:
        g = self.geometry
        ny, nx = scene.shape
        squares = scene.samples == "squares"

        def axis(samples: int, pitch: float, pixels: int, pixel: float, shift: float) -> Axis:
            first = samples * pitch / 2 + (0.5 - pixels / 2) * pixel + shift
            bandwidth = min(oversampling * 0.5 / pixel, self.exact.cutoff)
            return Axis(samples, pitch, pixels, pixel, first, squares, bandwidth)

        return (
            axis(nx, scene.pitch_x, g.columns, g.pitch_x, g.detector_x),
            axis(ny, scene.pitch_y, g.rows, g.pitch_y, g.detector_y),
        )

    def _filter(self, scene: SampledScene, tables: Tables, oversampling: float) -> sampling.Filter:
        x, y = self._axes(scene, oversampling)
        along_x, along_y = np.ones(x.terms), np.ones(y.terms)
        for e in self._apertures():
            along_x *= e.along_x(x.frequencies)
            along_y *= e.along_y(y.frequencies)
        return sampling.Filter(x, y, tables, along_x, along_y)

    def _filtered(self, scene: SampledScene) -> tuple[list[Rows], float, float]:
        """Through the cosine spectrum, as far up as the tolerance asks."""
        knobs, g, cutoff = self.settings, self.geometry, self.exact.cutoff
        widest = min(knobs.most_oversampling, bandwidth.limit(g, cutoff))
        tables = tabulate(
            self.exact, bandwidth.top(g, widest, cutoff), knobs.table_size, knobs.mixing_tolerance
        )
        oversampling = bandwidth.first_guess(g, knobs)
        while True:
            memory.require(memory.of_planes(scene, len(tables.mix), g, knobs), g)
            planes = scene.planes(tables.mix)
            budget = bandwidth.SHARE * knobs.tolerance * bandwidth.peak(planes, tables)
            coefficients = sampling.spectrum(planes, self.workers)
            if scene.samples == "squares":
                spread = self._spread(scene, tables, coefficients, widest)
                enough = max(spread.enough(budget), min(oversampling, widest))
                lost = spread.beyond(enough)
                break
            spread = self._spread(scene, tables, coefficients, oversampling)
            lost = spread.of_sampling(oversampling, self._passes)
            enough = oversampling
            oversampling = bandwidth.finer(enough, lost, budget, g, knobs, cutoff)
            if oversampling == enough:
                break
            del planes, coefficients
            finer = self.repaint(oversampling)
            assert isinstance(finer, SampledScene)
            scene = finer
        chosen = self._filter(scene, tables, enough)
        series = chosen.apply(coefficients, self.workers)

        def rows(color: int, s: slice) -> NDArray:
            return chosen.x.evaluate(series[color, s], axis=1)

        return [partial(rows, color) for color in range(len(series))], enough, lost

    def _passes(self, frequency: NDArray) -> NDArray:
        """Transfer of lens and photodetector, without its zeros, in the best color.

        frequency: (n,) in pixel Nyquist frequencies.
        """
        g = self.geometry
        per_meter = 0.5 / max(g.pitch_x, g.pitch_y)
        table = np.linspace(0, max(1e-9, float(frequency.max(initial=0))), 513)
        levels = self.exact.level.sum(axis=0)
        values = self.exact.at(table * per_meter).sum(axis=0) / np.maximum(levels, 1e-300)[:, None]
        lens = np.interp(frequency, table, values.max(axis=0))
        width = min(g.detector_width, g.detector_height) if self._apertures() else 0.0
        return lens / np.hypot(1, np.pi * frequency * per_meter * width)

    def _spread(
        self, scene: SampledScene, tables: Tables, coefficients: NDArray, oversampling: float
    ) -> bandwidth.Spread:
        """The signal's spectrum, as if all of it lay on the array and none in the margin."""
        g = self.geometry
        whole = scene.shape[0] * scene.pitch_y * scene.shape[1] * scene.pitch_x
        frequency, power = self._filter(scene, tables, oversampling).power(coefficients)
        density = whole / (g.sensor_width * g.sensor_height)
        return bandwidth.Spread(frequency * 2 * g.pitch_x, power * density)

    def _boxes(self, scene: SampledScene) -> list[Rows]:
        """Without optical blur a photodetector sees means over boxes, exactly."""
        x, y = self._axes(scene, 1.0)
        aperture = bool(self._apertures())
        width = self.geometry.detector_width if aperture else 0.0
        height = self.geometry.detector_height if aperture else 0.0
        planes = scene.planes(self.exact.level.T)
        values = [sampling.boxes(plane, x, y, width, height) for plane in planes]
        return [value.__getitem__ for value in values]
