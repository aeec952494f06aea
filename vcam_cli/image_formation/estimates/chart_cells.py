"""The cells on which a chart is painted: their error is measured, not guessed.

Cells far finer than what the lens passes fold nothing that counts. Where the whole chart on such
cells is cheap they are taken. Elsewhere its center, its busiest parts and some others are seen
through the lens on finer and finer cells, against a reference whose cells share no factor with any
of them, and the coarsest that keep their share of the tolerance are taken for the whole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.estimates.bandwidth import axes
from vcam_cli.image_formation.estimates.cell_search import CHEAP, CellSearch, CellTrial
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.parallel import product
from vcam_cli.scenes.base import ChartScene
from vcam_cli.scenes.cells import EVEN, uneven_points

CELLS_SHARE = 0.4
"""Part of the tolerance that cells may use."""
BEYOND_CUTOFF = 1.1
"""Cells per pixel pitch over the highest frequency passed [pixel Nyquist], at least."""
FOLDED = 0.04
"""Means over cells fold what edges have beyond the cells' Nyquist frequency: what is left of it is
this part of full signal over the squared ratio of that frequency to the cut-off, about."""
SAFE = 3.0
"""Factor on the cells that this asks for where none are measured: a chart of patches smaller than
the lens resolves leaves twice as much, relative to its own weak signal."""
MOST_OF_SMALL, MOST = 1 << 22, 1 << 26
"""Cells at most, of arrays with fewer pixels than a crop and of others."""
LADDER = (1.1, 1.6, 2.2, 2.7, 3.3, 4.2, 5.3, 6.6, 8.3, 10.4, 13.1, 16.4, 24.2, 32.3, 48.1)
"""Cells per pixel pitch that are tried on crops."""
LIKELY = 2.0
"""Cells per pixel pitch from which on they are tried; fewer, where it seems that they would do."""
OVEREXPOSED = 2.0
"""Cells of charts that fill pixels, at least: fewer end the spectrum within that of the pixels, and
bright light rings into dark pixels that are on none of the crops."""
OVEREXPOSED_SHARE = 0.3
"""Part of that share where light fills pixels: the error of the whole is then that of few pixels,
which hardly any crop shows."""
COPRIME = 1.37
"""Cells of a crop's reference over those that reach the cut-off."""
NEAR = 6.0
"""Cells of a first reference, a third of a pixel and more from those that it judges, which are
enough for most charts; only where they are not is a far finer one painted."""
CROP, SMALLEST_CROP = 48, 12
"""Pixels along a side of a crop, and of the smallest: fewer show too little of a chart."""
CROPPED = 0.07
"""Part of an array's pixels that crops have together, at most, but for the smallest ones."""
FEW_PIXELS = 24**2
"""Pixels of an array up to which none of it is a crop."""
CROP_CELLS, MOST_CROP_CELLS = 320, 480
"""Cells along a side of a crop's reference, and of that of the smallest crops at most."""
BLOCKS, POINTS = 16, 12
"""Parts of a chart along each axis that are compared by contrast, and points along each."""
FEW = 3
"""Crops of the busiest parts, and crops of parts taken evenly."""
FREQUENCIES = 1025
"""Entries of the crops' table over |f|."""


Table = tuple[NDArray, NDArray]
"""Frequencies (n,) [cycles/m], and an OTF there (n,), without unit."""


class ChosenCells(NamedTuple):
    """How finely a chart is painted."""

    per_pixel: float
    """Cells per pixel pitch."""
    error: float = 0.0
    """Rms of the signal on crops of the chart [e/s]; 0 where none were measured."""
    trials: int = 0
    """Times that the crops were painted for it, that of the reference among them."""


def cell_grid(scene: ChartScene, geometry: Geometry, per_pixel: float) -> tuple[int, int]:
    """Return the cells of a chart on which transforms are fast.

    Parameters
    ----------
    scene : ChartScene
        The chart.
    geometry : Geometry
        Geometry of the array.
    per_pixel : float
        Cells per pixel pitch, at least.

    Returns
    -------
    ny, nx : int
        Cells along y and x.
    """
    ny = scene.shape[0] * scene.pitch_y / geometry.pitch_y * per_pixel
    nx = scene.shape[1] * scene.pitch_x / geometry.pitch_x * per_pixel
    fast = [scipy.fft.next_fast_len(max(1, math.ceil(n - 1e-9)), real=True) for n in (ny, nx)]
    return fast[0], fast[1]


