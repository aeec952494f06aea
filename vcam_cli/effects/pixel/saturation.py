"""Saturation: the signal is clipped at the full well.

    electrons = min(signal + noise, full well)

Noise of the pixel is added before the clip, so full pixels show only noise behind it.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import circuit
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.readouts import has_several
from vcam_cli.effects.readout_chain import merged_saturation
from vcam_cli.effects.signal_chain import Limit, Site
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Saturation(Limit):
    """Clips above at the full well [electrons]; never below."""

    full_well: float
    several: bool = False
    """Whether it is where the last of several readouts saturates: others do before."""

    name = "saturation"
    reference = "Chen 2003, eq 2.26: Q_max = V_s / g"
    absent = "every pixel has it"
    seconds_per_pixel = 0.5e-9

    def __post_init__(self) -> None:
        # Light that one readout holds may fill another: the clamp of each has to stay.
        object.__setattr__(self, "removable", not self.several)

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the limit at the full well; of several readouts where the last one saturates."""
        if has_several(camera):
            return cls(merged_saturation(camera), several=True)
        return cls(circuit(camera).full_well)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"full well {self.full_well:.6g} e"

    @property
    def ceiling(self) -> float:
        """The most electrons that it lets through; a pixel that holds them is full."""
        return self.full_well

    def apply(self, electrons: Array, site: Site | None = None) -> Array:
        """Return the block clipped at the full well; it reuses the array [electrons]."""
        clipped: Array = np.minimum(electrons, electrons.dtype.type(self.full_well), out=electrons)
        return clipped
