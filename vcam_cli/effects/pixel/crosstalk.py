"""Crosstalk between neighbors: optical, electrical, and by interpixel capacitance.

    s'(r) = sum_d K(d) s(r - d),   sum_d K(d) = 1

With the share c to each of the four nearest, MTF(u, v) = 1 - 4 c + 2 c (cos 2 pi u + cos 2 pi v),
u and v in cycles per pixel. In a mosaic neighbors are of other colors, so that colors mix: behind
a Bayer mosaic red is (1 - 4 c) R + 4 c G, green (1 - 4 c) G + 2 c (R + B).

Optical and electrical crosstalk act on Poisson charges, so the noise of neighbors stays
independent. Interpixel capacitance couples voltages, so it correlates the noise of neighbors, with
the covariance C_01 / C_00 = 2 c (1 - 4 c) / ((1 - 4 c)^2 + 4 c^2), about 2 c.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.crosstalk import Kernel, Kernels
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import NeighborSharing
from vcam_cli.records import dataclass

MIDDLE = 550e-9
"""Wavelength at which its contrast is stated [m]."""


@dataclass(frozen=True)
class Crosstalk(NeighborSharing):
    """Optical and electrical crosstalk before charge is counted, interpixel capacitance behind.

    A kernel by wavelength is averaged for each color, weighted by the electrons of the scene's
    white behind that color's filter. At the border the array is extended by its own pattern and
    light. Dark-current pattern, reset noise and charge beyond the full well do not couple.
    """

    before: tuple[Kernels, ...]
    after: Kernel | None
    largest_share: float
    """Largest share of a pixel's signal that it gives away."""
    pitch: tuple[float, float]
    """Of the pixels, along x and y [m]."""

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
        after = None if coupling is None else coupling.points[0][1]
        return cls(before, after, 1 - kept, (geometry.pitch_x, geometry.pitch_y))

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        parts = ["before charge is counted"] if self.before else []
        parts += ["by capacitance"] if self.after is not None else []
        share = f"{100 * self.largest_share:.3g} %"
        nyquist = self.row_transfer(np.array([0.5 / self.pitch[0]]), MIDDLE)[0]
        return (
            f"a pixel gives {share} of its signal to its neighbors, {' and '.join(parts)}; MTF"
            f" {nyquist:.3g} at Nyquist along a row"
        )

    def row_transfer(self, frequency: Array, wavelength: float) -> Array:
        """Return the contrast (n,) that it leaves of gray waves along a row."""
        out = np.ones(len(frequency), complex)
        coupling = () if self.after is None else (np.array(self.after),)
        for kernel in (*(_kernel(kernels, wavelength) for kernels in self.before), *coupling):
            line = kernel.sum(axis=0)
            places = (np.arange(len(line)) - len(line) // 2) * self.pitch[0]
            out *= np.exp(-2j * np.pi * np.multiply.outer(frequency, places)) @ line
        return np.abs(out)

    def mean_error(self, signal: SignalLevels) -> float | None:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return self.largest_share * signal.full_signal


def _kernel(kernels: Kernels, wavelength: float) -> Array:
    """Return the kernel at a wavelength [m], in the size of the largest."""
    found = [np.array(kernel) for _, kernel in kernels.points]
    height, width = (max(kernel.shape[axis] for kernel in found) for axis in (0, 1))
    same_size = np.array(
        [
            np.pad(k, [((height - k.shape[0]) // 2,) * 2, ((width - k.shape[1]) // 2,) * 2])
            for k in found
        ]
    )
    at = np.interp(wavelength, [w for w, _ in kernels.points], np.arange(len(found)))
    low = min(int(at), len(found) - 1)
    high = min(low + 1, len(found) - 1)
    kernel: Array = same_size[low] + (at - low) * (same_size[high] - same_size[low])
    return kernel
