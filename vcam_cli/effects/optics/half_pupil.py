"""Blur by defocus of the light through one half of the lens.

    H(f) = 2 / (pi R^2) integral_0^|R| 2 h(x) sinc(2 h f_y) exp(-2 pi i s f_x x) dx,
    h(x) = sqrt(R^2 - x^2)

R is the radius of the blur of the whole lens, s the side on which the half's rays land: half a
disk, whose center of gravity lies 4 R / (3 pi) from the point's place. Two halves so have the
disparity 8 R / (3 pi), 4 / (3 pi) of the blur's diameter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.base import Effect
from vcam_cli.effects.blurs import GeometricTransfer
from vcam_cli.effects.optics.wavefront_blur import AberrationBlur
from vcam_cli.parallel import product
from vcam_cli.records import dataclass

LEFT, RIGHT = 1, -1
"""Side of the picture on which light of something near lands by each half of the lens, as the
photographer sees it: rays of the left half have not crossed yet, and the picture is upright."""
LEAST = 1e-9
"""Blurs of a smaller radius are skipped [m]."""


@dataclass(frozen=True)
class HalfPupil(AberrationBlur, GeometricTransfer):
    """Defocus seen through one half of a round pupil, in place of the lens's aberrations.

    Diffraction is a factor beside it, as that of the whole lens: by a half, contrast across the
    halves falls somewhat more. Aberrations other than defocus displace no phase here, and pupils
    cut by vignetting off the axis have the halves of round ones.
    """

    radius: float
    """Of the whole lens's blur; positive where things are nearer than what is in focus [m]."""
    half: int
    """LEFT or RIGHT."""

    @classmethod
    def from_camera(cls, camera: object, geometry: object) -> None:
        """Return None: it is an effect of a half's image, not of a camera's."""
        return

    def describe(self) -> str:
        """Return a short clause with this half's numbers and units."""
        moved = self.half * 4 * self.radius / (3 * math.pi)
        return f"half a lens moves points by {moved * 1e6:.4g} um"

    @property
    def reach(self) -> float:
        """How far the blur throws light [m]."""
        return abs(self.radius)

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: (m, n)."""
        radius, side = abs(self.radius), self.half * math.copysign(1, self.radius)
        highest = max(np.abs(fx).max(initial=0.0), np.abs(fy).max(initial=0.0))
        # x = R sin t: no root at the rim. Gauss's rule needs some points for every wave across R.
        node, weight = _gauss(24 + math.ceil(8 * highest * radius))
        t = (node + 1) * math.pi / 4
        x, h = radius * np.sin(t), radius * np.cos(t)
        share = weight * np.cos(t) ** 2  # sums to 1 over half a disk, but for rounding
        down = share * np.sinc(2 * np.outer(fy, h))
        across = np.outer(x, (2 * np.pi * side) * fx)
        # In one thread: BLAS would share out a complex product, and its threads wait for others.
        even, odd = product(down, np.cos(across)), product(down, np.sin(across))
        found: Array = (even - 1j * odd) / share.sum()
        return found


@lru_cache(maxsize=32)
def _gauss(points: int) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights: to find them takes longer than all the rest."""
    return np.polynomial.legendre.leggauss(points)


def halved(effects: Iterable[Effect], radius: float, half: int) -> tuple[Effect, ...]:
    """Return effects of a lens as one half of it has them.

    Parameters
    ----------
    effects : iterable of Effect
        Effects in the order of action.
    radius : float
        Radius of the whole lens's blur; positive where things are nearer than the focus [m].
    half : int
        LEFT or RIGHT.

    Returns
    -------
    tuple of Effect
        The same, defocus by half a pupil in place of aberrations.
    """
    kept = tuple(part for effect in effects for part in effect.seen_by_half_pupil())
    return kept if abs(radius) < LEAST else (HalfPupil(radius, half), *kept)
