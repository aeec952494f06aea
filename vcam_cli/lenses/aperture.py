"""The size of a lens's pupil, from whichever number gives it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from vcam_cli.lenses.paraxial import paraxial
from vcam_cli.lenses.prescription import Prescription
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Aperture:
    """One of the numbers that fix the pupil."""

    kind: Literal["entrance_pupil_diameter", "f_number", "stop_semi_diameter"]
    value: float
    """[m], or without unit."""


def pupil_diameter(lens: Prescription, aperture: Aperture) -> float:
    """Return the diameter of the entrance pupil at the primary wavelength [m].

    Raises
    ------
    ValueError
        Where it is not positive, or the lens forms no image.
    """
    unit = paraxial(replace(lens, pupil_diameter=1.0), lens.primary)
    if not (aperture.value > 0 and math.isfinite(aperture.value)):
        raise ValueError(f"its aperture is {aperture.value:g}, which lets no light through")
    if aperture.kind == "f_number":
        return unit.focal_length / aperture.value
    if aperture.kind == "stop_semi_diameter":
        return aperture.value / unit.stop_semi_diameter
    return aperture.value
