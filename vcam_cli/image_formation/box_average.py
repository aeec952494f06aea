"""Means over the photodetectors where nothing blurs the light before: exact, without a spectrum."""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.scenes.bands import bands_of_rows
from vcam_cli.scenes.base import ChartScene, SampledScene

SLIVER = 1e-9
"""Gaps between photodetectors below this part of the pitch are rounding errors."""


def box_averages(
    scene: SampledScene, mix: Array, geometry: Geometry, axes: tuple[Axis, Axis], workers: int
) -> Array:
    """Return the means of a scene over the collecting areas of all pixels.

    Parameters
    ----------
    scene : SampledScene
        The scene: a chart, or samples.
    mix : Array
        Signal (C, K) of each component in each color [e/s].
    geometry : Geometry
        Geometry of the array.
    axes : tuple of Axis
        Samples and pixels along x and y.
    workers : int
        Number of threads; the result does not depend on it.

    Returns
    -------
    Array
        Signal (C, rows, columns) [e/s].
    """
    size = geometry.collecting_width, geometry.collecting_height
    if isinstance(scene, ChartScene):
        return _chart_averages(scene, mix, geometry, size)
    x, y = axes
    planes = scene.planes(mix, workers)
    return np.array(
        [square_averages(square_averages(p, y, size[1], 0), x, size[0], 1) for p in planes]
    )


def point_values(scene: SampledScene, mix: Array, geometry: Geometry) -> Array:
    """Return a scene at the centers of the collecting areas.

    Parameters
    ----------
    scene : SampledScene
        The scene.
    mix : Array
        Signal (C, K) of each component in each color [e/s].
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    Array
        Signal (C, rows, columns) [e/s].
    """
    x, y = pixel_centers(geometry, detector=True)
    return scene.values_at(x, y, mix)


def _chart_averages(
    scene: ChartScene, mix: Array, geometry: Geometry, size: tuple[float, float]
) -> Array:
    """Paint the chart on cells that are the collecting areas, and the gaps between them."""
    centers = pixel_centers(geometry, detector=True)
    mix = np.asarray(mix, scene.dtype)
    found = scene.chart.box_averages(*centers, size, mix)
    if found is not None:
        return found
    if any(
        len(c) > 1 and c[1] - c[0] < s * (1 - SLIVER) for c, s in zip(centers, size, strict=True)
    ):
        return _overlapping_averages(scene, mix, centers, size)
    (x_edges, step_x), (y_edges, step_y) = (
        _edges(c, s) for c, s in zip(centers, size, strict=True)
    )
    out = np.empty((len(mix), geometry.rows, geometry.columns), scene.dtype)
    for rows in bands_of_rows(geometry.rows, len(x_edges)):
        cells = y_edges[rows.start * step_y : (rows.stop - 1) * step_y + 2]
        painted = scene.chart.crop_to_cells(x_edges, cells).averages(x_edges, cells, mix)
        out[:, rows] = painted[:, ::step_y, ::step_x]
    return out


def _overlapping_averages(
    scene: ChartScene, mix: Array, centers: tuple[Array, Array], size: tuple[float, float]
) -> Array:
    """Return the same of collecting areas that overlap, as those of closely spaced places do.

    The chart is painted on cells of half their distance, and summed up within each of them.
    """
    grids = [_grid(c, s) for c, s in zip(centers, size, strict=True)]
    (x_edges, left, right), (y_edges, top, bottom) = grids
    out = np.empty((len(mix), len(centers[1]), len(centers[0])), scene.dtype)
    for rows in bands_of_rows(len(centers[1]), len(x_edges)):
        first, last = int(top[rows.start]), math.ceil(bottom[rows.stop - 1])
        cells = y_edges[first : last + 1]
        painted = scene.chart.crop_to_cells(x_edges, cells).averages(x_edges, cells, mix)
        sums = np.zeros((len(mix), len(cells), len(x_edges)))
        sums[:, 1:, 1:] = painted.cumsum(axis=1, dtype=float).cumsum(axis=2)
        to_left, to_right = (_interpolated_sums(sums, edge, 2) for edge in (left, right))
        across = to_right - to_left
        above, below = (_interpolated_sums(across, edge[rows] - first, 1) for edge in (top, bottom))
        inside = below - above
        out[:, rows] = inside / ((right - left)[0] * (bottom - top)[0])
    return out


def _grid(center: Array, size: float) -> tuple[Array, Array, Array]:
    """Return edges of cells [m], and where among them boxes begin and end, counted in cells."""
    cell = (center[1] - center[0] if len(center) > 1 else size) / 2
    low = (center - center[0]) / cell
    count = math.ceil(low[-1] + size / cell + SLIVER)
    edges = center[0] - size / 2 + cell * np.arange(count + 1)
    return edges, low, low + size / cell


def _interpolated_sums(sums: Array, place: Array, axis: int) -> Array:
    """Return running sums between their places, where they are straight."""
    index = np.minimum(place.astype(int), sums.shape[axis] - 2)
    shape = (-1, 1) if axis == 1 else (-1,)
    part = (place - index).reshape(shape)
    below, above = (np.take(sums, index + step, axis=axis) for step in (0, 1))
    return np.asarray(below + part * (above - below))


def _edges(center: Array, size: float) -> tuple[Array, int]:
    """Return edges of boxes and of the gaps between them [m]; cells from one box to the next."""
    pitch = center[1] - center[0] if len(center) > 1 else size
    low, high = center - size / 2, center + size / 2
    if pitch - size > SLIVER * pitch:
        return np.stack([low, high], axis=1).ravel(), 2
    return np.append(low, high[-1]), 1


def square_averages(plane: Array, axis: Axis, size: float, along: int) -> Array:
    """Return the means of uniform squares of light over boxes, by running sums.

    Parameters
    ----------
    plane : Array
        Samples of one plane, in any unit.
    axis : Axis
        Samples and pixels along the axis.
    size : float
        Width of a box [m].
    along : int
        The axis of `plane`, 0 or 1.

    Returns
    -------
    Array
        Means in place of the samples along that axis, in the type of `plane`.
    """
    center = (axis.first + np.arange(axis.pixels) * axis.pixel_pitch) / axis.sample_pitch
    half = size / axis.sample_pitch / 2
    sums = np.cumsum(plane, axis=along, dtype=np.float64)
    low, high = (_mirrored_integral(sums, plane, center + edge, along) for edge in (-half, half))
    return ((high - low) / (2 * half)).astype(plane.dtype)


def _mirrored_integral(sums: Array, plane: Array, position: Array, along: int) -> Array:
    """Return the integral of samples, mirrored at both ends, from the edge to a position.

    Positions are counted in samples.
    """
    count = plane.shape[along]
    inside = count - np.abs(count - np.abs(position))
    shape = (-1, 1) if along == 0 else (1, -1)
    whole = 2 * np.take(sums, [-1], axis=along)
    read = _integral(sums, plane, np.clip(inside, 0, count), along)
    beyond, before = (position > count).reshape(shape), (position < 0).reshape(shape)
    return np.where(beyond, whole - read, np.where(before, -read, read))


def _integral(sums: Array, plane: Array, position: Array, along: int) -> Array:
    """Return the integral of the samples from the edge to `position`, counted in samples."""
    index = np.minimum(position.astype(int), plane.shape[along] - 1)
    shape = (-1, 1) if along == 0 else (1, -1)
    # The running sum holds the whole sample: the part of it beyond the position is taken back.
    back = (index + 1 - position).reshape(shape)
    integral: Array = np.take(sums, index, axis=along) - back * np.take(plane, index, axis=along)
    return integral
