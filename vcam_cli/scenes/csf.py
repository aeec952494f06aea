"""The contrast sensitivity chart: a chirp whose frequency grows to the right, contrast upward.

Reflectance mean (1 + c(y) cos(pi F x^2 / W + phase)), x [m] from the frame's left edge, W its
width: the frequency F x / W grows linearly from 0 to F = max_frequency at the right edge (on the
sensor plane). The contrast c grows linearly from 0 at the bottom edge to max_contrast at the top.

Beyond the frame the chirp goes on (frequencies above F to the right; to the left the even
continuation, its own mirror image), and the contrast stays at 0 below and at max_contrast above,
since a contrast above 1 would be negative light.

Modulated in color, reflectance is mean ((1 + c cos) S_1 + (1 - c cos) S_2): two colors, whose sum
is white and whose luminances under D65 are the same, take turns. They are mixtures of the
reflectances that make sRGB's red, green and blue.

Source: the test chart of chapter 3 of T. Chen, "Digital camera system simulator and
applications", Stanford 2003, after Campbell and Robson, J. Physiol. 197 (1968) 551.
"""

import math
from dataclasses import dataclass

import numpy as np

from vcam_cli.scenes.base import Array, Chart, Frame
from vcam_cli.spectra import Spectrum, srgb_reflectances

LUMINANCES = (0.2126, 0.7152, 0.0722)
"""Of sRGB's red, green and blue; ITU-R BT.709."""
FIRST = {"red-green": (1.0, None, 0.5), "blue-yellow": (None, None, 1.0)}
"""How much of red, green and blue is in the first of two colors; None is what makes the luminances
equal. The second color has the rest."""


def colors(modulation: str) -> tuple[Spectrum, ...]:
    """Reflectances of the parts of a chart: one of white, or two whose sum is white."""
    if modulation == "luminance":
        return (Spectrum.flat(1.0),)
    known = FIRST[modulation]
    missing = sum(y for y, share in zip(LUMINANCES, known, strict=True) if share is None)
    there = sum(y * s for y, s in zip(LUMINANCES, known, strict=True) if s is not None)
    rest = (sum(LUMINANCES) / 2 - there) / missing
    first = [rest if share is None else share for share in known]
    return tuple(_mixed(shares) for shares in (first, [1 - share for share in first]))


def _mixed(shares: list[float]) -> Spectrum:
    """A mixture of sRGB's red, green and blue, which share a table of wavelengths."""
    pure = srgb_reflectances()
    at = pure[0].tables[0].wavelength
    values = (share * color.at(at) for share, color in zip(shares, pure, strict=True))
    return Spectrum.sampled(at, sum(values, np.zeros_like(at)), "hold")


@dataclass(frozen=True)
class Csf(Chart):
    """max_frequency [cycles/m], mean 0..1, max_contrast 0..1, phase [rad], on `frame`."""

    frame: Frame
    max_frequency: float
    mean: float
    max_contrast: float
    phase: float

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Exact: the chirp is separable, its integral along x is a pair of Fresnel integrals."""
        chirp = np.diff(self._chirp_integral(x_edges)) / np.diff(x_edges)
        contrast = np.diff(self._contrast_integral(y_edges)) / np.diff(y_edges)
        self._mix(contrast, chirp, mix, out)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        from_left = x + self.frame.width / 2
        rate = self.max_frequency / self.frame.width
        chirp = np.cos(math.pi * rate * from_left**2 + self.phase)
        contrast = self.max_contrast * np.clip(0.5 - y / self.frame.height, 0.0, 1.0)
        out = np.empty((len(mix), len(y), len(x)), mix.dtype)
        self._mix(contrast, chirp, mix, out)
        return out

    def _mix(self, contrast: Array, chirp: Array, mix: Array, out: Array) -> None:
        pattern = np.outer(contrast.astype(mix.dtype), chirp.astype(mix.dtype))
        first, second = mix[:, 0], mix[:, 1] if mix.shape[1] > 1 else np.zeros(len(mix), mix.dtype)
        mean = mix.dtype.type(self.mean)
        for plane, level, swing in zip(
            out, mean * (first + second), mean * (first - second), strict=True
        ):
            np.multiply(pattern, swing, out=plane)
            plane += level

    def _chirp_integral(self, x: Array) -> Array:
        """Integral of cos(pi F x^2/W + phase) from the left edge to x [m]."""
        from scipy.special import fresnel

        from_left = x + self.frame.width / 2
        rate = self.max_frequency / self.frame.width
        if rate == 0.0:
            return from_left * math.cos(self.phase)
        scale = math.sqrt(2.0 * rate)
        sine, cosine = fresnel(scale * from_left)
        return (math.cos(self.phase) * cosine - math.sin(self.phase) * sine) / scale

    def _contrast_integral(self, y: Array) -> Array:
        """Integral [m] over y (down) of max_contrast clip(1/2 - y/H, 0, 1), up to a constant."""
        up = 0.5 - y / self.frame.height
        ramp = np.clip(up, 0.0, 1.0)
        return -self.max_contrast * self.frame.height * (ramp**2 / 2 + np.maximum(up - 1.0, 0.0))
