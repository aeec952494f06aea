"""What the measurement should find: the closed forms behind a camera's description.

References
----------
[1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021.
[2] N. Johnson, S. Kotz, N. Balakrishnan, "Continuous Univariate Distributions", vol. 1, Wiley,
    1994, section 13.10.1 (moments of a censored normal variable).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.effects.base import Effect, SeparableTransfer
from vcam_cli.engine import plan
from vcam_cli.engine.prepare import Prepared
from vcam_cli.engine.transfer import Transfer

NODES = 33
"""Of the integral over the pixels' differences."""
TOGETHER = 16
"""Frequencies at which a transfer of two dimensions is computed at once."""


def clipped_variance(mean: ArrayLike, sigma: ArrayLike, limit: float) -> NDArray:
    """Variance of min(X, limit) for a normal X of this mean and standard deviation, [2]."""
    from scipy.special import ndtr

    m, s = np.asarray(mean, np.float64), np.asarray(sigma, np.float64)
    a = (limit - m) / s
    density = np.exp(-(a**2) / 2) / np.sqrt(2 * np.pi)
    above = ndtr(-a)
    first = a * above - density
    second = ndtr(a) - a * density + a**2 * above
    return s**2 * (second - first**2)


def saturation_capacity(
    limit: float, dark: float, floor: float, pattern: Callable[[float], float]
) -> float:
    """Photo-electrons at which the temporal variance is largest, the saturation point of [1].

    limit: electrons that well or ADC hold; dark: mean dark signal [e]; floor: variance of the
    readout [e^2]; pattern: variance from pixel to pixel at a mean signal [e^2]. Noise that is cut
    off at the limit is less: the point lies some two standard deviations below it.
    """
    photo = (limit - dark) * np.linspace(0.2, 1.2, 5001)
    z, weight = np.polynomial.hermite_e.hermegauss(NODES)
    weight = weight / weight.sum()
    spread = np.sqrt([pattern(float(m + dark)) for m in photo])
    means = photo[:, None] + dark + spread[:, None] * z
    sigma = np.sqrt(np.maximum(means, 0) + floor) + 1e-9
    variance = clipped_variance(means, sigma, limit) @ weight
    return float(photo[np.argmax(variance)])


def system_mtf(
    ready: Prepared, color: int, frequency: NDArray, direction: tuple[float, float]
) -> NDArray:
    """Transfer of optics, diffusion and aperture at the center, |H(f)| / H(0).

    frequency: (n,) along `direction`, a unit vector (x, y) [cycles/m].
    """
    effects = plan.optical(ready.camera, ready.geometry)
    return along(ready.transfer, effects, color, frequency, direction)


def along(
    transfer: Transfer,
    effects: Sequence[Effect],
    color: int,
    frequency: NDArray,
    direction: tuple[float, float],
) -> NDArray:
    """|H(f)| / H(0) of a transfer's first component with the apertures among the effects.

    frequency: (n,) along `direction`, a unit vector (x, y) [cycles/m].
    """
    fx, fy = frequency * direction[0], frequency * direction[1]
    out = np.ones(len(frequency), np.complex128)
    for effect in effects:
        if isinstance(effect, SeparableTransfer):
            out *= effect.along_x(fx) * effect.along_y(fy)
    return np.abs(out * _blur(transfer, color, fx, fy)) / float(transfer.level[0, color])


def _blur(transfer: Transfer, color: int, fx: NDArray, fy: NDArray) -> NDArray:
    """H of the lens and the silicon at pairs of fx and fy: (n,) [e/s]."""
    if not transfer.plane:
        return transfer.at(np.hypot(fx, fy))[0, color]
    # All pairs of a few are quicker than pair by pair.
    parts = (slice(i, i + TOGETHER) for i in range(0, len(fx), TOGETHER))
    planes = (transfer.at_plane(fx[part], fy[part])[0, color] for part in parts)
    return np.concatenate([np.diagonal(plane) for plane in planes])
