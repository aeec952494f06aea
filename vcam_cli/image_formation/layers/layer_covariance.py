"""Covariance over the aperture of the layers of a scene, sampled as coarsely as their blur allows.

`occlusion.py` has the mathematics, `edge_tiles.py` the parts of the frame that are looked at: what
is opaque all over hides all alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from operator import methodcaller

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import ImageMotion, of_kind
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.layers.edge_tiles import Cells, Painting, tiles_with
from vcam_cli.image_formation.layers.occlusion import aperture_points
from vcam_cli.image_formation.layers.tile_sample import TileSample, all_tiles, telling_tiles
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.parallel import results
from vcam_cli.scenes.layered import LayeredScene

SHARP = 0.1
"""Radius of a blur below which a layer counts as sharp [pixels]."""
FINEST, MOST_VALUES = 8, 1 << 27
"""Cells along each side of a pixel, and values that are held on all of them, at most."""
RINGS = (2, 4, 8)
"""Rings of points in the aperture that are tried."""
FURTHER_RAYS, FURTHER_WAVES = 0.2, 0.6
"""Rms error of a number of rings over what it changed from half as many, as measured on layers of
discs and bars: of rays, and of waves, of which points near the pupil's edge count in part. It is no
less than by what part changes fall from one number of rings to the next."""
SAMPLED = 0.5
"""Error of the covariance by its cells, relative to it, as measured on layers of discs and bars,
over the square of their side. That is counted in the geometric mean of a pixel and the radius of
the sharpest layer, at least a pixel: its light has its detail in the covariance of those before
it, however wide they are."""
DETAIL = 0.1
"""Part of what detail within cells could hide that is taken to be lost: of layers whose detail has
nothing in common hardly any is, of the same mesh twice most."""
NARROWEST = 0.25
"""Width of the strips along edges that have a covariance, at least [pixels]. Where they are
narrower than pixels, they have less of it on coarse cells: that error grows with the inverse root
of their width."""


CONFIDENCE = 2.0
"""Standard errors that are added to what some tiles tell of all."""


@dataclass(frozen=True)
class Hidden:
    """What is known of the covariance."""

    rings: int = 0
    """Rings of points of the aperture over which it was summed; 0 where there was no need to."""
    error: float = 0.0
    """Predicted, rms [e/s]."""
    values: int = 0
    """Values that were moved to where rays see them."""

    @property
    def left_out(self) -> float:
        """What of the error is covariance that was not added, rms [e/s]."""
        return 0.0 if self.rings else self.error


def add_covariance(
    path: OpticalPath, scene: LayeredScene, light: NDArray, edges: NDArray, allowed: float
) -> Hidden:
    """Add what layers out of focus hide of each other to the light of pixels, where it counts.

    Some tiles tell whether it does, and how finely it is to be summed.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    scene : LayeredScene
        The scene.
    light : NDArray
        Light (C, rows, columns) that is changed [e/s].
    edges : NDArray
        What layers may hide of those behind them for some rays alone (rows, columns); 0 where all
        rays see the same [e/s].
    allowed : float
        Error to be reached, rms [e/s].

    Returns
    -------
    Hidden
        By how many rings it was summed, and its error.
    """
    if not _may_hide(path):
        return Hidden()
    g = path.geometry
    pitch = max(g.pitch_x, g.pitch_y)
    widest = _radii(path)
    # Of cells that are powers of two of pixels wide, the coarse ones are means of the fine.
    count = 2 ** math.floor(math.log2(max(widest[1] / pitch, 1)))
    tiles, size = tiles_with(edges > 0, widest[0] / pitch, 2 * count)
    if not tiles:
        return Hidden()
    sample = telling_tiles(tiles, edges)
    cells = Cells.around(g, size, 1, widest[0], 2 * count)
    found = _converged(path, scene, sample, (cells, count), allowed, _Rings(RINGS[:1]))
    values = found.values
    if _moves(path):  # at rest they would hide other light of each other
        return Hidden(0, found.likely_rms, values)
    if sample.drawn:
        grid = found.cells, found.count
        room = math.sqrt(max(allowed**2 - found.likely_square, 0.0))
        if 0 < room < found.error:  # it counts only if its error does
            found = _converged(path, scene, sample, grid, room, _Rings())
            values += found.values
        if found.light and found.likely_rms <= allowed:
            return Hidden(0, found.likely_rms, values)
        per_pixel = round(found.cells.per_pixel)
        closest = Cells.around(g, size, per_pixel, widest[0], 2 * found.count)
        grid, rings = (closest, found.count), found.sufficient_rings(allowed)
        found = _converged(path, scene, all_tiles(tiles, edges.size), grid, allowed, rings)
        values += found.values
    for tile, part in zip(found.sample.tiles, found.light, strict=True):
        light[:, *tile] += part
    np.maximum(light, 0, out=light)
    return Hidden(found.rings, found.error, values)


@dataclass(frozen=True)
class _Rings:
    """Numbers of rings of points of the aperture that are tried."""

    numbers: tuple[int, ...] = RINGS
    error: float = 0.0
    """Error of the last of them, relative to the covariance; 0 where what it changes has to tell
    it."""


@dataclass(frozen=True)
class _Sum:
    """Covariance at the pixels, summed over points of the aperture."""

    sample: TileSample
    """The tiles that have some."""
    light: list[NDArray]
    """(C, rows, columns) of every tile [e/s]."""
    rings: int
    cells: Cells
    """Those that were painted."""
    count: int
    """Painted cells along either side of one of the sum."""
    error: float
    """Predicted rms over the frame [e/s]."""
    values: int
    """Values of layers that were moved to where rays see them."""
    tried: tuple[tuple[int, float], ...] = ()
    """Numbers of rings that were tried, and the error of each [e/s]."""

    def sufficient_rings(self, allowed: float) -> _Rings:
        """Return the rings that suffice for an error [e/s], and what they are likely to err."""
        rms = self.sample.rms(self.light)
        if not rms:
            return _Rings()
        likely = math.sqrt(self.likely_square) / rms
        half = allowed / math.sqrt(2)
        enough = [each for each in self.tried if likely * each[1] <= half]
        number, error = min(enough, default=max(self.tried))
        return _Rings() if number == RINGS[0] else _Rings((number,), likely * error / rms)

    @property
    def likely_square(self) -> float:
        """The most that its mean square over the frame is likely to be [(e/s)^2]."""
        by_chance = CONFIDENCE * self.sample.chance_error(self.light)
        return (1 + by_chance) * self.sample.rms(self.light) ** 2

    @property
    def likely_rms(self) -> float:
        """The most that it is likely to be with its error, rms [e/s]."""
        return math.hypot(math.sqrt(self.likely_square), self.error)


def _converged(
    path: OpticalPath,
    scene: LayeredScene,
    sample: TileSample,
    grid: tuple[Cells, int],
    allowed: float,
    rings: _Rings,
) -> _Sum:
    """Return the covariance of some tiles, on as fine cells and by as many rings as it takes.

    It begins with given cells, so many of which along either side are taken together, and with
    some numbers of rings.
    """
    cells, count = grid
    pitch = max(path.geometry.pitch_x, path.geometry.pitch_y)
    half = allowed / math.sqrt(2)  # of independent errors
    painting = Painting(path, scene, sample.tiles, cells)
    sample = sample.part(painting.places)
    if not painting.batches:
        return _Sum(sample, [], 0, cells, count, 0.0, 0)
    finest = min(FINEST, max(math.isqrt(MOST_VALUES // painting.values), 1))
    found, values = _summed(path, painting, sample, count, half, rings), 0
    while True:
        values += found.values
        side = count * pitch / cells.per_pixel
        by_side = _squared_error(path) * side**2 * sample.rms(found.light)
        by_detail = DETAIL * math.sqrt(sample.share) * painting.unresolved(count)
        lost = math.hypot(by_side, by_detail)
        error = math.hypot(found.error, lost)
        room = math.sqrt(max(allowed**2 - found.error**2, half**2))  # what the rings leave
        is_coarse = lost > room and cells.per_pixel < finest * count
        is_settled = found.error <= half or found.rings == RINGS[-1]
        if error <= allowed or (is_settled and not is_coarse):
            return replace(found, cells=cells, error=error, values=values)
        if is_coarse:
            asked = side / pitch * (0.5 if by_detail > by_side else math.sqrt(room / lost))
            if asked < 1:
                per_pixel = max(math.ceil(1 / asked), round(pitch / side) + 1)
                per_pixel = min(per_pixel, finest)
                cells = Cells.around(path.geometry, cells.pixels, per_pixel, _radii(path)[0], 2)
                painting = Painting(path, scene, sample.tiles, cells)
                sample = sample.part(painting.places)
            count = 2 ** math.floor(math.log2(max(asked, 1)))
        found = _summed(path, painting, sample, count, half, _Rings())


def _moves(path: OpticalPath) -> bool:
    """Return whether layers move while they are exposed."""
    least = SHARP * min(path.geometry.pitch_x, path.geometry.pitch_y)
    every = (motion for optics in path.layers for motion in of_kind(optics.effects, ImageMotion))
    return any(motion.travel > least for motion in every)


def _squared_error(path: OpticalPath) -> float:
    """Return the error of the covariance by its cells, over it and their squared side [1/m2]."""
    pitch = max(path.geometry.pitch_x, path.geometry.pitch_y)
    widest = _radii(path)
    strip = min(max(widest[1] + _period(path), NARROWEST * pitch), pitch)
    return SAMPLED / (max(widest[-1], pitch) * math.sqrt(pitch * strip))


def _may_hide(path: OpticalPath) -> bool:
    """Return whether more than one layer is so far out of focus that rays through it differ."""
    least = SHARP * max(path.geometry.pitch_x, path.geometry.pitch_y)
    widest = _radii(path)
    return len(widest) > 1 and widest[0] >= least and widest[1] + _period(path) >= least


def _radii(path: OpticalPath) -> list[float]:
    """Return the radii of the layers' blurs, the widest first [m]."""
    return sorted((abs(optics.radius) for optics in path.layers), reverse=True)


