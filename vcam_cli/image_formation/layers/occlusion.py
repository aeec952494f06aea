"""What layers out of focus hide of each other, beyond the product of their means.

A ray through the point u of the aperture (in its radii) meets a layer whose points blur to the
radius r in x - r u. In the mean over all rays, light behind an edge is not the mean light times the
mean of what the edge lets pass: both depend on u, and their covariance over the aperture is
missing. In Zernike's polynomials Z_n, orthonormal over the aperture, a layer's opacity is
sum_n A_n Z_n(u) in every place, the light behind it sum_n S_n Z_n(u), and the covariance is

    sum of A_n S_n over n >= 2,   A_n = a filtered by c_n(r f),
    c_n(f) = mean of Z_n(u) exp(-2 pi i f u) = (-i)^m (-1)^((n-m)/2) 2 sqrt(n+1) J_{n+1}(z) / z
             times 1, sqrt(2) cos(m theta) or sqrt(2) sin(m theta),   z = 2 pi |f|.

A_1 and S_1 are the means. From the last layer to the first the light seen over a layer is

    S_1' = L_1 + (1 - A_1) S_1 - sum_n A_n S_n,   S_n' = L_n + (1 - A_1) S_n - A_n S_1.

What this leaves out is of third order: three layers that all vary together. Orders of polynomials
are added until the last changed the picture by no more than the error that is allowed.

References
----------
.. [1] A. J. E. M. Janssen, "Extended Nijboer-Zernike approach for the computation of optical
   point-spread functions", J. Opt. Soc. Am. A 19, 849-857, 2002, doi:10.1364/JOSAA.19.000849
   (the transform of a polynomial: Noll 1976, eq 8).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.physics.zernike import noll_orders

HIGHEST = 8
"""Highest radial order of polynomials that is tried."""
FURTHER = 1.2
"""Rms of all further orders over that of the last one, at most, on layers of discs and bars."""
STEP = 0.01
"""Between the entries of a table of Bessel functions, straight in between to 2e-5 [rad]."""


@dataclass(frozen=True, eq=False)
class BlurredLayer:
    """A layer's light and opacity before the lens, and how widely a point of it blurs."""

    light: NDArray
    """Light times opacity of every color (C, h, w), in any unit."""
    opacity: NDArray
    """(h, w) from 0 to 1."""
    radius: float
    """Radius of a point's blur [samples]; its sign is that of the distance before the focus."""

    @cached_property
    def spectrum(self) -> NDArray:
        """Transform (C + 1, h, w // 2 + 1) of light and opacity."""
        planes = np.concatenate([self.light, self.opacity[None]])
        return np.asarray(scipy.fft.rfft2(planes, axes=(1, 2)))

    def coefficient(self, index: int) -> tuple[NDArray, NDArray]:
        """Return light (C, h, w) and opacity (h, w) in the polynomial of a Noll index."""
        shape = self.opacity.shape
        fx, fy = scipy.fft.rfftfreq(shape[1]), scipy.fft.fftfreq(shape[0])
        factor = polynomial_transfer(index, self.radius * fx, self.radius * fy)
        found = scipy.fft.irfft2(self.spectrum * factor.astype(self.spectrum.dtype), shape)
        return found[:-1], found[-1]


@dataclass(frozen=True)
class Covariance:
    """What the product of means lacks."""

    light: NDArray
    """What is to be added to it (C, h, w), in the light's unit."""
    order: int
    """Highest radial order of the polynomials that were summed; 0 where none was."""
    error: float
    """Predicted rms of all further orders, by what the last one added; in the light's unit."""
    rms: float
    """Of the light."""


def polynomial_transfer(index: int, fx: NDArray, fy: NDArray) -> NDArray:
    """Return c_n, the mean over the aperture of Z_n(u) exp(-2 pi i f u) [1].

    Parameters
    ----------
    index : int
        Noll's index of the polynomial, from 1.
    fx, fy : NDArray
        Frequencies (n,) and (m,) [cycles per radius of the blur].

    Returns
    -------
    NDArray
        Transfer (m, n) without unit, complex.
    """
    from scipy.special import jv

    n, m = noll_orders(index)
    order = abs(m)
    length = np.hypot(fx[None, :], fy[:, None])
    z = np.arange(0.0, 2 * np.pi * float(length.max()) + 2 * STEP, STEP)
    table = np.concatenate([[0.5 * (n == 0)], jv(n + 1, z[1:]) / z[1:]])
    radial = np.interp(2 * np.pi * length, z, table)
    direction = (fx[None, :] + 1j * fy[:, None]) / np.where(length > 0, length, 1.0)
    turned = direction**order
    around = 1.0 if m == 0 else np.sqrt(2) * (turned.real if m > 0 else turned.imag)
    return 2 * np.sqrt(n + 1) * (-1) ** ((n - order) // 2) * (-1j) ** order * radial * around


def covariance(
    layers: Sequence[BlurredLayer], allowed: float, highest: int = HIGHEST
) -> Covariance:
    """Return the covariance over the aperture that the product of means lacks.

    Parameters
    ----------
    layers : sequence of BlurredLayer
        Layers of one shape, the nearest first. Their border is taken to repeat.
    allowed : float
        Rms that further polynomials may add, in the light's unit.
    highest : int, optional
        Highest order of polynomials that is tried.

    Returns
    -------
    Covariance
        The covariance.
    """
    means = [layer.coefficient(1) for layer in layers]
    behind = [np.zeros_like(layers[0].light)]
    for light, cover in reversed(means):
        behind.insert(0, light + (1 - cover) * behind[0])
    total, error = np.zeros_like(behind[0]), np.inf
    for order in range(1, highest + 1):
        first = order * (order + 1) // 2 + 1
        indices = range(first, first + order + 1)
        added = np.sum([_of_polynomial(layers, means, behind, i) for i in indices], axis=0)
        total += added
        error = _rms(added)
        if FURTHER * error <= allowed:
            break
    return Covariance(total, order, FURTHER * error, _rms(total))


def _rms(light: NDArray) -> float:
    """Return the rms of light (C, h, w) in the color where it is most."""
    return float(np.sqrt(np.square(light).mean(axis=(1, 2)).max()))


def _of_polynomial(
    layers: Sequence[BlurredLayer],
    means: Sequence[tuple[NDArray, NDArray]],
    behind: Sequence[NDArray],
    index: int,
) -> NDArray:
    """Return what one polynomial adds to the picture (C, h, w)."""
    varying, added = np.zeros_like(behind[0]), np.zeros_like(behind[0])
    ordered = list(zip(layers, means, behind[1:], strict=True))
    for layer, (_, cover), seen in reversed(ordered):
        light, opacity = layer.coefficient(index)
        clear = 1 - cover
        added = clear * added - opacity * varying
        varying = light + clear * varying - opacity * seen
    return added
