"""A scene's spectrum, looked at until it is known how far it has to be followed.

That of a picture, or of a chart of even rectangles, is at hand as far as the lens reaches. Other
charts are painted, again and again with finer cells, until what their cells lose is little enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine import bandwidth, brightness, memory, painted, parseval, sampling
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import Coefficients, OfRuns
from vcam_cli.engine.layers import Optics
from vcam_cli.engine.room import Room
from vcam_cli.engine.transfer import Tables
from vcam_cli.scenes.base import SampledScene, WaveScene

SINGLE = 5e-7
"""Error of transforms of 32-bit numbers, relative to the brightest sample."""

SceneAt = Callable[[int], WaveScene | SampledScene]
"""The scene with so many cells per pixel pitch, where it is a chart."""


@dataclass(frozen=True)
class Reach:
    """How far up a scene's spectrum is looked at, in pixel Nyquist frequencies."""

    looked: float
    most: float
    """Up to which it may be followed."""
    cells: int | None
    """Per pixel pitch, of a chart that has to be painted; None where the spectrum is at hand."""
    pixels: float
    """Of the scene, with the margin that a chart has."""


@dataclass(frozen=True)
class Seen:
    """A scene whose spectrum was looked at."""

    scene: SampledScene
    coefficients: Coefficients
    filter: sampling.Filter
    """With which rows of them were looked at."""
    sample: parseval.Sample
    """Through all that the lens does,"""
    alone: parseval.Sample
    """and through what is the same in all directions, as far as the lens reaches."""
    looked: float
    """Pixel Nyquist frequencies up to which `sample` goes,"""
    enough: float
    """and up to which the spectrum is to be followed."""
    lost: float
    """Rms of the signal beyond [electrons / s]"""
    budget: float
    """Rms of the signal that may be lost with the frequencies beyond,"""
    spare: float
    """and with each of other things [electrons / s]"""
    samples: int
    """Of one plane, as far as they are wanted."""
    held: int
    """Samples of all planes that were in memory together."""
    peak: float
    """Bound on the signal before blur [electrons / s]"""

    def chosen(self, optics: Optics) -> tuple[sampling.Filter, Coefficients]:
        """The filter for the picture, and the terms that it takes."""
        chosen, coefficients = self.filter, self.coefficients
        if self.enough != self.looked:
            chosen = filter_of(optics, self.scene, self.filter.tables, self.enough)
        if isinstance(coefficients, OfRuns):
            coefficients = coefficients.first(chosen.y.terms, chosen.x.terms)
        return chosen, coefficients

    def through(self, optics: Optics, tables: Tables) -> Seen:
        """Looked at once more, through tables that let less pass and go as far as is `enough`."""
        filter = filter_of(optics, self.scene, tables, self.enough)
        sample = self.sample.through(filter)
        budget = max(self.budget, _budget(optics, filter, self.coefficients))
        spread = _spread(optics, self.scene, sample.power())
        enough = max(spread.enough(budget), bandwidth.least(optics.settings))
        enough = min(enough, self.enough)
        return replace(
            self,
            filter=filter,
            sample=sample,
            looked=self.enough,
            enough=enough,
            lost=math.hypot(spread.beyond(enough), self.lost),
        )

    def beyond(self, what: Callable[[parseval.Sample], NDArray]) -> NDArray:
        """Of a mean square (C,), what is beyond the tables of all that the lens does.

        As without what has a direction: that only weakens the light.
        """
        if self.alone is self.sample:
            return np.zeros(1)
        within = replace(self.filter, tables=self.alone.filter.tables)
        return np.maximum(what(self.alone) - what(self.alone.through(within)), 0)

    def rms(self, optics: Optics, squares: NDArray) -> float:
        """Of the signal of most in any color, as if all of the scene lay on the array.

        An upper bound: some lies in the margin. squares: (C,) means over the scene.
        """
        return math.sqrt(_density(optics, self.scene) * float(squares.max()))


def reach(optics: Optics, scene: SampledScene) -> Reach:
    """How far up the spectrum of `scene`, as it is painted at first, is looked at."""
    knobs, g = optics.settings, optics.geometry
    first = bandwidth.first_guess(g, knobs)
    picture, known = scene.samples == "squares", scene.is_known
    pixels = g.rows * g.columns if picture else scene.shape[0] * scene.shape[1] / first**2
    limit = bandwidth.limit(g, optics.transfer.cutoff)
    most = min(bandwidth.most(pixels, knobs), limit)
    # What is known costs nothing to look at.
    far = max(most, min(bandwidth.KNOWN, bandwidth.LOOKED / g.columns))
    looked = min(far, limit) if known else most
    return Reach(looked, most, None if picture or known else first, pixels)


