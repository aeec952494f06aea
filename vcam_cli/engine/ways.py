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
from vcam_cli.engine import bandwidth, boxes, field, looking, memory, sampling, turns, waves
from vcam_cli.engine.coefficients import Coefficients, PlaneOfRuns
from vcam_cli.engine.layers import Followed, Layer, Layers, Optics
from vcam_cli.engine.looking import Reach, SceneAt, Seen
from vcam_cli.engine.parallel import pieces
from vcam_cli.engine.parseval import Sample
from vcam_cli.engine.room import Room, of_tables, of_zones, table_values
from vcam_cli.engine.settings import Settings
from vcam_cli.engine.transfer import EXACT_ENTRIES, Fineness, entries, mixtures, tabulate
from vcam_cli.scenes.base import SampledScene, WaveScene

Modes = tuple[field.Mode, ...]

FIELD_SHARE = 0.2
"""Part of the tolerance that modes of the field are left out for before the picture is asked: in a
picture all of full contrast and detail of all sizes."""
ROWS = 64
"""That are looked at together."""


def layers(optics: Optics, scene_at: SceneAt) -> tuple[Layers, Followed]:
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
    x, y = looking.axes(optics, scene, 1.0)
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


def cosines(optics: Optics, scene: SampledScene, scene_at: SceneAt) -> tuple[Layers, Followed]:
    """Through the cosine spectrum, as far up as the tolerance asks."""
    g, reach = optics.geometry, looking.reach(optics, scene)
    if scene.is_known:
        scene = looking.again(scene_at, math.ceil(reach.looked))
    seen, modes, room, tabulating = _seen(optics, scene, scene_at, reach)
    chosen, coefficients = seen.chosen(optics)
    modes, changed = _needed(optics, seen, modes)
    together = turns.together(chosen, coefficients, g)
    work = seen.filter, chosen, together, coefficients, seen.held, len(modes), room
    needed = max(tabulating, turns.needed(*work, g, optics.workers))
    memory.require(needed, g)
    tables = chosen.tables
    followed = Followed(
        oversampling=seen.enough,
        lost=seen.lost,
        samples=0 if scene.is_known else seen.samples,
        painted=reach.cells is not None,
        looked=seen.sample.size,
        terms=chosen.terms,
        planes=len(tables.mix),
        # Without one of them the picture may reach further than it does with all of them.
        changes=dict(_changes(optics, seen, changed)),
        modes=len(modes),
        passes=len(tables.parities) + len(modes),
        table_values=table_values(optics.transfer, optics.zones, tables),
        held=seen.held,
        peak=seen.peak,
        by_color=len(together) > 1,
        memory=needed,
    )
    return _filtered(chosen, coefficients, modes, together, optics.workers), followed


def _seen(
    optics: Optics, scene: SampledScene, scene_at: SceneAt, reach: Reach
) -> tuple[Seen, Modes, Room, int]:
    """The scene looked at through tables of all that the lens does.

    Also the modes of its field, what the tables take, and peak memory while they are made [bytes].
    """
    g, zones, exact = optics.geometry, optics.zones, optics.transfer
    fine = _fineness(optics.settings, bandwidth.top(g, reach.looked, exact.cutoff), bool(zones))
    mixing = field.mixtures(exact, zones, fine) if zones else mixtures([exact], fine)
    seen = None
    if reach.cells is None and (exact.plane or zones):
        # Aberrations only weaken a picture: without them it is found for little how far to go.
        radial = tabulate(exact.through(exact.radial), fine, mixing)
        most = replace(radial, values=entries(exact.mixed(mixing[0]).most(), fine))
        seen = looking.look(optics, scene, scene_at, reach, radial, Room(), most)
        fine = replace(fine, top=bandwidth.top(g, seen.enough, exact.cutoff))
    room = of_zones(exact, zones, fine) if zones else of_tables(exact, fine)
    needed = memory.of_tabulating(room, seen.held if seen else 0, optics.settings)
    memory.require(needed, g)
    modes: Modes = ()
    if zones:
        tables, modes = field.tabulate(exact, zones, g, fine, mixing)
    else:
        tables = tabulate(exact, fine, mixing)
    if seen:
        return seen.through(optics, tables), modes, room, needed
    return looking.look(optics, scene, scene_at, reach, tables, room), modes, room, needed


def _fineness(knobs: Settings, top: float, zones: bool) -> Fineness:
    """How fine tables are that go up to a frequency [cycles/m]."""
    most = EXACT_ENTRIES if knobs.float_width == 32 else knobs.table_size
    tolerance = knobs.mixing_tolerance
    if zones:
        tolerance = max(tolerance, FIELD_SHARE * knobs.tolerance)
    return Fineness(top, knobs.table_size, tolerance, most, knobs.plane_steps, knobs.spectral_rank)


def _filtered(
    chosen: sampling.Filter,
    coefficients: Coefficients,
    modes: Modes,
    together: Sequence[range],
    workers: int,
) -> Layers:
    """The light through every filter, colors in their turns."""
    work = [(mode, colors) for mode in (None, *modes) for colors in together]
    while work:
        mode, colors = work.pop(0)
        tables = (chosen.tables if mode is None else mode.tables()).of(colors)
        some = replace(chosen, tables=tables, frugal=len(together) > 1)
        series = some.apply(coefficients, workers)
        if not work:
            del coefficients  # memory for what comes
        values = partial(turns.of_color, series, colors.start)
        del series
        yield Layer(values, None if mode is None else mode.map, colors)
        del values


def _changes(optics: Optics, seen: Seen, modes: float) -> Iterator[tuple[str, float]]:
    """Rms change of the signal by leaving out each transfer, by Parseval's theorem.

    modes: rms that all modes of the field add to the signal.
    """
    sample = seen.sample
    for effect in optics.effects:
        beyond, also = np.zeros(1), 0.0
        if isinstance(effect, RadialTransfer):
            power = seen.alone.without(effect, optics.transfer)
        elif isinstance(effect, SeparableTransfer):
            power = sample.without_separable(effect)
            beyond = seen.beyond(partial(Sample.without_separable, effect=effect))
        elif isinstance(effect, PlaneTransfer):
            power, beyond = sample.without_planes(), seen.beyond(Sample.signal)
        elif isinstance(effect, FieldTransfer):
            power, also = sample.without_field(optics.transfer), modes
            beyond = seen.beyond(Sample.signal)
        else:
            continue
        yield effect.name, math.hypot(seen.rms(optics, power + beyond), also)


def _needed(optics: Optics, seen: Seen, modes: Modes) -> tuple[Modes, float]:
    """Those modes of the field that this picture needs, and the rms that all of them add."""
    squares = np.zeros(len(modes))
    for i, mode in enumerate(modes):
        power = seen.sample.mean_square(mode.tables(rough=True))
        squares[i] = mode.map.mean_square * seen.rms(optics, power) ** 2
    weakest = np.argsort(squares)
    dropped = set(weakest[np.cumsum(squares[weakest]) <= seen.spare**2].tolist())
    kept = tuple(mode for i, mode in enumerate(modes) if i not in dropped)
    return kept, math.sqrt(squares.sum())
