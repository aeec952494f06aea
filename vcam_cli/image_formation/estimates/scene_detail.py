"""How much detail a scene has at which frequencies, before it is transformed.

A scene without detail needs no lens and no transform, and one with little of it shows little of
what blurs it. A wave's power is known. Of other scenes a survey of points tells where the light
changes; there, and by chance elsewhere, tiles of points are transformed. How probable a tile was is
allowed for, so that the mean over the tiles is that over the array (`chosen_places.py`). Points lie
at random places of their cells: detail finer than the cells counts as noise, which never hides
(R. L. Cook, ACM Trans. Graphics 5, 1986).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.effects.base import Effect
from vcam_cli.image_formation.estimates.chosen_places import chosen_places
from vcam_cli.image_formation.estimates.edge_detail import (
    EdgePower,
    PixelLattice,
    isolated_edges,
    rectangles_power,
    straight_edge_power,
)
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.scenes.base import ChartScene, Scene, WaveScene
from vcam_cli.scenes.cells import EVEN, uneven_points

TILE = 32
"""Pixels along a side of a tile, at most."""
POINTS_PER_PIXEL = 2
"""Along each axis of a tile: up to the second Nyquist frequency."""
OVERLAP = 1.25
"""Length of the tiles that cover an array over that of its parts, at least: an edge between two
parts lies within a tile, and never at the ends of both."""
TILES = 16
"""Tiles that are transformed, at most."""
ASKED = (1, 2, 4, 8)
"""Numbers of tiles after which it is asked whether they tell enough."""
MOST_PLACES, FEW_PLACES = 24, 8
"""Parts of the array along each axis, at most, each of which may be a tile's place; and those where
the detail is known, and the survey serves gains alone, which change slowly."""
SURVEY = 4
"""Points along each axis of such a part."""
ANYWHERE = 0.1
"""Share of the tiles whose places do not depend on the survey."""
BLOCK = 8
"""Points along each side of the blocks in whose means the brightest light is sought."""
UNRESOLVED = 0.75
"""Part of the highest frequency from which on a tile's power is taken for noise of its points."""
REACH = 12.0
"""Reach of a lens in inverse cut-off frequencies, beyond which little light goes."""
APART = 4.0
"""Distance of edges in inverse cut-off frequencies, from which on each has a blur of its own."""
ENOUGH = 4.0
"""Shorter side of an array over the reach of its lens, from which on its own light tells what the
lens does to it."""
CONFIDENCE = 2.0
"""Standard errors that are added to what the tiles tell."""
WAVELENGTHS = 8
"""Wavelengths over which a transfer function is averaged."""


@dataclass(frozen=True)
class SceneDetail:
    """A scene before the array, in the color of most light."""

    fx: NDArray
    """Spatial frequencies along x (n,) [cycles/m]."""
    fy: NDArray
    """Spatial frequencies along y (m,) [cycles/m]."""
    power: NDArray
    """Mean squares of the signal without its constant (m, n) [(electrons / s)^2]."""
    unresolved: float
    """Mean square of detail whose frequency is not known [(electrons / s)^2]."""
    error: float
    """Standard error of the whole power, relative to it; 0 where nothing is left to chance."""
    x: NDArray
    """Columns of the survey, from the array's center [m]."""
    y: NDArray
    """Rows of the survey, from the array's center [m]."""
    light: NDArray
    """Signal at the survey's points (rows, columns) [electrons / s]."""
    brightest: float
    """Bound from below on the largest signal [electrons / s]."""

    @property
    def even(self) -> bool:
        """Whether the light is the same all over."""
        return not self.power.any() and not self.unresolved


Settled = Callable[[SceneDetail], bool]
"""Whether the detail that some tiles have, as if all others had none, is enough to know."""


