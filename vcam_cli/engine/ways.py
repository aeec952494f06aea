"""Three ways from a scene to its pixels' signal; each scene takes the one that suits it.

- A scene known as waves: each keeps its shape, its transfer is a number per color. Exact.
- A picture of uniform squares without any optical blur: means over boxes. Exact.
- Everything else: through the cosine spectrum, as far up as the tolerance asks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import Effect, RadialTransfer, SeparableTransfer
from vcam_cli.engine import bandwidth, memory, sampling
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.mosaic import Mosaic
from vcam_cli.engine.settings import Settings
from vcam_cli.engine.transfer import EXACT_ENTRIES, Tables, Transfer, tabulate
from vcam_cli.scenes.base import SampledScene, Wave, WaveScene

SINGLE = 5e-7
"""Error of transforms of 32-bit numbers, relative to the brightest sample."""
Rows = Callable[[slice], NDArray]
"""From array rows to one color's signal there, (rows, columns) [electrons / s]."""


@dataclass(frozen=True)
class Optics:
    """What the light passes between scene and electrons."""

    transfer: Transfer
    """Of the scene's components."""
    geometry: Geometry
    settings: Settings
    mosaic: Mosaic
    effects: tuple[Effect, ...]
    workers: int
    ceiling: float = np.inf
    """Rate at which a pixel fills up, as far as it is known; brighter ones all look alike [e/s]."""

    @property
    def separable(self) -> list[SeparableTransfer]:
        return [e for e in self.effects if isinstance(e, SeparableTransfer)]


@dataclass(frozen=True)
class Followed:
    """How far a scene's spectrum was followed, and what was in it."""

    oversampling: float = 0.0
    """Pixel Nyquist frequencies; 0 where the scene is known in closed form."""
    lost: float = 0.0
    """Estimated rms of the signal beyond [electrons / s]"""
    samples: int = 0
    """Samples of one plane of the scene; 0 where its waves are known."""
    planes: int = 0
    """Planes that were transformed."""
    changes: dict[str, float] = field(default_factory=dict)
    """Transfer -> rms change of the signal by leaving it out [electrons / s]"""


def rows(
    optics: Optics, scene_at: Callable[[int], WaveScene | SampledScene]
) -> tuple[list[Rows], Followed]:
    """For each color a function from array rows to its signal; and what the scene asked for."""
    scene = scene_at(bandwidth.first_guess(optics.geometry, optics.settings))
    if isinstance(scene, WaveScene):
        return waves(optics, scene)
    if scene.samples == "squares" and not optics.transfer.effects:
        return boxes(optics, scene)
    return cosines(optics, scene, scene_at)


