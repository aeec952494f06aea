"""Pictures of even areas by their outlines, and the exact Fourier series that follows.

On a line y = const such a picture is a staircase: B = ground + sum_j rise_j for all borders x_j to
the left. So its Fourier coefficients are integrals along the outlines (Green's theorem),

    c(fx, fy) = 1 / (Px Py) integral rise dy exp(-2 pi i (fx x + fy y)) / (2 pi i fx),

with (Px / 2 - x) in place of the last factor's 1 / (2 pi i fx) where fx = 0. Nothing is sampled but
the outlines themselves, by Gauss's rule.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from fourier import Series

RULES = tuple(
    (longest, np.polynomial.legendre.leggauss(count))
    for longest, count in ((0.02, 2), (0.15, 4), (0.8, 7), (4.0, 18))
)
"""Longest piece [waves], and Gauss's points and weights that are good to 1e-8 on it."""
NODES_AT_ONCE = 1 << 14


@dataclass(frozen=True)
class Outlines:
    """Points on outlines: where (x, y), and rise x dy of the light from left to right there [m].

    Right and left are those of growing x. `ground` is the light where there is nothing, at the
    left end of every line.
    """

    x: np.ndarray
    y: np.ndarray
    rise: np.ndarray
    ground: float = 0.0


def merge(parts: Iterable[Outlines], ground: float) -> Outlines:
    """All outlines of several, on one ground."""
    rows = [np.stack([part.x, part.y, part.rise]) for part in parts]
    return Outlines(*np.concatenate(rows, axis=1), ground)


def sides(start: np.ndarray, stop: np.ndarray, rise: np.ndarray, finest: float) -> Outlines:
    """Straight sides from start to stop (n, 2) [m]; the light rises by `rise` where y grows.

    finest: the highest frequency that the series will be asked for [cycles/m].
    """
    length = finest * np.hypot(*(stop - start).T)
    parts = []
    for side, part, weight in _pieces(length):
        x, y = (
            start[side, axis, None] + part * (stop - start)[side, axis, None] for axis in (0, 1)
        )
        tall = (rise * (stop - start)[:, 1])[side, None] * weight
        parts.append(Outlines(x.ravel(), y.ravel(), tall.ravel()))
    return merge(parts, 0.0)


def arcs(
    center: np.ndarray, radius: np.ndarray, first: np.ndarray, last: np.ndarray,
    inside: np.ndarray, finest: float,
) -> Outlines:  # fmt: skip
    """Arcs from angle first to last > first, at (x + r cos, y + r sin), (n, 2) and (n,).

    inside: the light within the circle less that outside of it.
    """
    turn = last - first
    parts = []
    for arc, part, weight in _pieces(np.maximum(finest * radius, 0.3) * turn):
        angle = first[arc, None] + part * turn[arc, None]
        x, y = (
            center[arc, axis, None] + radius[arc, None] * along(angle)
            for axis, along in ((0, np.cos), (1, np.sin))
        )
        tall = (inside * radius * turn)[arc, None] * -np.cos(angle) * weight
        parts.append(Outlines(x.ravel(), y.ravel(), tall.ravel()))
    return merge(parts, 0.0)


def _pieces(waves: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Curves, each so many waves long, cut into pieces: curve (m,), places 0..1 along it and
    weights, (m, nodes) each."""
    shortest = 0.0
    for longest, (node, weight) in RULES:
        some = np.flatnonzero((waves > shortest) & ((waves <= longest) | (longest == RULES[-1][0])))
        count = np.ceil(waves[some] / longest).astype(int)
        curve = np.repeat(some, count)
        number = np.arange(len(curve)) - np.repeat(np.cumsum(count) - count, count)
        parts = np.repeat(count, count)[:, None]
        yield curve, (number[:, None] + (node + 1) / 2) / parts, weight / 2 / parts
        shortest = longest


def circle(x: float, y: float, radius: float, inside: float, finest: float) -> Outlines:
    """A whole circle [m]; inside: its light less that around it."""
    one = (np.array([value]) for value in (radius, 0.0, 2 * math.pi, inside))
    return arcs(np.array([[x, y]]), *one, finest)


def rectangles(edges: np.ndarray, light: np.ndarray, finest: float) -> Outlines:
    """Rectangles (n, 4): left, right, top, bottom [m]; light: what each adds to what lies below."""
    left, right, top, bottom = edges.T
    start = np.concatenate([np.stack([left, top], 1), np.stack([right, top], 1)])
    stop = np.concatenate([np.stack([left, bottom], 1), np.stack([right, bottom], 1)])
    return sides(start, stop, np.concatenate([light, -light]), finest)


def series(picture: Outlines, period: float, highest: float) -> Series:
    """The picture, repeated with a period along both axes, up to a frequency [cycles/m].

    The outlines lie within half a period of the center.
    """
    most = math.floor(period * highest)
    fx = np.arange(most + 1) / period
    even, odd = np.zeros((2, most + 1, most + 1), complex)  # in fy
    for begin in range(0, len(picture.x), NODES_AT_ONCE):
        some = slice(begin, begin + NODES_AT_ONCE)
        x, y = picture.x[some], picture.y[some]
        along = _waves(-x / period, most)
        along[:, 1:] /= 2j * math.pi * fx[1:]
        along[:, 0] = period / 2 - x
        down = _waves(-y / period, most) * picture.rise[some, None]
        even += (down.real.T @ along.view(float)).view(complex)
        odd += (down.imag.T @ along.view(float)).view(complex)
    total = np.concatenate([(even - 1j * odd)[:0:-1], even + 1j * odd])
    total *= np.where(fx > 0, 2.0, 1.0) / period**2
    total[most, 0] += picture.ground
    return Series(fx, np.arange(-most, most + 1) / period, total)


def _waves(turns: np.ndarray, most: int) -> np.ndarray:
    """exp(2 pi i k turns), k = 0 .. most: (n, most + 1); by products, good to 1e-15 most."""
    out = np.repeat(np.exp(2j * math.pi * turns)[:, None], most + 1, axis=1)
    out[:, 0] = 1.0
    return np.multiply.accumulate(out, axis=1, out=out)
