"""From scene planes to pixels: transform, multiply, fold, evaluate; or exact box overlaps.

The heart of the engine. Work is cut into fixed pieces of rows or columns that threads share.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.effects.base import RadialTransfer, SeparableTransfer
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.parallel import each, pieces
from vcam_cli.engine.transfer import Tables, Transfer, entries

PIECE = 32
"""Rows or columns a thread takes at once: few enough for the cache."""


def spectrum(planes: NDArray, workers: int) -> NDArray:
    """DCT-II of every plane (R, ny, nx) along both axes, unnormalized; overwrites its argument."""
    for plane in planes:

        def along_rows(s: slice, plane: NDArray = plane) -> None:
            plane[s] = scipy.fft.dct(plane[s], type=2, axis=1, overwrite_x=True)

        def along_columns(s: slice, plane: NDArray = plane) -> None:
            # A copy first: columns of a plane whose rows are 2^n apart share few cache lines.
            columns = np.ascontiguousarray(plane[:, s])
            plane[:, s] = scipy.fft.dct(columns, type=2, axis=0, overwrite_x=True)

        each(along_rows, pieces(plane.shape[0], PIECE), workers)
        each(along_columns, pieces(plane.shape[1], PIECE), workers)
    return planes


@dataclass(frozen=True)
class Filter:
    """A transfer function acting on the cosine series of a scene.

    tables: H over |f|; along_x, along_y: separable factors on every cosine term of the axes.
    """

    x: Axis
    y: Axis
    tables: Tables
    along_x: NDArray
    along_y: NDArray

    def apply(self, coefficients: NDArray, workers: int) -> NDArray:
        """Signal of every color at the rows of photodetectors, still a cosine series along x.

        coefficients: (R, ny, nx) from `spectrum`. Returns (C, rows, folded x) [electrons / s],
        for `Axis.evaluate` along x.
        """
        colors = self.tables.values.shape[1]
        folded = np.zeros((colors, self.y.folded, self.x.folded), coefficients.dtype)
        lookup = _Lookup(self.tables, coefficients.dtype)

        def multiply(rows: slice) -> None:
            for target, terms, weights in self.y.sources(rows):
                self._multiply(coefficients, lookup, terms, weights, folded[:, target])

        each(multiply, pieces(self.y.folded, PIECE), workers)
        out = np.empty((colors, self.y.pixels, self.x.folded), coefficients.dtype)
        tasks = [(c, s) for c in range(colors) for s in pieces(self.x.folded, PIECE)]

        def evaluate(task: tuple[int, slice]) -> None:
            c, columns = task
            out[c, :, columns] = self.y.evaluate(folded[c, :, columns], axis=0)

        each(evaluate, tasks, workers)
        return out

    def _multiply(
        self,
        coefficients: NDArray,
        lookup: _Lookup,
        terms: NDArray,
        weights: NDArray,
        into: NDArray,
    ) -> None:
        """Adds the filtered terms (rows of the spectrum) to their folded rows, all colors."""
        for c, product in enumerate(self._products(coefficients, lookup, terms, weights)):
            into[c] += self.x.fold(product)

    def _products(
        self, coefficients: NDArray, lookup: _Lookup, terms: NDArray, weights: NDArray
    ) -> Iterator[NDArray]:
        """For each color, rows of the filtered spectrum, (terms, as many as are not zero)."""
        x, y, dtype = self.x, self.y, coefficients.dtype
        fy = y.frequencies[terms]
        reach = self.tables.top**2 - fy.min() ** 2
        if reach < 0:
            return
        count = min(x.terms, int(np.sqrt(reach) * 2 * x.length) + 1)
        index, sign = y.base(terms)
        by_row = (sign * weights * y.weights[terms] * self.along_y[terms]).astype(dtype)
        by_column = (x.weights[:count] * self.along_x[:count]).astype(dtype)
        rows = []
        for plane in coefficients:
            part = x.extend(plane[index], count) * by_column
            part *= by_row[:, None]
            rows.append(part)
        position = lookup.position(x.frequencies[:count], fy)
        for c in range(self.tables.values.shape[1]):
            total = lookup(0, c, position)
            total *= rows[0]
            for r in range(1, len(rows)):
                part = lookup(r, c, position)
                part *= rows[r]
                total += part
            yield total

    def power(
        self, coefficients: NDArray, factor: Callable[[int], NDArray] | None = None
    ) -> tuple[NDArray, NDArray]:
        """Mean squares of the signal by frequency, estimated from a sample of rows.

        factor: a further factor along each row of the spectrum, from the row's term (terms of x,).

        Returns the frequency [cycles/m], the larger of |fx| and |fy|, and for each color the
        mean square that terms of such frequencies add to the signal: (n,) and (C, n), rising in
        frequency, by Parseval's theorem.
        """
        lookup = _Lookup(self.tables, coefficients.dtype)
        frequency, power = [], []
        for term, stands_for in _rows_to_sample(self.y.terms):
            at = np.array([term])
            parts = [p[0] for p in self._products(coefficients, lookup, at, np.ones(1))]
            if not parts:
                break
            square = np.array(parts, dtype=np.float64) ** 2
            if factor is not None:
                square *= factor(term)[: square.shape[1]] ** 2
            square[:, 1:] *= 2
            frequency.append(
                np.maximum(self.x.frequencies[: square.shape[1]], self.y.frequencies[term])
            )
            power.append(square * (stands_for * (2 if term else 1)))
        order = np.argsort(together := np.concatenate(frequency), kind="stable")
        return together[order], np.concatenate(power, axis=1)[:, order]

    def without(self, effect: RadialTransfer, transfer: Transfer) -> Filter:
        """What leaving out a radial transfer adds to this filter. `transfer`: the whole of it."""
        others = [e for e in transfer.effects if e is not effect]
        mixed = transfer.through(others).mixed(self.tables.mix)
        size = self.tables.values.shape[-1]
        values = entries(mixed, self.tables.top, size) - self.tables.values
        return replace(self, tables=replace(self.tables, values=values))

    def without_separable(self, effect: SeparableTransfer, coefficients: NDArray) -> NDArray:
        """Mean squares (C, n) that leaving out a separable transfer adds to the signal."""
        x, y = effect.along_x(self.x.frequencies), effect.along_y(self.y.frequencies)

        def others(factors: NDArray, own: NDArray) -> NDArray:
            return np.divide(factors, own, out=np.ones_like(factors), where=np.abs(own) > 1e-12)

        rest = replace(self, along_x=others(self.along_x, x), along_y=others(self.along_y, y))
        return rest.power(coefficients, lambda term: 1 - x * y[term])[1]


def _rows_to_sample(terms: int) -> list[tuple[int, float]]:
    """(term, number of terms it stands for): all of the first few, then ever fewer.

    Straight edges along the array put their energy into the first rows and columns.
    """
    sample = np.unique(
        np.concatenate([np.arange(min(24, terms)), np.geomspace(24, terms, 72)]).astype(int)
    )
    sample = sample[sample < terms]
    edges = np.concatenate([[-0.5], (sample[1:] + sample[:-1]) / 2, [terms - 0.5]])
    return list(zip(sample.tolist(), np.diff(edges).tolist(), strict=True))


class _Lookup:
    """Tables over |f|, read at a block of frequencies.

    float32: the nearest of many entries, its error far below float32's own in the sum; float64:
    linear interpolation.
    """

    def __init__(self, tables: Tables, dtype: np.dtype) -> None:
        zero = np.zeros((*tables.values.shape[:-1], 2))
        self.values = np.concatenate([tables.values, zero], axis=-1).astype(dtype)
        self.linear = dtype == np.float64
        self.scale = 1 / tables.step if tables.top else 0.0
        self.last = tables.values.shape[-1]
        self.dtype = dtype

    def position(self, fx: NDArray, fy: NDArray) -> tuple[NDArray, NDArray | None]:
        """Indices, and for linear interpolation fractions, at all pairs of fx and fy."""
        u = ((fx * self.scale) ** 2).astype(self.dtype)
        v = ((fy * self.scale) ** 2).astype(self.dtype)
        radius = u[None, :] + v[:, None]
        np.sqrt(radius, out=radius)
        if self.linear:
            np.minimum(radius, self.last, out=radius)
            index = radius.astype(np.int32)
            radius -= index
            return index, radius
        radius += 0.5
        np.minimum(radius, self.last, out=radius)
        return radius.astype(np.int32), None

    def __call__(self, r: int, c: int, position: tuple[NDArray, NDArray | None]) -> NDArray:
        index, fraction = position
        table = self.values[r, c]
        value = np.take(table, index, mode="clip")
        if fraction is not None:
            value += fraction * np.take(np.diff(table, append=0), index, mode="clip")
        return value


def boxes(plane: NDArray, x: Axis, y: Axis, width: float, height: float) -> NDArray:
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
    low = np.clip(center - half, 0, axis.samples)
    high = np.clip(center + half, 0, axis.samples)
    sums = np.cumsum(plane, axis=along, dtype=np.float64)
    difference = _read(sums, plane, high, along) - _read(sums, plane, low, along)
    return difference / (2 * half)


def _read(sums: NDArray, plane: NDArray, position: NDArray, along: int) -> NDArray:
    """Integral of the samples from the edge to `position` (in samples)."""
    index = np.minimum(position.astype(int), plane.shape[along] - 1)
    shape = (-1, 1) if along == 0 else (1, -1)
    # sums includes the sample itself: take back the part of it beyond the position.
    back = (index + 1 - position).reshape(shape)
    return np.take(sums, index, axis=along) - back * np.take(plane, index, axis=along)
