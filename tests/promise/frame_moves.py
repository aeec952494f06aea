"""Lenses without diffraction: each ray displaces the light, of all wavelengths alike.

    pixel = mean over rays of (light on the photodetector, moved by the ray's -displacement)

The light of squares, or on one side of an edge, inside a rectangle is a closed form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from chart_truth import Truth
from fourier import places, working_f_number
from reference import GOLDEN, Setup, electrons_per_light, widened
from reference_collect import Collector, Squares
from reference_light import Rays

RAYS = 9000
"""Of the sum that is taken; a sum of two thirds of them says how good it is."""


class Light(Protocol):
    """Light of one component in rectangles centered at (y, x): (m, n) [m2]."""

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray: ...


@dataclass(frozen=True)
class Steps:
    """Light that changes along a direction: levels (n + 1,) between borders (n,) [m]."""

    angle: float
    borders: np.ndarray
    levels: np.ndarray

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        c, s = math.cos(self.angle), math.sin(self.angle)
        at = np.add.outer(s * y, c * x)
        found = np.full(at.shape, self.levels[0] * width * height)
        for border, rise in zip(self.borders, np.diff(self.levels), strict=True):
            part = half_plane(at - border, abs(c) * width / 2, abs(s) * height / 2)
            found += rise * part * width * height
        return found


def half_plane(distance: np.ndarray, a: float, b: float) -> np.ndarray:
    """Part of a rectangle on the bright side of a border; a, b: its half sides along the normal."""
    a, b = max(a, b), min(a, b)
    if b < 1e-9 * a:
        return np.clip(0.5 + distance / (2 * a), 0, 1)

    def ramp(t: np.ndarray) -> np.ndarray:
        return np.maximum(t, 0) ** 2

    corners = ramp(distance + a + b) - ramp(distance + a - b) - ramp(distance - a + b)
    return (corners + ramp(distance - a - b)) / (8 * a * b)


def squares_light(setup: Setup, squares: Squares, reach: float) -> list[Light]:
    """Of a picture, mirrored at its borders as far as displacements reach [m]."""
    room = reach + setup.pitch_x + setup.pitch_y
    planes, x0, y0 = widened(squares, replace(setup, off_axis="none"), room)
    sides = -2 * x0 / planes.shape[2], -2 * y0 / planes.shape[1]
    return [Collector(plane, "", x0, y0, *sides) for plane in planes]


def mean_electrons(setup: Setup, scene: Squares | Steps) -> Truth:
    """Mean photo-electrons of every pixel before a picture or before edges."""
    if setup.lens is None:
        return Truth(_sum(setup, scene, np.zeros((1, 2))), 0.0)
    fine, coarse = (_sum(setup, scene, _rays(setup, n)) for n in (RAYS, RAYS * 2 // 3))
    return Truth(fine, float(np.sqrt(np.mean((fine - coarse) ** 2)) / fine.max()))


def _sum(setup: Setup, scene: Squares | Steps, moves: np.ndarray) -> np.ndarray:
    """moves (n, 2) [m], each of the same share of the light."""
    light: Sequence[Light] = (
        [scene]
        if isinstance(scene, Steps)
        else squares_light(setup, scene, float(abs(moves).max()))
    )
    amount = electrons_per_light(setup).sum(axis=2)  # (K, C)
    x, y, gather = places(setup)
    planes = np.zeros((amount.shape[1], len(y), len(x)))
    for sent, one in zip(amount, light, strict=True):
        area = sum(one.inside(x - dx, y - dy, *setup.aperture[2:]) for dx, dy in moves)
        planes += np.multiply.outer(sent, area / len(moves))
    return gather(planes)


def _rays(setup: Setup, count: int) -> np.ndarray:
    """A ray from each point of the pupil lands 2 N grad W aside."""
    assert isinstance(setup.lens, Rays)
    k, f_number, step = np.arange(count) + 0.5, working_f_number(setup), 1e-5
    radius, path = np.sqrt(k / count), setup.lens.front.path
    u, v = radius * np.cos(GOLDEN * k), radius * np.sin(GOLDEN * k)
    slopes = [
        (path(u + a, v + b, f_number) - path(u - a, v - b, f_number)) / (2 * step)
        for a, b in ((step, 0.0), (0.0, step))
    ]
    return 2 * f_number * np.stack(slopes, axis=1)
