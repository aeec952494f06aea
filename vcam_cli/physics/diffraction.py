"""Diffraction at a circular pupil, for incoherent light and a lens without aberrations.

References
----------
.. [1] J. W. Goodman, "Introduction to Fourier Optics", 3rd edition, Roberts, 2005, section 6.3.
.. [2] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 2.2.1 (the lens is diffraction-limited).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.physics.radiometry import effective_f_number

Floats = NDArray[np.float64]

# 1 - u^2/20 (1 - u^2/42 (...)): u - sin(u) is u^3/6 times this; 2e-16 is reached at u = 1.
_DIVISORS = (20, 42, 72, 110, 156, 210, 272, 342)


def cutoff_frequency(
    wavelength: ArrayLike, f_number: ArrayLike, magnification: ArrayLike = 0.0
) -> Floats:
    """Return the cut-off frequency of a circular pupil in incoherent light.

    It is 1 / (wavelength N (1 - m)).

    Parameters
    ----------
    wavelength : array_like
        Wavelength [m], positive.
    f_number : array_like
        F-number N [dimensionless].
    magnification : array_like
        Magnification m [dimensionless], zero or negative. All three broadcast.

    Returns
    -------
    ndarray
        Spatial frequency on the sensor above which nothing passes [cycles/m].

    Examples
    --------
    At f/8 in green light from afar, 250 lp/mm:

    >>> float(cutoff_frequency(500e-9, 8)) / 1e3
    250.0
    """
    wavelength = np.asarray(wavelength, dtype=np.float64)
    return (1 / (wavelength * effective_f_number(f_number, magnification)))[()]


def otf_circular(
    frequency: ArrayLike,
    wavelength: ArrayLike,
    f_number: ArrayLike,
    magnification: ArrayLike = 0.0,
) -> Floats:
    """Return the optical transfer function of a circular pupil in incoherent light [1].

    OTF = (2/pi) (acos(nu) - nu sqrt(1 - nu^2)) for nu = |f| wavelength N (1 - m) below 1, else 0:
    the overlap of two pupils shifted by nu diameters. It is real: no light moves sideways.

    Parameters
    ----------
    frequency : array_like
        Spatial frequency on the sensor [cycles/m], of either sign.
    wavelength : array_like
        Wavelength [m], positive.
    f_number : array_like
        F-number N [dimensionless].
    magnification : array_like
        Magnification m [dimensionless], zero or negative. All four broadcast.

    Returns
    -------
    ndarray
        OTF in 0..1 [dimensionless]; 1 at frequency 0. Near the cut-off it falls as (1 - nu)^1.5 and
        keeps its relative accuracy there.

    Examples
    --------
    At half the cut-off, 39 % of the contrast is left:

    >>> round(float(otf_circular(125e3, 500e-9, 8)), 3)
    0.391
    """
    wavelength = np.asarray(wavelength, dtype=np.float64)
    scale = wavelength * effective_f_number(f_number, magnification)
    shift = np.minimum(np.abs(np.asarray(frequency, dtype=np.float64)) * scale, 1.0)
    return (2 / np.pi * _segment(shift))[()]


def _segment(shift: Floats) -> Floats:
    """Return acos(nu) - nu sqrt(1 - nu^2) for nu in 0..1.

    That is (angle - sin(angle)) / 2 of angle = 2 acos(nu), by its series in the angle below 1,
    where the difference would cancel.
    """
    half = np.arccos(shift)
    out = np.asarray(half - shift * np.sqrt((1 - shift) * (1 + shift)))
    small = (half < 0.5) & (shift < 1)  # beyond the cut-off it is 0 as it is
    near = 2 * half[small]
    square = near**2
    series = np.ones_like(near)
    for divisor in reversed(_DIVISORS):
        series = 1 - square / divisor * series
    out[small] = near**3 / 12 * series
    return out
