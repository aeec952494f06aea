"""Dead leaves: discs of all sizes lying over each other, the standard model of natural images.

Radii follow the power law r^-3 between two bounds, the only one that looks the same at every
distance; occlusion then makes sharp edges and a power spectrum near 1/f^2, as photographs have
(measured exponents of six seeds: -2.0 in the mean, with a spread of 0.14).
Every leaf has the reflectance of one of a few natural pigments (patches of the ColorChecker),
darkened by a factor of its own.

The picture belongs to the seed alone: leaves are placed in units of the frame's longer side, so
that another array, sampling or aspect shows the same leaves, cropped centrally. Beyond 3/4 of a
side from the centre the leaves repeat. A ColorChecker may lie on them, in the middle.

Sources: A. B. Lee, D. Mumford, J. Huang, "Occlusion models for natural images", International
Journal of Computer Vision 41 (2001) 35-59; as a test chart: F. Cao, F. Guichard, H. Hornung,
"Measuring texture sharpness of a digital camera", Proc. SPIE 7250 (2009).
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from vcam_cli.scenes import discs
from vcam_cli.scenes.base import Array, Frame, clip_cells
from vcam_cli.scenes.colorchecker import Card
from vcam_cli.scenes.discs import Discs
from vcam_cli.spectra import Spectrum, colorchecker

SMALLEST, LARGEST = 1 / 400, 1 / 4  # radii, in units of the frame's longer side
LAYERS = 5.0  # mean number of leaves over a point; exp(-5) of the ground shows
PERIOD = 1.5  # the leaves repeat after this, in the same unit
DARKEST = 0.25  # a leaf's own factor is uniform between this and 1

# How often each pigment occurs: the soil, plants, skin, sky and flowers of a landscape.
PIGMENTS = {
    "dark skin": 4,
    "light skin": 3,
    "blue sky": 3,
    "foliage": 6,
    "blue flower": 1,
    "yellow green": 2,
    "orange yellow": 1,
    "moderate red": 1,
    "white 9.5 (.05 D)": 2,
    "neutral 8 (.23 D)": 2,
    "neutral 6.5 (.44 D)": 2,
    "neutral 5 (.70 D)": 2,
}
GROUND = 0.5  # the ground is the first pigment, darkened by this


def reflectances() -> tuple[Spectrum, ...]:
    """The pigments' reflectances, in the order of `PIGMENTS`."""
    known = dict(colorchecker())
    return tuple(known[name] for name in PIGMENTS)


@dataclass(frozen=True)
class Leaves:
    """Discs on the torus of side `PERIOD`, the pigment (an index) and factor of each."""

    discs: Discs
    pigment: Array
    factor: Array


@lru_cache(maxsize=4)
def grow(seed: int) -> Leaves:
    """The leaves of a seed (a whole number from 0 up), about 60 000; a later one lies in front."""
    smallest, largest = SMALLEST, LARGEST
    ratio = (smallest / largest) ** 2
    mean_area = 2 * math.pi * smallest**2 * math.log(largest / smallest) / (1 - ratio)
    count = round(LAYERS * PERIOD**2 / mean_area)
    draw = np.random.Generator(np.random.Philox(key=seed))
    x, y = (draw.random((2, count)) - 0.5) * PERIOD
    radius = smallest / np.sqrt(1 - draw.random(count) * (1 - ratio))
    often = np.array(list(PIGMENTS.values()), float)
    pigment = np.searchsorted(np.cumsum(often / often.sum()), draw.random(count), side="right")
    pigment = np.minimum(pigment, len(often) - 1)
    factor = DARKEST + (1 - DARKEST) * draw.random(count)
    return Leaves(Discs(x, y, radius), pigment, factor)


@dataclass(frozen=True)
class DeadLeaves:
    """The chart; `mix` is (R, 12) in the order of `PIGMENTS`. unit [m]: the longer side."""

    leaves: Leaves
    unit: float

    def averages(self, x_edges: Array, y_edges: Array, mix: Array) -> Array:
        x, y = x_edges / self.unit, y_edges / self.unit
        leaves = _spread(self.leaves, x[0], x[-1], y[0], y[-1])
        return discs.averages(leaves.discs, _colors(leaves, mix), x, y)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        x, y = x / self.unit, y / self.unit
        leaves = _spread(self.leaves, x[0], x[-1], y[0], y[-1])
        return discs.values(leaves.discs, _colors(leaves, mix), x, y)


