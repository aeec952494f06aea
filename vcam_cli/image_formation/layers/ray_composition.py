"""Layers of a picture with depth, composed ray by ray: what their means over the aperture lack.

The rays through one point u of the aperture see each layer sharp, displaced by its blur's radius
times u. Composed so and averaged over u, layers hide each other exactly; composed of their means
they do not. The difference is as smooth as the layers out of focus are blurred, so it is summed up
on cells about as coarse as that, and only near samples that hide something.

Layers of a scene are summed by `ray_windows.py`: their opacities multiply, and shares of a surface
add up. A slope in 16 layers errs by 0.07 % of full signal here, and by 10.5 % front to back.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import pixel_centers
from vcam_cli.effects.optics.shaped_blur import opening_of
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.parallel import each
from vcam_cli.physics.opening import CIRCLE, Opening
from vcam_cli.records import dataclass
from vcam_cli.scenes.cells import cell_means
from vcam_cli.scenes.depth_scene import DepthScene

SHARP = 0.1
"""Radius of a blur below which a layer counts as sharp [pixels]."""
RAYS = 37
"""Points of the aperture: of 91, the sum is the same to a tenth of the error by the cells."""
SHARE = 0.3
"""Part of the tolerance that the cells may use."""
SAMPLED = 1.4
"""Error of the difference by its cells, relative to it, times the square of the blur's radius over
the cell: as measured on slopes and discs."""
FINEST = 3
"""Cells along a pixel's side, at most."""
FARTHEST = 64
"""Cells over which a point is blurred to one side, at most."""
TILE = 64
"""Cells along the side of what is composed at once."""
LEAST_COVER = 0.05
"""Cover below which nothing is known to be seen."""

Planes = tuple[Array, Array]
"""Light (C, h, w), and cover in the same shape or (h, w)."""


@dataclass(frozen=True)
class RayCorrection:
    """What the composition of means lacks."""

    light: Array | float = 0.0
    """(C, rows, columns) at the pixels [e/s]; 0 where it is nothing."""
    opened: Array | float = 0.0
    """Share (rows, columns) of what is hidden in it, likewise."""
    error: float = 0.0
    """Predicted rms error that its cells leave [e/s]."""
    cell: float = 0.0
    """Side of a cell [m]; 0 where there are none."""
    values: int = 0
    """Values that were moved to where a ray sees them."""


def composed(shown: Iterable[Planes], hidden: Iterable[Planes]) -> Planes:
    """Return the light of layers, the nearest first, and how much of it shows what is hidden.

    Parameters
    ----------
    shown, hidden : iterable
        Light times cover, and cover, of what the picture shows of each layer, and of what goes on
        behind nearer ones.

    Returns
    -------
    light : Array
        Light, in the shape of the layers'.
    opened : Array
        Share of the hidden layers in it, in the shape of the covers.
    """
    total: Array | float = 0.0
    clear: Array | float = 1.0
    for shone, covered in shown:
        total = total + shone * _visible(covered, clear)
        clear = np.maximum(clear - covered, 0)
        del shone, covered  # before the next layer is formed
    behind: list[Array | float] = [0.0, 0.0]
    for layer in hidden:
        behind = [own + plane for own, plane in zip(behind, layer, strict=True)]
        del layer
    light, cover = np.asarray(behind[0]), np.asarray(behind[1])
    visible = _visible(cover, clear)
    opened = np.broadcast_to(cover * visible, np.shape(clear))
    known = np.maximum(1 - clear + opened, LEAST_COVER)
    return np.asarray((total + light * visible) / known), np.asarray(opened)


def _visible(cover: Array, clear: Array | float) -> Array:
    """Return the part of a layer that is seen where so much is not covered yet."""
    return np.where(cover > clear, clear / np.where(cover > 0, cover, 1), 1).astype(cover.dtype)


