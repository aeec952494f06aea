"""A scene's planes on their way to the spectrum: painted whole, one after the other, or not at all.

Why not at all: the spectrum of even rectangles is known in closed form, as far as the lens reaches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine import bandwidth, few_rows, sampling
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import Coefficients, Folded, Passing, of_rectangles, passes
from vcam_cli.engine.transfer import Tables
from vcam_cli.scenes.base import Rectangles, SampledScene


@dataclass(frozen=True)
class Painted:
    """All planes of a scene: (R, ny, nx)."""

    planes: NDArray

    def peak(self, tables: Tables) -> float:
        """Largest signal before blur, from every eighth sample [electrons / s]."""
        return bandwidth.peak(self.planes[:, ::8, ::8], tables)

    def brightest(self, tables: Tables) -> float:
        """Bound on the signal of the brightest sample [electrons / s]."""
        return bandwidth.brightest(self.planes, tables)

    def doubled(self) -> Painted:
        """The same in 64 bits."""
        return replace(self, planes=self.planes.astype(np.float64))

    def spectrum(self, workers: int, terms: tuple[int, int]) -> Coefficients:
        """DCT-II of every plane, as many terms along y and x as are wanted: (R, *terms).

        Overwrites the planes.
        """
        return sampling.spectrum(self.planes, workers, terms)


@dataclass(frozen=True)
class Known:
    """A chart of even rectangles, which is never painted."""

    rectangles: Rectangles
    shape: tuple[int, int]
    """Cells that it would have: what the terms of the spectrum are scaled by."""
    dtype: type

    def peak(self, tables: Tables) -> float:
        """Largest signal before blur [electrons / s]."""
        return bandwidth.peak(self.rectangles.values, tables)

    def brightest(self, tables: Tables) -> float:
        """Bound on the same, color by color [electrons / s]."""
        return bandwidth.brightest(self.rectangles.values, tables)

    def doubled(self) -> Known:
        """The same in 64 bits."""
        return replace(self, dtype=np.float64)

    def spectrum(self, workers: int, terms: tuple[int, int]) -> Coefficients:
        """DCT-II of every plane without the frequencies that cells would fold: (R, *terms)."""
        return of_rectangles(self.rectangles, self.shape, terms, self.dtype)


@dataclass(frozen=True)
class _Seen:
    """What is kept of planes that were let go."""

    thin: NDArray
    """Every eighth sample of every plane."""
    extremes: NDArray
    """(R, 2)"""
    energy: NDArray
    """(R, ny) of the rows of every plane's spectrum"""
    rows: NDArray
    """(n,) those at hand"""
    some: NDArray
    """(R, n, nx) the same of every plane"""
    folded: Folded
    """What the filter made of them."""


@dataclass(frozen=True)
class InTurn:
    """Planes too large to be held at once: each is painted, looked at and let go."""

    scene: SampledScene
    mix: NDArray
    filter: sampling.Filter
    """Through which the planes will pass, or a wider one whose sample of rows is to be at hand."""
    known: bool
    """Whether it is that one: then it takes every plane at once, and none is painted twice."""
    terms: tuple[int, int]
    workers: int
    dtype: type

    def peak(self, tables: Tables) -> float:
        """Largest signal before blur, from every eighth sample [electrons / s]."""
        return bandwidth.peak(self._seen.thin, tables)

    def brightest(self, tables: Tables) -> float:
        """Bound on the signal of the brightest sample [electrons / s]."""
        return bandwidth.brightest(self._seen.extremes, tables)

    def doubled(self) -> InTurn:
        """The same in 64 bits."""
        return replace(self, dtype=np.float64)

    def spectrum(self, workers: int, terms: tuple[int, int]) -> Coefficients:
        """DCT-II of every plane, some rows at once and all of them when they are asked for."""
        seen = self._seen
        folded = [seen.folded] if seen.folded else []
        return Passing(seen.energy, seen.rows, seen.some, self._coefficients, folded)

    @cached_property
    def _seen(self) -> _Seen:
        thin, extremes, some, energy = [], [], [], []
        folded = self.filter.begun(np.dtype(self.dtype)) if self.known else {}
        for number in range(len(self.mix)):
            plane = self._plane(number)
            thin.append(plane[0, ::8, ::8].astype(np.float64))
            extremes.append([plane.min(), plane.max()])
            plane = self._spectrum(plane)
            energy.append(few_rows.energy(plane))
            if not number:
                terms, _ = few_rows.rows(self.filter.y, energy[0])
                rows = np.unique(self.filter.y.base(terms)[0])
            some.append(plane[0, rows])
            self.filter.add(plane, number, folded, self.workers)
            del plane
        planes = np.array(some)
        return _Seen(np.array(thin), np.array(extremes), np.array(energy), rows, planes, folded)

    def _coefficients(self, number: int) -> NDArray:
        return self._spectrum(self._plane(number))

    def _plane(self, number: int) -> NDArray:
        painted = self.scene.planes(self.mix[number : number + 1], self.workers)
        return painted.astype(self.dtype, copy=False)

    def _spectrum(self, plane: NDArray) -> NDArray:
        return sampling.spectrum(plane, self.workers, self.terms)


Light = Painted | Known | InTurn
"""A scene's planes, whichever way they go."""


def wanted(scene: SampledScene, x: Axis, y: Axis) -> tuple[int, int]:
    """Terms of the spectrum, along y and x, that are read of it.

    Those beyond the lens's cut-off are not; a picture of squares is read again and again.
    """
    ny, nx = scene.shape
    if scene.samples == "squares":
        return ny, nx
    return min(y.terms, ny), min(x.terms, nx)


def held(scene: SampledScene, rectangles: Rectangles | None, planes: int, zones: bool) -> int:
    """Samples of so many planes that are in memory together; zones: whether the blur has any."""
    if rectangles is not None:
        return (planes * len(rectangles.y) + len(rectangles.x)) * scene.shape[1]
    samples = math.prod(scene.shape)
    # Every zone wants all planes: they are made once.
    alone = not zones and passes(samples, planes, np.dtype(scene.dtype).itemsize)
    return samples if alone else samples * planes
