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
from vcam_cli.engine.transfer import PARITIES, Fineness, Tables, Transfer, entries

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
class Series:
    """A signal that is known at the rows of photodetectors, and as a series along x."""

    x: Axis
    cosines: NDArray | None
    """(C, rows, folded x)"""
    sines: NDArray | None

    def __call__(self, color: int, rows: slice) -> NDArray:
        """The signal of a color at the photodetectors of some rows: (rows, columns)."""
        parts = [
            self.x.evaluate(part[color, rows], axis=1, odd=odd)
            for part, odd in ((self.cosines, False), (self.sines, True))
            if part is not None
        ]
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]


@dataclass(frozen=True)
class Filter:
    """A transfer function acting on the cosine series of a scene.

    tables: H over the frequency; along_x, along_y: separable factors on every term of the axes.
    """

    x: Axis
    y: Axis
    tables: Tables
    along_x: NDArray
    along_y: NDArray

    def apply(self, coefficients: NDArray, workers: int) -> Series:
        """Signal of every color at the rows of photodetectors, still a series along x.

        coefficients: (R, ny, nx) from `spectrum`.
        """
        parts: dict[bool, NDArray] = {}
        for parity in self.tables.parities:
            more, odd_x = self._rows_of(parity, coefficients, workers), PARITIES[parity][0]
            if odd_x in parts:
                parts[odd_x] += more
            else:
                parts[odd_x] = more
        return Series(self.x, parts.get(False), parts.get(True))

    def _rows_of(self, parity: int, coefficients: NDArray, workers: int) -> NDArray:
        """What one parity adds: (C, rows, folded x) [electrons / s]."""
        odd_x, odd_y = PARITIES[parity]
        colors = self.tables.values.shape[1]
        folded = np.zeros((colors, self.y.folded, self.x.folded), coefficients.dtype)
        lookup = _Lookup(self.tables, parity, self.x.frequencies, coefficients.dtype)

        def multiply(rows: slice) -> None:
            for target, terms, weights in self.y.sources(rows, odd_y):
                products = self._products(coefficients, lookup, terms, weights)
                for color, product in zip(folded[:, target], products, strict=False):
                    color += self.x.fold(product, odd_x)

        each(multiply, pieces(self.y.folded, PIECE), workers)
        out = np.empty((colors, self.y.pixels, self.x.folded), coefficients.dtype)
        tasks = [(c, s) for c in range(colors) for s in pieces(self.x.folded, PIECE)]

        def evaluate(task: tuple[int, slice]) -> None:
            c, columns = task
            out[c, :, columns] = self.y.evaluate(folded[c, :, columns], axis=0, odd=odd_y)

        each(evaluate, tasks, workers)
        return out

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
        position = lookup.position(fy, count)
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
        lookups = [
            _Lookup(self.tables, p, self.x.frequencies, coefficients.dtype)
            for p in self.tables.parities
        ]
        frequency, power = [], []
        for rows, stands_for in _rows_to_sample(self.y.terms):
            count = np.ones(len(rows))
            parts = [list(self._products(coefficients, k, rows, count)) for k in lookups]
            if not parts[0]:
                break
            square = (np.array(parts, dtype=np.float64) ** 2).sum(axis=0)  # (C, rows, terms)
            if factor is not None:
                square *= np.array([factor(term)[: square.shape[2]] for term in rows]) ** 2
            square *= (stands_for * np.where(rows > 0, 2, 1))[:, None]
            square[..., 1:] *= 2
            along_x, along_y = self.x.frequencies[: square.shape[2]], self.y.frequencies[rows]
            frequency.append(np.maximum(along_x, along_y[:, None]).ravel())
            power.append(square.reshape(len(square), -1))
        order = np.argsort(together := np.concatenate(frequency), kind="stable")
        return together[order], np.concatenate(power, axis=1)[:, order]

    def without(self, effect: RadialTransfer, transfer: Transfer) -> Filter:
        """What leaving out a radial transfer adds to this filter. `transfer`: the whole of it.

        Where there is more than radial transfers, what these would do alone: they do no more then.
        """
        others = [e for e in transfer.effects if e is not effect]
        mixed = transfer.through(others).mixed(self.tables.mix)
        values = entries(mixed, self._fineness) - self.tables.values
        return replace(self, tables=replace(self.tables, values=values, planes=(None,) * 4))

    def without_field(self, alone: Transfer) -> Filter:
        """What leaving out a blur that changes over the field adds, on average.

        alone: the transfer without it.
        """
        values = entries(alone.mixed(self.tables.mix), self._fineness) - self.tables.values
        return replace(self, tables=replace(self.tables, values=values))

    @property
    def _fineness(self) -> Fineness:
        return Fineness(self.tables.top, self.tables.values.shape[-1], self.tables.error)

    def only_planes(self) -> Filter:
        """This filter without its radial part: what the other transfers add."""
        return replace(self, tables=replace(self.tables, values=0 * self.tables.values))

    def without_separable(self, effect: SeparableTransfer, coefficients: NDArray) -> NDArray:
        """Mean squares (C, n) that leaving out a separable transfer adds to the signal."""
        x, y = effect.along_x(self.x.frequencies), effect.along_y(self.y.frequencies)

        def others(factors: NDArray, own: NDArray) -> NDArray:
            return np.divide(factors, own, out=np.ones_like(factors), where=np.abs(own) > 1e-12)

        rest = replace(self, along_x=others(self.along_x, x), along_y=others(self.along_y, y))
        return rest.power(coefficients, lambda term: 1 - x * y[term])[1]


