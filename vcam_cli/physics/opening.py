"""The shape of a lens's opening: iris blades, a central obscuration, spiders.

Lengths are in radii of the circle around it, which the f-number counts. The corners of the blades
lie on that circle.

    share = area / pi,   of n blades n / (2 pi) sin(2 pi / n)
"""

from __future__ import annotations

import math
from functools import cached_property, lru_cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.physics import shaped_pupil
from vcam_cli.physics.shaped_pupil import Mask
from vcam_cli.records import dataclass

SHARE_SAMPLES = 1024
"""Samples across for the area of what spiders cover: it is known to 1e-5 of the circle."""


@dataclass(frozen=True)
class Opening:
    """A shape about the axis, the same in all places of the field."""

    blades: int = 0
    """Sides of a regular polygon; 0 for a circle."""
    rotation: float = 0.0
    """Direction of a corner and of a spider, from the right downwards [rad]."""
    obscuration: float = 0.0
    """Radius of what covers the center."""
    spiders: int = 0
    """Vanes from the center outwards, evenly spread."""
    vane: float = 0.0
    """Half the width of each."""

    def contains(self, x: Array, y: Array) -> Array:
        """Return whether places let light through.

        Parameters
        ----------
        x, y : Array
            Places right of the axis and below it, of one shape [radii].

        Returns
        -------
        Array
            Truth for each place.
        """
        square = x * x + y * y
        inside = (square <= 1) & (square >= self.obscuration**2)
        for k in range(self.blades):
            middle = self.rotation + (2 * k + 1) * math.pi / self.blades
            outwards = x * math.cos(middle) + y * math.sin(middle)
            inside &= outwards <= math.cos(math.pi / self.blades)
        for k in range(self.spiders):
            angle = self.rotation + 2 * math.pi * k / self.spiders
            along = x * math.cos(angle) + y * math.sin(angle)
            across = y * math.cos(angle) - x * math.sin(angle)
            inside &= (np.abs(across) >= self.vane) | (along < 0)
        return np.asarray(inside)

    @cached_property
    def share(self) -> float:
        """Area over that of the circle around it."""
        n = self.blades
        whole = n / (2 * math.pi) * math.sin(2 * math.pi / n) if n else 1.0
        free = whole - self.obscuration**2
        if not self.spiders:
            return free
        open_ones = Opening(n, self.rotation, self.obscuration)
        return free * self.mask(SHARE_SAMPLES).share / open_ones.mask(SHARE_SAMPLES).share

    @property
    def edge(self) -> float:
        """Bound on what a small lag takes of a circle's light, over the lag [1/radius].

        A lag takes a strip along the edges that look its way.
        """
        width = 2 * (1 + self.obscuration) + self.spiders
        return width / math.pi

    def mask(self, samples: int) -> Mask:
        """Return the shape on a grid.

        Parameters
        ----------
        samples : int
            Samples across the circle.

        Returns
        -------
        Mask
            What of each cell lies inside.
        """
        return _mask(self, samples)

    def describe(self) -> str:
        """Return a clause with its numbers."""
        parts = [f"{self.blades} blades"] if self.blades else []
        parts += [f"{100 * self.obscuration:.3g} % obscured"] if self.obscuration else []
        parts += [f"{self.spiders} spiders"] if self.spiders else []
        return f"{', '.join(parts)}: passes {100 * self.share:.3g} % of the light of a circle"


CIRCLE = Opening()


@lru_cache(maxsize=8)
def _mask(opening: Opening, samples: int) -> Mask:
    return shaped_pupil.mask(opening.contains, samples)
