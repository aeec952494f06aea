"""Blur of a lens whose opening is no circle: blades, an obscuration, spiders.

    H(f) = integral P(u - s/2) P*(u + s/2) d2u / area,   s = 2 lambda N (1 - m) f radii

It is the full transfer function, diffraction in it. Out of focus it is the opening's shape.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import field
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Effect, SignalLevels, of_kind
from vcam_cli.effects.blurs import PlaneTransfer
from vcam_cli.effects.optics.wavefront_blur import (
    GREEN,
    Lens,
    UniformBlur,
    focus_table,
    largest_loss,
    uniform_wavefront,
)
from vcam_cli.physics import shaped_pupil, zernike
from vcam_cli.physics.opening import CIRCLE, Opening
from vcam_cli.physics.shaped_pupil import OtfGrid
from vcam_cli.records import dataclass

FEWEST_SAMPLES = 384
"""Samples across an opening: the OTF of an annulus errs by 5e-4."""
GRIDS = 1 << 27
"""Memory of the grids of wavelengths that are kept [bytes]."""


@dataclass(frozen=True)
class ShapedBlur(UniformBlur, PlaneTransfer):
    """A wavefront that is the same everywhere, in an opening that is no circle."""

    opening: Opening = CIRCLE
    grids: ByteCache[OtfGrid] = field(
        default_factory=lambda: ByteCache(GRIDS), compare=False, repr=False
    )
    """By wavelength."""

    reference = "Goodman, Introduction to Fourier Optics, 3rd ed., section 6.3: autocorrelation"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> ShapedBlur | None:
        """Return the blur of a lens with such an opening, else None."""
        shape = camera.optics.aperture
        if not camera.optics.is_lens or shape is None or shape.opening == CIRCLE:
            return None
        terms = uniform_wavefront(camera, geometry) or ()
        lens = Lens(geometry.working_f_number, diffracts=True)
        return cls(lens, terms, focus_table(camera), shape.opening)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        stops = math.sqrt(1 / self.opening.share)
        found = f"{self.opening.describe()}, T-number {stops:.3g} times the f-number"
        return f"{found}; {super().describe()}" if self.terms or self.focus else found

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: complex (m, n)."""
        return self._otf_at(fx[None, :], fy[:, None], wavelength)

    def otf_along(self, frequency: Array, across: tuple[float, float], wavelength: float) -> Array:
        """Return the transfer (n,) of waves in one direction."""
        return self._otf_at(across[0] * frequency, across[1] * frequency, wavelength)

    def _otf_at(self, fx: Array, fy: Array, wavelength: float) -> Array:
        lag = 2 * wavelength * self.lens.working_f_number
        key = wavelength, self.terms, self.focus
        grid = self.grids.get(key, lambda: self._grid(wavelength))
        return grid.interpolate(lag * fx, lag * fy)

    def _grid(self, wavelength: float) -> OtfGrid:
        terms = self.terms if self.focus is None else self.at(wavelength).terms
        pupil = self.opening.mask(self._samples)
        at = shaped_pupil.places(pupil)
        x, y = np.meshgrid(at, at)
        turns = zernike.wavefront(terms, x, y) / wavelength if terms else np.zeros(x.shape)
        return shaped_pupil.grid_of_paths(pupil, turns)

    @cached_property
    def _samples(self) -> int:
        steepest = max(zernike.max_slope(blur.terms) for blur in self.extremes)
        return max(FEWEST_SAMPLES, shaped_pupil.samples_across(steepest / SHORTEST))

    def kept_bytes(self, wavelengths: Array, by_harmonics: bool = False) -> int:
        """Return the memory of its grids [bytes]."""
        each = 8 * (2 * self._samples + 1) * (self._samples + shaped_pupil.MIRRORED_LAGS)
        return min(len(wavelengths) * each, GRIDS) + 6 * each

    def spread(self, wavelengths: Array) -> Array:
        """Return a bound (J,) on |1 - H(f)| / (2 pi |f|) [m]."""
        lost = self.opening.edge / self.opening.share / (2 * np.pi)
        lags = 2 * wavelengths * self.lens.working_f_number
        return np.asarray(lags * lost + super().spread(wavelengths))

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        return largest_loss(self, 0.999 * self.cutoff(GREEN)) * float(signal.full_signal)


SHORTEST = 380e-9
"""Wavelength for which samples across a pupil suffice, about [m]."""


def opening_of(effects: Iterable[Effect]) -> Opening:
    """Return the opening of the lens among some effects.

    Parameters
    ----------
    effects : iterable of Effect
        Effects of a camera.

    Returns
    -------
    Opening
        Its shape; a circle where none is said.
    """
    return next((blur.opening for blur in of_kind(effects, ShapedBlur)), CIRCLE)
