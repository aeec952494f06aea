"""Where layers hide something from some rays alone, and how finely that is summed there.

All rays of a pixel see the same unless the opacity of a nearer layer changes within what they meet
of it: elsewhere nothing is missing from the product of means, exactly. Around these edges the
array is divided into windows. What edges of an opacity from m to M hide of light up to B is at most

    (M - m) A (1 - A) B,        A = (mean opacity - m) / (M - m),

so windows where the squares of that add up to little are left out, and the bound is stated.

In all others the covariance is summed over rays (`occlusion.py`), by two sets that share neither
radii nor angles nor cells. The finer of the two is taken, and their difference is its error. Where
that is too much a still finer set of the other kind follows, window by window, until all errors
together are within what is allowed.

Where lens and silicon blur nothing, layers in focus have detail within cells, and sums on cells of
a half and a third of a pixel may agree and both err. There, three sums are the least, and the last
one errs by half of its difference from the first one, or more.

Layers of a map of depth are summed by `ray_composition.py`: shares of a surface add up. Planes are
the same by both to 0.01 % of full signal, in a tenth and a thirtieth of the frame's time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property, lru_cache, partial
from heapq import nlargest
from itertools import count
from typing import NamedTuple

import numpy as np
from scipy.fft import next_fast_len

from vcam_cli.arrays import Array
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.shaped_blur import opening_of
from vcam_cli.image_formation.estimates.bandwidth import line_spread_tail
from vcam_cli.image_formation.layers.gathering import Pixels
from vcam_cli.image_formation.layers.occlusion import RayLayer, covariance, covariance_bytes, rays
from vcam_cli.image_formation.layers.ray_cells import BORDER, Cells, SharpImage, Window
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.parallel import results
from vcam_cli.physics.opening import Opening
from vcam_cli.records import dataclass


class Level(NamedTuple):
    """How finely the covariance of a window is summed."""

    cells: int
    """Along a pixel's side."""
    rays: int
    rings: int = 1
    """Rings of equal area of the pupil whose rays diffract alike."""
    sectors: int = 1
    """Sectors of each, opposite ones together."""


LEVELS = tuple(
    Level(*level)
    for level in (
        (1, 6), (2, 12), (3, 30), (4, 80), (6, 180), (8, 300), (11, 500), (15, 840), (20, 1400),
        (27, 2300), (36, 3900),
    )
)  # fmt: skip
"""From coarse to fine. Errors by cells and by rays fall about alike; each level errs half as much
as the one before. The first two are enough at `standard` for seven layers of leaves or rectangles.
Cells of two pixels and of one would both miss detail within pixels, and agree."""
DIFFRACTED = tuple(
    Level(*level)
    for level in (
        (1, 6), (2, 12), (3, 30), (4, 80, 2, 4), (4, 200, 4, 4), (5, 500, 4, 8), (6, 1500, 8, 8),
        (8, 3000, 8, 16), (10, 6000, 16, 16), (13, 12000, 16, 32),
    )
)  # fmt: skip
"""The same behind a lens that diffracts: it blurs cells, but at each frequency passes few of the
rays. Parts of the pupil with few rays err more than larger ones do: 12 rays in one part took a
ninth of the time and erred by 0.8 of those in 12, 30 in two a quarter and 0.9."""
MOST_VALUES = 1 << 33
"""Values that rays look up in a window, at most: the predicted error includes that of windows which
need more."""
SIDE, LONGEST = 8, 32
"""Side of a tile [pixels], and tiles along either side of a window, at most; of windows that are
joined the area is at most that of such a square."""
ALONE = 700
"""Pixels, with those of the border, whose coarsest sums take as long as what each window takes
besides, about: 1200 to 1800 were measured, where windows have one size and number of layers."""
FEW = 4.0
"""The stated error is larger by this over the square root of all windows' pixels: how far two sums
are apart says the less of their errors the fewer pixels there are. Of 108 random frames of 20 to
192 pixels a sum erred by up to 2.3 times how far it was from those before it, and by 1.2 times as
stated (errors above 0.03 % of full signal)."""
SHRINK = 0.25
"""Square of the error of a level over that of the one before, about."""
GROWTH = 4
"""Values that a level takes over those of all before it, about."""
LEFT_OUT = 0.3
"""Part of what is allowed that windows left out may have, by their bound. With 0.6 rays of eight
layers look up a quarter less at `standard` (rectangles), in as much time, and eight of leaves take
2.4 times the time at 0.2 %."""
BEYOND = 0.4
"""Part of what is allowed that light which diffracts from beyond a window's border may have."""
WIDEST_BORDER = 12
"""Pixels of such a border, at most: the predicted error includes what a narrower one leaves."""