def ray_correction(path: OpticalPath, scene: DepthScene, full: float) -> RayCorrection:
    """Return what the means of layers over the aperture lack at the pixels.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : DepthScene
        The scene.
    full : float
        Full signal, to which the tolerance is relative [e/s].

    Returns
    -------
    RayCorrection
        The light that is missing.
    """
    behind, radii = scene.cut.hidden, scene.cut.radii
    pitch = max(path.geometry.pitch_x, path.geometry.pitch_y)
    if not len(behind.samples):
        return RayCorrection()
    near, far = (np.abs(scene.cut.radius(at)) for at in (behind.samples, behind.sources))
    blur = float(np.sqrt(np.square(np.minimum(near, far)).mean()))
    if blur < SHARP * pitch:
        return RayCorrection()
    allowed = SHARE * path.settings.tolerance * full
    light = scene.flat.planes(path.transfer.level.T, path.workers)

    def on_cells(width: float) -> _Cells:
        together = max(round(width / scene.flat.pitch_x), 1)
        opening = opening_of(e for layer in path.layers for e in layer.effects)
        return _Cells(scene, light, together, path.workers, opening)

    finest = max(pitch / FINEST, float(np.abs(radii).max()) / FARTHEST)
    cells = on_cells(max(blur, finest))
    found = cells.missing()
    rms = _rms(found)
    width = blur * math.sqrt(allowed / (SAMPLED * rms)) if rms > 0 else blur
    if max(width, finest) < cells.width:
        cells = on_cells(max(width, finest))
        found = cells.missing()
    error = min(SAMPLED * (cells.width / blur) ** 2, 1.0) * _rms(found)
    planes = [_at_pixels(plane, path, scene, cells.width) for plane in found]
    return RayCorrection(np.stack(planes[:-1]), planes[-1], error, cells.width, cells.values)


def _rms(missing: Array) -> float:
    """Return the rms of the light of planes (C + 1, h, w) in the color where it is most."""
    return float(np.sqrt(np.square(missing[:-1], dtype=float).mean(axis=(1, 2)).max()))


def _at_pixels(plane: Array, path: OpticalPath, scene: DepthScene, cell: float) -> Array:
    """Return the means over the collecting areas of a plane (h, w) of cells."""
    g, (width, height) = path.geometry, scene.flat.extent
    x, y = pixel_centers(g, detector=True)
    down = box_means(plane, (y + height / 2) / cell, g.collecting_height / cell)
    return box_means(down.T, (x + width / 2) / cell, g.collecting_width / cell).T