def scene_detail(
    path: OpticalPath, scene: Scene, settled: Settled = lambda _: False
) -> SceneDetail | None:
    """Return the detail of a scene before the array.

    Parameters
    ----------
    path : OpticalPath
        Lens and pixels, whose colors tell how much each of the scene's components counts.
    scene : Scene
        Scene before the lens.
    settled : callable, optional
        Whether what some tiles tell is enough; by default all of them are asked.

    Returns
    -------
    SceneDetail or None
        None where a lens blurs so widely that the light beside the array counts as much as its own.
    """
    level = path.transfer.level
    level = level[:, int(level.sum(axis=0).argmax())]
    if isinstance(scene, WaveScene):
        return _wave_detail(path, scene, level)
    if isinstance(scene, ChartScene) and _is_even(scene):
        return _surveyed(path, scene, level, (1, 1))
    g = path.geometry
    reach = max((e.reach for e in path.effects), default=0.0)
    if min(g.sensor_width, g.sensor_height) < ENOUGH * (REACH / path.transfer.cutoff + reach):
        return None
    if isinstance(scene, ChartScene):
        edges = _edge_power(path, scene, level)
        if edges is not None:
            return _edge_detail(path, scene, level, edges)
    return _tile_detail(path, scene, level, settled)


def _is_even(scene: ChartScene) -> bool:
    half_width = scene.pitch_x * scene.shape[1] / 2
    return scene.chart.highest_frequency(half_width) == 0


def _surveyed(
    path: OpticalPath, scene: Scene, level: NDArray, places: Sequence[int]
) -> SceneDetail:
    """Return the light at a few points, as if it were even."""
    g = path.geometry
    sides = g.sensor_height, g.sensor_width
    y, x = (
        uneven_points(length, count * SURVEY, step)
        for length, count, step in zip(sides, places, EVEN, strict=True)
    )
    light = _light_at(scene, x, y, level)
    none, nothing = np.zeros(1), np.zeros((1, 1))
    brightest = min(float(light.mean()), path.ceiling)
    return SceneDetail(none, none, nothing, 0.0, 0.0, x, y, light, brightest)


def _light_at(scene: Scene, x: NDArray, y: NDArray, level: NDArray) -> NDArray:
    """Return the signal of a scene at points, whose products stay far from where floats end."""
    largest = float(np.abs(level).max()) or 1.0
    return scene.values_at(x, y, level[None] / largest)[0].astype(np.float64) * largest


def _places(path: OpticalPath, most: int) -> list[int]:
    """Return the parts of the array along y and x of which each is surveyed."""
    g = path.geometry
    return [min(max(1, round(n / TILE)), most) for n in (g.rows, g.columns)]


def _edge_power(path: OpticalPath, scene: ChartScene, level: NDArray) -> EdgePower | None:
    """Return the waves of edges that lie further apart than what blurs them; else None."""
    g, widest = path.geometry, max((e.reach for e in path.effects), default=0.0)
    apart = max(APART / path.transfer.cutoff + 2 * widest, g.pitch_x, g.pitch_y)
    cutoff = min(path.transfer.cutoff, 1 / min(g.pitch_x, g.pitch_y))
    ends = min(cutoff, 1 / max(g.pitch_x, g.pitch_y, widest)), cutoff
    size = g.sensor_width, g.sensor_height
    pixels = PixelLattice((g.pitch_x, g.pitch_y), size, path.transfer.cutoff)
    across = scene.chart.across_edge()
    if across is not None:
        x, y = (np.array([-part, part]) * apart for part in across)
        signals = np.diag(_light_at(scene, x, y, level))
        return straight_edge_power(across, signals, pixels, *ends)
    rectangles = isolated_edges(scene, level, size, apart)
    return None if rectangles is None else rectangles_power(rectangles, pixels, *ends)


def _edge_detail(
    path: OpticalPath, scene: ChartScene, level: NDArray, edges: EdgePower
) -> SceneDetail:
    """Return the detail of even light between edges."""
    return replace(
        _surveyed(path, scene, level, _places(path, FEW_PLACES)),
        fx=edges.fx,
        fy=edges.fy,
        power=edges.power,
        unresolved=edges.beyond,
        brightest=min(edges.brightest, path.ceiling),
    )