def cells_per_pixel(path: OpticalPath, scene: ChartScene, highest: float) -> ChosenCells:
    """Return how finely a chart is painted, and the error that this leaves.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : ChartScene
        The chart.
    highest : float
        Frequency beyond which lens and pixels pass nothing [pixel Nyquist].

    Returns
    -------
    ChosenCells
        Cells per pixel pitch, their error, and the trials that it took.
    """
    if path.settings.oversampling is not None:
        return ChosenCells(path.settings.oversampling)
    asked = highest * max(BEYOND_CUTOFF, math.sqrt(FOLDED / path.settings.tolerance))
    asked *= math.sqrt(_brightest_over_full(path, scene))
    finest = SAFE * asked
    g = path.geometry
    if math.prod(cell_grid(scene, g, finest)) <= CHEAP:
        return ChosenCells(finest)
    whole = math.prod(cell_grid(scene, g, 1.0))
    if g.rows * g.columns <= FEW_PIXELS:  # too few to tell an error from chance
        return ChosenCells(min(finest, math.sqrt(MOST_OF_SMALL / whole)))
    otf = _mean_otf(path, finest)
    most = min(finest, max(1.0, math.sqrt(MOST / whole)))
    far = min(COPRIME * max(asked, LADDER[1]), MOST_CROP_CELLS / SMALLEST_CROP)
    search = None
    for reference in sorted({min(NEAR, far), far}):
        search = _search(path, scene, otf, reference, most, search)
        if search.kept:
            cells, error = search.kept
            return ChosenCells(_with_undivided(path, scene, cells), error, search.trials)
    assert search is not None
    budget, last = search.budget, search.failed or CellTrial(most, search.budget)
    # It falls with the square of the cells, about: faster than is reckoned here.
    enough = min(last.cells * last.error / budget, most) if budget else most
    return ChosenCells(enough, last.error_of(enough, 1.0), search.trials)


def _with_undivided(path: OpticalPath, scene: ChartScene, cells: float) -> float:
    """Return more cells where the chart would paint such wide ones in parts, and gain by more.

    Painting a cell takes as long as transforming it, about.
    """
    finer = max(path.geometry.pitch_x, path.geometry.pitch_y) / scene.chart.undivided
    painted = math.ceil(finer / cells) * cells
    return finer if painted**2 - finer**2 > finer**2 - cells**2 > 0 else cells


def _search(
    path: OpticalPath,
    scene: ChartScene,
    otf: Table,
    reference: float,
    most: float,
    before: CellSearch | None,
) -> CellSearch:
    """Return the search among the cells that a reference of so many judges, and `most` at most.

    One before it found none among fewer cells.
    """
    g, level = path.geometry, path.judged_weights.sum(axis=1)
    crops, edges = _crops(path, scene, reference, level)
    converged = _signals(path, crops, reference, level, otf)
    within = partial(_within, g)
    full = min(float(within(converged).max()), path.ceiling)
    budget = CELLS_SHARE * path.settings.tolerance * full
    failed = before.failed if before else None
    least = failed.cells if failed else 0.0
    if converged.max() > path.ceiling:
        least, budget = max(least, OVEREXPOSED), OVEREXPOSED_SHARE * budget

    def measure(cells: float) -> CellTrial:
        found = _signals(path, crops, cells, level, otf)
        error = _error_that_counts(found, converged, path.ceiling, within(found).size, edges)
        return CellTrial(_crop_grid(crops[0], g, cells)[0] * g.pitch_y / crops[0].pitch_y, error)

    ladder = [c for c in LADDER if least <= c <= min(most, reference / COPRIME)]
    first = next((i for i, c in enumerate(ladder) if c >= LIKELY), len(ladder) - 1)
    search = CellSearch(measure, budget, failed=failed, trials=1 + (before.trials if before else 0))
    search.try_upward(ladder[first:])
    search.try_downward(ladder[:first])
    search.try_between(math.prod(cell_grid(scene, g, 1.0)), max(least, LADDER[0]))
    return search


