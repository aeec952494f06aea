"""Blur by charge that diffuses laterally in the silicon before it is collected.

    MTF(f) = D(f) / D(0),   1 / L_f^2 = 1 / L_n^2 + (2 pi f)^2
    D(f) = 1 - e^(-a L) + e^(-a L) integral_0^L_d a e^(-a z) sinh((L_d - z) / L_f) dz
                          / sinh(L_d / L_f)

a is the absorption of silicon, L_n the diffusion length, L and L_d the depths of the depletion
region and of the neutral one below it.

Red light is absorbed below the depletion region, so it blurs more than blue. The transfer never
falls to zero: charge from the depletion region is collected where it is generated.

The thesis multiplies it by the aperture's MTF, with a depletion region that covers the whole array.
For small photodetectors and long diffusion the two factors do not separate exactly, and the true
contrast is higher: E. G. Stevens, IEEE Transactions on Electron Devices 39, 2621-2623, 1992,
doi:10.1109/16.163473.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.photodiode import diffusion
from vcam_cli.effects.blurs import RadialTransfer
from vcam_cli.physics import silicon
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class ChargeDiffusion(RadialTransfer):
    """Collection of a sinusoid of charge over that of uniform charge, in one dimension of depth."""

    diffusion_length: float
    """Of electrons in the neutral region [m]."""
    depletion_width: float
    """Of the region whose charge is collected where it is born [m]."""
    neutral_depth: float
    """From the depletion region to where electrons are lost [m]."""

    name = "charge_diffusion"
    reference = "Chen 2003, eqs 2.27-2.29; absorption of silicon: Green 2008"
    absent = "pixel.photodetector.charge_diffusion has the value none"
    largest_loss = 1.0

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the diffusion in the camera's silicon, or None where the file describes none."""
        lengths = diffusion(camera)
        if lengths is None:
            return None
        return cls(lengths.diffusion_length, lengths.depletion_width, lengths.neutral_depth)

    @remembered(4)  # a frame's plan says it: 0.1 ms of 2 that plans take
    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        at = self.spectral_otf(np.array([100e3]), np.array([550e-9, 650e-9]))
        green, red = 100 * at[:, 0]
        return f"MTF at 100 lp/mm: {green:.3g} % at 550 nm, {red:.3g} % at 650 nm"

    def otf(self, frequency: Array, wavelength: float) -> Array:
        """Return the transfer at `frequency` [cycles/m] and `wavelength` [m]."""
        return self._transfer(frequency, silicon.absorption(wavelength))

    def spectral_otf(self, frequency: Array, wavelengths: Array) -> Array:
        """Return the transfer at every wavelength (J,) [m]: (J, *shape of `frequency`)."""
        waves = wavelengths.reshape(-1, *(1,) * frequency.ndim)
        return self._transfer(frequency, silicon.absorption(waves))

    def _transfer(self, frequency: Array, absorption: Array) -> Array:
        """Return the transfer of light with absorption coefficients that broadcast [1/m]."""
        return silicon.diffusion_mtf(
            frequency,
            absorption,
            self.diffusion_length,
            self.depletion_width,
            self.neutral_depth,
        )

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or inf [cycles/m]."""
        return np.inf