def dead_leaves(seed: int, frame: Frame) -> DeadLeaves:
    """The leaves of a seed, spread over a frame."""
    return DeadLeaves(grow(seed), max(frame.width, frame.height))


def _colors(leaves: Leaves, mix: Array) -> Array:
    """The color of the ground and of every leaf: (R, n + 1)."""
    ground = GROUND * mix[:, :1]
    return np.concatenate([ground, mix[:, leaves.pigment] * leaves.factor], axis=1)


def _spread(leaves: Leaves, left: float, right: float, top: float, bottom: float) -> Leaves:
    """All copies of the periodic leaves that meet a rectangle, in their order."""
    reach = LARGEST / PERIOD
    across = range(math.ceil(left / PERIOD - 0.5 - reach), math.floor(right / PERIOD + 1.5 + reach))
    down = range(math.ceil(top / PERIOD - 0.5 - reach), math.floor(bottom / PERIOD + 1.5 + reach))
    index, x, y = [], [], []
    for column in across:
        for row in down:
            dx, dy = column * PERIOD, row * PERIOD
            here = leaves.discs.touching(left - dx, right - dx, top - dy, bottom - dy)
            index.append(here)
            x.append(leaves.discs.x[here] + dx)
            y.append(leaves.discs.y[here] + dy)
    every = np.concatenate(index)
    order = np.argsort(every, kind="stable")
    every = every[order]
    there = Discs(np.concatenate(x)[order], np.concatenate(y)[order], leaves.discs.radius[every])
    return replace(leaves, discs=there, pigment=leaves.pigment[every], factor=leaves.factor[every])


@dataclass(frozen=True)
class WithColorChecker:
    """A ColorChecker lying on the leaves; `mix` is (R, 25), as for the card."""

    leaves: DeadLeaves
    card: Card

    def averages(self, x_edges: Array, y_edges: Array, mix: Array) -> Array:
        of_leaves = mix[:, _patches_of_pigments()]
        out = self.leaves.averages(x_edges, y_edges, of_leaves)
        columns, cover_x, inside_x = clip_cells(x_edges, self.card.half_width)
        rows, cover_y, inside_y = clip_cells(y_edges, self.card.half_height)
        if len(cover_x) and len(cover_y):
            hidden = _Hidden(self.leaves, of_leaves, cover_x, cover_y, inside_x, inside_y)
            out[:, rows, columns] = hidden.taken_from(out[:, rows, columns])
            here = x_edges[columns.start : columns.stop + 1], y_edges[rows.start : rows.stop + 1]
            out[:, rows, columns] += self.card.light(self.card.averaged(*here), mix)
        return out

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        cover = self.card.sampled(x, y)
        leaves = self.leaves.values(x, y, mix[:, _patches_of_pigments()])
        return leaves * (1 - np.outer(cover.down, cover.across)) + self.card.light(cover, mix)


def _patches_of_pigments() -> list[int]:
    names = [name for name, _ in colorchecker()]
    return [names.index(name) for name in PIGMENTS]


@dataclass(frozen=True)
class _Hidden:
    """The leaves under the card, to be taken away: all but in the outermost rows and columns of
    its cells, where only what lies under it is."""

    leaves: DeadLeaves
    mix: Array
    cover_x: Array
    cover_y: Array
    inside_x: Array
    inside_y: Array

    def taken_from(self, light: Array) -> Array:
        out = np.zeros_like(light)
        for row in self._outermost(self.cover_y):
            out[:, row] = light[:, row] - self._under(row, slice(0, len(self.cover_x)))
        for column in self._outermost(self.cover_x):
            under = self._under(slice(0, len(self.cover_y)), column)
            out[:, :, column] = light[:, :, column] - under
        return np.asarray(np.maximum(out, 0.0))

    def _outermost(self, cover: Array) -> list[slice]:
        """The first and last cell, where the card covers them in part."""
        ends = {0, len(cover) - 1}
        return [slice(end, end + 1) for end in sorted(ends) if cover[end] < 1.0]

    def _under(self, rows: slice, columns: slice) -> Array:
        x = self.inside_x[columns.start : columns.stop + 1]
        y = self.inside_y[rows.start : rows.stop + 1]
        cover = np.outer(self.cover_y[rows], self.cover_x[columns])
        return self.leaves.averages(x, y, self.mix) * cover
