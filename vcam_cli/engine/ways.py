"""Three ways from a scene to its pixels' signal; each scene takes the one that suits it.

- A scene known as waves: each keeps its shape, its transfer is a number per color. Exact.
- A picture of uniform squares, or a chart of even rectangles, without any optical blur: means over
  boxes. Exact.
- Everything else: through the cosine spectrum, as far up as the tolerance asks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import (
    FieldTransfer,
    PlaneTransfer,
    RadialTransfer,
    SeparableTransfer,
)
from vcam_cli.engine import (
    bandwidth,
    boxes,
    field,
    memory,
    painted,
    parseval,
    sampling,
    turns,
    waves,
)
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import Coefficients, OfRuns, PlaneOfRuns
from vcam_cli.engine.layers import Followed, Layer, Layers, Optics
from vcam_cli.engine.parallel import pieces
from vcam_cli.engine.room import of_tables, of_zones, table_values
from vcam_cli.engine.transfer import EXACT_ENTRIES, Fineness, Tables, tabulate
from vcam_cli.scenes.base import SampledScene, WaveScene

FIELD_SHARE = 0.2
"""Part of the tolerance that modes of the field are left out for before the picture is asked: in a
picture all of full contrast and detail of all sizes."""
SINGLE = 5e-7
"""Error of transforms of 32-bit numbers, relative to the brightest sample."""
ROWS = 64
"""That are looked at together."""


def layers(
    optics: Optics, scene_at: Callable[[int], WaveScene | SampledScene]
) -> tuple[Layers, Followed]:
    """The light at the photodetectors; and what the scene asked for."""
    scene = scene_at(bandwidth.first_guess(optics.geometry, optics.settings))
    if isinstance(scene, WaveScene):
        return waves.layers(optics, scene)
    blurred = optics.transfer.effects or optics.field
    if not blurred and (scene.samples == "squares" or scene.is_known):
        return overlaps(optics, scene)
    return cosines(optics, scene, scene_at)


def overlaps(optics: Optics, scene: SampledScene) -> tuple[Layers, Followed]:
    """Means over the photodetectors' boxes; points where the aperture is switched off."""
    g = optics.geometry
    over, needed = _over(optics, scene)
    points = over(0.0, 0.0)
    if not optics.separable:
        return iter([Layer(lambda color, s: points[color][s])]), Followed(memory=needed)
    means = over(g.collecting_width, g.collecting_height)
    change = 0.0
    for a, b in zip(means, points, strict=True):
        squares = [np.square(a[s] - b[s]).sum(dtype=np.float64) for s in pieces(g.rows, ROWS)]
        change = max(change, math.sqrt(math.fsum(squares) / (g.rows * g.columns)))
    changes = {e.name: change for e in optics.separable}
    followed = Followed(changes=changes, memory=needed)
    return iter([Layer(lambda color, s: means[color][s])]), followed


def _over(
    optics: Optics, scene: SampledScene
) -> tuple[Callable[[float, float], Sequence[NDArray | PlaneOfRuns]], int]:
    """From the size of boxes to the means of every color over them; and memory [bytes]."""
    g, level = optics.geometry, optics.transfer.level.T
    x, y = _axes(optics, scene, 1.0)
    light = scene.rectangles(level)
    if light is not None:
        exact, dtype = partial(boxes.of_rectangles, light, x, y), optics.settings.dtype
        needed = memory.of_overlaps(light, g, optics.settings)
        memory.require(needed, g)
        return lambda width, height: list(exact(width, height, dtype)), needed
    needed = memory.of_boxes(scene, len(optics.mosaic.colors), g, optics.settings)
    memory.require(needed, g)
    planes = scene.planes(level, optics.workers)
    size = x, y
    return lambda *box: [boxes.of_samples(plane, *size, *box) for plane in planes], needed