def _brightest_over_full(path: OpticalPath, scene: ChartScene) -> float:
    """Return the brightest light before a small array over that of its brightest pixel, at least 1.

    What cells fold of an edge is relative to the light there, the tolerance to that of a pixel,
    which may see all of a chart or lie beside a lamp. Of larger arrays crops tell.
    """
    g = path.geometry
    sensor = g.sensor_width, g.sensor_height
    if 2 * math.prod(sensor) > math.prod(scene.extent):
        return 1.0
    level = path.judged_weights.sum(axis=1)[None]
    on_it, around = (
        scene.values_at(*_uneven_points(size), level)[0] for size in (sensor, scene.extent)
    )
    rows, columns = (np.arange(0, 1, 1 / min(n, len(on_it))) for n in (g.rows, g.columns))
    rows, columns = ((starts * len(on_it)).astype(int) for starts in (rows, columns))
    sums = np.add.reduceat(np.add.reduceat(on_it, rows, 0), columns, 1)
    full = float(sums.max()) / on_it.size * len(rows) * len(columns)
    brightest = float(max(on_it.max(), around.max()))
    return max(1.0, brightest / full) if full > 0 else 1.0


def _uneven_points(size: tuple[float, float]) -> tuple[NDArray, NDArray]:
    """Return points (n,) along x and y over a centered rectangle [m]."""
    x, y = (
        uneven_points(length, BLOCKS * POINTS, step)
        for length, step in zip(size, EVEN, strict=True)
    )
    return x, y


def _error_that_counts(
    found: NDArray, converged: NDArray, ceiling: float, pixels: int, edges: float
) -> float:
    """Return the rms of the error of crops (crops, rows, columns) that full pixels do not hide.

    What cells err on is edges, of which the array has so many times as much as the crops, in the
    mean over each.

    Where light is far brighter than what fills a pixel, hardly any error counts; but the few that
    do, below it, are as large as full signal, and a crop has too few pixels to show them. So the
    errors of a crop are also given to its darkest pixels first, from either end. Of an array that
    is smaller than its crops, with fewer `pixels`, the error is that of as many that err most: its
    own may have none by chance, and the many around them would hide theirs.
    """
    full = np.minimum(converged, ceiling)
    errors = np.square(np.minimum(found, ceiling) - full).ravel()
    if pixels == errors.size and converged.max() <= ceiling:
        return math.sqrt(float(errors.mean()) * edges)
    squares = np.sort(errors)[-pixels:].mean()
    if converged.max() > ceiling:
        crops = len(found), -1
        light = np.sort(converged.reshape(crops), axis=1)
        errors = np.sort((found - converged).reshape(crops), axis=1)
        for moved in (errors, errors[:, ::-1]):
            changed = np.clip(light + moved, 0, ceiling) - np.minimum(light, ceiling)
            squares = max(squares, np.square(changed).mean())
    return math.sqrt(float(squares))


def _crop_grid(crop: ChartScene, geometry: Geometry, per_pixel: float) -> tuple[int, int]:
    """Return the cells (ny, nx) of a crop, no whole number of them a pixel.

    Those would lie in it as its photodetectors do, and err less there than on the whole.
    """
    pixels = round(crop.pitch_y / geometry.pitch_y), round(crop.pitch_x / geometry.pitch_x)
    counts = (math.ceil(per_pixel * n - 1e-9) for n in pixels)
    ny, nx = (count + (count % n == 0) for count, n in zip(counts, pixels, strict=True))
    return ny, nx


def _mean_otf(path: OpticalPath, highest: float) -> Table:
    """Return the OTF of the color with most light, its aberrations aside.

    They only weaken detail.
    """
    g = path.geometry
    corner = highest * math.hypot(0.5 / g.pitch_x, 0.5 / g.pitch_y)
    f = np.linspace(0, min(path.transfer.cutoff, corner), FREQUENCIES)
    weights = path.judged_weights.sum(axis=0)
    otf = (weights / (weights.sum() or 1.0)) @ path.transfer.otf_radial(f)
    return f, otf


def _crops(
    path: OpticalPath, scene: ChartScene, cells: float, level: NDArray
) -> tuple[list[ChartScene], float]:
    """Return places of a chart on which cells are tried, and the array's edges over theirs.

    `cells` are those of the reference, per pixel pitch. Edges are told by the mean square of the
    steps between points: an edge has as much of it as its length.
    """
    g = path.geometry
    most = math.sqrt(CROPPED / (1 + 2 * FEW) * g.rows * g.columns)
    side = int(np.clip(min(CROP_CELLS / cells, most), SMALLEST_CROP, CROP))
    size = side * g.pitch_x, side * g.pitch_y
    sensor = g.sensor_width, g.sensor_height
    half = np.maximum(np.subtract(sensor, size) / 2, 0)  # a small array is amid each
    even = 2 * (np.arange(1, FEW + 1)[:, None] * EVEN % 1) - 1
    busy, steps = _busiest(path, scene, level)
    places = np.clip(np.concatenate([[(0, 0)], even * half, busy]), -half, half)
    different = dict.fromkeys((float(x), float(y)) for x, y in places)
    on_crops = np.mean([_steps_on(steps, place, size, sensor) for place in different])
    edges = float(steps.mean() / on_crops) if on_crops else 1.0
    return [scene.crop(place, *size) for place in different], edges