def _summed(
    path: OpticalPath,
    painting: Painting,
    sample: TileSample,
    count: int,
    allowed: float,
    rings: _Rings,
) -> _Sum:
    """Return the covariance at the pixels by as many rings as it takes, of those given.

    It is that on cells of so many of those that were painted, along either side. Of a sample that
    takes more than the fewest rings it is also told what three quarters of them err.
    """
    period = _period(path)
    further = FURTHER_WAVES if period > 0 else FURTHER_RAYS
    batches = [batch.together(count) for batch in painting.batches]
    cells = painting.cells.together(count)
    light, last, tried, points = [np.zeros((1, 1, 1))] * len(sample.tiles), math.inf, [], 0

    def lacking(number: int) -> list[NDArray]:
        found = results(methodcaller("lacking", cells, number, period), batches, path.workers)
        return [part for parts in found for part in parts]

    def apart(one: list[NDArray], other: list[NDArray]) -> float:
        return sample.rms([a - b for a, b in zip(one, other, strict=True)])

    for number in rings.numbers:
        before, light = light, lacking(number)
        change = apart(light, before)
        error = change * max(further, min(change / last, 1.0) if last > 0 else 0.0)
        last = change
        if rings.error:
            error = rings.error * sample.rms(light)
        tried.append((number, error))
        points += len(list(aperture_points(number)))
        if error <= allowed:
            break
    if sample.drawn and number > RINGS[0]:
        between = 3 * number // 4
        tried.append((between, math.hypot(apart(lacking(between), light), error)))
        points += len(list(aperture_points(between)))
    values = points * sum(batch.values for batch in batches)
    return _Sum(sample, light, number, painting.cells, count, error, values, tuple(tried))


def _period(path: OpticalPath) -> float:
    """Return the period of the lens's cut-off in the scene's mean light; 0 without diffraction."""
    white = path.transfer.weights[-1].sum(axis=0)
    mean = float(np.average(path.transfer.wavelengths, weights=white))
    lens = of_kind(path.layers[0].effects, Diffraction)
    return max((1 / effect.cutoff(mean) for effect in lens), default=0.0)
