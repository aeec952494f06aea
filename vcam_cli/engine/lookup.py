"""Transfer tables, read at blocks of frequencies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import iadd, imul

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.plane_lookup import PlaneLookup, Where
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
    float64: linear interpolation.
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
        self.end = (computed - 1) * self.finer + 1  # the first entry that is 0
        self.fx = fx
        self.scale = self.finer / tables.step if tables.top else 0.0
        self.values = self.rises = None
        if parity == 0 and tables.has_values:
            self.computed = tables.values.astype(dtype)
            self.values = _laid_out(self.computed, self.finer)
            self.rises = np.diff(self.values, append=0) if self.linear else None
        plane = tables.planes[parity]
        self.plane = None if plane is None else PlaneLookup(plane, tables.top, fx, dtype, few)

    def _position(self, rows: Rows) -> Position:
        """Where the table over |f| is read, at all pairs of frequencies of the rows."""
        if self.values is None:
            return None, None
        u = self._square[: rows.count].astype(self.dtype)
        v = ((rows.fy * self.scale) ** 2).astype(self.dtype)
        radius = u[None, :] + v[:, None]
        np.sqrt(radius, out=radius)
        if self.linear:
            np.minimum(radius, self.end, out=radius)
            index = radius.astype(np.intp)
            radius -= index
            return index, radius
        radius += 0.5
        if radius[:, -1].max(initial=0) > self.end:  # it rises along x
            np.minimum(radius, self.end, out=radius)
        return radius.astype(np.intp), None

    @property
    def smooth(self) -> bool:
        """Whether the tables are over |f| alone and need not be better than the nearest entry."""
        return self.values is not None and self.plane is None and not self.linear

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
        last = table.shape[-1] - 1
        beyond = radius > last * (1 + 1e-9)
        np.minimum(radius, last, out=radius)
        index = np.minimum(radius.astype(np.intp), last - 1)
        low, high = (np.take(table, index + i, axis=-1, mode="wrap") for i in (0, 1))
        high -= low
        high *= (radius - index).astype(table.dtype)
        high += low
        if beyond[:, -1].any():  # it rises along x
            high[..., beyond] = 0
        return high

    def at(self, rows: Rows, planes: int) -> Iterator[Iterator[NDArray]]:
        """For each color, the tables of so many planes at all frequencies of the rows: (n, count).

        To be used, and overwritten, before the next is asked for.
        """
        position = self._position(rows)
        where = None if self.plane is None else self.plane.where(rows.fy)
        for color in range(self.colors):
            yield (self._at(r, color, rows, position, where) for r in range(planes))

    def _at(self, r: int, c: int, rows: Rows, position: Position, where: Where | None) -> NDArray:
        index, fraction = position
        on_top = None
        if self.plane is not None and where is not None:
            on_top = self.plane.read(r, c, where, rows.count)
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
