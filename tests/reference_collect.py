"""Scenes of the slow camera, and how much of their light lies inside rectangles.

Lengths in meters on the sensor, x to the right, y down, the origin at the center of the array.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


def centers(count: int, pitch: float) -> np.ndarray:
    """Centers of `count` cells along an axis, the array centered on 0 [m]."""
    return (np.arange(count) + 0.5 - count / 2) * pitch


@dataclass(frozen=True)
class Squares:
    """Squares of light, each uniform, centered on the array: B_k = planes[k], shape (K, ny, nx)."""

    planes: np.ndarray
    width: float  # of one square [m]
    height: float  # [m]
    outside: str = "mirror"  # what lies beyond them: "mirror" or "black"


@dataclass(frozen=True)
class Rectangle:
    """B = 1 inside a rectangle of the sensor plane [m], 0 elsewhere."""

    left: float
    right: float
    top: float
    bottom: float

    @property
    def far(self) -> float:
        """What it amounts to far away: a rectangle without end is the same everywhere."""
        return float(math.isinf(self.left))

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Area common to the rectangle and those centered at every (y, x): (..., m, n) [m2]."""
        wide = np.minimum(x + width / 2, self.right) - np.maximum(x - width / 2, self.left)
        tall = np.minimum(y + height / 2, self.bottom) - np.maximum(y - height / 2, self.top)
        return np.maximum(tall, 0)[..., :, None] * np.maximum(wide, 0)[..., None, :]

    def at(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Area common to the rectangle and those centered at the points (x, y): their shape."""
        wide = np.minimum(x + width / 2, self.right) - np.maximum(x - width / 2, self.left)
        tall = np.minimum(y + height / 2, self.bottom) - np.maximum(y - height / 2, self.top)
        return np.maximum(tall, 0) * np.maximum(wide, 0)


@dataclass(frozen=True)
class Product:
    """B = across(x) down(y), smooth in a photodetector; 0 on average far away."""

    across: Callable[[np.ndarray], np.ndarray]
    down: Callable[[np.ndarray], np.ndarray]
    far = 0.0

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Integral over the rectangles centered at every (y, x), eight Gauss points a side."""
        node, weight = np.polynomial.legendre.leggauss(8)
        wide = self.across(x[..., None] + node * width / 2) @ weight
        tall = self.down(y[..., None] + node * height / 2) @ weight
        return tall[..., :, None] * wide[..., None, :] * width * height / 4

    def at(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Integral over the rectangles centered at the points (x, y), of any shape: that shape."""
        node, weight = np.polynomial.legendre.leggauss(8)
        wide = self.across(x[..., None] + node * width / 2) @ weight
        tall = self.down(y[..., None] + node * height / 2) @ weight
        return tall * wide * width * height / 4


@dataclass(frozen=True)
class Waves:
    """B = sum_n amplitude cos(2 pi (fx x + fy y) + phase); frequencies [cycles/m], one spectrum."""

    amplitude: tuple[float, ...]
    fx: tuple[float, ...]
    fy: tuple[float, ...]
    phase: tuple[float, ...]


class Collector:
    """Light of one plane of squares inside rectangles, by its running sum (bilinear: exact)."""

    def __init__(
        self, plane: np.ndarray, outside: str, x0: float, y0: float, width: float, height: float
    ):
        self.sum = np.pad(plane.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0))) * width * height
        self.x0, self.y0, self.width, self.height = x0, y0, width, height
        self.far = float(plane.mean()) if outside == "mirror" else 0.0  # B far away

    def up_to(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Light above and to the left of every (y, x): (..., m, n) [m2]."""
        return self.corner(x[..., None, :], y[..., :, None])

    def inside(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Integral of B over the rectangles centered at every (y, x): (..., m, n) [m2]."""
        sides = np.concatenate([x - width / 2, x + width / 2], axis=-1)
        rows = np.concatenate([y - height / 2, y + height / 2], axis=-1)
        corner = self.up_to(sides, rows)
        m, n = y.shape[-1], x.shape[-1]
        lower, upper = corner[..., m:, :], corner[..., :m, :]
        return lower[..., n:] - upper[..., n:] - lower[..., :n] + upper[..., :n]

    def corner(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Light above and to the left of the points (x, y), of any shape: that shape [m2]."""
        u, v = (x - self.x0) / self.width, (y - self.y0) / self.height
        i, j = np.floor(v).astype(int), np.floor(u).astype(int)
        s, t = v - i, u - j
        flat, at = self.sum.ravel(), i * self.sum.shape[1] + j
        above = flat.take(at) * (1 - t) + flat.take(at + 1) * t
        at += self.sum.shape[1]
        below = flat.take(at) * (1 - t) + flat.take(at + 1) * t
        return above * (1 - s) + below * s

    def at(self, x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
        """Integral of B over rectangles centered at the points (x, y), of any shape: that shape."""
        left, right, top, bottom = x - width / 2, x + width / 2, y - height / 2, y + height / 2
        above = self.corner(right, top) - self.corner(left, top)
        return self.corner(right, bottom) - self.corner(left, bottom) - above
