"""Blur by an optical low-pass filter: birefringent plates in front of the sensor double the image.

    H(f) = product over the plates of cos(pi f . d),   |1 - H(f)| <= 2 pi |f| r

d is the displacement of the two copies that a plate makes, r the mean distance of all copies from
their center, |d| / 2 for one plate. One plate along x, y or a diagonal makes two copies, two
crossed plates four, at the corners of a square. Contrast falls to 0 at half a cycle per |d|. All
copies are equally bright, at any polarization and wavelength.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import reduce
from itertools import product

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Effect
from vcam_cli.effects.blurs import GeometricTransfer, SeparableTransfer
from vcam_cli.records import dataclass

Vectors = tuple[tuple[float, float], ...]


class LowPass(Effect):
    """Displaced copies of the image, by a birefringent filter on the sensor."""

    name = "low_pass"
    reference = "J. E. Greivenkamp, Appl. Opt. 29, 676, 1990 (optical prefilters)"
    absent = "optics.low_pass has the value none"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Effect | None:
        """Return the filter of a camera, or None where it has none."""
        given = camera.optics.low_pass
        if given is None or given.displacement == 0:
            return None
        d, oblique = given.displacement, given.displacement / math.sqrt(2)
        plates: dict[str, Vectors] = {
            "x": ((d, 0.0),),
            "y": ((0.0, d),),
            "both": ((d, 0.0), (0.0, d)),
            "diagonal": ((oblique, oblique),),
        }
        kind = ObliqueLowPass if given.axes == "diagonal" else LowPassAlongAxes
        return kind(plates[given.axes])


@dataclass(frozen=True)
class Plates(LowPass):
    """What is common to plates in any direction."""

    plates: Vectors
    """Displacement (x, y) of the copies that each plate makes [m]."""

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        places = (f"({x * 1e6:.3g}, {y * 1e6:.3g})" for x, y in self.plates)
        return f"{2 ** len(self.plates)} copies, displaced by {' and '.join(places)} um"

    @property
    def reach(self) -> float:
        """How far from its place it throws light [m]."""
        return float(np.hypot(*self.copies).max())

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|): the copies' mean distance [m]."""
        return np.full(len(wavelengths), np.hypot(*self.copies).mean())

    @property
    def copies(self) -> Array:
        """Places (2, copies) of the copies of a point along x and y [m]."""
        signs = np.array(list(product((-0.5, 0.5), repeat=len(self.plates))))
        return np.array((signs @ np.array(self.plates)).T)

    def seen_by_turned(self, angle: float) -> ObliqueLowPass:
        """Return the filter as a scene meets it that is turned clockwise by an angle [rad]."""
        cosine, sine = math.cos(angle), math.sin(angle)
        return ObliqueLowPass(
            tuple((cosine * x + sine * y, cosine * y - sine * x) for x, y in self.plates)
        )


@dataclass(frozen=True)
class LowPassAlongAxes(Plates, SeparableTransfer):
    """Plates that displace along x, along y, or one along each."""

    is_even = True

    def along_x(self, frequency: Array) -> Array:
        """Return the transfer along x at `frequency` [cycles/m]."""
        return _contrast(frequency * x for x, _ in self.plates)

    def along_y(self, frequency: Array) -> Array:
        """Return the transfer along y at `frequency` [cycles/m]."""
        return _contrast(frequency * y for _, y in self.plates)


@dataclass(frozen=True)
class ObliqueLowPass(Plates, GeometricTransfer):
    """Plates that displace in any direction."""

    is_symmetric = True

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: (m, n)."""
        return _contrast(fx[None, :] * x + fy[:, None] * y for x, y in self.plates)

    def otf_along(self, frequency: Array, across: tuple[float, float], wavelength: float) -> Array:
        """Return the transfer (n,) of waves in one direction."""
        return _contrast(frequency * (across[0] * x + across[1] * y) for x, y in self.plates)


def _contrast(cycles: Iterable[Array]) -> Array:
    """Return the product of the contrasts of waves by their cycles between the copies."""
    return reduce(np.multiply, (np.cos(np.pi * c) for c in cycles))