AT_ONCE = 16
"""Rows of a sample that are filtered together."""


def _rows_to_sample(terms: int) -> list[tuple[NDArray, NDArray]]:
    """Rows, and the number of rows each stands for: all of the first few, then ever fewer.

    Straight edges along the array put their energy into the first rows and columns.
    """
    sample = np.unique(
        np.concatenate([np.arange(min(24, terms)), np.geomspace(24, terms, 72)]).astype(int)
    )
    sample = sample[sample < terms]
    edges = np.concatenate([[-0.5], (sample[1:] + sample[:-1]) / 2, [terms - 0.5]])
    stands_for = np.diff(edges)
    parts = [slice(i, i + AT_ONCE) for i in range(0, len(sample), AT_ONCE)]
    return [(sample[part], stands_for[part]) for part in parts]


Position = tuple[NDArray | None, NDArray | None, NDArray, int]
"""Of |f|: indices, fractions, where they are needed; fy; terms along x."""


class _Lookup:
    """Tables of one parity, read at a block of frequencies.

    Over |f|, float32: the nearest of many entries, its error far below float32's own in the sum;
    float64: linear interpolation. Over fx and fy: linear interpolation along both, along x for
    all `fx` at once, which are the same in all blocks.
    """

    def __init__(self, tables: Tables, parity: int, fx: NDArray, dtype: np.dtype) -> None:
        self.linear = dtype == np.float64
        self.dtype = dtype
        self.last = tables.values.shape[-1]
        self.fx = fx
        self.scale = 1 / tables.step if tables.top else 0.0
        self.values = None
        if parity == 0 and tables.has_values:
            zero = np.zeros((*tables.values.shape[:-1], 2))
            self.values = np.concatenate([tables.values, zero], axis=-1).astype(dtype)
        self.planes = None
        if (plane := tables.planes[parity]) is not None:
            self.plane_scale = (plane.shape[-1] - 1) / tables.top
            along = np.minimum(fx * self.plane_scale, plane.shape[-1] - 1)
            self.planes = [
                [between(part, along, 1).astype(dtype) for part in color] for color in plane
            ]

    def position(self, fy: NDArray, count: int) -> Position:
        """Where the tables are read, at all pairs of the first `count` fx and of fy."""
        if self.values is None:
            return None, None, fy, count
        u = ((self.fx[:count] * self.scale) ** 2).astype(self.dtype)
        v = ((fy * self.scale) ** 2).astype(self.dtype)
        radius = u[None, :] + v[:, None]
        np.sqrt(radius, out=radius)
        if self.linear:
            np.minimum(radius, self.last, out=radius)
            index = radius.astype(np.int32)
            radius -= index
            return index, radius, fy, count
        radius += 0.5
        np.minimum(radius, self.last, out=radius)
        return radius.astype(np.int32), None, fy, count

    def __call__(self, r: int, c: int, position: Position) -> NDArray:
        index, fraction, fy, count = position
        on_top = None
        if self.planes is not None:
            on_top = between(self.planes[r][c][:, :count], fy * self.plane_scale, 0)
        if self.values is None or index is None:
            return np.zeros((len(fy), count), self.dtype) if on_top is None else on_top
        table = self.values[r, c]
        value = np.take(table, index, mode="clip")
        if fraction is not None:
            value += fraction * np.take(np.diff(table, append=0), index, mode="clip")
        return value if on_top is None else np.add(value, on_top, out=value)


def between(table: NDArray, position: NDArray, axis: int) -> NDArray:
    """A table read between its entries along an axis; constant beyond its end."""
    position = np.minimum(position, table.shape[axis] - 1)
    index = np.minimum(position.astype(int), table.shape[axis] - 2)
    fraction = (position - index).astype(table.dtype).reshape((-1, 1) if axis == 0 else (1, -1))
    low, high = np.take(table, index, axis), np.take(table, index + 1, axis)
    high -= low
    high *= fraction
    high += low
    return high


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
