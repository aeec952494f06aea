"""What the measurement should find: the closed forms of the camera's model.

References
----------
.. [1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021.
.. [2] N. Johnson, S. Kotz, N. Balakrishnan, "Continuous Univariate Distributions", vol. 1, Wiley,
   1994, section 13.10.1 (moments of a censored normal variable).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import SeparableTransfer
from vcam_cli.image_formation.neighbor_sharing import Sharing
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.simulation.preparation import Prepared

NODES = 33
"""Gauss points of the integral over the pixels' differences."""
BATCH = 16
"""Frequencies at which a transfer of two dimensions is computed at once."""


def clipped_variance(mean: ArrayLike, sigma: ArrayLike, limit: float) -> Array:
    """Return the variance of min(X, limit) for a normal X, section 13.10.1 of [1]_.

    Parameters
    ----------
    mean, sigma : array_like
        Mean and standard deviation of X, above 0; their shapes broadcast.
    limit : float
        Where X is clipped, in the same unit.

    Returns
    -------
    array
        Variances, in the square of that unit.

    References
    ----------
    .. [1] N. Johnson, S. Kotz, N. Balakrishnan, "Continuous Univariate Distributions", vol. 1,
       Wiley, 1994.
    """
    from scipy.special import ndtr

    m, s = np.asarray(mean, np.float64), np.asarray(sigma, np.float64)
    a = (limit - m) / s
    density = np.exp(-(a**2) / 2) / np.sqrt(2 * np.pi)
    above = ndtr(-a)
    first = a * above - density
    second = ndtr(a) - a * density + a**2 * above
    variance: Array = s**2 * (second - first**2)
    return variance


def saturation_capacity(
    limit: float, dark: float, floor: float, pattern: Callable[[float], float]
) -> float:
    """Return the photo-electrons at which the temporal variance is largest.

    That is the saturation point of [1]_. Noise that is cut off at the limit is less: the point lies
    some two standard deviations below it.

    Parameters
    ----------
    limit : float
        Electrons that well or ADC hold [e].
    dark : float
        Mean dark signal [e].
    floor : float
        Variance of reset and readout [e^2].
    pattern : callable
        Variance from pixel to pixel [e^2] at a mean signal [e].

    Returns
    -------
    float
        Photo-electrons [e].

    References
    ----------
    .. [1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021.
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
    ready: Prepared, color: int, frequency: Array, direction: tuple[float, float]
) -> Array:
    """Return the MTF of optics, diffusion, aperture and crosstalk at the center, |H(f)| / H(0).

    Parameters
    ----------
    ready : Prepared
        The camera.
    color, frequency, direction
        As those of `directional_mtf`.

    Returns
    -------
    (n,) array
        Transfer, 1 at frequency 0.
    """
    effects = ready.solved.effects.mean_signal
    found = directional_mtf(ready.transfer, effects, color, frequency, direction)
    if ready.sharing is None:
        return found
    light = np.linalg.solve(ready.sharing.matrix, ready.white_rate)
    return found * sharing_mtf(ready.sharing, ready.geometry, color, light, frequency, direction)


def sharing_mtf(
    sharing: Sharing,
    geometry: Geometry,
    color: int,
    light: Array,
    frequency: Array,
    direction: tuple[float, float],
) -> Array:
    """Return the contrast of gray waves that crosstalk leaves in the pixels of a color.

    Parameters
    ----------
    sharing : Sharing
        What pixels give to their neighbors.
    geometry : Geometry
        Geometry of the array.
    color, frequency, direction
        As those of `directional_mtf`.
    light : (C,) array
        Light of the colors in even gray, before pixels share it, in any unit.

    Returns
    -------
    (n,) array
        Contrast, 1 at frequency 0.
    """
    fx, fy = frequency * direction[0], frequency * direction[1]
    return np.abs(sharing.transfer(color, light, fx * geometry.pitch_x, fy * geometry.pitch_y))


def directional_mtf(
    transfer: Transfer,
    effects: Sequence[Effect],
    color: int,
    frequency: Array,
    direction: tuple[float, float],
) -> Array:
    """Return |H(f)| / H(0) of a transfer's first component with the apertures among the effects.

    Parameters
    ----------
    transfer : Transfer
        Transfer of the lens and the silicon.
    effects : sequence of Effect
        Effects; separable transfers are used.
    color : int
        Index of the color.
    frequency : (n,) array
        Spatial frequencies along `direction` [cycles/m].
    direction : tuple of float
        Unit vector (x, y).

    Returns
    -------
    (n,) array
        Transfer, 1 at frequency 0.
    """
    fx, fy = frequency * direction[0], frequency * direction[1]
    out = np.ones(len(frequency), np.complex128)
    for effect in of_kind(effects, SeparableTransfer):
        out *= effect.along_x(fx) * effect.along_y(fy)
    return np.abs(out * _blur(transfer, color, fx, fy)) / float(transfer.level[0, color])


def _blur(transfer: Transfer, color: int, fx: Array, fy: Array) -> Array:
    """Return H of the lens and the silicon at pairs of fx and fy: (n,) [e/s]."""
    if not transfer.plane_blurs:
        response: Array = transfer.radial_response(np.hypot(fx, fy))[0, color]
        return response
    # The plane over a few of each is quicker than one pair after another.
    parts = (slice(i, i + BATCH) for i in range(0, len(fx), BATCH))
    planes = (transfer.plane_response(fx[part], fy[part])[0, color] for part in parts)
    return np.concatenate([np.diagonal(plane) for plane in planes])
