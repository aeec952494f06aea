"""Steps on a picture that has all its colors: less noise, sharper edges, and those of plug-ins.

A step looks at some rows with a few more around them, mirrored beyond the picture's border. The
ideal image has neither noise nor blur, and passes denoising and sharpening as it is.

References
----------
.. [1] J.-S. Lee, "Digital image enhancement and noise filtering by use of local statistics", IEEE
   Transactions on Pattern Analysis and Machine Intelligence 2(2), 165-168, 1980,
   doi:10.1109/TPAMI.1980.4766994.
.. [2] J. Immerkaer, "Fast noise variance estimation", Computer Vision and Image Understanding
   64(2), 300-302, 1996, doi:10.1006/cviu.1996.0060.
.. [3] W. K. Pratt, "Digital Image Processing", 4th ed., Wiley, 2007, section 10.4: unsharp masking.
"""

import math
from collections.abc import Callable

import numpy as np

from vcam_cli.processing.base import Block, mirrored_index
from vcam_cli.records import dataclass

WINDOW = 5
"""Pixels along a side of the window of the adaptive filter."""
REACH = 4.0
"""Standard deviations after which the Gaussian of an unsharp mask ends."""

Planes = np.ndarray


def _unchanged(colors: np.ndarray) -> np.ndarray:
    return colors


@dataclass(frozen=True)
class PictureOperation:
    """A step that looks at neighbors; see `base.Operation`."""

    work: Callable[[Planes], Planes]
    """Returns planes (C, rows, columns) after the step, in the same shape."""
    halo: int
    """Pixels on every side that `work` looks at."""
    rows: int
    """Rows of the picture."""
    on_colors: Callable[[np.ndarray], np.ndarray] = _unchanged
    """What the step does to full-color values (C, ...) of the ideal image."""

    def process_block(self, block: Block) -> Block:
        """Return the block after the step, less its halo."""
        planes, halo = block.planes, self.halo
        if halo:
            count = planes.shape[1]
            inside = mirrored_index(np.arange(count) + block.first_row, self.rows) - block.first_row
            planes = planes[:, inside]  # steps before know nothing of what is beyond the border
            planes = np.pad(planes, ((0, 0), (0, 0), (halo, halo)), "reflect")
        done = np.asarray(self.work(planes))
        if done.shape != planes.shape:
            raise ValueError(f"a step made {done.shape} of {planes.shape}")
        inner = slice(halo, -halo or None)
        done = np.ascontiguousarray(done[:, inner, inner], dtype=np.float32)
        return Block(done, block.first_row + halo)

    def process_colors(self, values: np.ndarray) -> np.ndarray:
        """Return what the step makes of full-color values of the ideal image."""
        return self.on_colors(values)


def noise_sums(planes: Planes) -> np.ndarray:
    """Return what `noise_level` needs of some rows.

    Parameters
    ----------
    planes : ndarray
        Rows of a picture (C, rows, columns).

    Returns
    -------
    ndarray
        (2, C): sums of the absolute second differences of [2], and their numbers.
    """
    across = np.diff(planes.astype(np.float64), 2, axis=2)
    both = np.abs(np.diff(across, 2, axis=1))
    return np.array([both.sum(axis=(1, 2)), np.full(len(planes), float(both[0].size))])


def noise_level(sums: np.ndarray) -> np.ndarray:
    """Return the standard deviation of white noise in each color [2].

    Second differences along rows and columns see little of a picture and all of its noise. Noise
    that interpolation has smoothed is measured too low, and that of a fine texture too high.

    Parameters
    ----------
    sums : ndarray
        Sum of `noise_sums` over all rows (2, C).

    Returns
    -------
    ndarray
        Standard deviation (C,), in the unit of the picture.
    """
    return np.asarray(math.sqrt(math.pi / 2) / 6 * sums[0] / np.maximum(sums[1], 1))


def denoised(planes: Planes, deviation: np.ndarray) -> Planes:
    """Return planes after the adaptive Wiener filter [1].

    Where the variance v in a window about a pixel is that of the noise, the window's mean is taken;
    where it is larger, the part (v - noise) / v of the pixel's difference from the mean stays.

    Parameters
    ----------
    planes : ndarray
        Planes (C, rows, columns).
    deviation : ndarray
        Standard deviation of the noise of each color (C,).

    Returns
    -------
    ndarray
        Planes of the same shape.
    """
    from scipy import ndimage

    out = np.empty_like(planes)
    for plane, sigma, result in zip(planes, deviation, out, strict=True):
        wide = plane.astype(np.float64)
        mean = ndimage.uniform_filter(wide, WINDOW)
        variance = ndimage.uniform_filter(np.square(wide), WINDOW) - mean**2
        share = 1 - sigma**2 / np.maximum(variance, max(sigma**2, np.finfo(np.float32).tiny))
        result[:] = mean + share * (wide - mean)
    return out


def sharpened(planes: Planes, radius: float, amount: float) -> Planes:
    """Return planes plus a multiple of their difference from a blurred copy [3].

    Parameters
    ----------
    planes : ndarray
        Planes (C, rows, columns).
    radius : float
        Standard deviation of the Gaussian [pixels].
    amount : float
        Factor on the difference.

    Returns
    -------
    ndarray
        Planes of the same shape.
    """
    from scipy import ndimage

    blurred = ndimage.gaussian_filter(
        planes, (0, radius, radius), radius=(0, *[blur_reach(radius)] * 2)
    )
    return planes + np.float32(amount) * (planes - blurred)


def blur_reach(radius: float) -> int:
    """Return how far the Gaussian of an unsharp mask reaches [pixels]."""
    return math.ceil(REACH * radius)


def desaturated(colors: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Return colors without negative components, of the same luminance.

    A color is moved towards the gray of its luminance until its smallest component is 0, which
    leaves its luminance and, in linear light, its dominant wavelength. What is no brighter than
    black (noise) stays as it is; so does what is brighter than white.

    Parameters
    ----------
    colors : ndarray
        Linear light (C, ...).
    shares : ndarray
        Shares of the colors in luminance (C,), sum 1.

    Returns
    -------
    ndarray
        Colors of the same shape and type.
    """
    gray = np.tensordot(shares.astype(colors.dtype), colors, 1)
    least = colors.min(axis=0)
    outside = (least < 0) & (gray > 0)
    keep = np.where(outside, gray / np.where(outside, gray - least, 1), 1).astype(colors.dtype)
    mapped = np.where(outside, np.maximum(gray + keep * (colors - gray), 0), colors)
    return np.asarray(mapped, colors.dtype)
