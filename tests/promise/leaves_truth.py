"""Dead leaves by the arcs of them that are seen: exact, for the leaves repeat as a series does.

Leaves are cut where they meet other leaves and the border of the period. Between two cuts an arc is
hidden by a leaf in front of it, or seen whole, and then one leaf lies behind all of it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from fourier import Series, cutoff
from outlines import arcs, series
from reference import Setup
from reference_scenes import DATA, column

from vcam_cli.scenes.charts.dead_leaves import GROUND, PERIOD, PIGMENTS, generate_leaves

CELLS = 4000
"""Of the picture, along a side, on which leaves are looked for that are seen at all."""
HALF = PERIOD / 2


def dead_leaves(setup: Setup, seed: int) -> Series:
    """The leaves of a seed before the camera; monochromatic light."""
    x, y, radius, pigment, factor = _visible_leaves(seed)
    reflectance = [
        column(DATA / "colorchecker.csv", name)(setup.wavelength[:1])[0] for name in PIGMENTS
    ]
    color = np.append(np.array(reflectance)[pigment] * factor, GROUND * reflectance[0])
    leaf, first, last, behind = _visible_arcs(
        seed
    )  # behind = -1: the ground, which is the last color
    unit = max(setup.size)
    center = unit * np.stack([x, y], 1)[leaf]
    rise = color[leaf] - color[behind]
    found = arcs(center, unit * radius[leaf], first, last, rise, cutoff(setup))
    inside = replace(found, x=(found.x + HALF * unit) % (PERIOD * unit) - HALF * unit)
    out = series(inside, PERIOD * unit, cutoff(setup))
    out.coefficients[:, 0] += _left_border(seed, color, unit, out.fy)
    return out


@lru_cache(maxsize=4)
def _visible_leaves(seed: int) -> tuple[np.ndarray, ...]:
    """Leaves of which a cell is seen, front last: x, y, radius in the scene's unit, pigment,
    factor. The others are seen, if at all, in slivers of less than a cell."""
    leaves = generate_leaves(seed)
    label = np.zeros((CELLS, CELLS), np.int32)
    step = PERIOD / CELLS
    for number, (x, y, radius) in enumerate(
        zip(leaves.discs.x, leaves.discs.y, leaves.discs.radius, strict=True), 1
    ):
        ends = [np.floor((at + np.array([-radius, radius]) + HALF) / step) for at in (x, y)]
        columns, rows = (np.arange(low, high + 1, dtype=int) for low, high in ends)
        across, down = ((at + 0.5) * step - HALF for at in (columns, rows))
        inside = np.add.outer((down - y) ** 2, (across - x) ** 2) <= radius**2
        place = np.ix_(rows % CELLS, columns % CELLS)
        label[place] = np.where(inside, number, label[place])
    some = np.unique(label)
    some = some[some > 0] - 1
    every = (*(getattr(leaves.discs, name) for name in ("x", "y", "radius")), leaves.pigment)
    return tuple(each[some] for each in (*every, leaves.factor))


@lru_cache(maxsize=4)
def _visible_arcs(seed: int) -> tuple[np.ndarray, ...]:
    """Arcs that are seen: leaf, first and last angle, leaf behind it (-1: the ground)."""
    x, y, radius, *_ = _visible_leaves(seed)
    found = [_visible_arcs_of(number, x, y, radius) for number in range(len(x))]
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))


def _visible_arcs_of(
    number: int, x: np.ndarray, y: np.ndarray, radius: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Those of one leaf."""
    own = radius[number]
    dx, dy = _nearest(x - x[number]), _nearest(y - y[number])
    apart = np.hypot(dx, dy)
    near = np.flatnonzero((apart < own + radius) & (apart > own - radius))
    near = near[near != number]
    dx, dy, apart, other = dx[near], dy[near], apart[near], radius[near]
    meets = apart > abs(own - other)
    cosine = (apart**2 + own**2 - other**2)[meets] / (2 * apart[meets] * own)
    toward, half = np.arctan2(dy, dx)[meets], np.arccos(np.clip(cosine, -1, 1))
    cuts = np.concatenate([toward - half, toward + half, _border_angles(x[number], own)])
    cuts = np.unique(np.append(cuts % (2 * math.pi), [0.0, 2 * math.pi]))
    first, last = cuts[:-1], cuts[1:]
    middle = (first + last) / 2
    inside = np.add.outer(own * np.cos(middle), -dx) ** 2 <= other**2 - (
        np.add.outer(own * np.sin(middle), -dy) ** 2
    )
    seen = ~(inside & (near > number)).any(axis=1)
    behind = np.where(inside & (near < number), near, -1).max(axis=1, initial=-1)
    leaf = np.full(len(first), number)
    return tuple(each[seen] for each in (leaf, first, last, behind))


def _border_angles(x: float, radius: float) -> np.ndarray:
    """Where a leaf crosses the left or right border of the period."""
    cosine = np.array([(side - x) / radius for side in (-HALF, HALF)])
    angle = np.arccos(cosine[abs(cosine) < 1])
    return np.concatenate([angle, -angle])


def _left_border(seed: int, color: np.ndarray, unit: float, fy: np.ndarray) -> np.ndarray:
    """Fourier coefficients of the light along the left border of the period: lines begin there."""
    x, y, radius, *_ = _visible_leaves(seed)
    near = np.flatnonzero(abs(_nearest(x + HALF)) < radius)
    reach = np.sqrt(radius[near] ** 2 - _nearest(x[near] + HALF) ** 2)
    ends = np.concatenate([y[near] - reach, y[near] + reach, [-HALF]])
    ends = np.unique(np.append((ends + HALF) % PERIOD - HALF, HALF))
    middle = (ends[1:] + ends[:-1]) / 2
    inside = abs(_nearest(np.subtract.outer(middle, y[near]))) < reach
    light = color[np.where(inside, near, -1).max(axis=1, initial=-1)]
    wave = np.exp(-2j * math.pi * np.outer(fy, middle * unit))
    length = np.diff(ends)
    return (wave * np.sinc(np.outer(fy, length * unit))) @ (light * length) / PERIOD


def _nearest(apart: np.ndarray) -> np.ndarray:
    """A difference of places to the nearest of all copies."""
    return apart - PERIOD * np.rint(apart / PERIOD)
