"""Mean squared error and peak signal-to-noise ratio of linear light.

Both judge all pixels and channels alike, on linear values where the perfect white is 1, and clip
nothing: a value above white or below black counts with its full error.

Why blocks of float64: a float32 sum stops growing once its terms fall below half a unit in its
last place, and a float64 copy of a 12-megapixel picture would take 0.3 GB.
"""

import math

import numpy as np

_BLOCK = 64  # rows


def mse(image: np.ndarray, ideal: np.ndarray) -> float:
    """Mean of (image - ideal)^2 over all pixels and channels [white^2].

    image, ideal: the same shape, (rows, columns) or (rows, columns, C), any real dtype.
    Raises ValueError where shapes differ or there is nothing to compare. NaN gives NaN.
    """
    if image.shape != ideal.shape:
        raise ValueError(f"shapes differ: {image.shape} and {ideal.shape}")
    if image.size == 0:
        raise ValueError("no pixels to compare")
    return math.fsum(_squares(image, ideal)) / image.size


def _squares(image: np.ndarray, ideal: np.ndarray) -> list[float]:
    """The sum of squared differences of every block of rows."""
    sums = []
    for start in range(0, image.shape[0], _BLOCK):
        rows = slice(start, start + _BLOCK)
        difference = np.subtract(image[rows], ideal[rows], dtype=np.float64)
        np.square(difference, out=difference)
        sums.append(float(difference.sum()))
    return sums


def psnr_of_mse(error: float, peak: float = 1.0) -> float:
    """Peak signal-to-noise ratio [dB] 10 log10(peak^2 / error); `inf` where the error is 0.

    `inf` is also what the metrics file says of two identical pictures.
    """
    if error == 0:
        return math.inf
    return 20.0 * math.log10(peak) - 10.0 * math.log10(error)  # the quotient may overflow


def psnr_db(image: np.ndarray, ideal: np.ndarray, peak: float = 1.0) -> float:
    """Peak signal-to-noise ratio [dB] of `image`; `peak` is the value of white."""
    return psnr_of_mse(mse(image, ideal), peak)
