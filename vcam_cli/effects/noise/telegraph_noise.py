"""Random telegraph noise: traps in the transistors of some pixels, now filled, now empty.

    noise = A (b - p)   or, double sampled,   A (b_1 - b_2)

b is 1 with the probability p that the trap is filled, else 0; steps A are exponentially
distributed.
"""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class TelegraphNoise(NoiseSource):
    """Pixels with a trap, which shifts their signal by a step while it is filled.

    Positions and steps A are fixed to the sensor; the state of a trap is drawn anew in every
    readout, since traps switch faster than frames follow. With correlated double sampling, the
    difference of two readouts, a pixel has three levels: -A, 0 and A; otherwise two. Their mean is
    part of the pixel's offset.
    """

    fraction: float
    """Of the pixels that have a trap."""
    amplitude: float
    """Mean of the steps, which are distributed exponentially [electrons]."""
    occupancy: float
    """Share of the time that a trap is filled."""
    double_sampled: bool = False

    name = "telegraph_noise"
    reference = (
        "Wang, Rao, Mierop and Theuwissen, Random telegraph signal in CMOS image sensor pixels,"
        " IEDM 2006, doi:10.1109/IEDM.2006.346973"
    )
    keys_behind_light = ("pixel.readout.telegraph_noise",)
    absent = "pixel.readout.telegraph_noise has the value none or 0"
    seconds_per_pixel = 14e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the noise that the file gives, or None where it gives none."""
        given = camera.pixel.readout.telegraph_noise
        if given is None or not given.fraction * given.amplitude:
            return None
        if given.occupancy in (0, 1):
            return None
        double = ARCHITECTURES[camera.pixel.architecture].reset_noise == "none"
        return cls(given.fraction, given.amplitude, given.occupancy, double)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        levels = "three levels" if self.double_sampled else "two levels"
        return (
            f"{100 * self.fraction:.4g} % of the pixels, {levels} {self.amplitude:.4g} e apart,"
            f" occupancy {100 * self.occupancy:.3g} %"
        )

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with the state of its traps in it; it reuses the array [electrons]."""
        # 64 bits whatever the rest is computed in: the same pixels in both.
        chance = site.sensor_uniform(f"{self.name} trap")
        level = self._filled(site, self.name)
        level -= self._filled(site, f"{self.name} reset") if self.double_sampled else self.occupancy
        trapped = chance < self.fraction
        # Of pixels with a trap, chance / fraction is even from 0 to 1, whatever the fraction is.
        step = -self.amplitude * np.log1p(-chance[trapped] / self.fraction)
        electrons[..., trapped] += (step * level[..., trapped]).astype(electrons.dtype)
        return electrons

    def _filled(self, site: Site, name: str) -> NDArray[np.float64]:
        """Return 1 where a trap would be filled at this readout, 0 where empty."""
        return (site.uniform(name) < self.occupancy).astype(np.float64)

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds, in the mean over the pixels [electrons squared]."""
        readouts = 2 if self.double_sampled else 1
        square = 2 * self.amplitude**2  # mean square of exponential steps
        return readouts * self.fraction * square * self.occupancy * (1 - self.occupancy)
