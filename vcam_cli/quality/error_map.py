"""False colors for a map of differences: black for 0, light yellow for large ones.

The colors are ten points of matplotlib's `inferno` (S. van der Walt, N. Smith, 2015, CC0), straight
between: lightness rises steadily, so the map reads right in gray and for color-blind eyes.
"""

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array

INFERNO = (
    "000004", "1b0c41", "4a0c6b", "781c6d", "a52c60",
    "cf4446", "ed6925", "fb9b06", "f7d13d", "fcffa4",
)  # fmt: skip
"""Codes of sRGB from the lower to the upper end, evenly spaced."""
_LEVELS = 256
_SHARE = 99.0
"""Percentile of the pixels that lies within the scale."""
_BLOCK = 256  # rows


def scale_limit(values: Array) -> float:
    """Return the upper end of a map's scale: the smallest of 1, 2, 5, 10, 20 ... that holds 99 %.

    Steps, so that maps of similar pictures have the same scale. At least 1: less than one Delta E
    is hardly seen.

    Parameters
    ----------
    values : ndarray
        Map (rows, columns) of differences.

    Returns
    -------
    float
        Upper end in the unit of the map.
    """
    most = float(np.percentile(values, _SHARE))
    if not np.isfinite(most) or most <= 1.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(most))
    steps = decade * np.array([1.0, 2.0, 5.0, 10.0])
    return float(steps[np.searchsorted(steps, most)])


def false_color(values: Array, upper: float) -> NDArray[np.uint8]:
    """Return a map of differences as a picture.

    Parameters
    ----------
    values : ndarray
        Map (rows, columns) of differences; NaN counts as the largest.
    upper : float
        Difference shown in the lightest color; 0 is black.

    Returns
    -------
    ndarray of uint8
        Codes of sRGB (rows, columns, 3).
    """
    colors = _color_table()
    out = np.empty((*values.shape, 3), np.uint8)
    for row in range(0, len(values), _BLOCK):
        rows = slice(row, row + _BLOCK)
        share = np.clip(np.nan_to_num(values[rows] / upper, nan=1.0), 0.0, 1.0)
        level = (share * (_LEVELS - 1) + 0.5).astype(np.uint8)
        out[rows] = colors[level]
    return out


def _color_table() -> NDArray[np.uint8]:
    """Return the codes (256, 3) of the colors."""
    points = np.array([[int(code[i : i + 2], 16) for i in (0, 2, 4)] for code in INFERNO])
    place = np.linspace(0, len(points) - 1, _LEVELS)
    each = [np.interp(place, np.arange(len(points)), channel) for channel in points.T]
    return np.round(np.array(each).T).astype(np.uint8)
