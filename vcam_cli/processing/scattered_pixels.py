"""The picture of pixels that fill no rows and columns: every color on a square grid of its own.

At each pixel of the picture and for each color a plane is fitted to the eight samples around it,
and read there. Samples weigh as ((R - d) / (R d))^2, d being their distance and R that of the
ninth [1]: a near sample counts for nearly all, one far away for nothing, and none comes in or goes
out with a jump. A sample in the middle of a picture's pixel is kept as it is, an even color stays
even, and one that rises evenly does so to the corners.

Where all samples lie on one side, a plane may lead far off. It is tilted less where the weights
of the samples would have to add up to more than `MAX_WEIGHT_SUM` without their signs.

Why this one: PSNR [dB] of a chart of rings, colors and edges on 128 x 128 pixels; the honeycomb
with rows half a column apart, the Bayer mosaic with each pixel moved by up to 0.4 and its color
changed for another's at random. Tents reach to R, and have the number of samples
that suits them best of 4 to 12.

                                   honeycomb   moved
    mean, tent                        25.8      16.5
    mean, squared tent                27.4      16.7
    plane, squared tent               27.7      16.3
    mean, these weights               25.9      16.8
    plane, these weights (this)       27.8      16.8

References
----------
.. [1] R. J. Renka, "Multivariate interpolation of large sets of scattered data", ACM Transactions
   on Mathematical Software 14(2), 1988, doi:10.1145/45054.45055, for the weights, which are
   R. Franke's and G. Nielson's.
.. [2] H. Knutsson, C.-F. Westin, "Normalized and differential convolution", CVPR 1993,
   doi:10.1109/CVPR.1993.341081: a normalized convolution to the first order.
"""

import numpy as np

from vcam_cli.parallel import each, pieces
from vcam_cli.processing.base import Layout
from vcam_cli.records import dataclass

NEIGHBORS = 8
"""Samples of its color that a pixel of the picture is made of."""
MAX_WEIGHT_SUM = 3.0
"""Largest sum of their weights without their signs; with them it is 1."""
MIN_SATURATION_WEIGHT = 1e-3
"""Weight above which a sample's saturation counts."""
AT_ONCE = 1 << 12
"""Pixels whose samples are weighed together: 4 MB."""
_NEAR = 1e-6  # of R: what is nearer is in the middle, what is as near to R is at R
_FIRM = 1e-9  # of R squared: added to the spread of the samples, which may lie on a line


@dataclass(frozen=True)
class GriddedSamples:
    """Scattered samples on the picture's grid."""

    planes: np.ndarray
    """Values (C, rows, columns), float32, in the unit of the samples."""
    highest: np.ndarray
    """Highest of all samples that have a share in a pixel (rows, columns)."""


def interpolate_to_grid(
    linear: np.ndarray, codes: np.ndarray, layout: Layout, colors: int, workers: int = 1
) -> GriddedSamples:
    """Return all colors of scattered samples on the grid of the picture [1].

    Parameters
    ----------
    linear : ndarray
        Samples in linear light, in the shape of the frame.
    codes : ndarray
        The same samples as measured; the highest are returned.
    layout : Layout
        Positions and colors of the samples, and the grid.
    colors : int
        Number of colors.
    workers : int
        Number of threads.

    Returns
    -------
    GriddedSamples
        The picture, and the highest sample of every pixel.

    Raises
    ------
    ValueError
        There is no sample of a color.
    """
    grid = (len(layout.picture_y), len(layout.picture_x))
    planes = np.empty((colors, *grid), np.float32)
    highest = np.zeros(grid, codes.dtype)
    sources = []
    for color in range(colors):
        here = layout.color == color
        if not here.any():
            raise ValueError(f"no sample of color {color}")
        sources.append((Samples(layout.x[here], layout.y[here]), linear[here], codes[here]))

    def fill(rows: slice) -> None:
        y, x = np.meshgrid(layout.picture_y[rows], layout.picture_x, indexing="ij")
        top = highest[rows]
        for plane, (samples, values, measured) in zip(planes, sources, strict=True):
            index, weight = samples.weights_at(x.ravel(), y.ravel())
            plane[rows] = np.einsum("ij,ij->i", weight, values[index]).reshape(y.shape)
            counted = np.where(np.abs(weight) > MIN_SATURATION_WEIGHT, measured[index], 0)
            np.maximum(top, counted.max(axis=1).reshape(y.shape), out=top)

    each(fill, pieces(grid[0], max(1, AT_ONCE // grid[1])), workers)
    return GriddedSamples(planes, highest)


class Samples:
    """Positions of the samples of one color, x and y (n,), in any unit of length."""

    def __init__(self, x: np.ndarray, y: np.ndarray) -> None:
        from scipy.spatial import KDTree

        self._x, self._y = x, y
        self._tree = KDTree(np.stack([x, y], axis=1))

    def weights_at(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the samples that make the color at points, and their weights.

        Parameters
        ----------
        x, y : ndarray
            Points (n,), in the unit of the samples' positions.

        Returns
        -------
        index : ndarray of int
            Samples of each point (n, k).
        weight : ndarray
            Their weights (n, k), which sum to 1.
        """
        count = min(NEIGHBORS, len(self._x))
        found = min(count + 1, len(self._x))
        nearest = np.arange(1, found + 1)
        distance, index = map(np.asarray, self._tree.query(np.stack([x, y], axis=1), nearest))
        reach = distance[:, -1:] if found > count else 2 * distance[:, -1:]
        reach = np.maximum(reach, np.finfo(float).tiny)
        index = index[:, :count]
        # Samples at the distance R have no weight: it does not matter which are among the eight.
        near = np.clip(distance[:, :count] / reach, _NEAR, 1 - _NEAR)
        weight = (1 / near - 1) ** 2
        weight /= _sum(weight)
        across = (self._x[index] - x[:, np.newaxis]) / reach
        down = (self._y[index] - y[:, np.newaxis]) / reach
        return index, _plane_weights(weight, across, down)


def _plane_weights(weight: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return weights (n, k) of the fitted plane at 0, from those of the samples at x, y."""
    mean_x, mean_y = _sum(weight * x), _sum(weight * y)
    x, y = x - mean_x, y - mean_y
    xx, yy, xy = _sum(weight * x * x) + _FIRM, _sum(weight * y * y) + _FIRM, _sum(weight * x * y)
    slope = xx * yy - xy * xy
    tilt = weight * (x * (yy * mean_x - xy * mean_y) + y * (xx * mean_y - xy * mean_x)) / slope
    size = _sum(np.abs(tilt))
    tilt *= np.minimum(1, (MAX_WEIGHT_SUM - 1) / np.maximum(size, np.finfo(float).tiny))
    return np.asarray(weight - tilt)


def _sum(values: np.ndarray) -> np.ndarray:
    return np.asarray(values.sum(axis=1, keepdims=True))
