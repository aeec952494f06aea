"""Microlens: a lens on every pixel collects light for its photodetector.

    gain = min(g w h, 0.95 W H) / (w h)

g is the microlens's `gain`, w and h are the sides of the photodetector, W and H those of the pixel.
`efficiency` states the share of the pixel that is collected instead.

This effect is the larger signal, a factor that is the same in all pixels. The larger sampling area
is part of `pixel_aperture`.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import NeutralGain
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Microlens(NeutralGain):
    """Collecting area over area of the photodetector."""

    ratio: float
    share: float
    """Of the pixel's area, what is collected: its effective fill factor."""

    name = "microlens"
    reference = (
        "Chen 2003, section 3.5.4; Catrysse, Liu and El Gamal 2000, doi:10.1117/12.385460 (shift)"
    )
    absent = "pixel.microlens has the value none"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the gain by a microlens, or None where the pixel has none."""
        if camera.pixel.microlens is None:
            return None
        share = geometry.effective_fill_factor
        # A quantum efficiency of the pixel, as makers print it, has the lens's light in it.
        included = camera.pixel.photodetector.quantum_efficiency.per_pixel
        return cls(1.0 if included else share / geometry.fill_factor, share)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        if self.ratio == 1:
            return f"effective fill factor {100 * self.share:.4g} %; its gain is part of the QE"
        return f"{self.ratio:.4g} times the light; effective fill factor {100 * self.share:.4g} %"

    def gain(self, x: Array, y: Array) -> Array:
        """Return the factor at the positions x (columns,), y (rows,) [m]: (rows, columns)."""
        return np.full((1, 1), self.ratio, x.dtype)

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return (1 - 1 / self.ratio) * signal.full_signal
