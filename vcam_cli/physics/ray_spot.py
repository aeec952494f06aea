"""Round spots to which rays blur a point, and how corners of light look through them.

Light within the spot is as (1 - s^2)^n, s the distance from its center in radii: n = 0, the disc of
a lens out of focus, and n = 1, the paraboloid of slopes of depth. Any image of even rectangles is a
sum of displaced corners x+ y+, with x+ = max(x, 0). Behind a spot the ramp x+ and the corner become

    g(a) = < (a + u)+ >,        Q(a, b) = < (a + u)+ (b + v)+ >,

with the mean < > over the points (u, v) of the spot. Both are elementary. With x+ = (x + |x|) / 2
and the symmetry of the spot, Q differs from g(a) g(b) by

    R(a, b) = Q(a, b) - g(a) g(b) = cov(|a + u|, |b + v|) / 4,

which is 0 where a or b is beyond the spot, and is a sum of few products of one function of each.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

NODES = 129
"""Places over a radius at which the products are known; straight lines between them err by 1e-5 of
the largest."""
LEAST = 1e-4
"""Part of the largest product below which others are left out: a corner then errs by 1e-6 of the
light of a square whose side is the spot's radius."""


@dataclass(frozen=True)
class RaySpot:
    """A round spot of light."""

    radius: float
    """[m]"""
    power: int
    """n, 0 or 1."""

    def ramp(self, place: Array) -> Array:
        """Return what the spot makes of a ramp max(x, 0).

        Parameters
        ----------
        place : Array
            Places x of the spot's center, in any shape [radii].

        Returns
        -------
        Array
            Ramp at these places [radii].
        """
        a = np.clip(place, -1, 1)
        c = np.sqrt(1 - a**2)
        if self.power == 0:
            inside = (2 / np.pi) * (a * ((a * c + np.arcsin(a)) / 2 + np.pi / 4) + c**3 / 3)
        else:
            inside = (8 / (3 * np.pi)) * (a * (_cubes(a) + 3 * np.pi / 16) + c**5 / 5)
        return np.asarray(np.where(np.abs(place) < 1, inside, np.maximum(place, 0)))

    def corner(self, a: Array, b: Array) -> Array:
        """Return what the spot makes of a corner max(x, 0) max(y, 0).

        Parameters
        ----------
        a, b : Array
            Places of the spot's center along x and y, from -1 to 1, of one shape [radii].

        Returns
        -------
        Array
            Q(a, b) [radii squared].
        """
        # The integral over u from -a to 1. Where |u| < k the chord of the spot crosses the corner's
        # edge; elsewhere it lies within the corner (b > 0), or beside it.
        k, start = np.sqrt(1 - b**2), -a
        crossed = self._crossed(a, b, k) - self._crossed(a, b, np.clip(start, -k, k))
        whole = self._whole(a, b, np.ones_like(k)) - self._whole(a, b, np.maximum(start, k))
        whole += self._whole(a, b, -k) - self._whole(a, b, np.minimum(start, -k))
        total: Array = (crossed + np.where(b > 0, whole, 0)) * ((1 + self.power) / np.pi)
        return total

    def _crossed(self, a: Array, b: Array, u: Array) -> Array:
        """Return the antiderivative where chords cross the edge of the corner."""
        c = np.sqrt(np.maximum(1 - u**2, 0))
        if self.power == 0:  # of (a + u) (b^2 + c^2 + 2 b c) / 2
            even = a * (b**2 + 1) * u + (b**2 + 1) * u**2 / 2 - a * u**3 / 3 - u**4 / 4
            return np.asarray(even / 2 + b * (a * (u * c + np.arcsin(u)) / 2 - c**3 / 3))
        # of (a + u) (c^4 / 4 + b^2 c^2 / 2 - b^4 / 12 + 2 b c^3 / 3)
        first = (u - 2 * u**3 / 3 + u**5 / 5) / 4 + b**2 * (u - u**3 / 3) / 2 - b**4 * u / 12
        second = (u**2 / 2 - u**4 / 2 + u**6 / 6) / 4 + b**2 * (u**2 / 2 - u**4 / 4) / 2
        second = second - b**4 * u**2 / 24
        return np.asarray(a * first + second + 2 * b / 3 * (a * _cubes(u) - c**5 / 5))

    def _whole(self, a: Array, b: Array, u: Array) -> Array:
        """Return the antiderivative where chords lie within the corner."""
        c = np.sqrt(np.maximum(1 - u**2, 0))
        if self.power == 0:  # of (a + u) 2 b c
            return np.asarray(2 * b * (a * (u * c + np.arcsin(u)) / 2 - c**3 / 3))
        return np.asarray(4 * b / 3 * (a * _cubes(u) - c**5 / 5))  # of (a + u) 4 b c^3 / 3

    def products(self) -> tuple[Array, Array]:
        """Return R as a sum of products, R(a, b) = sum_q sign_q phi_q(a) phi_q(b).

        Returns
        -------
        signs : Array
            Signs (Q,).
        values : Array
            Functions (Q, NODES) at even steps of |a| from 0 to 1; they are 0 beyond.
        """
        return _products(self.power)


def _cubes(u: Array) -> Array:
    """Return the integral of (1 - u^2)^(3/2) from 0 to u."""
    c = np.sqrt(np.maximum(1 - u**2, 0))
    total: Array = u * c**3 / 4 + 3 / 8 * (u * c + np.arcsin(u))
    return total


@lru_cache(maxsize=2)
def _products(power: int) -> tuple[Array, Array]:
    """Return the eigenvectors of R, which is symmetric, at the nodes."""
    spot, at = RaySpot(1.0, power), np.linspace(0, 1, NODES)
    a, b = np.meshgrid(at, at)
    ramp = spot.ramp(at)
    values, vectors = np.linalg.eigh(spot.corner(a, b) - np.outer(ramp, ramp))
    kept = np.abs(values) > LEAST * np.abs(values).max()
    scaled = vectors[:, kept] * np.sqrt(np.abs(values[kept]))
    return np.sign(values[kept]), scaled.T
