"""A lens as a list of surfaces. Lengths in [m]; light travels along +z."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.lenses.glasses import AIR, Glass
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Surface:
    """A surface that is symmetric about the axis, and what follows it.

    z(r) = c r^2 / (1 + sqrt(1 - (1 + k) c^2 r^2)) + A4 r^4 + A6 r^6 + ...
    """

    curvature: float
    """c, positive where the center lies to the right [1/m]."""
    thickness: float
    """To the next vertex; of the last surface: to the image plane [m]."""
    glass: Glass = AIR
    """Behind the surface."""
    conic: float = 0.0
    """k"""
    asphere: tuple[float, ...] = ()
    """A4 [1/m^3], A6 [1/m^5], ..."""
    semi_diameter: float = math.inf
    """Half the clear diameter [m]."""
    clips: bool = False
    """Whether light beyond the semi-diameter is lost, besides at the stop."""

    def scaled(self, factor: float) -> Surface:
        """Return the surface with all lengths multiplied."""
        powers = (factor ** -(2 * i + 3) for i in range(len(self.asphere)))
        return replace(
            self,
            curvature=self.curvature / factor,
            thickness=self.thickness * factor,
            asphere=tuple(a * p for a, p in zip(self.asphere, powers, strict=True)),
            semi_diameter=self.semi_diameter * factor,
        )


@dataclass(frozen=True)
class Prescription:
    """Surfaces, stop, pupil and field of a lens."""

    name: str
    surfaces: tuple[Surface, ...]
    stop: int
    """Index of the surface that is the aperture stop."""
    pupil_diameter: float
    """Of the entrance pupil, paraxial, at the primary wavelength [m]."""
    primary: float
    """Wavelength that focal length, f-number and pupils are for [m]."""
    field: float = 0.0
    """Half the field angle that the designer gives [rad]; 0: not given."""
    title: str = ""
    source: str = ""
    remarks: tuple[str, ...] = ()
    """What the file says and the simulation ignores or had to choose."""

    def scaled(self, factor: float) -> Prescription:
        """Return the lens with all lengths multiplied; its f-number stays."""
        surfaces = tuple(surface.scaled(factor) for surface in self.surfaces)
        return replace(self, surfaces=surfaces, pupil_diameter=self.pupil_diameter * factor)

    def moved(self, shift: float) -> Prescription:
        """Return the lens with its image plane moved away from it [m]."""
        *front, last = self.surfaces
        moved = replace(last, thickness=last.thickness + shift)
        return replace(self, surfaces=(*front, moved))

    def indices(self, wavelengths: Array) -> Array:
        """Return the index before the first and behind every surface: (S + 1, W)."""
        waves = np.asarray(wavelengths, float)
        return np.array([np.ones_like(waves), *(s.glass.index(waves) for s in self.surfaces)])

    @property
    def length(self) -> float:
        """From the first vertex to the image plane [m]."""
        return sum(surface.thickness for surface in self.surfaces)