def _wave_detail(path: OpticalPath, scene: WaveScene, level: NDArray) -> SceneDetail:
    """Return waves at their pairs of frequencies, with half of their squared amplitudes."""
    g = path.geometry
    shortest = min(g.columns, g.rows)
    places = _places(path, FEW_PLACES) if shortest > 1 else (1, 1)
    even = _surveyed(path, scene, level, places)
    waves = [wave for wave in scene.waves if wave.fx or wave.fy]
    amplitudes = np.array([level @ np.asarray(wave.weights) for wave in waves])
    return replace(
        even,
        fx=np.array([wave.fx for wave in waves]),
        fy=np.array([wave.fy for wave in waves]),
        power=np.diag(np.square(amplitudes) / 2),
    )


def _tile_detail(path: OpticalPath, scene: Scene, level: NDArray, settled: Settled) -> SceneDetail:
    """Return the power of tiles of points, each as much as it stands for.

    Those of most contrast come first: often they tell enough.
    """
    g, rng = path.geometry, np.random.default_rng(0)
    size, pitch = np.array([g.rows, g.columns]), np.array([g.pitch_y, g.pitch_x])
    # Few tiles cover all; the others lie anywhere around their places, to see what is between.
    counts = np.where(size > TILE, np.ceil(size * OVERLAP / TILE), 1).astype(int)
    side = np.minimum(TILE, size)
    covers = counts.prod() <= TILES
    if not covers:
        counts = np.array(_places(path, MOST_PLACES))
        side = np.minimum(TILE, size // counts)
    points, length = POINTS_PER_PIXEL * side, side * pitch
    even = _surveyed(path, scene, level, counts.tolist())
    parts = even.light.reshape(counts[0], SURVEY, counts[1], SURVEY)
    places, shares = _tile_places(_contrast(parts), rng)

    def light_of_tile(place: int) -> NDArray:
        index = np.array(divmod(place, counts[1]))
        place_in_part = 0.5 if covers else rng.random(2)
        start = ((index + place_in_part) / counts - 0.5) * size * pitch - length / 2
        y, x = (
            first + (np.arange(n) + rng.random(n)) * (whole / n)
            for first, whole, n in zip(start, length, points, strict=True)
        )
        return _light_at(scene, x, y, level)

    brightest = float(parts.mean(axis=(1, 3)).max())
    power, sums = np.zeros(points), np.zeros(0)
    for first, last in pairwise((0, *(n for n in ASKED if n < len(places)), len(places))):
        values = np.array([light_of_tile(int(place)) for place in places[first:last]])
        brightest = max(brightest, _brightest_block(values))
        squares = np.square(scipy.fft.dctn(values, type=2, norm="ortho", axes=(1, 2)))
        squares *= shares[first:last, None, None] / points.prod()
        squares[:, 0, 0] = 0
        power += squares.sum(axis=0)
        sums = np.append(sums, squares.sum(axis=(1, 2)))
        detail = replace(
            _with_tiles(even, power, sums, length), brightest=min(brightest, path.ceiling)
        )
        if last < len(places) and settled(detail):
            break
    return detail


def _with_tiles(even: SceneDetail, power: NDArray, sums: NDArray, length: NDArray) -> SceneDetail:
    """Return a scene's detail with the mean squares of its tiles, of so much length [m].

    `power` are those of every frequency in all tiles, `sums` of all frequencies in every tile.
    """
    whole = float(sums.sum())
    error = float(sums.std()) * math.sqrt(len(sums)) / whole if whole else 0.0
    top = [math.floor(UNRESOLVED * n) for n in power.shape]
    noise = float(power[top[0] :, top[1] :].mean())
    fy, fx = (np.arange(n) / (2 * side) for n, side in zip(power.shape, length, strict=True))
    return replace(
        even,
        fx=fx,
        fy=fy,
        power=np.maximum(power - noise, 0),
        unresolved=noise * power.size,
        error=error,
    )


def _contrast(light: NDArray) -> NDArray:
    """Return the contrast of every part of the array in itself and to its neighbors.

    Of surveyed points (parts, points, parts, points): (parts, parts).
    """
    mean = light.mean(axis=(1, 3))
    steps = [np.abs(np.diff(mean, axis=axis, append=mean.take([-1], axis))) for axis in (0, 1)]
    return np.asarray(light.std(axis=(1, 3)) + sum(steps))


def _tile_places(contrast: NDArray, rng: np.random.Generator) -> tuple[NDArray, NDArray]:
    """Return the parts of the array that get a tile, and the share that each stands for.

    All of them where they are few; else the more often the more contrast they have.
    """
    flat = contrast.ravel()
    if flat.size <= TILES:
        return np.argsort(-flat), np.full(flat.size, 1 / flat.size)
    return chosen_places(flat, TILES, ANYWHERE, rng)


def _brightest_block(values: NDArray) -> float:
    """Return the largest mean over blocks of points: light that no blur takes away.

    Of tiles (tiles, rows, columns).
    """
    n = min(BLOCK, *values.shape[1:])
    rows, columns = (size // n for size in values.shape[1:])
    blocks = values[:, : rows * n, : columns * n].reshape(-1, rows, n, columns, n)
    return float(blocks.mean(axis=(2, 4)).max())


def transfer_functions(path: OpticalPath, detail: SceneDetail) -> dict[Effect, NDArray]:
    """Return the transfer function of every blur at the frequencies of a scene's detail.

    Parameters
    ----------
    path : OpticalPath
        Lens and pixels.
    detail : SceneDetail
        Detail of the scene before them.

    Returns
    -------
    dict
        Effect -> transfer function (m, n), without unit; effects that blur nothing are missing.
        Where it changes over the field, one that loses as much as all places in the mean.
    """
    if detail.even:
        return {}
    spectrum = _spectrum(path)
    found = ((e, e.mean_transfer(detail.fx, detail.fy, spectrum)) for e in path.effects)
    return {effect: function for effect, function in found if function is not None}


def change_by_omission(
    detail: SceneDetail, functions: Mapping[Effect, NDArray], omitted: Collection[Effect]
) -> float:
    """Return the rms change of the signal by leaving out transfer functions together.

    Standard errors of the tiles are added.

    Parameters
    ----------
    detail : SceneDetail
        Detail of the scene.
    functions : mapping
        Transfer functions of all blurs, as of `transfer_functions`.
    omitted : collection of Effect
        Effects that are left out; those that blur nothing change nothing here.

    Returns
    -------
    float
        Rms change in the color of most light [electrons / s].
    """
    kept = lost = np.ones(detail.power.shape)
    for effect, function in functions.items():
        if effect in omitted:
            lost = lost * function
        else:
            kept = kept * np.abs(function)
    changed = np.square(kept * np.abs(1 - lost))
    squares = float((detail.power * changed).sum()) + detail.unresolved * float(changed.max())
    return math.sqrt(squares * (1 + CONFIDENCE * detail.error))


def _spectrum(path: OpticalPath) -> list[tuple[float, float]]:
    """Return some wavelengths [m], and their shares of the light."""
    transfer = path.transfer
    light = np.abs(transfer.weights).sum(axis=(0, 1)) + np.finfo(float).tiny
    count = min(WAVELENGTHS, len(light))
    starts = np.arange(count) * len(light) // count
    each = np.add.reduceat(light, starts)
    means = np.add.reduceat(light * transfer.wavelengths, starts) / each
    return list(zip(means.tolist(), (each / each.sum()).tolist(), strict=True))
