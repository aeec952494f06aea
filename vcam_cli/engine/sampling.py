"""From scene planes to pixels: transform, multiply, fold, evaluate; or exact box overlaps.

The heart of the engine. Work is cut into fixed pieces of rows or columns that threads share.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import Basis, Coefficients, Folded, Passing
from vcam_cli.engine.lookup import Lookup, Rows
from vcam_cli.engine.parallel import at_once, each, pieces, within
from vcam_cli.engine.stretches import AT_NODES, LONGEST, stretches
from vcam_cli.engine.transfer import PARITIES, Tables


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

        rows, columns = plane.shape
        each(along_rows, pieces(rows, at_once(columns)), workers)
        each(along_columns, pieces(across, at_once(rows)), workers)
    return planes[:, :down, :across]


Turn = tuple[bool, NDArray | None]
"""Waves of the pixels, and how much of them is in every term: see `Axis.bases`."""


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
    frugal: bool = False
    """Whether it rather takes longer than much memory."""

    def apply(self, coefficients: Coefficients, workers: int) -> Series:
        """Signal of every color at the rows of photodetectors, still a series along x.

        coefficients: (R, ny, nx) from `spectrum`.
        """
        passing = isinstance(coefficients, Passing)
        folded = coefficients.taken() if isinstance(coefficients, Passing) else {}
        if isinstance(coefficients, Passing) and not folded:
            folded = self.begun(coefficients.dtype)
            for first, planes in coefficients.one_by_one():
                self.add(planes, first, folded, workers)
                del planes  # before the next ones are made
        parts: dict[bool, NDArray] = {}
        for together in self.groups:
            if not passing:
                folded = self.begun(coefficients.dtype, together)
                self.add(coefficients, 0, folded, workers)
            for basis in together:
                self._evaluated(folded.pop(basis), basis, parts, workers)
        return Series(self.x, parts.get(False), parts.get(True))

    @cached_property
    def groups(self) -> list[list[Basis]]:
        """The pixels' waves that the signal is made of; those together that the same products make.

        Where the photodetectors are off center along x each product is for a cosine and a sine.
        """
        sides = [PARITIES[parity] for parity in self.tables.parities]
        every = {
            (x, y)
            for odd_x, odd_y in sides
            for x, _ in self.x.bases(odd_x)
            for y, _ in self.y.bases(odd_y)
        }
        even, odd = ([b for b in sorted(every) if b[1] == odd_y] for odd_y in (False, True))
        if not self.x.shift:
            return [[basis] for basis in (*even, *odd)]
        return [even, *([basis] for basis in odd)] if self.frugal else [even, odd]

    def begun(self, dtype: np.dtype, bases: Sequence[Basis] | None = None) -> Folded:
        """What planes are added to, of all of the pixels' waves or of some."""
        shape = self.tables.values.shape[1], self.y.folded, self.x.folded
        every = [basis for group in self.groups for basis in group]
        return {basis: np.zeros(shape, dtype) for basis in (every if bases is None else bases)}

    def add(self, planes: Coefficients, first: int, folded: Folded, workers: int) -> None:
        """Adds what planes give, whose index is from `first` on."""
        for parity in self.tables.parities:
            odd_x, odd_y = PARITIES[parity]
            along_x = self.x.bases(odd_x)
            wanted = [
                turn
                for turn in self.y.bases(odd_y)
                if any((to_x, turn[0]) in folded for to_x, _ in along_x)
            ]
            if wanted:
                lookup = Lookup(self.tables, parity, self.x.frequencies, planes.dtype, first)
            for along_y in wanted:
                self._multiply(planes, lookup, along_x, along_y, folded, workers)

    def _multiply(
        self,
        planes: Coefficients,
        lookup: Lookup,
        along_x: list[Turn],
        along_y: Turn,
        folded: Folded,
        workers: int,
    ) -> None:
        """Adds what planes give through one parity of the tables to waves of one kind along y."""
        odd_y, turn_y = along_y
        targets = [
            (folded[odd, odd_y], odd, None if turn is None else turn.astype(planes.dtype))
            for odd, turn in along_x
            if (odd, odd_y) in folded
        ]

        def multiply(rows: slice) -> None:
            for target, terms, weights in self.y.sources(rows, odd_y):
                if turn_y is not None:
                    weights = weights * turn_y[terms]
                for part, colors in self._through(planes, lookup, terms, weights):
                    here = slice(target.start + part.start, target.start + part.stop)
                    for color, product in enumerate(colors):
                        for sums, odd, turn in targets:
                            some = product if turn is None else product * turn[: product.shape[1]]
                            sums[color, here] += self.x.fold(some, odd, overwrite=True)

        each(multiply, pieces(self.y.folded, LONGEST), workers)

    def _through(
        self, planes: Coefficients, lookup: Lookup, terms: NDArray, weights: NDArray
    ) -> Iterator[tuple[slice, Iterator[NDArray]]]:
        """Rows of the spectrum, a few at a time: which they are, and each color's.

        terms, weights: (n,) which rows, and factors on them.
        """
        fy = self.y.frequencies[terms]
        count = self._count(fy)
        along_x = (self.x.weights * self.along_x)[:count]
        along_y = weights * self.y.base(terms)[1] * self.y.weights[terms] * self.along_y[terms]
        for stretch in stretches(lookup, fy, along_x, len(planes)) if count else ():
            for part in within(stretch.rows, at_once(count)):
                found = self.rows(planes, terms[part])
                if found is not None:
                    yield part, stretch.through(found, along_y[part])

    def _evaluated(
        self, folded: NDArray, basis: Basis, parts: dict[bool, NDArray], workers: int
    ) -> None:
        """Adds what waves of one kind give, (C, rows, folded x), to the part that has those of x.

        [electrons / s]; overwrites `folded`, and may keep it.
        """
        odd_x, odd_y = basis
        known = parts.get(odd_x)
        place = self._place(odd_x)
        shape = (len(folded), self.y.pixels, self.x.folded)
        if known is None:
            parts[odd_x] = np.empty(shape, folded.dtype) if place is None else folded[:, place]
        out = parts[odd_x]
        columns = pieces(self.x.folded, at_once(self.y.transform))
        tasks = [(c, s) for c in range(len(folded)) for s in columns]

        def evaluate(task: tuple[int, slice]) -> None:
            c, columns = task
            values = folded[c, :, columns]
            found = self.y.evaluate(values, axis=0, odd=odd_y, overwrite=True)
            if known is not None:
                out[c, :, columns] += found
            elif self.y.window is None or not np.may_share_memory(found, values):
                out[c, :, columns] = found

        each(evaluate, tasks, workers)

    def _place(self, odd_x: bool) -> slice | None:
        """Rows of what is folded that the rows of photodetectors may take; None for none.

        Where they are every virtual pixel or a window of them, they take the place of the terms;
        of a chirp-z transform too, where that is no more memory than rows by themselves would be.
        """
        if self.y.window is not None:
            return self.y.window
        alone = sum(basis[0] == odd_x for group in self.groups for basis in group) == 1
        fits = self.y.pixels <= self.y.folded <= 2 * self.y.pixels
        return slice(self.y.pixels) if alone and fits else None

    def takes(self, itemsize: int, passing: bool = False) -> int:
        """Memory that `apply` takes at most for what it folds and evaluates [bytes].

        passing: whether planes pass one by one, to be added to all of the pixels' waves at once.
        """
        colors = self.tables.values.shape[1]
        folded = colors * self.y.folded * self.x.folded * itemsize
        evaluated = colors * self.y.pixels * self.x.folded * itemsize
        every = [basis for together in self.groups for basis in together]
        kept: dict[bool, int] = {}
        most = 0
        for together in [every] if passing else self.groups:
            for done, (odd_x, _) in enumerate(together):
                waiting = (len(together) - done) * folded
                if odd_x not in kept and self._place(odd_x) is not None:
                    kept[odd_x], waiting = folded, waiting - folded
                kept.setdefault(odd_x, evaluated)
                most = max(most, sum(kept.values()) + waiting)
        return most

    def beside(self, itemsize: int, workers: int) -> int:
        """Memory that `apply` takes for its tables and for pieces of work [bytes]."""
        planes, colors, entries = self.tables.values.shape
        terms = self.x.terms
        sizes = [0, *(plane.shape[-1] for plane in self.tables.planes if plane is not None)]
        tables = planes * colors * (2 * entries * self.tables.finer + max(sizes) * terms) * itemsize
        rows = at_once(terms) * terms * (2 * planes * itemsize + 8 + 6 * itemsize)
        nodes = AT_NODES * planes * colors * terms * itemsize
        longest = max(self.x.transform, self.y.transform)
        chirp = 6 * at_once(longest) * longest * itemsize
        return tables + workers * max(rows + nodes, chirp)

    def rows(self, coefficients: Coefficients, terms: NDArray) -> Rows | None:
        """Rows (n,) of every plane's spectrum, without factors; None where all tables are 0."""
        fy = self.y.frequencies[terms]
        count = self._count(fy)
        if not count:
            return None
        index = _neighbors(self.y.base(terms)[0])
        parts = [self.x.extend(plane[index], count) for plane in coefficients]
        return Rows(parts, fy, count)

    @property
    def terms(self) -> int:
        """Terms of a plane's spectrum that tables reach."""
        return int(self._counts(self.y.frequencies).sum())

    def _count(self, fy: NDArray) -> int:
        """Terms along x that tables reach at some of these frequencies (n,) along y."""
        return int(self._counts(fy.min()))

    def _counts(self, fy: NDArray) -> NDArray:
        """Terms along x that tables reach at each of these frequencies along y."""
        left = self.tables.top**2 - fy**2
        count = (np.sqrt(np.maximum(left, 0)) * 2 * self.x.length).astype(int) + 1
        return np.where(left < 0, 0, np.minimum(count, self.x.terms))


def _neighbors(index: NDArray) -> NDArray | slice:
    """Consecutive indices, rising or falling, as a slice, of which numpy makes a view."""
    steps = np.diff(index)
    if not len(steps) or abs(steps[0]) != 1 or (steps != steps[0]).any():
        return index
    step, stop = int(steps[0]), int(index[-1] + steps[0])
    return slice(int(index[0]), stop if stop >= 0 else None, step)
