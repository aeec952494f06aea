"""Means over the photodetectors, as nothing blurs the light before: exact, by overlaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import OfRuns
from vcam_cli.scenes.base import Rectangles


def of_rectangles(
    light: Rectangles, x: Axis, y: Axis, width: float, height: float, dtype: type
) -> OfRuns:
    """Means of even rectangles over every photodetector: planes of rows, (R, rows, columns).

    Mirrored at the borders. A box of width 0 reads the rectangle under its center.
    """
    along_y, along_x = _overlaps(light.y, y, height), _overlaps(light.x, x, width)
    return OfRuns(along_y.astype(dtype), (light.values @ along_x.T).astype(dtype))


def _overlaps(edges: NDArray, axis: Axis, size: float) -> NDArray:
    """The share of every box that lies in each run from edge to edge: (pixels, runs)."""
    edges = edges - edges[0]
    center = axis.first + np.arange(axis.pixels) * axis.pixel_pitch
    if size == 0:
        nearest = np.searchsorted(edges, center + 1e-9 * axis.sample_pitch, side="right") - 1
        runs = np.arange(len(edges) - 1)
        return (np.clip(nearest, 0, runs[-1])[:, None] == runs).astype(float)
    low, high = (_below(edges, center + edge) for edge in (-size / 2, size / 2))
    return (high - low) / size


def _below(edges: NDArray, position: NDArray) -> NDArray:
    """Length of each run before a position; the runs go on mirrored at both ends."""
    length, widths = edges[-1], np.diff(edges)
    inside = length - np.abs(length - np.abs(position))
    read = np.clip(inside[:, None] - edges[:-1], 0, widths)
    beyond, before = (position > length)[:, None], (position < 0)[:, None]
    return np.where(beyond, 2 * widths - read, np.where(before, -read, read))


def of_samples(plane: NDArray, x: Axis, y: Axis, width: float, height: float) -> NDArray:
    """Means of a plane of uniform squares over every photodetector: (rows, columns).

    Exact up to rounding: running sums along each axis, read at both edges of each box. A box of
    width 0 reads the sample under its center.
    """
    return _box_means(_box_means(plane, y, height, 0), x, width, 1)


def _box_means(plane: NDArray, axis: Axis, size: float, along: int) -> NDArray:
    center = (axis.first + np.arange(axis.pixels) * axis.pixel_pitch) / axis.sample_pitch
    if size == 0:
        sample = np.clip(np.floor(center + 1e-9), 0, axis.samples - 1).astype(int)
        return np.take(plane, sample, axis=along)
    half = size / axis.sample_pitch / 2
    sums = np.cumsum(plane, axis=along, dtype=np.float64)
    low, high = (_up_to(sums, plane, center + edge, along) for edge in (-half, half))
    return (high - low) / (2 * half)


def _up_to(sums: NDArray, plane: NDArray, position: NDArray, along: int) -> NDArray:
    """Integral of the samples, mirrored at both ends, from the edge to `position` (in samples)."""
    count = plane.shape[along]
    inside = count - np.abs(count - np.abs(position))
    shape = (-1, 1) if along == 0 else (1, -1)
    whole = 2 * np.take(sums, [-1], axis=along)
    read = _read(sums, plane, np.clip(inside, 0, count), along)
    beyond, before = (position > count).reshape(shape), (position < 0).reshape(shape)
    return np.where(beyond, whole - read, np.where(before, -read, read))


def _read(sums: NDArray, plane: NDArray, position: NDArray, along: int) -> NDArray:
    """Integral of the samples from the edge to `position` (in samples)."""
    index = np.minimum(position.astype(int), plane.shape[along] - 1)
    shape = (-1, 1) if along == 0 else (1, -1)
    # sums includes the sample itself: take back the part of it beyond the position.
    back = (index + 1 - position).reshape(shape)
    return np.take(sums, index, axis=along) - back * np.take(plane, index, axis=along)
