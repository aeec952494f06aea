"""Transfer functions of aberrated lenses on many frequencies: the overlap of two pupils.

The same integral as `transfer` of tests/reference_light.py, over all frequencies of a grid at once;
the wavefront is written out as a polynomial in the pupil's coordinates, which is what it is.
"""

from __future__ import annotations

import math

import numpy as np
from reference_light import Wavefront, bend, chords

POINTS = 20
"""Gauss's points along an axis for an even wavefront; good to 1e-8 with those of `bend`."""
AT_ONCE = 1 << 17
"""Points of the pupil that are held in memory."""


def transfer(
    front: Wavefront, fx: np.ndarray, fy: np.ndarray, wavelength: float, f_number: float
) -> np.ndarray:
    """H at frequencies (F,) [cycles/m], complex; f_number is N (1 - m)."""
    found = np.zeros(fx.shape, complex)
    half = wavelength * f_number * np.hypot(fx, fy)
    passed = np.flatnonzero(half < 1)
    count = POINTS + bend(front, wavelength, f_number)
    powers, coefficients = polynomial(front, f_number)
    node, weight = np.polynomial.legendre.leggauss(count)
    for some in np.array_split(passed, max(1, math.ceil(len(passed) * count**2 / AT_ONCE))):
        h = half[some, None, None]
        most = np.arccos(h)
        angle = most * node[:, None]
        reach = np.cos(angle) - h
        p, q = reach * node, np.sin(angle)
        area = most * np.cos(angle) * weight[:, None] * reach * weight
        with np.errstate(invalid="ignore"):
            c, s = (np.nan_to_num(f[some, None, None] * wavelength * f_number / h, nan=float(n))
                    for f, n in ((fx, 1), (fy, 0)))  # fmt: skip
        path = [
            _sum(powers, coefficients, c * along - s * q, s * along + c * q)
            for along in (p - h, p + h)
        ]
        wave = np.exp(2j * np.pi / wavelength * (path[0] - path[1]))
        found[some] = (area * wave).sum(axis=(1, 2)) / math.pi
    return found


def polynomial(front: Wavefront, f_number: float) -> tuple[list[tuple[int, int]], np.ndarray]:
    """Powers of u and v, and their coefficients [m]: the wavefront exactly."""
    order = max([2, *(_order(number) for number, _ in front.terms)])
    powers = [(i, n - i) for n in range(order + 1) for i in range(n + 1)]
    u, v, _ = chords(order + 2)
    terms = np.stack([(u**i * v**j).ravel() for i, j in powers], axis=1)
    path = front.path(u, v, f_number).ravel()
    coefficients = np.linalg.lstsq(terms, path, rcond=None)[0]
    assert np.allclose(terms @ coefficients, path, rtol=0, atol=1e-15)
    return powers, coefficients


def _order(number: int) -> int:
    return math.ceil((math.sqrt(8 * number + 1) - 3) / 2)


def _sum(
    powers: list[tuple[int, int]], coefficients: np.ndarray, u: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """The polynomial at points of any shape, by Horner's rule along u in each power of v."""
    total: np.ndarray = np.zeros(np.broadcast(u, v).shape)
    table = dict(zip(powers, coefficients, strict=True))
    order = max(i for i, _ in powers)
    for j in range(order, -1, -1):
        row: np.ndarray = np.zeros(np.shape(u))
        for i in range(order - j, -1, -1):
            row = row * u + table[i, j]
        total = total * v + row
    return total
