"""Tables laid on stretches of neighbouring rows: read at four of them, interpolated between.

Reading a table at every term of a spectrum is what filtering costs most. Over a few dozen rows a
table is smooth along y: a cubic through four frequencies is as good, and a product of small
matrices makes it. Factors along x and y are in the matrices, so they cost nothing. Every stretch
is checked: where its cubic errs by more than reading the nearest entry may, as it does where the
frequency is low or tables have corners, it is halved, and in the end read at every term. So are
the lowest frequencies always, for the mean signal and most of a picture's light are there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.lookup import Lookup, Rows
from vcam_cli.engine.parallel import product

LONGEST = 128
"""Rows of a stretch, at most: a node costs as much as reading a row."""
SHORTEST = 32
"""Rows below which a stretch is read."""
_NODES = np.cos(np.pi * (np.arange(4) + 0.5) / 4)
"""Chebyshev's, from -1 to 1."""
_CUBICS = np.linalg.inv(np.vander(_NODES))
"""Of each node the cubic that is 1 there and 0 at the others, highest power first: (4, 4)."""
_CHECKED = np.cos(np.pi * np.arange(5) / 4)
"""The places where a cubic through them errs most, both ends among them."""
SPARSE = 4
"""Terms along x for one that is checked: a corner of a table runs through many of a stretch."""
AT_NODES = 2 * (len(_NODES) + len(_CHECKED))
"""Rows of tables that a stretch takes while it is made."""


class Stretch(Protocol):
    """Rows that are filtered in the same way."""

    @property
    def rows(self) -> slice: ...

    def through(self, found: Rows, along_y: NDArray) -> Iterator[NDArray]:
        """For each color, what some of the rows of all planes are through the tables."""
        ...


@dataclass(frozen=True)
class Read:
    """A stretch whose tables are read at every term."""

    rows: slice
    lookup: Lookup
    along_x: NDArray

    def through(self, found: Rows, along_y: NDArray) -> Iterator[NDArray]:
        """See `Stretch`."""
        found = found.times(self.along_x, along_y)
        return map(found.through, self.lookup.at(found, len(found.planes)))


@dataclass(frozen=True)
class Interpolated:
    """A stretch whose tables are known at four frequencies along y."""

    rows: slice
    middle: float
    half: float
    """Frequencies from `middle` - `half` to `middle` + `half` [cycles/m]."""
    values: NDArray
    """(R, C, 4, count) the tables there, with the factors along x."""

    def through(self, found: Rows, along_y: NDArray) -> Iterator[NDArray]:
        """See `Stretch`."""
        cubic = _cubic((found.fy - self.middle) / self.half) * along_y[:, None]
        left = cubic.astype(self.values.dtype)
        for nodes in self.values.swapaxes(0, 1):
            yield found.through(product(left, each[:, : found.count]) for each in nodes)


def stretches(lookup: Lookup, fy: NDArray, along_x: NDArray, planes: int) -> Iterator[Stretch]:
    """All rows, in stretches.

    fy: (n,) their frequencies, rising or falling [cycles/m]; along_x: (count,) factors on the terms
    that are asked for; planes: of how many tables are asked for.
    """
    waiting = [slice(0, len(fy))]
    while waiting:
        rows = waiting.pop()
        found = None
        if lookup.smooth and rows.stop - rows.start >= SHORTEST and fy[rows].min() > 0:
            found = _interpolated(lookup, rows, fy[rows], along_x, planes)
        if found is not None:
            yield found
        elif rows.stop - rows.start < 2 * SHORTEST or not lookup.smooth:
            yield Read(rows, lookup, along_x)
        else:
            middle = (rows.start + rows.stop) // 2
            waiting += [slice(middle, rows.stop), slice(rows.start, middle)]


def _interpolated(
    lookup: Lookup, rows: slice, fy: NDArray, along_x: NDArray, planes: int
) -> Interpolated | None:
    """A stretch by its cubic; None where that errs."""
    middle, half = (fy[0] + fy[-1]) / 2, abs(fy[0] - fy[-1]) / 2
    terms = np.arange(len(along_x))
    values = lookup.between(middle + half * _NODES, terms, planes)
    checked = lookup.between(middle + half * _CHECKED, terms[::SPARSE], planes)
    cubic = _cubic(_CHECKED).astype(values.dtype)
    error = np.abs(np.matmul(cubic, values[..., ::SPARSE]) - checked).max(axis=(2, 3))
    if (error > lookup.errors[:planes]).any():
        return None
    return Interpolated(rows, middle, half, values * along_x.astype(values.dtype))


def _cubic(t: NDArray) -> NDArray:
    """What each node adds to a cubic through all of them at t in -1 .. 1: (n, 4)."""
    return np.vander(t, len(_NODES)) @ _CUBICS
