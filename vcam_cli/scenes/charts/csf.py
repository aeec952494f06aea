"""The contrast sensitivity chart: a chirp whose frequency grows to the right, contrast upward.

Reflectance mean (1 + c(y) cos(pi F x^2 / W + phase)), x [m] from the frame's left edge, W its
width: the frequency F x / W grows linearly from 0 to F = max_frequency at the right edge (on the
sensor plane). The contrast c grows linearly from 0 at the bottom edge to max_contrast at the top.

Beyond the frame the chirp goes on (frequencies above F to the right; to the left the even
continuation, its own mirror image), and the contrast stays at 0 below and at max_contrast above,
since a contrast above 1 would be negative light.

Modulated in color, reflectance is mean ((1 + c cos) S_1 + (1 - c cos) S_2): two colors, whose sum
is white and whose luminances under D65 are the same, alternate. They are mixtures of the
reflectances that make sRGB's red, green and blue.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, chapter 3 (the test chart).
.. [2] F. W. Campbell, J. G. Robson, "Application of Fourier analysis to the visibility of
   gratings", Journal of Physiology 197, 551-566, 1968, doi:10.1113/jphysiol.1968.sp008574.
"""

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, Frame
from vcam_cli.scenes.closed_form import Products
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region
from vcam_cli.spectra import Spectrum, srgb_reflectances

LUMINANCES = (0.2126, 0.7152, 0.0722)
"""Relative luminances of sRGB's red, green and blue, ITU-R BT.709."""
FIRST_COLOR_SHARES = {"red-green": (1.0, None, 0.5), "blue-yellow": (None, None, 1.0)}
"""Shares of red, green and blue in the first of two colors; the second has the rest.

None is replaced by the value that makes the luminances equal.
"""


def modulation_colors(modulation: str) -> tuple[Spectrum, ...]:
    """Return the reflectances of the parts of a chart: one of white, or two whose sum is white.

    Parameters
    ----------
    modulation : str
        "luminance", or a pair of colors of `FIRST_COLOR_SHARES`.

    Returns
    -------
    tuple of Spectrum
        Reflectances without unit.
    """
    if modulation == "luminance":
        return (Spectrum.flat(1.0),)
    known = FIRST_COLOR_SHARES[modulation]
    missing = sum(y for y, share in zip(LUMINANCES, known, strict=True) if share is None)
    there = sum(y * s for y, s in zip(LUMINANCES, known, strict=True) if s is not None)
    rest = (sum(LUMINANCES) / 2 - there) / missing
    first = [rest if share is None else share for share in known]
    return tuple(_primary_mixture(shares) for shares in (first, [1 - share for share in first]))


def _primary_mixture(shares: list[float]) -> Spectrum:
    """Return a mixture of sRGB's red, green and blue, which share a table of wavelengths."""
    pure = srgb_reflectances()
    at = pure[0].tables[0].wavelength
    values = (share * color.evaluate(at) for share, color in zip(shares, pure, strict=True))
    return Spectrum.from_samples(at, sum(values, np.zeros_like(at)), "hold")


@dataclass(frozen=True)
class Csf(Chart):
    """The contrast sensitivity chart on a frame."""

    frame: Frame
    max_frequency: float
    """Frequency at the right edge [cycles/m]."""
    mean: float
    """Mean reflectance, 0..1."""
    max_contrast: float
    """Contrast at the upper edge, 0..1."""
    phase: float
    """Phase of the chirp at the left edge [rad]."""

    def highest_frequency(self, half_width: float) -> float:
        """Return twice that of the chirp at the edge: room for what its window adds [cycles/m]."""
        at_edge = self.max_frequency * (0.5 + half_width / self.frame.width)
        return 2 * at_edge + 8 / min(self.frame.width, self.frame.height)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy that steps would have which change as much as the chirp does.

        A wave of amplitude a and frequency f rises by 4 a f over a length in the mean; cells that
        resolve it see steps of a part of a.
        """
        bright = self.mean * float(np.abs(level).sum()) * self.max_contrast
        highest = self.max_frequency * (
            0.5 + (abs(region.center[0]) + region.size[0] / 2) / self.frame.width
        )
        return EdgeEnergy(aligned=4 * highest * bright**2)

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the exact averages over the cells into `out`.

        The chirp is separable, and its integral along x is a pair of Fresnel integrals.
        """
        chirp = np.diff(self._chirp_integral(x_edges)) / np.diff(x_edges)
        contrast = np.diff(self._contrast_integral(y_edges)) / np.diff(y_edges)
        self._mix(contrast, chirp, mix, out)

    separates = True

    def products(self, x_edges: Array, y_edges: Array, mix: Array) -> Products:
        """Return the mean, and contrast times chirp."""
        chirp = np.diff(self._chirp_integral(x_edges)) / np.diff(x_edges)
        contrast = np.diff(self._contrast_integral(y_edges)) / np.diff(y_edges)
        down = np.stack([np.ones(len(contrast)), contrast], axis=1)
        level, swing = self._levels(np.asarray(mix, float))
        along = np.stack([np.outer(level, np.ones(len(chirp))), np.outer(swing, chirp)], axis=1)
        return Products(down, along)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        from_left = x + self.frame.width / 2
        rate = self.max_frequency / self.frame.width
        chirp = np.cos(math.pi * rate * from_left**2 + self.phase)
        contrast = self.max_contrast * np.clip(0.5 - y / self.frame.height, 0.0, 1.0)
        out = np.empty((len(mix), len(y), len(x)), mix.dtype)
        self._mix(contrast, chirp, mix, out)
        return out

    def _mix(self, contrast: Array, chirp: Array, mix: Array, out: Array) -> None:
        pattern = np.outer(contrast.astype(mix.dtype), chirp.astype(mix.dtype))
        for plane, level, swing in zip(out, *self._levels(mix), strict=True):
            np.multiply(pattern, swing, out=plane)
            plane += level

    def _levels(self, mix: Array) -> tuple[Array, Array]:
        """Return the mean light (R,) and its largest difference from it, of both colors."""
        first, second = mix[:, 0], mix[:, 1] if mix.shape[1] > 1 else np.zeros(len(mix), mix.dtype)
        mean = mix.dtype.type(self.mean)
        return mean * (first + second), mean * (first - second)

    def _chirp_integral(self, x: Array) -> Array:
        """Return the integral of cos(pi F x^2/W + phase) from the left edge to x [m]."""
        from scipy.special import fresnel

        from_left = x + self.frame.width / 2
        rate = self.max_frequency / self.frame.width
        if rate == 0.0:
            return from_left * math.cos(self.phase)
        scale = math.sqrt(2.0 * rate)
        sine, cosine = fresnel(scale * from_left)
        return (math.cos(self.phase) * cosine - math.sin(self.phase) * sine) / scale

    def _contrast_integral(self, y: Array) -> Array:
        """Return an integral over y (down) of max_contrast clip(1/2 - y/H, 0, 1) [m]."""
        up = 0.5 - y / self.frame.height
        ramp = np.clip(up, 0.0, 1.0)
        return -self.max_contrast * self.frame.height * (ramp**2 / 2 + np.maximum(up - 1.0, 0.0))
