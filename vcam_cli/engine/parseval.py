"""What filters do to a picture, by Parseval's theorem, from a sample of rows of its spectrum.

Of the rows only products of planes are kept, terms of neighbouring frequencies together: each table
that is asked about then costs little. Mean squares are those of the signal as a continuous
function, before pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from functools import cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import RadialTransfer, SeparableTransfer
from vcam_cli.engine import few_rows
from vcam_cli.engine.coefficients import Coefficients
from vcam_cli.engine.lookup import Lookup, Rows
from vcam_cli.engine.parallel import pieces
from vcam_cli.engine.sampling import Filter
from vcam_cli.engine.transfer import Fineness, Tables, Transfer, entries

AT_ONCE = 1 << 15
"""Terms of a sample that are multiplied together, about; no fewer than 16 rows."""
ALIKE = 1 / 32
"""Width of frequencies along x whose terms are added up, relative to the frequency: over so little
a transfer changes by its slope alone, which what is above and below the middle evens out. Not for a
term that stands out: it would be judged in another place."""


class Sample:
    """Some rows of a picture's spectrum, for tables that are like those of a filter."""

    def __init__(self, filter: Filter, coefficients: Coefficients) -> None:
        self.filter = filter
        """Through which they are seen, unless it is another one that is asked about."""
        self._terms, stand_for = few_rows.of(filter.y, coefficients)
        along_y = np.square(filter.y.base(self._terms)[1] * filter.y.weights[self._terms])
        along_y *= stand_for * np.where(self._terms > 0, 2, 1)
        taken = list(self._taken(coefficients))
        self.size = sum(planes[0].size for _, planes in taken)
        """Terms of a plane that are in it."""
        energy = np.zeros(filter.x.terms)
        for part, planes in taken:
            for plane in planes:
                energy[: plane.shape[1]] += along_y[part] @ np.square(plane)
        first = _pools(filter.x.terms, few_rows.standing_out(energy))
        self._last = np.append(first[1:], filter.x.terms) - 1
        self._middle = (first + self._last) // 2
        self._pairs = list(combinations_with_replacement(range(len(coefficients)), 2))
        """Of planes, (r, s) with r up to s."""
        self._bare = np.zeros((len(self._pairs), len(self._terms), len(first)))
        """(pairs, rows, pools) sums of products, without the separable factors, as often as they
        count: rows for those that they stand for, cosines by their mean square."""
        for part, planes in taken:
            pools = first[: np.searchsorted(first, planes[0].shape[1])]
            for sums, (r, s) in zip(self._bare, self._pairs, strict=True):
                sums[part, : len(pools)] = np.add.reduceat(planes[r] * planes[s], pools, axis=1)
        twice = np.array([1 if r == s else 2 for r, s in self._pairs])
        self._bare *= twice[:, None, None] * along_y[:, None]
        self._with = self._bare * self._separable

    def _taken(self, coefficients: Coefficients) -> Iterator[tuple[slice, list[NDArray]]]:
        """Some rows at a time: which they are, and every plane's (n, count)."""
        x = self.filter.x
        along_x = x.weights * np.where(np.arange(x.terms) > 0, np.sqrt(2), 1)
        for part in pieces(len(self._terms), max(16, AT_ONCE // x.terms)):
            found = self.filter.rows(coefficients, self._terms[part])
            if found is None:  # nor are there any of higher frequencies
                return
            yield part, [plane * along_x[: found.count] for plane in found.planes]

    @property
    def _separable(self) -> NDArray:
        """The filter's separable factors, squared: (rows, pools)."""
        return _square(self.filter.along_y[self._terms], self.filter.along_x[self._middle])

    def through(self, filter: Filter) -> Sample:
        """The same rows for another filter, which reaches no further."""
        out = copy(self)
        out.filter = filter
        rows, pools = self._terms < filter.y.terms, self._last < filter.x.terms
        out._terms = self._terms[rows]
        out._last, out._middle = self._last[pools], self._middle[pools]
        out._bare = self._bare[:, rows][:, :, pools]
        out._with = out._bare * out._separable
        return out

    def power(self) -> tuple[NDArray, NDArray]:
        """Mean squares of the filter's signal by frequency.

        Returns the frequency in pixel Nyquist frequencies of its axis, the larger of those along x
        and y, and for each color the mean square that terms of such frequencies add to the signal:
        (n,) and (C, n), rising in frequency. Of terms that are added up it is the highest.
        """
        return self._by_frequency(self._squares(self.filter.tables, self._with))

    def most(self, tables: Tables) -> tuple[NDArray, NDArray]:
        """The same at most, through any tables of a lens that passes no more than these do.

        Planes whose light cancels through one of them need not through another: as if none did.
        """
        own = [np.sqrt(p) for (r, s), p in zip(self._pairs, self._with, strict=True) if r == s]
        parts = [map(np.multiply, values, own) for values in self._read(tables, 0)]
        return self._by_frequency(np.array([np.square(sum(part)) for part in parts]))

    def _by_frequency(self, squares: NDArray) -> tuple[NDArray, NDArray]:
        filter = self.filter
        fx = 2 * filter.x.pixel_pitch * filter.x.frequencies[self._last]
        fy = 2 * filter.y.pixel_pitch * filter.y.frequencies[self._terms]
        below = fx <= fy[:, None]
        along_y, along_x = (squares * below).sum(axis=2), (squares * ~below).sum(axis=1)
        frequency = np.concatenate([fx, fy])
        order = np.argsort(frequency, kind="stable")
        return frequency[order], np.concatenate([along_x, along_y], axis=1)[:, order]

    def signal(self) -> NDArray:
        """Mean square of the filter's signal: (C,)."""
        return self.mean_square(self.filter.tables)

    def mean_square(self, tables: Tables) -> NDArray:
        """Of the signal through other tables in the place of the filter's: (C,)."""
        return self._squares(tables, self._with).sum(axis=(1, 2))

    def _squares(self, tables: Tables, products: NDArray) -> NDArray:
        """Mean squares of every color's signal: (C, rows, pools)."""
        out = np.zeros((tables.values.shape[1], *products.shape[1:]))
        for parity in tables.parities:
            for total, values in zip(out, self._read(tables, parity), strict=True):
                for (r, s), product in zip(self._pairs, products, strict=True):
                    total += values[r] * values[s] * product
        return np.maximum(out, 0, out=out)

    def _read(self, tables: Tables, parity: int) -> Iterator[list[NDArray]]:
        """For each color, every plane's table in the middle of the pools: (rows, pools)."""
        fx, fy = self.filter.x.frequencies[self._middle], self.filter.y.frequencies[self._terms]
        lookup = Lookup(tables, parity, fx, np.dtype(np.float64), few=True)
        return map(list, lookup.at(Rows([], fy, len(fx)), len(tables.mix)))

    def without(self, effect: RadialTransfer, transfer: Transfer) -> NDArray:
        """What leaving out a radial transfer adds: (C,). transfer: the whole of it.

        Where there is more than radial transfers, what these would do alone: they do no more then.
        """
        tables = self.filter.tables
        alone = transfer.through([e for e in transfer.effects if e is not effect])
        return self.mean_square(replace(tables, values=_rest(alone, tables), planes=(None,) * 4))

    def without_field(self, alone: Transfer) -> NDArray:
        """What leaving out a blur that changes over the field adds, on average: (C,).

        alone: the transfer without it.
        """
        tables = self.filter.tables
        return self.mean_square(replace(tables, values=_rest(alone, tables)))

    def without_planes(self) -> NDArray:
        """What leaving out all but the radial transfers adds: (C,)."""
        tables = self.filter.tables
        return self.mean_square(replace(tables, values=0 * tables.values))

    def without_separable(self, effect: SeparableTransfer) -> NDArray:
        """What leaving out a separable transfer adds: (C,)."""
        filter, x, y = self.filter, self._middle, self._terms
        own_x = effect.along_x(filter.x.frequencies[x])
        own_y = effect.along_y(filter.y.frequencies[y])
        rest = _square(_others(filter.along_y[y], own_y), _others(filter.along_x[x], own_x))
        products = self._bare * (rest * np.square(1 - own_y[:, None] * own_x))
        return self._squares(filter.tables, products).sum(axis=(1, 2))


def _pools(terms: int, alone: NDArray) -> NDArray:
    """First terms of those that are added up; those that stand out are alone.

    An odd number each, so that one is in the middle, but beside those that are alone.
    """
    return np.unique(np.concatenate([_even_pools(terms), alone, alone[alone < terms - 1] + 1]))


@cache
def _even_pools(terms: int) -> NDArray:
    first, out = 0, []
    while first < terms:
        out.append(first)
        first += min(int(first * ALIKE) // 2 * 2 + 1, terms - first)
    return np.array(out)


def _square(along_y: NDArray, along_x: NDArray) -> NDArray:
    """Of separable factors: (rows, pools)."""
    return np.square(along_y[:, None] * along_x)


def _rest(transfer: Transfer, tables: Tables) -> NDArray:
    """Another transfer's table over |f|, less the tables' own."""
    count = tables.values.shape[-1]
    fine = Fineness(tables.top, count, tables.error, most=count)
    return entries(transfer.mixed(tables.mix), fine) - tables.values


def _others(factors: NDArray, own: NDArray) -> NDArray:
    """A product without one of its factors; 1 where that is 0."""
    return np.divide(factors, own, out=np.ones_like(factors), where=np.abs(own) > 1e-12)
