"""Means over the photodetectors where nothing blurs the light before: exact, without a spectrum."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.scenes.base import CELLS_A_BAND, ChartScene, SampledScene

SLIVER = 1e-9
"""Gaps between photodetectors below this part of the pitch are rounding errors."""


def box_averages(
    scene: SampledScene, mix: NDArray, geometry: Geometry, axes: tuple[Axis, Axis], workers: int
) -> NDArray:
    """Means of a scene over the collecting areas of all pixels: (C, rows, columns).

    mix: (C, K) signal of each component in each color [electrons / s]; axes: along x and y.
    """
    size = geometry.collecting_width, geometry.collecting_height
    if isinstance(scene, ChartScene):
        return _chart_averages(scene, mix, geometry, size)
    x, y = axes
    planes = scene.planes(mix, workers)
    return np.array(
        [square_averages(square_averages(p, y, size[1], 0), x, size[0], 1) for p in planes]
    )


def point_values(scene: SampledScene, mix: NDArray, geometry: Geometry) -> NDArray:
    """A scene at the centers of the collecting areas: (C, rows, columns)."""
    return scene.values_at(*pixel_centers(geometry, detector=True), mix)


def _chart_averages(
    scene: ChartScene, mix: NDArray, geometry: Geometry, size: tuple[float, float]
) -> NDArray:
    """The chart painted on cells that are the collecting areas, and the gaps between them."""
    centers = pixel_centers(geometry, detector=True)
    x, y = (_edges(c, s, scene.chart.coarsest_cell) for c, s in zip(centers, size, strict=True))
    mix = np.asarray(mix, scene.dtype)
    out = np.empty((len(mix), geometry.rows, geometry.columns), scene.dtype)
    band = max(1, CELLS_A_BAND // len(x[0]) // y[1])
    for top in range(0, geometry.rows, band):
        rows = slice(top, min(top + band, geometry.rows))
        cells = y[0][rows.start * y[2] : (rows.stop - 1) * y[2] + y[1] + 1]
        painted = scene.chart.crop_to_cells(x[0], cells).averages(x[0], cells, mix)
        out[:, rows] = _box_means(_box_means(painted, y, 1), x, 2)
    return out


Boxes = tuple[NDArray, int, int]
"""Edges of cells along an axis, cells in a box, and cells from one box to the next."""


def _edges(center: NDArray, size: float, coarsest: float) -> Boxes:
    """Edges of boxes and of the gaps between them, the boxes in parts that can be painted [m]."""
    pitch = center[1] - center[0] if len(center) > 1 else size
    parts = max(1, math.ceil(size / coarsest)) if math.isfinite(coarsest) else 1
    inside = center[:, None] + size * (np.arange(parts + 1) / parts - 0.5)
    if pitch - size > SLIVER * pitch:
        gaps = max(1, math.ceil((pitch - size) / coarsest)) if math.isfinite(coarsest) else 1
        gap = inside[:, -1:] + (pitch - size) * (np.arange(1, gaps) / gaps)
        return np.concatenate([inside, gap], axis=1).ravel(), parts, parts + gaps
    return np.append(inside[:, :-1].ravel(), inside[-1, -1]), parts, parts


def _box_means(cells: NDArray, boxes: Boxes, axis: int) -> NDArray:
    """Means over the boxes' cells along an axis."""
    _, parts, step = boxes
    every = np.moveaxis(cells, axis, -1)
    picked = [every[..., part::step] for part in range(parts)]
    count = min(p.shape[-1] for p in picked)
    mean = np.mean([p[..., :count] for p in picked], axis=0, dtype=cells.dtype)
    return np.moveaxis(mean, -1, axis)


def square_averages(plane: NDArray, axis: Axis, size: float, along: int) -> NDArray:
    """Means of uniform squares of light over boxes, by running sums read at both edges."""
    center = (axis.first + np.arange(axis.pixels) * axis.pixel_pitch) / axis.sample_pitch
    half = size / axis.sample_pitch / 2
    sums = np.cumsum(plane, axis=along, dtype=np.float64)
    low, high = (_mirrored_integral(sums, plane, center + edge, along) for edge in (-half, half))
    return ((high - low) / (2 * half)).astype(plane.dtype)


def _mirrored_integral(sums: NDArray, plane: NDArray, position: NDArray, along: int) -> NDArray:
    """Integral of the samples, mirrored at both ends, from the edge to `position` (in samples)."""
    count = plane.shape[along]
    inside = count - np.abs(count - np.abs(position))
    shape = (-1, 1) if along == 0 else (1, -1)
    whole = 2 * np.take(sums, [-1], axis=along)
    read = _integral(sums, plane, np.clip(inside, 0, count), along)
    beyond, before = (position > count).reshape(shape), (position < 0).reshape(shape)
    return np.where(beyond, whole - read, np.where(before, -read, read))


def _integral(sums: NDArray, plane: NDArray, position: NDArray, along: int) -> NDArray:
    """Integral of the samples from the edge to `position` (in samples)."""
    index = np.minimum(position.astype(int), plane.shape[along] - 1)
    shape = (-1, 1) if along == 0 else (1, -1)
    # The running sum holds the whole sample: the part of it beyond the position is taken back.
    back = (index + 1 - position).reshape(shape)
    return np.take(sums, index, axis=along) - back * np.take(plane, index, axis=along)