Paint = Callable[[Cells], Sequence[RayLayer]]
"""What gives the layers that are seen on cells, the nearest first; none where all rays see the
same."""


@dataclass(frozen=True)
class Hidden:
    """Cells and errors of the covariance that was added."""

    cells: int = 0
    """Cells along a pixel's side where they are finest; 0 where none was added."""
    rays: int = 0
    """Rays where they are most."""
    error: float = 0.0
    """Difference of two sums that share no structure, rms over the array [e/s]."""
    left_out: float = 0.0
    """Bound on the rms of what was left out [e/s]."""
    values: int = 0
    """Values that were looked up."""
    memory: int = 0
    """Memory that it took [bytes]."""


@dataclass(eq=False)
class _Sum:
    """The covariance in a window."""

    window: Window
    level: int
    light: Array
    """(C, rows, columns) [e/s]"""
    error: float = 0.0
    """Sum of the squares of how far it is from sums before it [(e/s)^2]."""
    values: int = 0
    before: Array | None = None
    """Light of the sum before, where that counts, too [e/s]."""
    memory: int = 0
    """While it was summed up [bytes]."""


@dataclass(frozen=True)
class RaySum:
    """The covariance of layers in windows of an array."""

    path: OpticalPath
    furthest: tuple[float, float]
    """How far a ray meets a layer from where it reaches the sensor, along x and y [m]."""
    paint: Paint
    painting_bytes: Callable[[Cells], int]
    """What memory that takes, beside its result."""
    border: int = BORDER
    """Pixels around a window from which light diffracts into it."""
    sharp: SharpImage = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sharp", SharpImage(self.path))

    @property
    def levels(self) -> tuple[Level, ...]:
        """From coarse to fine."""
        return DIFFRACTED if self.sharp.diffracts else LEVELS

    @cached_property
    def opening(self) -> Opening:
        """Shape of the aperture."""
        return opening_of(e for layer in self.path.layers for e in layer.effects)

    def add(self, light: Array, windows: Sequence[Window], allowed: float) -> Hidden:
        """Add the covariance in windows to the light of pixels.

        Parameters
        ----------
        light : Array
            Light (C or 1, rows, columns) that is changed [e/s].
        windows : sequence of Window
            Windows that do not overlap.
        allowed : float
            Error to be reached, rms over the array [e/s].

        Returns
        -------
        Hidden
            How finely it was summed, and its error.
        """
        g = self.path.geometry
        pixels = sum(math.prod(window.pixels) for window in windows)
        stated = 1 + FEW / math.sqrt(max(pixels, 1))
        budget = (allowed / stated) ** 2 * g.rows * g.columns
        sums = results(self._first_sum, windows, self.path.workers)
        while coarse := _too_coarse(sums, budget, len(self.levels)):
            fine = results(self._refined, coarse, self.path.workers)
            sums = [one for one in sums if one not in coarse] + fine
        for one in sums:
            own = Pixels(self.path, one.window).own(one.light)
            light[:, one.window.rows, one.window.columns] += own
        np.maximum(light, 0, out=light)
        memory = self.sharp.nbytes + sum(one.light.nbytes for one in sums)
        memory += sum(nlargest(self.path.workers, (one.memory for one in sums)))
        used = [one for one in sums if one.light.any()]
        if not used:
            return Hidden(memory=memory)
        finest = self.levels[max(one.level for one in used)]
        squares = sum(one.error for one in sums)
        error = stated * math.sqrt(squares / (g.rows * g.columns))
        values = sum(one.values for one in sums)
        return Hidden(finest.cells, finest.rays, error, 0.0, values, memory)

    def _first_sum(self, window: Window) -> _Sum:
        """Return the sum of the second level, whose cells are halves of the first one's."""
        cells = self._cells(window, 1)
        layers = self.paint(cells)
        if cells.divided == (1.0, 1.0):
            halves = self.levels[1].cells // self.levels[0].cells
            coarse = self._summed(
                0, cells.together(halves), [own.together(halves) for own in layers]
            )
        else:
            on = self._cells(window, 0)
            coarse = self._summed(0, on, self.paint(on))
        found = self._compared(self._summed(1, cells, layers), coarse)
        return self._refined(found) if self.sharp.is_local else found

    def _refined(self, coarse: _Sum) -> _Sum:
        level = coarse.level + 1
        cells = self._cells(coarse.window, level)
        return self._compared(self._summed(level, cells, self.paint(cells)), coarse)

    def _compared(self, fine: _Sum, coarse: _Sum) -> _Sum:
        apart, values = _squares(fine.light, coarse.light), fine.values + coarse.values
        fine = replace(fine, memory=max(fine.memory, coarse.memory))
        if not self.sharp.is_local:
            return replace(fine, error=apart, values=values)
        if coarse.before is not None:
            apart = max(apart, _squares(fine.light, coarse.before) / 4)
        return replace(fine, error=apart, values=values, before=coarse.light)

    def _cells(self, window: Window, level: int) -> Cells:
        per_pixel, g = self.levels[level].cells, self.path.geometry
        rows, columns = window.pixels
        border = (0, 0)
        if not self.sharp.is_local:
            border = (
                per_pixel * _fast_border(rows, self.border),
                per_pixel * _fast_border(columns, self.border),
            )
        down, right = (
            math.ceil(far / pitch) + 1
            for far, pitch in zip(self.furthest[::-1], (g.pitch_y, g.pitch_x), strict=True)
        )
        single = self.path.settings.dtype == np.float32
        divided = self.sharp.divided(g)
        return Cells(g, window, per_pixel, border, (down, right), single, divided)

    def _summed(self, level: int, cells: Cells, layers: Sequence[RayLayer]) -> _Sum:
        """Return the sum of a level."""
        of, dtype = self.levels[level], self.path.settings.dtype
        groups = self.sharp.groups(rays(of.rays, level % 2, self.opening), of.rings, of.sectors)
        painting = self.painting_bytes(cells)
        memory = covariance_bytes(layers, cells.inner, len(groups), painting)
        if all(layer.planes[-1].min() == layer.planes[-1].max() for layer in layers[:-1]):
            colors = len(self.path.mosaic.colors)
            none: Array = np.zeros((colors, *cells.window.pixels), dtype)
            return _Sum(cells.window, level, none, memory=memory)
        seen = partial(self.sharp.at_pixels, cells, len(groups))
        light = covariance(layers, groups, cells.inner, cells.met, seen)
        traced = sum(map(len, groups))
        values = traced * sum(len(own.planes) for own in layers) * math.prod(cells.inner)
        return _Sum(cells.window, level, light.astype(dtype), values=values, memory=memory)


