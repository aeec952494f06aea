"""Transfer tables, read at blocks of frequencies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import iadd, imul

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.parallel import at_once, pieces
from vcam_cli.engine.transfer import Tables

_BEYOND = 2
"""Entries of 0 that go on beyond a table's end."""
Position = tuple[NDArray | None, NDArray | None]
"""In a table over |f|: indices and fractions, where they are needed."""


@dataclass(frozen=True)
class Rows:
    """Some rows of a picture's spectrum."""

    planes: list[NDArray]
    """(n, count) of every plane; may be views of it"""
    fy: NDArray
    """(n,) [cycles/m]"""
    count: int
    """Terms along x, from 0 on."""

    def times(self, along_x: NDArray, along_y: NDArray) -> Rows:
        """With factors on them: along x (more terms than there are), and y (n,)."""
        dtype = self.planes[0].dtype
        across, down = along_x[: self.count].astype(dtype), along_y.astype(dtype)[:, None]
        planes = [plane * across for plane in self.planes]
        for plane in planes:
            plane *= down
        return replace(self, planes=planes)

    def through(self, tables: Iterable[NDArray]) -> NDArray:
        """All planes together, each through its own table (n, count); overwrites the tables."""
        return reduce(iadd, map(imul, tables, self.planes))


class Lookup:
    """Tables of one parity, read at a block of frequencies.

    Over |f|, float32: the nearest of many entries, its error far below float32's own in the sum;
    float64: linear interpolation. Over fx and fy: linear interpolation along both, along x for
    all `fx` at once, which are the same in all blocks; of few rows when they are asked for, since
    all of it takes as much memory as many rows of the picture.
    """

    def __init__(
        self,
        tables: Tables,
        parity: int,
        fx: NDArray,
        dtype: np.dtype,
        first: int = 0,
        few: bool = False,
    ) -> None:
        """first: which of the tables' components is the first that is asked for; few: whether it
        is asked for few rows."""
        tables = replace(
            tables,
            values=tables.values[first:],
            planes=tuple(None if plane is None else plane[first:] for plane in tables.planes),
        )
        self.linear = dtype == np.float64
        self.dtype = dtype
        self.colors, computed = tables.values.shape[1:]
        self.finer = 1 if self.linear else tables.finer
        self.last = (computed - 1) * self.finer
        self.fx = fx
        self.scale = self.finer / tables.step if tables.top else 0.0
        self.values = self.rises = None
        if parity == 0 and tables.has_values:
            self.computed = tables.values.astype(dtype)
            self.values = _laid_out(self.computed, self.finer)
            self.rises = np.diff(self.values, append=0) if self.linear else None
        self.planes: Sequence[Sequence[NDArray]] | None = None
        self.along = None
        if (plane := tables.planes[parity]) is not None:
            self.plane_scale = (plane.shape[-1] - 1) / tables.top
            along = np.minimum(fx * self.plane_scale, plane.shape[-1] - 1)
            if few:
                self.planes, self.along = list(plane), along
            else:
                self.planes = [[_along_x(part, along, dtype) for part in color] for color in plane]

    def _position(self, rows: Rows) -> Position:
        """Where the table over |f| is read, at all pairs of frequencies of the rows."""
        if self.values is None:
            return None, None
        u = self._square[: rows.count].astype(self.dtype)
        v = ((rows.fy * self.scale) ** 2).astype(self.dtype)
        radius = u[None, :] + v[:, None]
        np.sqrt(radius, out=radius)
        if self.linear:
            np.minimum(radius, self.last, out=radius)
            index = radius.astype(np.intp)
            radius -= index
            return index, radius
        radius += 0.5
        if radius[:, -1].max(initial=0) > self.last:  # it rises along x
            np.minimum(radius, self.last, out=radius)
        return radius.astype(np.intp), None

    @property
    def smooth(self) -> bool:
        """Whether the tables are over |f| alone and need not be better than the nearest entry."""
        return self.values is not None and self.planes is None and not self.linear

    @cached_property
    def _square(self) -> NDArray:
        """Of every frequency along x, in entries."""
        return np.square(self.fx * self.scale)

    @cached_property
    def errors(self) -> NDArray:
        """(R, C) what the nearest entry errs by at most, up to the tables' end."""
        return np.abs(np.diff(self.computed)).max(axis=-1, initial=0) / (2 * self.finer)

    def between(self, fy: NDArray, terms: NDArray, planes: int) -> NDArray:
        """Tables over |f| of so many planes by linear interpolation: (planes, C, n, terms)."""
        table, scale = self.computed[:planes], self.scale / self.finer
        radius = np.hypot(self.fx[terms] * scale, fy[:, None] * scale)
        np.minimum(radius, table.shape[-1] - 1, out=radius)
        index = np.minimum(radius.astype(np.intp), table.shape[-1] - 2)
        low, high = (np.take(table, index + i, axis=-1, mode="wrap") for i in (0, 1))
        high -= low
        high *= (radius - index).astype(table.dtype)
        high += low
        return high

    def at(self, rows: Rows, planes: int) -> Iterator[Iterator[NDArray]]:
        """For each color, the tables of so many planes at all frequencies of the rows: (n, count).

        To be used, and overwritten, before the next is asked for.
        """
        position = self._position(rows)
        for color in range(self.colors):
            yield (self._at(r, color, rows, position) for r in range(planes))

    def _at(self, r: int, c: int, rows: Rows, position: Position) -> NDArray:
        index, fraction = position
        on_top = self._on_top(r, c, rows)
        if self.values is None or index is None:
            shape = len(rows.fy), rows.count
            return np.zeros(shape, self.dtype) if on_top is None else on_top
        # No index is outside: "wrap" is the mode that asks least.
        value = np.take(self.values[r, c], index, mode="wrap")
        if fraction is not None and self.rises is not None:
            rise = np.take(self.rises[r, c], index, mode="wrap")
            rise *= fraction
            value += rise
        return value if on_top is None else np.add(value, on_top, out=value)

    def _on_top(self, r: int, c: int, rows: Rows) -> NDArray | None:
        if self.planes is None:
            return None
        plane, at = self.planes[r][c], rows.fy * self.plane_scale
        if self.along is None:
            return between(plane[:, : rows.count], at, 0)
        return _along_x(between(plane, at, 0), self.along[: rows.count], self.dtype)


def _laid_out(values: NDArray, finer: int) -> NDArray:
    """With so many entries for each, straight between them, and those beyond the end."""
    out = np.zeros((*values.shape[:-1], (values.shape[-1] - 1) * finer + 1 + _BEYOND), values.dtype)
    between = out[..., : -1 - _BEYOND].reshape(*values.shape[:-1], -1, finer)
    np.multiply(
        np.diff(values)[..., None], (np.arange(finer) / finer).astype(values.dtype), between
    )
    between += values[..., :-1, None]
    out[..., -1 - _BEYOND] = values[..., -1]
    return out


def _along_x(table: NDArray, position: NDArray, dtype: np.dtype) -> NDArray:
    """A table read between its columns; few rows at a time, since it is large in 64 bits."""
    out = np.empty((len(table), len(position)), dtype)
    for rows in pieces(len(table), at_once(len(position))):
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
