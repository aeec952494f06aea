"""What a pixel gives to its neighbors: light, charge, and the voltage of its sense node.

    s'(r) = sum_d K(d) s(r - d),   sum_d K(d) = 1

With the share c to each of the four nearest, MTF(u, v) = 1 - 4 c + 2 c (cos 2 pi u + cos 2 pi v),
u and v in cycles per pixel. In a mosaic neighbors are of other colors, so that colors mix: behind
a Bayer mosaic red is (1 - 4 c) R + 4 c G, green (1 - 4 c) G + 2 c (R + B).

Light and charge that stray before they are counted arrive by chance, so noise of neighbors is
independent. Interpixel capacitance acts behind: neighbors show part of each other's noise, with the
covariance C_01 / C_00 = 2 c (1 - 4 c) / ((1 - 4 c)^2 + 4 c^2), about 2 c.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.crosstalk import Kernel, Kernels
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import NeighborSharing


@dataclass(frozen=True)
class Crosstalk(NeighborSharing):
    """Optical crosstalk, then electrical, then charge is counted, then interpixel capacitance.

    A kernel by wavelength is, for each color, its mean over the electrons that the scene's white
    makes behind that color's filter. Beyond the array's border lie pixels of its pattern that see
    what those inside see. Pattern of dark currents and reset noise do not couple; charge beyond the
    full well does not either.
    """

    before: tuple[Kernels, ...]
    after: Kernel | None
    largest_share: float
    """Largest share of a pixel's signal that it gives away."""

    name = "crosstalk"
    reference = (
        "interpixel capacitance: Moore, Ninkov, Forrest, Opt. Eng. 45(7), 2006,"
        " doi:10.1117/1.2219103; before the charge is counted a Poisson number splits: Kingman,"
        " Poisson Processes, 1993, section 5.5"
    )
    keys_behind_light = ("pixel.crosstalk",)
    absent = "pixel.crosstalk has the value none"
    seconds_per_pixel = 10e-9

    def __post_init__(self) -> None:
        # Coupled noise is correlated: no bound on a pixel's variance says how much that is.
        object.__setattr__(self, "removable", self.after is None)

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the camera's crosstalk, or None where pixels give nothing away."""
        given = camera.pixel.crosstalk
        if given is None:
            return None
        before = tuple(k for k in (given.optical, given.electrical) if k is not None)
        coupling = given.interpixel_capacitance
        kept = 1.0
        for kernels in (*before, coupling):
            kept *= 1 - (0.0 if kernels is None else kernels.largest_share)
        if kept == 1:
            return None
        return cls(before, None if coupling is None else coupling.points[0][1], 1 - kept)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        parts = ["before charge is counted"] if self.before else []
        parts += ["by capacitance"] if self.after is not None else []
        share = f"{100 * self.largest_share:.3g} %"
        return f"a pixel gives {share} of its signal to its neighbors, {' and '.join(parts)}"

    def mean_error(self, signal: SignalLevels) -> float | None:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return self.largest_share * signal.full_signal