def _squares(one: Array, other: Array) -> float:
    """Return the sum of the squared differences in the color where it is largest [(e/s)^2]."""
    return float(np.square(one - other, dtype=float).sum(axis=(1, 2)).max())


def _too_coarse(sums: Sequence[_Sum], budget: float, levels: int) -> list[_Sum]:
    """Return the windows to be refined for all errors together to come within a budget.

    They are those before the last of `levels` that err most for what they cost, and enough of them
    to keep the budget if the squares of their errors shrink as expected.
    """
    total = sum(one.error for one in sums)
    if total <= budget:
        return []
    left, found = (budget - SHRINK * total) / (1 - SHRINK), []
    for one in sorted(sums, key=lambda each: each.error / max(each.values, 1)):
        left -= one.error
        if left < 0 and one.level + 1 < levels and GROWTH * one.values <= MOST_VALUES:
            found.append(one)
    return found


def border_around(
    path: OpticalPath, end: float, hidden: float, allowed: float
) -> tuple[int, float]:
    """Return how wide a border around windows is, and what diffracts from beyond it.

    The light of a line that diffracts farther than x falls on both its sides, along x and along y.
    Layers are assumed to hide as much beyond a window as on the array, up to where they end.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    end : float
        How far beyond the array layers that hide others end [m].
    hidden : float
        Bound on what layers hide from some rays alone, rms over the array [e/s].
    allowed : float
        Error to be reached, rms over the array [e/s].

    Returns
    -------
    border : int
        Border [pixels].
    error : float
        Rms of the light from beyond [e/s]; 0 without diffraction.
    """
    lens = of_kind(path.layers[0].effects, Diffraction)
    if not lens:
        return BORDER, 0.0
    pixels = np.arange(BORDER, WIDEST_BORDER + 1)
    distance = pixels * min(path.geometry.pitch_x, path.geometry.pitch_y)
    distance = np.append(distance, max(end, distance[-1]))
    tail = line_spread_tail(lens, float(path.transfer.wavelengths[-1]), distance)
    errors = 2 * math.sqrt(2) * hidden * (tail[:-1] - tail[-1])
    number = min(int((errors > BEYOND * allowed).sum()), len(pixels) - 1)
    return int(pixels[number]), float(errors[number])