def look(
    optics: Optics,
    scene: SampledScene,
    scene_at: SceneAt,
    reach: Reach,
    tables: Tables,
    room: Room,
    most: Tables | None = None,
) -> Seen:
    """Looks at the spectrum of a scene through tables that go as far as `reach`.

    room: of the tables; most: where the lens does more than that, tables of what passes at most.
    Raises CannotDo where memory does not suffice.
    """
    knobs, cells, highest = optics.settings, reach.cells, 0.0
    while True:
        looked = reach.looked if cells is None else float(cells)
        filter = filter_of(optics, scene, tables, looked)
        light, terms, held = _light(optics, scene, filter, room)
        peak = light.peak(tables)
        highest = max(highest, peak)
        spare = bandwidth.SHARE * knobs.tolerance * min(peak, optics.ceiling)
        if light.brightest(tables) * SINGLE > spare:
            light = light.doubled()
        coefficients = light.spectrum(optics.workers, terms)
        sample = parseval.Sample(filter, coefficients)
        power = sample.power() if most is None else sample.most(most)
        spread = _spread(optics, scene, power)
        budget = spare
        if cells is None:
            # Of what the lens does more it is known that it keeps the mean.
            budget = _budget(optics, filter, coefficients, least=most is not None)
            enough = min(max(spread.enough(budget), bandwidth.least(knobs)), reach.most)
            lost = spread.beyond(enough)
            break
        enough, limit = looked, bandwidth.limit(optics.geometry, optics.transfer.cutoff)
        lost = spread.of_sampling(enough, limit, partial(_passes, optics))
        finer = bandwidth.finer(cells, lost, budget, reach.pixels, knobs)
        if finer == cells:
            break
        del light, coefficients, sample
        cells, scene = finer, again(scene_at, finer)
    samples = math.prod(terms if isinstance(light, painted.Known) else scene.shape)
    return Seen(
        scene=scene,
        coefficients=coefficients,
        filter=filter,
        sample=sample,
        alone=sample,
        looked=looked,
        enough=enough,
        lost=lost,
        budget=budget,
        spare=spare,
        samples=samples,
        held=held,
        peak=highest,
    )


def _light(
    optics: Optics, scene: SampledScene, filter: sampling.Filter, room: Room
) -> tuple[painted.Light, tuple[int, int], int]:
    """A scene's planes, the terms of their spectrum that are wanted, and samples held together."""
    mix, knobs = filter.tables.mix, optics.settings
    terms = painted.wanted(scene, filter.x, filter.y)
    rectangles = scene.rectangles(mix)
    held = painted.held(scene, rectangles, len(mix), bool(optics.zones))
    needed = memory.of_looking(filter, held, knobs.float_width // 8, room)
    memory.require(needed, optics.geometry)
    if rectangles is not None:
        return painted.Known(rectangles, scene.shape, knobs.dtype), terms, held
    if held < math.prod(scene.shape) * len(mix):
        alone = scene.samples != "squares"
        light = painted.InTurn(scene, mix, filter, alone, terms, optics.workers, knobs.dtype)
        return light, terms, held
    return painted.Painted(scene.planes(mix, optics.workers)), terms, held


def _budget(
    optics: Optics, filter: sampling.Filter, coefficients: Coefficients, least: bool = False
) -> float:
    """Rms of the signal that may be lost of a spectrum at hand [electrons / s].

    least: whether of full signal nothing is known but the mean.
    """
    full = brightness.least(filter, coefficients, 1 if least else brightness.TERMS)
    return bandwidth.at_hand(optics.settings.tolerance) * min(full, optics.ceiling)


def again(scene_at: SceneAt, cells: int) -> SampledScene:
    """The scene painted with so many cells per pixel pitch."""
    scene = scene_at(cells)
    assert isinstance(scene, SampledScene)
    return scene


def axes(optics: Optics, scene: SampledScene, oversampling: float) -> tuple[Axis, Axis]:
    """Along x and y, followed up to so many pixel Nyquist frequencies."""
    g, cutoff = optics.geometry, optics.transfer.cutoff
    ny, nx = scene.shape
    squares = scene.samples == "squares"

    def axis(samples: int, pitch: float, pixels: int, pixel: float, shift: float) -> Axis:
        first = samples * pitch / 2 + (0.5 - pixels / 2) * pixel + shift
        highest = min(oversampling * 0.5 / pixel, cutoff)
        return Axis(samples, pitch, pixels, pixel, first, squares, highest)

    return (
        axis(nx, scene.pitch_x, g.columns, g.pitch_x * g.sampling_scale, g.collecting_x),
        axis(ny, scene.pitch_y, g.rows, g.pitch_y * g.sampling_scale, g.collecting_y),
    )


def filter_of(
    optics: Optics, scene: SampledScene, tables: Tables, oversampling: float
) -> sampling.Filter:
    """Tables, and all that is separable, up to so many pixel Nyquist frequencies."""
    x, y = axes(optics, scene, oversampling)
    along_x, along_y = np.ones(x.terms), np.ones(y.terms)
    for e in optics.separable:
        along_x *= e.along_x(x.frequencies)
        along_y *= e.along_y(y.frequencies)
    return sampling.Filter(x, y, tables, along_x, along_y)


def _spread(
    optics: Optics, scene: SampledScene, power: tuple[NDArray, NDArray]
) -> bandwidth.Spread:
    """The signal's spectrum, as if all of it lay on the array and none in the margin."""
    frequency, squares = power
    return bandwidth.Spread(frequency, squares * _density(optics, scene))


def _density(optics: Optics, scene: SampledScene) -> float:
    """Area of the scene over that of the array."""
    g = optics.geometry
    area = scene.shape[0] * scene.pitch_y * scene.shape[1] * scene.pitch_x
    return area / (g.sensor_width * g.sensor_height)


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
    width = min(g.collecting_width, g.collecting_height) if optics.separable else 0.0
    return np.asarray(lens / np.hypot(1, np.pi * frequency * per_meter * width))