def cosines(
    optics: Optics, scene: SampledScene, scene_at: Callable[[int], WaveScene | SampledScene]
) -> tuple[Layers, Followed]:
    """Through the cosine spectrum, as far up as the tolerance asks."""
    knobs, g, cutoff = optics.settings, optics.geometry, optics.transfer.cutoff
    oversampling = bandwidth.first_guess(g, knobs)
    # A spectrum that is at hand goes as far as the lens; other charts have to be painted finer.
    picture, known = scene.samples == "squares", scene.is_known
    at_hand = picture or known
    pixels = g.rows * g.columns if picture else scene.shape[0] * scene.shape[1] / oversampling**2
    widest = min(bandwidth.most(pixels, knobs), bandwidth.limit(g, cutoff))
    # What is known costs nothing to look at, where no tables over fx and fy are needed for it.
    free = known and not optics.transfer.plane and optics.field is None
    far = max(widest, min(bandwidth.KNOWN, bandwidth.LOOKED / g.columns))
    reach = min(far, bandwidth.limit(g, cutoff)) if free else widest
    if known:
        oversampling, scene = _again(scene_at, math.ceil(reach))
    top = bandwidth.top(g, reach, cutoff)
    most = EXACT_ENTRIES if knobs.float_width == 32 else knobs.table_size
    steps, rank = knobs.plane_steps, knobs.spectral_rank
    fine = Fineness(top, knobs.table_size, knobs.mixing_tolerance, most, steps, rank)
    modes: tuple[field.Mode, ...] = ()
    zones = optics.zones
    room = of_zones(optics.transfer, zones, fine) if zones else of_tables(optics.transfer, fine)
    memory.require(memory.BASE + room.most, g)
    if zones:
        fine = replace(fine, tolerance=max(fine.tolerance, FIELD_SHARE * knobs.tolerance))
        tables, modes = field.tabulate(optics.transfer, zones, g, fine)
    else:
        tables = tabulate(optics.transfer, fine)
    highest = 0.0
    while True:
        reach = reach if at_hand else float(oversampling)
        terms = painted.wanted(scene, *_axes(optics, scene, reach))
        rectangles = scene.rectangles(tables.mix)
        samples = math.prod(terms if rectangles is not None else scene.shape)
        held = painted.held(scene, rectangles, len(tables.mix), bool(zones))
        looked = _filter(optics, scene, tables, reach)
        needed = memory.of_looking(looked, held, knobs.float_width // 8, room)
        memory.require(needed, g)
        light: painted.Known | painted.Painted | painted.InTurn
        if rectangles is not None:
            light = painted.Known(rectangles, scene.shape, knobs.dtype)
        elif held < samples * len(tables.mix):
            light = painted.InTurn(
                scene, tables.mix, looked, not picture, terms, optics.workers, knobs.dtype
            )
        else:
            light = painted.Painted(scene.planes(tables.mix, optics.workers))
        peak = light.peak(tables)
        highest = max(highest, peak)
        budget = bandwidth.SHARE * knobs.tolerance * min(peak, optics.ceiling)
        if light.brightest(tables) * SINGLE > budget:
            light = light.doubled()
        coefficients = light.spectrum(optics.workers, terms)
        sample = parseval.Sample(looked, coefficients)
        spread = _spread(optics, scene, sample)
        if at_hand:
            enough = min(max(spread.enough(budget), bandwidth.least(knobs)), widest)
            lost = spread.beyond(enough)
            break
        enough = reach
        lost = spread.of_sampling(enough, bandwidth.limit(g, cutoff), partial(_passes, optics))
        finer = bandwidth.finer(oversampling, lost, budget, pixels, knobs)
        if finer == oversampling:
            break
        del light, coefficients, sample
        oversampling, scene = _again(scene_at, finer)
    chosen = looked if enough == reach else _filter(optics, scene, tables, enough)
    if isinstance(coefficients, OfRuns):
        coefficients = coefficients.first(chosen.y.terms, chosen.x.terms)
    modes, squares = _needed(optics, scene, sample, modes, budget)
    # Without one of them the picture may reach further than it does with all of them.
    changes = dict(_changes(optics, scene, sample, squares))
    together = turns.together(chosen, coefficients, g)
    needed = turns.needed(
        looked, chosen, together, coefficients, held, len(modes), room, g, optics.workers
    )
    memory.require(needed, g)
    followed = Followed(
        oversampling=enough,
        lost=lost,
        samples=0 if known else samples,
        painted=not at_hand,
        looked=sample.size,
        terms=chosen.terms,
        planes=len(tables.mix),
        changes=changes,
        modes=len(modes),
        passes=len(tables.parities) + len(modes),
        table_values=table_values(optics.transfer, zones, tables),
        held=held,
        peak=highest,
        by_color=len(together) > 1,
        memory=needed,
    )
    del light

    def each(coefficients: Coefficients) -> Layers:
        work = [(mode, colors) for mode in (None, *modes) for colors in together]
        while work:
            mode, colors = work.pop(0)
            tables = (chosen.tables if mode is None else mode.tables()).of(colors)
            some = replace(chosen, tables=tables, frugal=len(together) > 1)
            series = some.apply(coefficients, optics.workers)
            if not work:
                del coefficients  # memory for what comes
            values = partial(turns.of_color, series, colors.start)
            del series
            yield Layer(values, None if mode is None else mode.map, colors)
            del values

    return each(coefficients), followed


def _again(
    scene_at: Callable[[int], WaveScene | SampledScene], oversampling: int
) -> tuple[int, SampledScene]:
    """The oversampling, and the scene painted so."""
    scene = scene_at(oversampling)
    assert isinstance(scene, SampledScene)
    return oversampling, scene


def _axes(optics: Optics, scene: SampledScene, oversampling: float) -> tuple[Axis, Axis]:
    g, cutoff = optics.geometry, optics.transfer.cutoff
    ny, nx = scene.shape
    squares = scene.samples == "squares"

    def axis(samples: int, pitch: float, pixels: int, pixel: float, shift: float) -> Axis:
        first = samples * pitch / 2 + (0.5 - pixels / 2) * pixel + shift
        bandwidth = min(oversampling * 0.5 / pixel, cutoff)
        return Axis(samples, pitch, pixels, pixel, first, squares, bandwidth)

    return (
        axis(nx, scene.pitch_x, g.columns, g.pitch_x * g.sampling_scale, g.collecting_x),
        axis(ny, scene.pitch_y, g.rows, g.pitch_y * g.sampling_scale, g.collecting_y),
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


def _spread(optics: Optics, scene: SampledScene, sample: parseval.Sample) -> bandwidth.Spread:
    """The signal's spectrum, as if all of it lay on the array and none in the margin."""
    frequency, power = sample.power()
    return bandwidth.Spread(frequency, power * _density(optics, scene))


def _density(optics: Optics, scene: SampledScene) -> float:
    """Area of the scene over that of the array."""
    g = optics.geometry
    area = scene.shape[0] * scene.pitch_y * scene.shape[1] * scene.pitch_x
    return area / (g.sensor_width * g.sensor_height)


def _changes(
    optics: Optics,
    scene: SampledScene,
    sample: parseval.Sample,
    modes: float,
) -> Iterator[tuple[str, float]]:
    """Rms change of the signal by leaving out each transfer, by Parseval's theorem.

    As if all of it lay on the array and none in the margin: an upper bound. modes: mean square
    that all modes of the field add to the signal.
    """
    density = _density(optics, scene)
    for effect in optics.effects:
        if isinstance(effect, RadialTransfer):
            power = sample.without(effect, optics.transfer)
        elif isinstance(effect, SeparableTransfer):
            power = sample.without_separable(effect)
        elif isinstance(effect, PlaneTransfer):
            power = sample.without_planes()
        elif isinstance(effect, FieldTransfer):
            power = sample.without_field(optics.transfer)
        else:
            continue
        square = density * power.max()
        square += modes if isinstance(effect, FieldTransfer) else 0.0
        yield effect.name, float(np.sqrt(square))


def _needed(
    optics: Optics,
    scene: SampledScene,
    sample: parseval.Sample,
    modes: tuple[field.Mode, ...],
    budget: float,
) -> tuple[tuple[field.Mode, ...], float]:
    """Those modes of the field that this picture needs, and the mean square that all of them add.

    budget: rms that may be lost with the others [electrons / s]
    """
    squares = np.zeros(len(modes))
    for i, mode in enumerate(modes):
        power = sample.mean_square(mode.tables(rough=True))
        squares[i] = _density(optics, scene) * mode.map.mean_square * power.max()
    weakest = np.argsort(squares)
    dropped = set(weakest[np.cumsum(squares[weakest]) <= budget**2].tolist())
    kept = tuple(mode for i, mode in enumerate(modes) if i not in dropped)
    return kept, float(squares.sum())


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