@dataclass
class _Cells:
    """Samples taken together, composed ray by ray."""

    scene: DepthScene
    light: Array
    """Light (C, h, w) of the samples [e/s]."""
    together: int
    """Samples along the side of a cell."""
    workers: int
    opening: Opening
    """Shape of the aperture."""
    values: int = 0

    @property
    def width(self) -> float:
        """Side of a cell [m]."""
        return self.together * self.scene.flat.pitch_x

    def missing(self) -> Array:
        """Return what the composition of means lacks in every cell (C + 1, rows, columns).

        It is light [e/s], and the share of what is hidden in it.
        """
        shape = [math.ceil(count / self.together) for count in self.light.shape[1:]]
        out = np.zeros((len(self.light) + 1, *shape), self.light.dtype)
        reach = math.ceil(float(np.abs(self.scene.cut.radii).max()) / self.width) + 1
        hides = np.zeros(self.light.shape[1:], bool)
        hides.ravel()[self.scene.cut.hidden.samples] = True
        y, x = (index // self.together for index in np.nonzero(hides))
        near = np.zeros(shape, bool)
        near[y, x] = True
        tiles: list[tuple[slice, slice]] = []
        for top, left in product(*(range(0, count, TILE) for count in shape)):
            rows, columns = slice(top, top + TILE), slice(left, left + TILE)
            around = tuple(slice(max(s.start - reach, 0), s.stop + reach) for s in (rows, columns))
            if near[around].any():
                tiles.append((rows, columns))

        counts = [0] * len(tiles)

        def fill(number: int) -> None:
            tile = tiles[number]
            here = out[:, tile[0], tile[1]]
            found, counts[number] = self._tile(tile, reach)
            here[:] = found[:, : here.shape[1], : here.shape[2]]

        each(fill, range(len(tiles)), self.workers)
        self.values = sum(counts)
        return out

    def _tile(self, tile: tuple[slice, slice], reach: int) -> tuple[Array, int]:
        """Return the same in one tile, and how many values were moved for it."""
        layers = list(self._layers(self.light, tile, reach))
        means = [np.zeros((len(p), TILE, TILE), p.dtype) for _, p, _ in layers]
        total: Array | float = 0.0
        points = aperture_points(RAYS, self.opening)
        for u, v in points:
            seen = [_moved(p, radius * u, radius * v, reach) for radius, p, _ in layers]
            total = total + self._composed(layers, seen)
            for mean, one in zip(means, seen, strict=True):
                mean += one / len(points)
        lacking = np.asarray(total / len(points) - self._composed(layers, means))
        return lacking, len(points) * sum(mean.size for mean in means)

    def _composed(self, layers: list[tuple[float, Array, bool]], planes: list[Array]) -> Array:
        """Return light and the share of what is hidden in it (C + 1, h, w)."""
        parts: tuple[list[Planes], list[Planes]] = ([], [])
        for (_, _, hidden), own in zip(layers, planes, strict=True):
            parts[hidden].append((own[:-1], own[-1]))
        light, opened = composed(*parts)
        return np.concatenate([light, opened[None]])

    def _layers(
        self, samples: Array, tile: tuple[slice, slice], reach: int
    ) -> Iterator[tuple[float, Array, bool]]:
        """Yield radius [cells], light and cover (C + 1, h, w) and whether it is hidden.

        They are those of layers in a tile and as far around it as they blur.
        """
        cut, n = self.scene.cut, self.together
        rows, columns = (
            _mirrored(np.arange((s.start - reach) * n, (s.start + TILE + reach) * n), count)
            for s, count in zip(tile, samples.shape[1:], strict=True)
        )
        light = samples[:, rows[:, None], columns]
        flat = np.ravel_multi_index(np.ix_(rows, columns), samples.shape[1:])
        first, share = cut.first.ravel()[flat].astype(int), cut.share.ravel()[flat]
        yield from self._present(light, first, share, False)
        place = np.full(cut.first.size, -1)
        place[cut.hidden.samples] = np.arange(len(cut.hidden.samples))
        index = place[flat]
        there = index >= 0
        if there.any():
            source = cut.hidden.sources[index]
            first = np.where(there, cut.first.ravel()[source].astype(int), -2)
            light = samples.reshape(len(samples), -1)[:, source]
            yield from self._present(light, first, cut.share.ravel()[source], True)

    def _present(
        self, light: Array, first: Array, share: Array, hidden: bool
    ) -> Iterator[tuple[float, Array, bool]]:
        n, radii = self.together, self.scene.cut.radii
        known = np.unique(first[first >= 0])
        for layer in np.union1d(known, known + 1):
            cover = np.where(first == layer, 1 - share, np.where(first == layer - 1, share, 0))
            if layer < len(radii) and cover.any():
                both = np.concatenate([light * cover, cover[None]])
                means = cell_means(both, n).astype(light.dtype)
                yield radii[layer] / self.width, means, hidden


def aperture_points(count: int, opening: Opening = CIRCLE) -> list[tuple[float, float]]:
    """Return points of equal shares of an aperture's area, in its radii: a spiral of golden angles.

    Parameters
    ----------
    count : int
        Number of points; of an opening that is no circle about as many.
    opening : Opening, optional
        Shape of the aperture.

    Returns
    -------
    list of tuple
        Points (x, y) [radii].

    References
    ----------
    .. [1] H. Vogel, "A better way to construct the sunflower head", Math. Biosciences 44, 179-189,
       1979, doi:10.1016/0025-5564(79)90080-4.
    """
    count = round(count / opening.share)
    points = []
    for k in range(count):
        radius, angle = math.sqrt((k + 0.5) / count), math.pi * (1 + math.sqrt(5)) * (k + 0.5)
        points.append((radius * math.cos(angle), radius * math.sin(angle)))
    return [point for point in points if opening.contains(*map(np.asarray, point))]


def _mirrored(index: Array, count: int) -> Array:
    index = index % (2 * count)
    mirrored: Array = np.minimum(index, 2 * count - 1 - index)
    return mirrored


def _moved(planes: Array, x: float, y: float, reach: int) -> Array:
    """Return the inner part of planes, displaced by x cells to the right and y down."""
    out = planes
    for axis, by in ((1, y), (2, x)):
        start = math.floor(reach - by)
        part = planes.dtype.type(reach - by - start)
        low, high = (
            out[(slice(None),) * axis + (slice(at, at + TILE),)] for at in (start, start + 1)
        )
        out = low * (1 - part) + high * part
    return out


def box_means(plane: Array, at: Array, width: float) -> Array:
    """Return the means of even rows over boxes around places.

    Parameters
    ----------
    plane : Array
        Rows (n, ...) of values.
    at : Array
        Centers (m,) of the boxes [rows].
    width : float
        Width of the boxes [rows].

    Returns
    -------
    Array
        Means (m, ...), in the unit of the values.
    """
    sums = np.concatenate([np.zeros_like(plane[:1]), np.cumsum(plane, axis=0)])
    low, high = (_interpolated(sums, at + side * width / 2) for side in (-1, 1))
    means: Array = (high - low) / plane.dtype.type(width)
    return means


def _interpolated(plane: Array, at: Array) -> Array:
    """Return a plane straight between its rows, at places counted in rows."""
    index = np.clip(at.astype(int), 0, len(plane) - 2)
    part = (at - index).astype(plane.dtype)[:, None]
    return np.asarray(plane[index] * (1 - part) + plane[index + 1] * part)
