"""What layers out of focus hide of each other, beyond the product of their means.

A ray through the point u of the aperture (in its radii) meets a layer whose points blur to the
radius r in x - r u. In the mean over all rays, light behind an edge is not the mean light times the
mean of what the edge lets pass: both depend on u, and their covariance over the aperture is
missing. It is the mean over u of the layers put one before the other, as the rays through u see
them, less the layers' means put one before the other:

    <L_1 + (1 - a_1) (L_2 + (1 - a_2) (...))> - (<L_1> + (1 - <a_1>) (<L_2> + (1 - <a_2>) (...))).

The mean is a sum over points of the aperture: Gauss's in the squared radius, evenly spaced along
each ring.

In waves, a frequency f of incoherent light is transferred by the points of the pupil that are
lambda N f / 2 away from two others, one each way (in the pupil's diameters) [1]_. So the picture
through u has those frequencies alone for which both of them lie in the pupil. A point stands for a
patch around it, and counts by how much of that lies in their overlap: whole points, in or out,
would take twice as many rings.

References
----------
.. [1] H. H. Hopkins, "The frequency response of a defocused optical system", Proc. R. Soc. A 231,
   91-103, 1955, doi:10.1098/rspa.1955.0158.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.physics.diffraction import otf_circular

SPOKES = 4
"""Points along the aperture's edge, over the number of rings."""


@dataclass(frozen=True, eq=False)
class BlurredLayer:
    """A layer's light and opacity before the lens, and how widely a point of it blurs."""

    planes: NDArray
    """Light times opacity of every color, in any unit, and opacity from 0 to 1 (..., C + 1, h, w).
    What comes first are places that do not see each other."""
    radius: tuple[float, float]
    """Radius of a point's blur along x and y [samples]; its sign is that of the distance before the
    focus."""

    @cached_property
    def spectrum(self) -> NDArray:
        """Transform (..., C + 1, h, w // 2 + 1) of light and opacity."""
        return np.asarray(scipy.fft.rfft2(self.planes))

    def shift(self, u: float, v: float) -> NDArray:
        """Return the transfer (h, w // 2 + 1) to what rays through a point of the aperture see."""
        rows, columns = self.planes.shape[-2:]
        down = np.exp(-2j * np.pi * self.radius[1] * v * scipy.fft.fftfreq(rows))
        right = np.exp(-2j * np.pi * self.radius[0] * u * scipy.fft.rfftfreq(columns))
        return np.outer(down, right).astype(self.spectrum.dtype)

    def filtered(self, transfer: NDArray) -> NDArray:
        """Return light and opacity (..., C + 1, h, w) behind a transfer."""
        return np.asarray(scipy.fft.irfft2(self.spectrum * transfer, self.planes.shape[-2:]))


def aperture_points(rings: int) -> Iterator[tuple[float, float, float]]:
    """Yield points (u, v) of a disc of radius 1 and their weights, whose sum is 1."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    for ring, (node, weight) in enumerate(zip(nodes, weights, strict=True)):
        radius = math.sqrt((1 + node) / 2)
        count = math.ceil(SPOKES * rings * radius)
        for angle in 2 * np.pi / count * (np.arange(count) + ring / 2):
            yield radius * math.cos(angle), radius * math.sin(angle), weight / 2 / count


def covariance(
    layers: Sequence[BlurredLayer], rings: int, period: tuple[float, float] = (0.0, 0.0)
) -> NDArray:
    """Return the covariance over the aperture that the product of means lacks.

    Parameters
    ----------
    layers : sequence of BlurredLayer
        Layers of one shape, the nearest first. Their border is taken to repeat.
    rings : int
        Rings of points in the aperture.
    period : tuple of float, optional
        Along x and y, of the frequency from which the lens transfers nothing, lambda N [samples]; 0
        without diffraction.

    Returns
    -------
    NDArray
        What is to be added to the product of means (..., C, h, w), in the light's unit.
    """
    shape = layers[0].planes.shape[-2:]
    fx, fy = scipy.fft.rfftfreq(shape[1])[None, :], scipy.fft.fftfreq(shape[0])[:, None]
    apart_x, apart_y = period[0] * fx, period[1] * fy
    spectrum = np.zeros_like(layers[0].spectrum[..., :-1, :, :])
    transfers = [np.zeros(spectrum.shape[-2:], spectrum.dtype) for _ in layers]
    counted = np.zeros(spectrum.shape[-2:], spectrum.real.dtype)
    points = list(aperture_points(rings))
    half = math.sqrt(math.pi / len(points)) / 2
    for u, v, weight in points:
        # The further of u + apart and u - apart from the middle.
        between = 2 * np.abs(u * apart_x + v * apart_y)
        furthest = np.sqrt(u**2 + v**2 + apart_x**2 + apart_y**2 + between)
        steep = 2 * min(half, 1 - math.hypot(u, v))
        inside = weight * np.clip(0.5 + (1 - furthest) / steep, 0, 1)
        inside = inside.astype(counted.dtype)
        shifts = [layer.shift(u, v) for layer in layers]
        seen = _composed([a.filtered(b) for a, b in zip(layers, shifts, strict=True)])
        spectrum += inside * scipy.fft.rfft2(seen)
        counted += inside
        for transfer, shift in zip(transfers, shifts, strict=True):
            transfer += inside * shift
    share = otf_circular(np.hypot(apart_x, apart_y), 1.0, 1.0) / np.where(counted > 0, counted, 1)
    share = share.astype(counted.dtype)
    means = [a.filtered(share * b) for a, b in zip(layers, transfers, strict=True)]
    together = scipy.fft.irfft2(share * spectrum, shape)
    return np.asarray(together - _composed(means))


def _composed(layers: Sequence[NDArray]) -> NDArray:
    """Return the light (..., C, h, w) of layers (..., C + 1, h, w) one before the other."""
    total = np.zeros_like(layers[0][..., :-1, :, :])
    for layer in reversed(layers):
        total = layer[..., :-1, :, :] + (1 - layer[..., -1:, :, :]) * total
    return total
