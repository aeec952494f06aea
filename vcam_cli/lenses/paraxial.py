"""First-order properties of a lens: focal length, pupils, conjugates.

References
----------
.. [1] W. T. Welford, "Aberrations of Optical Systems", Adam Hilger, 1986, chapter 3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.lenses.prescription import Prescription, Surface
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Paraxial:
    """First-order data at one wavelength. Lengths in [m], positions along +z."""

    focal_length: float
    back_focus: float
    """Rear focus from the last vertex."""
    front_focus: float
    """Front focus from the first vertex."""
    entrance_pupil: float
    """From the first vertex."""
    exit_pupil: float
    """From the last vertex."""
    exit_pupil_diameter: float
    pupil_magnification: float
    """Exit over entrance pupil."""
    stop_semi_diameter: float
    """Marginal ray's height in the stop."""

    @property
    def front_principal(self) -> float:
        """Front principal plane from the first vertex, from which object distances count."""
        return self.front_focus + self.focal_length

    def image(self, distance: float) -> float:
        """Return the image's place from the last vertex, of an object's distance.

        Parameters
        ----------
        distance : float
            From the object to the front principal plane, or inf [m].
        """
        if math.isinf(distance):
            return self.back_focus
        return self.back_focus + self.focal_length**2 / (distance - self.focal_length)


def paraxial(lens: Prescription, wavelength: float) -> Paraxial:
    """Return the first-order data of a lens at a wavelength [m].

    Raises
    ------
    ValueError
        For a lens without power, or whose stop is imaged to infinity on the object's side.
    """
    index = lens.indices(np.array([wavelength]))[:, 0]
    whole = _matrix(lens.surfaces, index)
    before = _matrix(lens.surfaces[: lens.stop], index, last_gap=True)
    behind = _matrix(lens.surfaces[lens.stop :], index[lens.stop :])
    power = -whole[1, 0]
    if not power > 1e-12 * np.abs(whole).max():
        raise ValueError("it has no positive power and forms no real image")
    focal_length = 1 / power
    if abs(before[0, 0]) < 1e-12:
        raise ValueError("its entrance pupil lies at infinity")
    # (y, n u) of a ray through the stop's center: seen from the first and from the last vertex.
    entrance = before[0, 1] / before[0, 0]
    exit_pupil = -behind[0, 1] / behind[1, 1] if behind[1, 1] else math.inf
    magnification = behind[0, 0] + behind[1, 0] * exit_pupil
    pupils = magnification * before[0, 0] if math.isfinite(exit_pupil) else math.inf
    return Paraxial(
        focal_length=float(focal_length),
        back_focus=float(whole[0, 0] * focal_length),
        front_focus=float(-whole[1, 1] * focal_length),
        entrance_pupil=float(entrance),
        exit_pupil=float(exit_pupil),
        exit_pupil_diameter=float(abs(pupils) * lens.pupil_diameter),
        pupil_magnification=float(abs(pupils)),
        stop_semi_diameter=float(abs(before[0, 0]) * lens.pupil_diameter / 2),
    )


def _matrix(surfaces: Iterable[Surface], index: Array, last_gap: bool = False) -> Array:
    """Return what surfaces make of (y, n u): refractions and the gaps between them.

    `last_gap`: the gap behind the last one, too.
    """
    total = np.eye(2)
    chain = tuple(surfaces)
    for i, surface in enumerate(chain):
        power = surface.curvature * (index[i + 1] - index[i])
        total = np.array([[1.0, 0.0], [-power, 1.0]]) @ total
        if i + 1 < len(chain) or last_gap:
            total = np.array([[1.0, surface.thickness / index[i + 1]], [0.0, 1.0]]) @ total
    return total
