"""Rays through a sequence of surfaces, all at once.

References
----------
.. [1] W. T. Welford, "Aberrations of Optical Systems", Adam Hilger, 1986, chapter 4.
.. [2] G. H. Spencer and M. V. R. K. Murty, "General ray-tracing procedure", Journal of the Optical
   Society of America 52, 672-678, 1962, doi:10.1364/JOSA.52.000672.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.lenses.prescription import Surface
from vcam_cli.records import dataclass

STEPS = 30
"""Newton's steps to an asphere at most: six are enough but where a ray grazes it."""
CLOSE = 1e-15
"""Distance to an asphere at which they end, over the ray's height: rounding."""


class Rays(NamedTuple):
    """Rays at a plane or surface; all arrays have one shape.

    A tuple is changed in a fifth of the time of a record, and five are made at each surface.
    """

    x: Array
    y: Array
    z: Array
    """Places from the vertex [m]."""
    l: Array  # noqa: E741
    m: Array
    n: Array
    """Direction cosines along x, y and z."""
    path: Array
    """Optical path so far [m]."""
    alive: Array
    """Whether the ray has met all surfaces so far."""

    def after(self, length: Array, index: Array | float) -> Rays:
        """Return the rays a length further on [m], in a medium."""
        return self._replace(
            x=self.x + length * self.l,
            y=self.y + length * self.m,
            z=self.z + length * self.n,
            path=self.path + length * index,
        )

    def shifted(self, along: float) -> Rays:
        """Return the rays seen from an origin that lies further along z [m]."""
        return self._replace(z=self.z - along)


@dataclass(frozen=True, eq=False)
class Trace:
    """Rays at the image plane, and what they met on their way."""

    rays: Rays
    stop_x: Array
    stop_y: Array
    """Where they met the stop [m]."""
    fullness: Array
    """Largest of their squared heights over those of all apertures that clip."""


def trace(
    surfaces: Sequence[Surface], indices: Array, rays: Rays, stop: int, to_stop: bool = False
) -> Trace:
    """Trace rays from the first vertex to the image plane.

    Parameters
    ----------
    surfaces : sequence of Surface
        The lens.
    indices : ndarray
        Index before the first and behind every surface (S + 1, ...), broadcast against the rays.
    rays : Rays
        Near the first vertex, their z from there.
    stop : int
        Index of the surface that is the stop.
    to_stop : bool
        Whether to end there, as aiming does.

    Returns
    -------
    Trace
        The rays at the plane behind the last gap; those that missed a surface or were totally
        reflected are not alive, and hold numbers without meaning.
    """
    with np.errstate(all="ignore"):  # dead rays go on with numbers without meaning
        return _trace(surfaces, indices, rays, stop, to_stop)


def points(surfaces: Sequence[Surface], indices: Array, rays: Rays) -> tuple[Array, Array]:
    """Return where rays meet the surfaces and the image plane: x and z (S + 1, ...) [m].

    z counts from the first vertex; NaN from where a ray fails.
    """
    found, origin = [], 0.0
    with np.errstate(all="ignore"):
        for i, surface in enumerate(surfaces):
            at = _meet(surface, rays, indices[i])
            found.append((at.x, at.z + origin, at.alive))
            origin += surface.thickness
            rays = _refract(surface, at, indices[i], indices[i + 1]).shifted(surface.thickness)
            rays = rays.after(-rays.z / rays.n, indices[i + 1])
    found.append((rays.x, rays.z + origin, rays.alive))
    x, z, alive = (np.array(part) for part in zip(*found, strict=True))
    return np.where(alive, x, np.nan), np.where(alive, z, np.nan)


def sag(surface: Surface, height: Array) -> Array:
    """Return z of a surface at heights [m]; NaN where it does not exist."""
    z, _, exists = _sag(surface, np.asarray(height, float) ** 2)
    return np.where(exists, z, np.nan)


def _trace(
    surfaces: Sequence[Surface], indices: Array, rays: Rays, stop: int, to_stop: bool
) -> Trace:
    fullness = np.zeros(np.broadcast_shapes(rays.x.shape, indices.shape[1:]))
    stop_x = stop_y = fullness
    for i, surface in enumerate(surfaces):
        at = _meet(surface, rays, indices[i])
        if i == stop:
            stop_x, stop_y = at.x, at.y
            if to_stop:
                return Trace(at, stop_x, stop_y, fullness)
        if surface.clips:
            part = (at.x**2 + at.y**2) / surface.semi_diameter**2
            fullness = np.fmax(fullness, part)
        rays = _refract(surface, at, indices[i], indices[i + 1]).shifted(surface.thickness)
        rays = rays.after(-rays.z / rays.n, indices[i + 1])
    return Trace(rays, stop_x, stop_y, fullness)