def _steps_on(
    steps: NDArray, place: tuple[float, float], size: tuple[float, float], sensor: tuple
) -> float:
    """Return the mean of what blocks (rows, columns) have, over those that a crop meets."""
    columns, rows = (
        slice(
            max(0, math.floor(((at - length / 2) / whole + 0.5) * BLOCKS + 1e-9)),
            max(1, math.ceil(((at + length / 2) / whole + 0.5) * BLOCKS - 1e-9)),
        )
        for at, length, whole in zip(place, size, sensor, strict=True)
    )
    return float(steps[rows, columns].mean())


def _within(g: Geometry, signals: NDArray) -> NDArray:
    """Return the pixels of crops (crops, rows, columns) that are those of the array."""
    rows, columns = (
        slice((side - n) // 2, (side + n + 1) // 2)
        for side, n in zip(
            signals.shape[1:], np.minimum(signals.shape[1:], (g.rows, g.columns)), strict=True
        )
    )
    return signals[:, rows, columns]


def _busiest(path: OpticalPath, scene: ChartScene, level: NDArray) -> tuple[NDArray, NDArray]:
    """Return the centers (n, 2) of the parts of most contrast, with and without a ceiling [m].

    They come from values at points. With them come the mean squares of the steps between these, in
    every block (BLOCKS, BLOCKS).
    """
    g = path.geometry
    x, y = _uneven_points((g.sensor_width, g.sensor_height))
    light = scene.values_at(x, y, level[None])[0].reshape(BLOCKS, POINTS, BLOCKS, POINTS)
    contrasts = [light.var(axis=(1, 3)).ravel()]
    if float(light.max()) > path.ceiling:
        contrasts.append(np.minimum(light, path.ceiling).var(axis=(1, 3)).ravel())
    order = np.concatenate([np.argsort(contrast)[::-1][:FEW] for contrast in contrasts])
    centers = (np.stack([order % BLOCKS, order // BLOCKS], axis=1) + 0.5) / BLOCKS - 0.5
    steps = [np.square(np.diff(light, axis=axis)).mean(axis=(1, 3)) for axis in (1, 3)]
    return np.asarray(centers * (g.sensor_width, g.sensor_height)), steps[0] + steps[1]


def _signals(
    path: OpticalPath, crops: Sequence[ChartScene], cells: float, level: NDArray, otf: Table
) -> NDArray:
    """Return the signals (crops, rows, columns) of crops of one size [e/s].

    They are mirrored at their borders. `level` (K,) is the signal of the scene's components.
    """
    g, first = path.geometry, crops[0]
    rows, columns = round(first.pitch_y / g.pitch_y), round(first.pitch_x / g.pitch_x)
    small = replace(path, geometry=replace(g, rows=rows, columns=columns))
    grid = _crop_grid(first, g, cells)
    x, y = axes(small, first.with_cells(grid), cells)
    transfer = np.interp(np.hypot(x.frequencies, y.frequencies[:, None]), *otf, right=0.0)
    for effect in path.separable:
        transfer *= np.outer(effect.along_y(y.frequencies), effect.along_x(x.frequencies))
    along_y, along_x = _waves(y), _waves(x).T
    signals = []
    for crop in crops:
        light = crop.with_cells(grid).planes(level[None])[0].astype(np.float64)
        light = scipy.fft.dctn(light, type=2)[: y.terms, : x.terms] * transfer
        signals.append(product(product(along_y, light), along_x))
    return np.array(signals)


def _waves(axis: Axis) -> NDArray:
    """Return every term of an axis at every photodetector: (pixels, terms)."""
    k = np.arange(axis.terms)
    place = (axis.first + np.arange(axis.pixels) * axis.pixel_pitch) / axis.length
    return np.cos(np.pi * np.outer(place, k)) * (axis.weights * np.where(k > 0, 2, 1))