def waves(optics: Optics, scene: WaveScene) -> tuple[list[Rows], Followed]:
    """The sum of waves at the photodetectors, each with its own transfer."""
    x, y = pixel_centers(optics.geometry, detector=True)
    parts = []
    for wave in scene.waves:
        level = _wave_level(optics, wave, optics.effects)
        ex = np.exp(1j * (2 * np.pi * wave.fx * x + wave.phase))
        parts.append((level, ex, np.exp(2j * np.pi * wave.fy * y)))

    def values(color: int, s: slice) -> NDArray:
        total = np.zeros((len(y[s]), len(x)))
        for level, ex, ey in parts:
            total += level[color] * (ey[s, None] * ex[None, :]).real
        return total

    changes = {}
    some = slice(None, None, max(1, len(y) // 64))
    for effect in optics.effects:
        if isinstance(effect, RadialTransfer | SeparableTransfer):
            others = tuple(e for e in optics.effects if e is not effect)
            total = np.zeros((len(optics.mosaic.colors), len(y[some]), len(x)))
            for wave, (level, ex, ey) in zip(scene.waves, parts, strict=True):
                difference = _wave_level(optics, wave, others) - level
                total += difference[:, None, None] * (ey[some, None] * ex[None, :]).real
            changes[effect.name] = float(np.sqrt(np.square(total).mean(axis=(1, 2)).max()))
    return [partial(values, c) for c in range(len(optics.mosaic.colors))], Followed(changes=changes)


def _wave_level(optics: Optics, wave: Wave, effects: tuple[Effect, ...]) -> NDArray:
    """Amplitude of a wave's signal in each color, (C,) [electrons / s]."""
    frequency = np.array([np.hypot(wave.fx, wave.fy)])
    level = np.asarray(wave.weights) @ optics.transfer.through(effects).at(frequency)[..., 0]
    for e in effects:
        if isinstance(e, SeparableTransfer):
            level = level * e.along_x(np.array([wave.fx])) * e.along_y(np.array([wave.fy]))
    return np.asarray(level)


def boxes(optics: Optics, scene: SampledScene) -> tuple[list[Rows], Followed]:
    """Means over the photodetectors' boxes; points where the aperture is switched off."""
    g = optics.geometry
    x, y = _axes(optics, scene, 1.0)
    memory.require(memory.of_planes(scene, len(optics.mosaic.colors), g, optics.settings), g)
    planes = scene.planes(optics.transfer.level.T, optics.workers)
    points = [sampling.boxes(plane, x, y, 0.0, 0.0) for plane in planes]
    if not optics.separable:
        return [point.__getitem__ for point in points], Followed()
    means = [sampling.boxes(p, x, y, g.detector_width, g.detector_height) for p in planes]
    change = max(
        float(np.sqrt(np.square(a - b).mean(dtype=np.float64)))
        for a, b in zip(means, points, strict=True)
    )
    changes = {e.name: change for e in optics.separable}
    return [mean.__getitem__ for mean in means], Followed(changes=changes)


def cosines(
    optics: Optics, scene: SampledScene, scene_at: Callable[[int], WaveScene | SampledScene]
) -> tuple[list[Rows], Followed]:
    """Through the cosine spectrum, as far up as the tolerance asks."""
    knobs, g, cutoff = optics.settings, optics.geometry, optics.transfer.cutoff
    widest = min(bandwidth.most(g, knobs), bandwidth.limit(g, cutoff))
    top = bandwidth.top(g, widest, cutoff)
    computed = EXACT_ENTRIES if knobs.float_width == 32 else knobs.table_size
    tables = tabulate(optics.transfer, top, knobs.table_size, knobs.mixing_tolerance, computed)
    oversampling = bandwidth.first_guess(g, knobs)
    while True:
        memory.require(memory.of_planes(scene, len(tables.mix), g, knobs), g)
        planes = scene.planes(tables.mix, optics.workers)
        peak = min(bandwidth.peak(planes, tables), optics.ceiling)
        budget = bandwidth.SHARE * knobs.tolerance * peak
        if bandwidth.brightest(planes, tables) * SINGLE > budget:
            planes = planes.astype(np.float64)
        coefficients = sampling.spectrum(planes, optics.workers)
        if scene.samples == "squares":
            spread = _spread(optics, scene, _filter(optics, scene, tables, widest), coefficients)
            enough = max(spread.enough(budget), min(knobs.oversampling, widest))
            lost = spread.beyond(enough)
            break
        enough = float(oversampling)
        spread = _spread(optics, scene, _filter(optics, scene, tables, enough), coefficients)
        lost = spread.of_sampling(enough, bandwidth.limit(g, cutoff), partial(_passes, optics))
        finer = bandwidth.finer(oversampling, lost, budget, g, knobs)
        if finer == oversampling:
            break
        del planes, coefficients
        oversampling, again = finer, scene_at(finer)
        assert isinstance(again, SampledScene)
        scene = again
    chosen = _filter(optics, scene, tables, enough)
    changes = dict(_changes(optics, scene, chosen, coefficients))
    series = chosen.apply(coefficients, optics.workers)

    def values(color: int, s: slice) -> NDArray:
        return chosen.x.evaluate(series[color, s], axis=1)

    samples, count = planes[0].size, len(planes)
    followed = Followed(enough, lost, samples, count, changes)
    return [partial(values, c) for c in range(len(series))], followed


def _axes(optics: Optics, scene: SampledScene, oversampling: float) -> tuple[Axis, Axis]:
    g, cutoff = optics.geometry, optics.transfer.cutoff
    ny, nx = scene.shape
    squares = scene.samples == "squares"

    def axis(samples: int, pitch: float, pixels: int, pixel: float, shift: float) -> Axis:
        first = samples * pitch / 2 + (0.5 - pixels / 2) * pixel + shift
        bandwidth = min(oversampling * 0.5 / pixel, cutoff)
        return Axis(samples, pitch, pixels, pixel, first, squares, bandwidth)

    return (
        axis(nx, scene.pitch_x, g.columns, g.pitch_x, g.detector_x),
        axis(ny, scene.pitch_y, g.rows, g.pitch_y, g.detector_y),
    )


def _filter(
    optics: Optics, scene: SampledScene, tables: Tables, oversampling: float
) -> sampling.Filter:
    x, y = _axes(optics, scene, oversampling)
    along_x, along_y = np.ones(x.terms), np.ones(y.terms)
    for e in optics.separable:
        along_x *= e.along_x(x.frequencies)
        along_y *= e.along_y(y.frequencies)
    return sampling.Filter(x, y, tables, along_x, along_y)


def _spread(
    optics: Optics, scene: SampledScene, filter: sampling.Filter, coefficients: NDArray
) -> bandwidth.Spread:
    """The signal's spectrum, as if all of it lay on the array and none in the margin."""
    frequency, power = filter.power(coefficients)
    nyquist = 2 * optics.geometry.pitch_x
    return bandwidth.Spread(frequency * nyquist, power * _density(optics, scene))


def _density(optics: Optics, scene: SampledScene) -> float:
    """Area of the scene over that of the array."""
    g = optics.geometry
    area = scene.shape[0] * scene.pitch_y * scene.shape[1] * scene.pitch_x
    return area / (g.sensor_width * g.sensor_height)


def _changes(
    optics: Optics, scene: SampledScene, chosen: sampling.Filter, coefficients: NDArray
) -> Iterator[tuple[str, float]]:
    """Rms change of the signal by leaving out each transfer, by Parseval's theorem.

    As if all of it lay on the array and none in the margin: an upper bound.
    """
    density = _density(optics, scene)
    for effect in optics.effects:
        if isinstance(effect, RadialTransfer):
            power = chosen.without(effect, optics.transfer).power(coefficients)[1]
        elif isinstance(effect, SeparableTransfer):
            power = chosen.without_separable(effect, coefficients)
        else:
            continue
        yield effect.name, float(np.sqrt(density * power.sum(axis=1).max()))


def _passes(optics: Optics, frequency: NDArray) -> NDArray:
    """Transfer of lens and photodetector, without its zeros, in the best color.

    frequency: (n,) in pixel Nyquist frequencies.
    """
    g = optics.geometry
    per_meter = 0.5 / max(g.pitch_x, g.pitch_y)
    table = np.linspace(0, max(1e-9, float(frequency.max(initial=0))), 513)
    levels = optics.transfer.level.sum(axis=0)
    values = optics.transfer.at(table * per_meter).sum(axis=0)
    values = values / np.maximum(levels, 1e-300)[:, None]
    lens = np.interp(frequency, table, values.max(axis=0))
    width = min(g.detector_width, g.detector_height) if optics.separable else 0.0
    return np.asarray(lens / np.hypot(1, np.pi * frequency * per_meter * width))