def _meet(surface: Surface, rays: Rays, index: Array) -> Rays:
    """Return the rays on a surface, to whose vertex z refers."""
    c, k = surface.curvature, surface.conic
    x, y, z, l, m, n = rays.x, rays.y, rays.z, rays.l, rays.m, rays.n  # noqa: E741
    if c == 0:
        length, alive = -z / n, rays.alive
    else:
        # A t^2 + 2 B t + C = 0; of both roots that where the ray goes through from the left.
        a = c * (l * l + m * m + (1 + k) * n * n)
        b = c * (x * l + y * m + (1 + k) * z * n) - n
        inside = b * b - a * (c * (x * x + y * y + (1 + k) * z * z) - 2 * z)
        alive = rays.alive & (inside >= 0)
        root = np.sqrt(np.where(inside >= 0, inside, 0.0))
        length = (c * (x * x + y * y + (1 + k) * z * z) - 2 * z) / (root - b)
        if surface.asphere:  # a base that is missed is no reason: Newton starts at the vertex
            length = np.where(inside >= 0, length, -z / n)
            alive = rays.alive
    at = rays.after(length, index)._replace(alive=alive)
    return _newton(surface, at, index) if surface.asphere else at


def _newton(surface: Surface, rays: Rays, index: Array) -> Rays:
    """Return rays moved on from near an asphere to it."""
    for _ in range(STEPS):
        sag, slope, exists = _sag(surface, rays.x**2 + rays.y**2)
        miss = np.where(exists, sag - rays.z, 0.0)
        down = rays.n - 2 * slope * (rays.x * rays.l + rays.y * rays.m)
        step = miss / np.where(np.abs(down) > 1e-6, down, 1e-6)
        rays = rays.after(step, index)
        height = np.abs(rays.x) + np.abs(rays.y) + np.abs(rays.z)
        far = np.abs(step) > CLOSE * height
        if not (far & exists & rays.alive).any():
            break
    close = np.abs(miss) < 1e-9 * np.maximum(height, 1e-9)
    return rays._replace(alive=rays.alive & exists & close)


def _sag(surface: Surface, r2: Array) -> tuple[Array, Array, Array]:
    """Return z, dz/d(r^2), and whether the surface exists there."""
    c, k = surface.curvature, surface.conic
    inside = 1 - (1 + k) * c * c * r2
    exists = inside > 0
    root = np.sqrt(np.where(exists, inside, 1.0))
    sag, slope = c * r2 / (1 + root), c / (2 * root)
    series = np.zeros_like(r2)
    series_slope = np.zeros_like(r2)
    for i in range(len(surface.asphere) - 1, -1, -1):  # Horner: A4 + A6 r^2 + ...
        series_slope = series_slope * r2 + (i + 2) * surface.asphere[i]
        series = series * r2 + surface.asphere[i]
    return sag + series * r2 * r2, slope + series_slope * r2, exists


def _refract(surface: Surface, at: Rays, before: Array, behind: Array) -> Rays:
    """Return the rays behind a surface, by Snell's law in vectors."""
    nx: Array | float
    ny: Array | float
    nz: Array | float
    if surface.curvature == 0 and not surface.asphere:
        nx, ny, nz = 0.0, 0.0, 1.0
    elif surface.asphere:
        slope = _sag(surface, at.x**2 + at.y**2)[1]
        length = 1 / np.sqrt(1 + 4 * slope * slope * (at.x**2 + at.y**2))
        nx, ny, nz = -2 * slope * at.x * length, -2 * slope * at.y * length, length
    else:
        c, k = surface.curvature, surface.conic
        nx, ny, nz = -c * at.x, -c * at.y, 1 - c * (1 + k) * at.z
        if k:
            length = 1 / np.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx * length, ny * length, nz * length
    mu = before / behind
    incoming = at.l * nx + at.m * ny + at.n * nz
    square = 1 - mu * mu * (1 - incoming * incoming)
    alive = at.alive & (square >= 0) & (incoming > 0)
    change = np.sqrt(np.where(square >= 0, square, 0.0)) - mu * incoming
    return at._replace(
        l=mu * at.l + change * nx,
        m=mu * at.m + change * ny,
        n=mu * at.n + change * nz,
        alive=alive,
    )
