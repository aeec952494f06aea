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
from vcam_cli.engine.coefficients import Coefficients, Folded, Passing, rows_to_sample
from vcam_cli.engine.parallel import each, pieces
from vcam_cli.engine.transfer import PARITIES, Fineness, Tables, Transfer, entries

PIECE = 32
"""Rows or columns a thread takes at once: few enough for the cache."""


def spectrum(planes: NDArray, workers: int, terms: tuple[int, int] | None = None) -> NDArray:
    """DCT-II of every plane (R, ny, nx) along both axes, unnormalized; overwrites its argument.

    terms: how many are wanted along y and x, default all: a view of (R, *terms).
    """
    down, across = terms or planes.shape[1:]
    for plane in planes:

        def along_rows(s: slice, plane: NDArray = plane) -> None:
            plane[s] = scipy.fft.dct(plane[s], type=2, axis=1, overwrite_x=True)

        def along_columns(s: slice, plane: NDArray = plane) -> None:
            # A copy first: columns of a plane whose rows are 2^n apart share few cache lines.
            columns = np.ascontiguousarray(plane[:, s])
            plane[:down, s] = scipy.fft.dct(columns, type=2, axis=0, overwrite_x=True)[:down]

        each(along_rows, pieces(plane.shape[0], PIECE), workers)
        each(along_columns, pieces(across, PIECE), workers)
    return planes[:, :down, :across]


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

    def apply(self, coefficients: Coefficients, workers: int) -> Series:
        """Signal of every color at the rows of photodetectors, still a series along x.

        coefficients: (R, ny, nx) from `spectrum`.
        """
        folded = coefficients.taken() if isinstance(coefficients, Passing) else {}
        if isinstance(coefficients, Passing) and not folded:
            folded = self.begun(coefficients.dtype)
            for first, planes in coefficients.one_by_one():
                self.add(planes, first, folded, workers)
                del planes  # before the next ones are made
        parts: dict[bool, NDArray] = {}
        for parity in self.tables.parities:
            odd_x, odd_y = PARITIES[parity]
            if not isinstance(coefficients, Passing):
                folded = self.begun(coefficients.dtype, parity)
                self.add(coefficients, 0, folded, workers)
            more = self._evaluated(folded.pop(parity), odd_y, workers)
            if odd_x in parts:
                parts[odd_x] += more
            else:
                parts[odd_x] = more
        return Series(self.x, parts.get(False), parts.get(True))

    def begun(self, dtype: np.dtype, parity: int | None = None) -> Folded:
        """What planes are added to, of all parities or of one."""
        shape = self.tables.values.shape[1], self.y.folded, self.x.folded
        parities = self.tables.parities if parity is None else [parity]
        return {p: np.zeros(shape, dtype) for p in parities}

    def add(self, planes: Coefficients, first: int, folded: Folded, workers: int) -> None:
        """Adds what planes give, whose index is from `first` on."""
        for parity, target in folded.items():
            self._multiply(parity, planes, first, target, workers)

    def _multiply(
        self, parity: int, planes: Coefficients, first: int, folded: NDArray, workers: int
    ) -> None:
        """Adds what planes give through one parity of the tables."""
        odd_x, odd_y = PARITIES[parity]
        lookup = _Lookup(self.tables, parity, self.x.frequencies, planes.dtype, first)

        def multiply(rows: slice) -> None:
            for target, terms, weights in self.y.sources(rows, odd_y):
                products = self._products(planes, lookup, terms, weights)
                for color, product in zip(folded[:, target], products, strict=False):
                    color += self.x.fold(product, odd_x, overwrite=True)

        each(multiply, pieces(self.y.folded, PIECE), workers)

    def _evaluated(self, folded: NDArray, odd_y: bool, workers: int) -> NDArray:
        """What one parity adds: (C, rows, folded x) [electrons / s]; overwrites its argument."""
        colors = len(folded)
        # Where pixels are every virtual one or a window of them they take the place of the terms.
        window = self.y.window
        shape = (colors, self.y.pixels, self.x.folded)
        out = np.empty(shape, folded.dtype) if window is None else folded[:, window]
        tasks = [(c, s) for c in range(colors) for s in pieces(self.x.folded, PIECE)]

        def evaluate(task: tuple[int, slice]) -> None:
            c, columns = task
            values = folded[c, :, columns]
            found = self.y.evaluate(values, axis=0, odd=odd_y, overwrite=True)
            if window is None or not np.may_share_memory(found, values):
                out[c, :, columns] = found

        each(evaluate, tasks, workers)
        return out

    def _products(
        self, coefficients: Coefficients, lookup: _Lookup, terms: NDArray, weights: NDArray
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

    @property
    def sampled(self) -> NDArray:
        """Rows of the coefficients that `power` looks at, rising."""
        terms = np.concatenate([rows for rows, _ in rows_to_sample(self.y.terms)])
        return np.unique(self.y.base(terms)[0])

    def power(
        self, coefficients: Coefficients, factor: Callable[[int], NDArray] | None = None
    ) -> tuple[NDArray, NDArray]:
        """Mean squares of the signal by frequency, estimated from a sample of rows.

        factor: a further factor along each row of the spectrum, from the row's term (terms of x,).

        Returns the frequency [cycles/m], the larger of |fx| and |fy|, and for each color the
        mean square that terms of such frequencies add to the signal: (n,) and (C, n), rising in
        frequency, by Parseval's theorem. Terms of the same frequency are added up.
        """
        fx, colors = self.x.frequencies, self.tables.values.shape[1]
        along_x = np.zeros((colors, self.x.terms))
        frequency, power = [fx], [along_x]
        for rows, squares in self._squares(coefficients, factor):
            fy = self.y.frequencies[rows]
            below = np.searchsorted(fx[: squares.shape[2]], fy, side="right")
            along_y = np.zeros((colors, len(rows)))
            for i, stop in enumerate(below):
                along_y[:, i] = squares[:, i, :stop].sum(axis=1)
                along_x[:, stop : squares.shape[2]] += squares[:, i, stop:]
            frequency.append(fy)
            power.append(along_y)
        order = np.argsort(together := np.concatenate(frequency), kind="stable")
        return together[order], np.concatenate(power, axis=1)[:, order]

    def mean_square(
        self, coefficients: Coefficients, factor: Callable[[int], NDArray] | None = None
    ) -> NDArray:
        """The sums of `power` over all frequencies: (C,)."""
        parts = [s.sum(axis=(1, 2)) for _, s in self._squares(coefficients, factor)]
        return np.sum(parts, axis=0) if parts else np.zeros(self.tables.values.shape[1])

    def _squares(
        self, coefficients: Coefficients, factor: Callable[[int], NDArray] | None
    ) -> Iterator[tuple[NDArray, NDArray]]:
        """Some rows' terms, and the mean squares they add for all rows that they stand for.

        (n,) and (C, n, as many as are not zero)
        """
        sample = rows_to_sample(self.y.terms)
        found: list[NDArray] = []
        for number, parity in enumerate(self.tables.parities):
            lookup = _Lookup(self.tables, parity, self.x.frequencies, coefficients.dtype)
            for i, (rows, _) in enumerate(sample):
                parts = self._products(coefficients, lookup, rows, np.ones(len(rows)))
                here = np.array([np.square(part, dtype=np.float64) for part in parts])
                if number == 0:
                    found.append(here)
                elif len(here):
                    found[i] += here
        for (rows, stands_for), squares in zip(sample, found, strict=True):
            if not len(squares):
                return
            if factor is not None:
                squares *= np.array([factor(term)[: squares.shape[2]] for term in rows]) ** 2
            squares *= (stands_for * np.where(rows > 0, 2, 1))[:, None]
            squares[..., 1:] *= 2
            yield rows, squares

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

    def without_separable(self, effect: SeparableTransfer, coefficients: Coefficients) -> NDArray:
        """Mean squares (C,) that leaving out a separable transfer adds to the signal."""
        x, y = effect.along_x(self.x.frequencies), effect.along_y(self.y.frequencies)

        def others(factors: NDArray, own: NDArray) -> NDArray:
            return np.divide(factors, own, out=np.ones_like(factors), where=np.abs(own) > 1e-12)

        rest = replace(self, along_x=others(self.along_x, x), along_y=others(self.along_y, y))
        return rest.mean_square(coefficients, lambda term: 1 - x * y[term])


Position = tuple[NDArray | None, NDArray | None, NDArray, int]
"""Of |f|: indices, fractions, where they are needed; fy; terms along x."""


class _Lookup:
    """Tables of one parity, read at a block of frequencies.

    Over |f|, float32: the nearest of many entries, its error far below float32's own in the sum;
    float64: linear interpolation. Over fx and fy: linear interpolation along both, along x for
    all `fx` at once, which are the same in all blocks.
    """

    def __init__(
        self, tables: Tables, parity: int, fx: NDArray, dtype: np.dtype, first: int = 0
    ) -> None:
        """first: which of the tables' components is the first that is asked for."""
        tables = replace(
            tables,
            values=tables.values[first:],
            planes=tuple(None if plane is None else plane[first:] for plane in tables.planes),
        )
        self.linear = dtype == np.float64
        self.dtype = dtype
        self.last = tables.values.shape[-1]
        self.fx = fx
        self.scale = 1 / tables.step if tables.top else 0.0
        self.values = self.rises = None
        if parity == 0 and tables.has_values:
            zero = np.zeros((*tables.values.shape[:-1], 2))
            self.values = np.concatenate([tables.values, zero], axis=-1).astype(dtype)
            self.rises = np.diff(self.values, append=0) if self.linear else None
        self.planes = None
        if (plane := tables.planes[parity]) is not None:
            self.plane_scale = (plane.shape[-1] - 1) / tables.top
            along = np.minimum(fx * self.plane_scale, plane.shape[-1] - 1)
            self.planes = [[_along_x(part, along, dtype) for part in color] for color in plane]

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
            index = radius.astype(np.intp)
            radius -= index
            return index, radius, fy, count
        radius += 0.5
        if radius[:, -1].max(initial=0) > self.last:  # it rises along x
            np.minimum(radius, self.last, out=radius)
        return radius.astype(np.intp), None, fy, count

    def __call__(self, r: int, c: int, position: Position) -> NDArray:
        index, fraction, fy, count = position
        on_top = None
        if self.planes is not None:
            on_top = between(self.planes[r][c][:, :count], fy * self.plane_scale, 0)
        if self.values is None or index is None:
            return np.zeros((len(fy), count), self.dtype) if on_top is None else on_top
        table = self.values[r, c]
        # No index is outside: "wrap" is the mode that asks least.
        value = np.take(table, index, mode="wrap")
        if fraction is not None and self.rises is not None:
            rise = np.take(self.rises[r, c], index, mode="wrap")
            rise *= fraction
            value += rise
        return value if on_top is None else np.add(value, on_top, out=value)


def _along_x(table: NDArray, position: NDArray, dtype: np.dtype) -> NDArray:
    """A table read between its columns; few rows at a time, since it is large in 64 bits."""
    out = np.empty((len(table), len(position)), dtype)
    for rows in pieces(len(table), PIECE):
        out[rows] = between(table[rows], position, 1)
    return out


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
