"""Cosine coefficients of a scene's planes that are not all in memory at once.

Every form is a sequence of planes, of each of which rows can be asked for by their index; an array
(R, ny, nx) is the simplest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.parallel import product
from vcam_cli.scenes.base import Rectangles

HELD = 1 << 28
"""Bytes of coefficients that are held at once; planes that take more pass one by one."""


class Plane(Protocol):
    """Rows of one plane's coefficients."""

    def __getitem__(self, index: NDArray | slice) -> NDArray: ...


class Coefficients(Protocol):
    """Of all planes of a scene."""

    @property
    def dtype(self) -> np.dtype: ...

    def __iter__(self) -> Iterator[Plane]: ...

    def __len__(self) -> int: ...


Basis = tuple[bool, bool]
"""Whether waves along x, and along y, are sines."""
Folded = dict[Basis, NDArray]
"""(C, folded y, folded x) of the pixels' own waves: what a filter makes of the planes so far."""


def passes(samples: int, planes: int, itemsize: int) -> bool:
    """Whether so many planes of so many samples are too much to be held at once."""
    return planes > 1 and samples * planes * itemsize > HELD


@dataclass(frozen=True)
class PlaneOfRuns:
    """Rows of one of those planes."""

    along: NDArray
    values: NDArray

    def __getitem__(self, index: NDArray | slice) -> NDArray:
        return product(self.along[index], self.values)


@dataclass(frozen=True)
class OfRuns:
    """Those of planes in which many rows are alike, each computed when it is asked for."""

    along: NDArray
    """(ny, d) coefficients along y of every run of rows"""
    values: NDArray
    """(R, d, nx) coefficients along x of the rows that differ"""

    @property
    def dtype(self) -> np.dtype:
        return self.values.dtype

    def first(self, down: int, across: int) -> OfRuns:
        """The first terms along y and x alone: rows of more take longer."""
        return OfRuns(self.along[:down], self.values[..., :across])

    @property
    def shape(self) -> tuple[int, int, int]:
        return len(self.values), len(self.along), self.values.shape[2]

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[PlaneOfRuns]:
        return (PlaneOfRuns(self.along, values) for values in self.values)

    def __array__(self, dtype: type | None = None, copy: bool | None = None) -> NDArray:
        every = np.arange(len(self.along))
        return np.array([plane[every] for plane in self], dtype)


def of_rectangles(
    rectangles: Rectangles, shape: tuple[int, int], terms: tuple[int, int], dtype: type
) -> OfRuns:
    """First terms of the DCT-II of cells of even light in rectangles, in closed form: (R, *terms).

    shape: cells (ny, nx). What cells fold, frequencies beyond their own Nyquist's, is not in it.
    """
    along_y = terms_of_runs(rectangles.y, shape[0], terms[0])
    along_x = terms_of_runs(rectangles.x, shape[1], terms[1])
    return OfRuns(along_y.astype(dtype), (rectangles.values @ along_x.T).astype(dtype))


def terms_of_runs(edges: NDArray, cells: int, terms: int) -> NDArray:
    """First terms of the DCT-II of light that is 1 from edge to edge: (terms, runs).

    edges: (runs + 1,) from the border to the border. With the edges as parts b of the way from
    border to border, the cosine series of a run has the terms (sin(pi k b') - sin(pi k b)) / pi k;
    means over N cells weaken them by sinc(k / 2N), and a DCT-II counts them 2N times.
    """
    parts = (edges - edges[0]) / (edges[-1] - edges[0])
    k = np.arange(1, terms)
    sines = np.sin(np.pi * (np.outer(k, parts) % 2))
    out = np.empty((terms, len(parts) - 1))
    out[0] = 2 * cells * np.diff(parts)
    scale = 2 * cells * np.sinc(k / (2 * cells)) / (np.pi * k)
    out[1:] = np.diff(sines, axis=1) * scale[:, None]
    return out


@dataclass(frozen=True)
class _PlaneOfSome:
    rows: NDArray
    values: NDArray

    def __getitem__(self, index: NDArray | slice) -> NDArray:
        return self.values[np.searchsorted(self.rows, np.r_[index])]


@dataclass(frozen=True)
class Passing:
    """Planes that are made again whenever all of them are wanted; a few rows are at hand.

    Why: a plane of a chart in color has four samples a pixel, and there are four of them or more.
    """

    energy: NDArray
    """(R, ny) sums of squares of every plane's rows"""
    rows: NDArray
    """(n,) rising: the rows at hand"""
    some: NDArray
    """(R, n, nx) those of every plane"""
    make: Callable[[int], NDArray]
    """From a plane's index to its coefficients: (1, ny, nx)"""
    folded: list[Folded] = field(default_factory=list)
    """What the filter that is to come has made of all planes, where it was known beforehand."""

    @property
    def dtype(self) -> np.dtype:
        return self.some.dtype

    def __len__(self) -> int:
        return len(self.some)

    def __iter__(self) -> Iterator[Plane]:
        return (_PlaneOfSome(self.rows, values) for values in self.some)

    def taken(self) -> Folded:
        """What is there of the filter's work, once; nothing where there is none."""
        return self.folded.pop() if self.folded else {}

    def one_by_one(self) -> Iterator[tuple[int, NDArray]]:
        """Every plane's index, and the plane by itself: (1, ny, nx)."""
        for number in range(len(self.some)):
            yield number, self.make(number)