@lru_cache(1 << 10)
def _fast_border(pixels: int, least: int) -> int:
    """Return the narrowest border with which transforms are fast.

    Eight layers of photographs take a twentieth less time so.
    """
    return next(n for n in count(least) if next_fast_len(pixels + 2 * n) == pixels + 2 * n)


def windows_with(bound: Array, allowed: float, border: int = BORDER) -> tuple[list[Window], float]:
    """Return the windows of an array in which there may be too much to leave it out.

    Parameters
    ----------
    bound : Array
        What there is in each pixel at most (rows, columns), in any unit.
    allowed : float
        What may be left out, rms over the array, in the same unit.
    border : int, optional
        Pixels around each window that are computed with it.

    Returns
    -------
    windows : list of Window
        The windows.
    left_out : float
        Bound on the skipped covariance, rms over the array, in the same unit.
    """
    rows, columns = bound.shape
    whole = np.zeros((-(-rows // SIDE) * SIDE, columns))
    np.square(bound, dtype=float, out=whole[:rows])
    squares = whole.reshape(-1, SIDE, columns).sum(axis=1)
    squares = np.add.reduceat(squares, np.arange(0, columns, SIDE), axis=1)
    order = np.argsort(squares, axis=None)
    sums = np.cumsum(squares.ravel()[order])
    out = order[sums <= allowed**2 * bound.size]
    kept = np.ones(squares.shape, bool)
    kept.ravel()[out] = False
    windows = []
    for top, left, bottom, right in _joined_boxes(list(_rectangles(kept)), kept.shape, border):
        squares[top:bottom, left:right] = 0
        down = slice(top * SIDE, min(bottom * SIDE, rows))
        windows.append(Window(down, slice(left * SIDE, min(right * SIDE, columns))))
    return windows, math.sqrt(float(squares.sum()) / bound.size)


Box = tuple[int, int, int, int]
"""First row and column of a rectangle of tiles, and the ends of its rows and columns."""


def _rectangles(kept: Array) -> Iterator[Box]:
    """Yield rectangles that together are all that is kept."""
    kept = kept.copy()
    while kept.flat[first := int(kept.argmax())]:
        top, left = divmod(first, kept.shape[1])
        bottom, right = top, left
        while right < min(left + LONGEST, kept.shape[1]) and kept[top, right]:
            right += 1
        while bottom < min(top + LONGEST, len(kept)) and kept[bottom, left:right].all():
            bottom += 1
        kept[top:bottom, left:right] = False
        yield top, left, bottom, right


def _joined_boxes(rectangles: Sequence[Box], shape: tuple[int, ...], border: int) -> list[Box]:
    """Return rectangles, two of them as the one around both where that costs less.

    It may have tiles that lie between them, but none of others. Rays of eight layers of rectangles
    take an eighth less time so, those of photographs as much as without.
    """
    boxes = np.array(rectangles, int).reshape(-1, 4)
    owner = np.full(shape, -1)
    for number, (top, left, bottom, right) in enumerate(boxes):
        owner[top:bottom, left:right] = number
    costs = _cost(boxes, border)
    for number in range(len(boxes)):
        while costs[number] > 0:  # -inf where it has become part of another one
            ends = np.minimum(boxes, boxes[number])[:, :2], np.maximum(boxes, boxes[number])[:, 2:]
            around = np.concatenate(ends, axis=1)
            saved = costs + costs[number] - _cost(around, border)
            saved[number] = 0
            for other in np.argsort(-saved)[: np.count_nonzero(saved > 0)]:
                top, left, bottom, right = around[other]
                inside = owner[top:bottom, left:right]
                if np.isin(inside, (-1, number, other)).all():
                    break
            else:
                break
            inside[:] = number
            boxes[number], costs[other] = around[other], -math.inf
            costs[number] = _cost(around[other : other + 1], border)[0]
    return [tuple(box) for box in boxes[costs > 0].tolist()]


def _cost(boxes: Array, border: int) -> Array:
    """Return the pixels (n,) that rectangles (n, 4) of tiles cost; too large ones without end."""
    sides = boxes[:, 2:] - boxes[:, :2]
    pixels = ALONE + (SIDE * sides + 2 * border).prod(axis=1)
    return np.where(sides.prod(axis=1) <= LONGEST**2, pixels, math.inf)
