"""What filters do to a picture, by Parseval's theorem, from a sample of rows of its spectrum.

The rows are brought to the filter's terms once; each table that is asked about then costs a
multiplication. Mean squares are those of the signal as a continuous function, before pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import RadialTransfer, SeparableTransfer
from vcam_cli.engine import few_rows
from vcam_cli.engine.coefficients import Coefficients
from vcam_cli.engine.lookup import Lookup, Position, Rows
from vcam_cli.engine.parallel import pieces
from vcam_cli.engine.sampling import Filter
from vcam_cli.engine.transfer import Fineness, Tables, Transfer, entries

AT_ONCE = 1 << 17
"""Terms of a sample that are filtered together, about; no fewer than 16 rows."""


@dataclass(frozen=True, eq=False)
class _Block:
    """Rows that are filtered together."""

    terms: NDArray
    """(n,) which they are"""
    weights: NDArray
    """(n,) how often the squares of their terms count"""
    bare: Rows
    """Without the separable factors."""
    rows: Rows
    positions: dict[tuple[float, int] | None, Position] = field(default_factory=dict)

    def through(self, lookup: Lookup, rows: Rows) -> Iterator[NDArray]:
        """The signal of each color: (n, count)."""
        if lookup.places not in self.positions:
            self.positions[lookup.places] = lookup.position(rows)
        return lookup.through(rows, self.positions[lookup.places])


class Sample:
    """Some rows of a picture's spectrum, for tables that are like those of a filter."""

    def __init__(self, filter: Filter, coefficients: Coefficients) -> None:
        self._filter, self._dtype = filter, coefficients.dtype
        self._blocks = tuple(self._taken(coefficients))

    @property
    def size(self) -> int:
        """Terms of a plane that are in it."""
        return sum(block.rows.planes[0].size for block in self._blocks)

    def _taken(self, coefficients: Coefficients) -> Iterator[_Block]:
        along_x, along_y = self._filter.along_x, self._filter.along_y
        every, stand_for = few_rows.rows(self._filter.y, few_rows.energy(coefficients))
        for part in pieces(len(every), max(16, AT_ONCE // self._filter.x.terms)):
            terms, stands_for = every[part], stand_for[part]
            found = self._filter.rows(coefficients, terms)
            if found is None:  # nor are there any of higher frequencies
                return
            x, y = self._filter.x, self._filter.y
            bare = found.times(x.weights, y.base(terms)[1] * y.weights[terms])
            weights = stands_for * np.where(terms > 0, 2, 1)
            yield _Block(terms, weights, bare, bare.times(along_x, along_y[terms]))

    def power(self) -> tuple[NDArray, NDArray]:
        """Mean squares of the filter's signal by frequency.

        Returns the frequency in pixel Nyquist frequencies of its axis, the larger of those along x
        and y, and for each color the mean square that terms of such frequencies add to the signal:
        (n,) and (C, n), rising in frequency. Terms of the same frequency are added up.
        """
        fx, fy = (2 * a.pixel_pitch * a.frequencies for a in (self._filter.x, self._filter.y))
        along_x = np.zeros((self._filter.tables.values.shape[1], len(fx)))
        frequency, power = [fx], [along_x]
        for block, squares in self._squares():
            below = np.searchsorted(fx, fy[block.terms], side="right")
            along_y = np.empty(squares.shape[:2])
            for row, count in enumerate(below):
                here = squares[:, row, :count]
                along_y[:, row] = here.sum(axis=-1)
                here[:] = 0
            along_x[:, : block.rows.count] += block.weights @ squares
            frequency.append(fy[block.terms])
            power.append(along_y * block.weights)
        order = np.argsort(together := np.concatenate(frequency), kind="stable")
        return together[order], np.concatenate(power, axis=1)[:, order]

    def _squares(self) -> Iterator[tuple[_Block, NDArray]]:
        """Of the filter's signal, for the terms of every row: (C, n, count)."""
        tables, fx = self._filter.tables, self._filter.x.frequencies
        lookups = [Lookup(tables, p, fx, self._dtype, few=True) for p in tables.parities]
        for block in self._blocks:
            squares = np.empty((tables.values.shape[1], *block.rows.planes[0].shape))
            for number, lookup in enumerate(lookups):
                for total, part in zip(squares, block.through(lookup, block.rows), strict=True):
                    if number:
                        total += np.square(part, dtype=np.float64)
                    else:
                        np.square(part, out=total, dtype=np.float64)
            squares[..., 1:] *= 2
            yield block, squares

    def mean_square(self, tables: Tables) -> NDArray:
        """Of the signal through other tables in the place of the filter's: (C,)."""
        return self._mean_square(tables, [block.rows for block in self._blocks])

    def _mean_square(self, tables: Tables, rows: list[Rows]) -> NDArray:
        total: NDArray = np.zeros(tables.values.shape[1])
        for parity in tables.parities:
            lookup = Lookup(tables, parity, self._filter.x.frequencies, self._dtype, few=True)
            for block, own in zip(self._blocks, rows, strict=True):
                for c, part in enumerate(block.through(lookup, own)):
                    wide = part.astype(np.float64, copy=False)
                    squares = 2 * np.einsum("ij,ij->i", wide, wide) - wide[:, 0] ** 2
                    total[c] += block.weights @ squares
        return total

    def without(self, effect: RadialTransfer, transfer: Transfer) -> NDArray:
        """What leaving out a radial transfer adds: (C,). transfer: the whole of it.

        Where there is more than radial transfers, what these would do alone: they do no more then.
        """
        tables = self._filter.tables
        alone = transfer.through([e for e in transfer.effects if e is not effect])
        return self.mean_square(replace(tables, values=_rest(alone, tables), planes=(None,) * 4))

    def without_field(self, alone: Transfer) -> NDArray:
        """What leaving out a blur that changes over the field adds, on average: (C,).

        alone: the transfer without it.
        """
        tables = self._filter.tables
        return self.mean_square(replace(tables, values=_rest(alone, tables)))

    def without_planes(self) -> NDArray:
        """What leaving out all but the radial transfers adds: (C,)."""
        tables = self._filter.tables
        return self.mean_square(replace(tables, values=0 * tables.values))

    def without_separable(self, effect: SeparableTransfer) -> NDArray:
        """What leaving out a separable transfer adds: (C,)."""
        filter = self._filter
        own_x, own_y = effect.along_x(filter.x.frequencies), effect.along_y(filter.y.frequencies)
        rest_x, rest_y = _others(filter.along_x, own_x), _others(filter.along_y, own_y)
        rows = []
        for block in self._blocks:
            change = 1 - own_y[block.terms, None] * own_x[: block.bare.count]
            rows.append(block.bare.times(rest_x, rest_y[block.terms], change))
        return self._mean_square(filter.tables, rows)


def _rest(transfer: Transfer, tables: Tables) -> NDArray:
    """Another transfer's table over |f|, less the tables' own."""
    fine = Fineness(tables.top, tables.values.shape[-1], tables.error)
    return entries(transfer.mixed(tables.mix), fine) - tables.values


def _others(factors: NDArray, own: NDArray) -> NDArray:
    """A product without one of its factors; 1 where that is 0."""
    return np.divide(factors, own, out=np.ones_like(factors), where=np.abs(own) > 1e-12)
