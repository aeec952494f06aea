"""Charge that stays in a pixel when it is read, and comes with the next frame of a sequence.

    r_k = (1 - l) s_k + l min(r_(k-1), w)

s_k is the charge that frame k collects, r_k what is read, w the full well. Constant light reads as
it is; behind a flash the part l^k of it is read k frames later, and no charge is lost.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import circuit
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import Retention
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Lag(Retention):
    """Every electron stays behind with the same chance, at each frame anew.

    So it acts on mean signals: an electron is read in one frame alone, a Poisson number of them
    splits into independent Poisson numbers by frame, and no noise is correlated between frames.
    Before the first frame a pixel has seen its light for long. It is not simulated that few
    electrons lag by a larger share than many, nor that a pattern of dark currents lags.
    """

    share: float
    """Share of a pixel's charge."""
    full_well: float
    """Of a pixel [electrons]."""

    name = "lag"
    reference = (
        "Theuwissen, Solid-State Imaging with Charge-Coupled Devices, 1995, section 5.4;"
        " splitting of Poisson numbers: Kingman, Poisson Processes, 1993, section 5.5"
    )
    keys_behind_light = ("pixel.lag",)
    absent = "pixel.lag is 0"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the lag of a camera's pixels, or None where all charge is read."""
        share = camera.pixel.lag
        return cls(share, circuit(camera).full_well) if share else None

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        return f"{100 * self.share:.3g} % of a pixel's charge is read in the next frame"

    def mean_error(self, signal: SignalLevels) -> float:
        """Return the most that it changes between two frames [electrons]."""
        return self.share * signal.full_signal
