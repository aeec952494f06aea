"""Mean squared error and peak signal-to-noise ratio of linear light.

Both judge all pixels and channels alike, on linear values where the perfect white is 1, and clip
nothing: a value above white or below black counts with its full error.

Why blocks of float64: a float32 sum stops growing once its terms fall below half a unit in its
last place, and a float64 copy of a 12-megapixel picture would take 0.3 GB.
"""

import math

import numpy as np

_BLOCK = 64
"""Rows that are summed at once."""


def mse(image: np.ndarray, ideal: np.ndarray) -> float:
    """Return the mean squared error over all pixels and channels.

    Parameters
    ----------
    image, ideal : ndarray
        Linear values, white = 1, of one shape (rows, columns) or (rows, columns, C), of any real
        dtype.

    Returns
    -------
    float
        Mean of (image - ideal)^2 [white^2]; NaN where a value is.

    Raises
    ------
    ValueError
        The shapes differ, or there is nothing to compare.
    """
    if image.shape != ideal.shape:
        raise ValueError(f"shapes differ: {image.shape} and {ideal.shape}")
    if image.size == 0:
        raise ValueError("no pixels to compare")
    return math.fsum(_squared_differences(image, ideal)) / image.size


def _squared_differences(image: np.ndarray, ideal: np.ndarray) -> list[float]:
    """Return the sum of squared differences of every block of rows."""
    sums = []
    for start in range(0, image.shape[0], _BLOCK):
        rows = slice(start, start + _BLOCK)
        difference = np.subtract(image[rows], ideal[rows], dtype=np.float64)
        np.square(difference, out=difference)
        sums.append(float(difference.sum()))
    return sums


def psnr_of_mse(error: float, peak: float = 1.0) -> float:
    """Return the peak signal-to-noise ratio of a mean squared error, 10 log10(peak^2 / error).

    Parameters
    ----------
    error : float
        Mean squared error [white^2].
    peak : float
        Value of white.

    Returns
    -------
    float
        Ratio [dB]; inf where the error is 0, which is also what the metrics file says of two
        identical pictures.

    Examples
    --------
    >>> psnr_of_mse(0.01)
    20.0
    """
    if error == 0:
        return math.inf
    return 20.0 * math.log10(peak) - 10.0 * math.log10(error)  # the quotient may overflow


def psnr_db(image: np.ndarray, ideal: np.ndarray, peak: float = 1.0) -> float:
    """Return the peak signal-to-noise ratio of an image.

    Parameters
    ----------
    image, ideal : ndarray
        Linear values of one shape (rows, columns) or (rows, columns, C).
    peak : float
        Value of white.

    Returns
    -------
    float
        Ratio [dB]; inf where the images are the same.

    Raises
    ------
    ValueError
        The shapes differ, or there is nothing to compare.
    """
    return psnr_of_mse(mse(image, ideal), peak)
