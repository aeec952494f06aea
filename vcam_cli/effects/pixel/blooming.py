"""Blooming: charge beyond the full well spills along the column.

    each way along the column = blooming (charge - full well) / 2

The share `blooming` of the excess of a full pixel flows half up and half down and fills the
neighbors one after the other; a drain discards the rest. Charge is conserved except for the drain
and the ends of a column.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import circuit
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import Overflow
from vcam_cli.errors import bad
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Blooming(Overflow):
    """Excess charge spills along columns, never along rows.

    It spills in one step at the end of the exposure, noise included. It is not simulated for hot
    pixels without a stated charge.
    """

    share: float
    """Share of the excess that the drain leaves."""
    full_well: float
    """Of a pixel [electrons]."""

    name = "blooming"
    reference = "Janesick, Scientific Charge-Coupled Devices, 2001, section 4.2"
    keys_behind_light = ("pixel.blooming",)
    absent = "pixel.blooming is 0"
    seconds_per_pixel = 20e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the blooming of a camera's pixels, or None where a drain takes all excess."""
        share, defects = camera.pixel.blooming, camera.pixel.defects
        if not share:
            return None
        if defects.hot and defects.hot_current is None:
            message = "would spill a charge that is not stated, over the columns' neighbors"
            raise bad("pixel.defects.hot", message, "add defects.hot_current: 200")
        return cls(share, circuit(camera).full_well)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{100 * self.share:.3g} % of the excess charge flows along the column"

    def mean_error(self, signal: SignalLevels) -> float | None:
        """Return 0 where no signal comes near the well; elsewhere it is not left out."""
        return 0.0 if signal.extreme < self.full_well else None

    def settled(self, charge: Array) -> Array:
        """Return charges (rows, columns) after their excess has found room [electrons]."""
        well = charge.dtype.type(self.full_well)
        spilled = np.maximum(charge - well, 0) * charge.dtype.type(self.share / 2)
        if not spilled.any():
            return np.asarray(np.minimum(charge, well))
        # 64 bits: what goes on is a difference of sums over the column.
        held, half = np.minimum(charge, well).astype(np.float64), spilled.astype(np.float64)
        for rows in (range(len(held)), range(len(held) - 1, -1, -1)):
            on_its_way = np.zeros(held.shape[1])
            for row in rows:
                taken = np.minimum(on_its_way, self.full_well - held[row])
                held[row] += taken
                on_its_way += half[row] - taken
        settled: Array = held.astype(charge.dtype)
        return settled
