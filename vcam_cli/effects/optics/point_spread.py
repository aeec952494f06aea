"""Blur by a point spread function that was measured or comes from a lens program.

It has both aberrations and diffraction in it, so the effect `diffraction` goes.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import field
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.blurs import PlaneTransfer
from vcam_cli.effects.optics.wavefront_blur import AberrationBlur, largest_loss
from vcam_cli.records import dataclass

PSF = "optics.psf"
"""Key under which the camera carries the samples of its point spread function."""

LEAST_PHASE = 1e-3
"""Phase below which the cosine integral, infinite at a sample itself, counts as there: 6.3."""

AT_ONCE = 4096
"""Frequencies in one direction that are computed at once: 64 kB for each row of samples."""

ROUNDING = 1e-9
"""Part of the Nyquist frequency within which a frequency counts as on it: nothing passes there."""


@dataclass(frozen=True)
class PointSpread(AberrationBlur, PlaneTransfer):
    """A point spread function from a file: points of light, one on every sample.

    Its origin, where a perfect lens would put the light, is the middle of the file's grid, between
    two samples where their number is even.
    """

    file: str
    pitch: float
    """Distance of the samples [m]."""
    wavelengths: tuple[float, ...]
    """Wavelengths of the channels [m]; empty where there is one for all wavelengths."""
    samples: Array | None = field(compare=False, repr=False)
    """Samples (channels, rows, columns), each of sum 1; None before the file was read."""
    content: bytes = field(repr=False)
    """Digest of the samples, by which blurs are equal: a file may be written anew."""

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> PointSpread | None:
        """Return the blur of the file's point spread function, or None where it gives none."""
        psf = camera.optics.psf
        if psf is None:
            return None
        samples = camera.samples(PSF)
        content = b"" if samples is None else hashlib.sha256(samples.tobytes()).digest()
        return cls(psf.file, psf.pitch, psf.wavelengths, samples, content)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        text = f"point spread function sampled every {self.pitch * 1e6:.4g} um"
        if self.samples is None:
            return text
        return f"{text}; 90 % of the light within {2e6 * self._radius(0.9):.3g} um"

    @property
    def reach(self) -> float:
        """How far from its place the blur throws almost all of the light, diffraction aside [m]."""
        return self._radius(0.99)

    def line_tail(self, distance: Array) -> Array:
        """Return the envelope of a line's light beyond the reach, to one side.

        Samples that end at their Nyquist frequency F are sinc functions: of one at x a line leaves
        1/2 - Si(2 pi F (u - x)) / pi beyond u, which rings with the amplitude 1 / (2 pi^2 F (u -
        x)); with the cosine integral beside it, the sum's modulus is its envelope.
        """
        from scipy.special import sici

        out = np.zeros(len(distance))
        for axis, at in zip((1, 2), self._coordinates, strict=True):
            for side in (1, -1):
                z = np.subtract.outer(self.reach + distance, side * at) * (np.pi / self.pitch)
                sine, cosine = sici(np.maximum(np.abs(z), LEAST_PHASE))
                light = self._loaded_samples().sum(axis=axis).T
                beyond = (0.5 - np.sign(z) * sine / np.pi) @ light, cosine / np.pi @ light
                out = np.maximum(out, np.hypot(*beyond).max(axis=1))
        falling: Array = np.maximum.accumulate(out[::-1])[::-1]
        return falling

    def spread(self, wavelengths: Array) -> Array:
        """Return the mean distance (J,) of the light from its place [m]; inf before it is read."""
        if self.samples is None:
            return np.full(len(wavelengths), np.inf)
        x, y = self._coordinates
        light = np.abs(self.samples)
        radius = np.hypot(x[None, :], y[:, None])
        return np.full(len(wavelengths), float((light * radius).sum(axis=(1, 2)).max()))

    def _loaded_samples(self) -> Array:
        if self.samples is None:
            raise RuntimeError(f"{self.file} has not been read")
        return self.samples

    def _radius(self, share: float) -> float:
        """Return the radius around the origin that holds a share of the light [m]."""
        x, y = self._coordinates
        radius = np.hypot(x[None, :], y[:, None]).ravel()
        order = np.argsort(radius)
        light = np.cumsum(self._loaded_samples().mean(axis=0).ravel()[order])
        return float(radius[order][np.searchsorted(light, share * light[-1])])

    @property
    def _coordinates(self) -> tuple[Array, Array]:
        _, rows, columns = self._loaded_samples().shape
        x = (np.arange(columns) - (columns - 1) / 2) * self.pitch
        y = (np.arange(rows) - (rows - 1) / 2) * self.pitch
        return x, y

    def otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the transfer at all pairs of fx (n,) and fy (m,) [cycles/m]: complex (m, n).

        It is 0 beyond the Nyquist frequency of the samples.
        """
        within_x, within_y = (np.abs(f) < self.axis_cutoff(wavelength) for f in (fx, fy))
        return self.smooth_otf_plane(fx, fy, wavelength) * np.outer(within_y, within_x)

    def otf_along(self, frequency: Array, across: tuple[float, float], wavelength: float) -> Array:
        """Return the transfer (n,) of waves in one direction, its end included."""
        key = frequency.tobytes(), across

        def compute() -> Array:
            from vcam_cli.parallel import pieces  # threads, which `vcam explain` does not need

            some = pieces(len(frequency), AT_ONCE)
            return np.concatenate([self._channels_along(frequency[s], across) for s in some], 1)

        transfer = self._channel_transfer(self._transfer_cache.get(key, compute), wavelength)
        return transfer * (np.abs(frequency) <= self.cutoff_along(across, wavelength))

    def _channels_along(self, frequency: Array, across: tuple[float, float]) -> Array:
        """Return the Fourier sums of the samples in one direction: (channels, n)."""
        x, y = self._coordinates
        along = np.exp(-2j * np.pi * across[0] * np.outer(x, frequency))
        down = np.exp(-2j * np.pi * across[1] * np.outer(y, frequency))
        samples = self._loaded_samples()
        return np.array([np.einsum("yn,yn->n", down, plane @ along) for plane in samples])

    def smooth_otf_plane(self, fx: Array, fy: Array, wavelength: float) -> Array:
        """Return the Fourier sums of the samples, periodic in fx and fy: complex (m, n)."""
        key = (fx.tobytes(), fy.tobytes())
        return self._channel_transfer(
            self._transfer_cache.get(key, lambda: self._channel_transfers(fx, fy)), wavelength
        )

    def _channel_transfer(self, channels: Array, wavelength: float) -> Array:
        """Return the transfer at a wavelength between those of the channels (channels, ...)."""
        if len(self.wavelengths) < 2:
            copied: Array = channels[0].copy()
            return copied
        order = np.argsort(self.wavelengths)
        at = np.interp(wavelength, np.array(self.wavelengths)[order], np.arange(len(order)))
        low = min(int(at), len(order) - 2)
        part = at - low
        transfer: Array = (1 - part) * channels[order[low]] + part * channels[order[low + 1]]
        return transfer

    @cached_property
    def _transfer_cache(self) -> ByteCache[Array]:
        """The last transfer of the channels, which the wavelengths share."""
        return ByteCache(0)

    def _channel_transfers(self, fx: Array, fy: Array) -> Array:
        """Return the Fourier sums of the samples: (channels, m, n)."""
        x, y = self._coordinates
        along = np.exp(-2j * np.pi * np.outer(x, fx))
        down = np.exp(-2j * np.pi * np.outer(fy, y))
        return np.array([down @ plane @ along for plane in self._loaded_samples()])

    def cutoff(self, wavelength: float) -> float:
        """Return the frequency from which the transfer is zero, or inf [cycles/m]."""
        return math.sqrt(0.5) / self.pitch

    def cutoff_along(self, across: tuple[float, float], wavelength: float) -> float:
        """Return where waves in one direction are zero along either axis [cycles/m]."""
        return self.axis_cutoff(wavelength) / max(map(abs, across))

    def axis_cutoff(self, wavelength: float) -> float:
        """Return the Nyquist frequency of the samples, less what rounding may bring a term to."""
        return (1 - ROUNDING) * 0.5 / self.pitch

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        if self.samples is None:
            return signal.full_signal
        return largest_loss(self, 0.5 / self.pitch) * signal.full_signal
