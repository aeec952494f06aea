"""Diffraction by the circular aperture of the lens.

    OTF(f) = (2 / pi) (acos(nu) - nu sqrt(1 - nu^2)),   nu = |f| lambda N (1 - m) < 1, else 0

N is the f-number, m the magnification, f the frequency on the sensor. The cut-off frequency is 1 /
(lambda N (1 - m)), lower for red light than for blue.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import switched_off
from vcam_cli.effects.blurs import RadialTransfer
from vcam_cli.physics import diffraction
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Diffraction(RadialTransfer):
    """Incoherent transfer function of an ideal circular pupil."""

    f_number: float
    magnification: float
    """Of what is in focus, over that of the pupils."""

    name = "diffraction"
    reference = "Chen 2003, section 2.2.1; Goodman, Introduction to Fourier Optics, section 6.3"
    absent = "optics.diffraction is false, or psf, mtf, prescription or aperture has it"
    origin = "lens"
    largest_loss = 1.0

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the diffraction of the lens, or None where the file leaves it out."""
        replaced = camera.optics.replaces_diffraction and not switched_off(camera, "aberration")
        if replaced or not camera.optics.diffraction:
            return None
        return cls(geometry.f_number, geometry.cone_magnification)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        cutoff = self.cutoff(550e-9) / 1e3
        return f"cut-off {cutoff:.4g} lp/mm at 550 nm"

    def otf(self, frequency: Array, wavelength: float) -> Array:
        """Return the transfer at `frequency` [cycles/m] and `wavelength` [m]."""
        return diffraction.otf_circular(frequency, wavelength, self.f_number, self.magnification)

    def spectral_otf(self, frequency: Array, wavelengths: Array) -> Array:
        """Return the transfer at every wavelength (J,) [m]: (J, *shape of `frequency`)."""
        waves = wavelengths.reshape(-1, *(1,) * frequency.ndim)
        return diffraction.otf_circular(frequency, waves, self.f_number, self.magnification)

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) [m].

        The transfer is convex in nu: it lies above its tangent 1 - 4 nu / pi.
        """
        cutoff = diffraction.cutoff_frequency(wavelengths, self.f_number, self.magnification)
        return 2 / np.pi**2 / cutoff

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or inf [cycles/m]."""
        return float(diffraction.cutoff_frequency(wavelength, self.f_number, self.magnification))
