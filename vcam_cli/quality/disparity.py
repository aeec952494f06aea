"""By how many pixels two pictures of one scene differ along rows, place by place.

    d(x) = argmin sum_w (left(x + w + d / 2) - right(x + w - d / 2))^2,   w in a window

Whole shifts are tried, and a parabola through the least sum and its neighbors has the rest. The
sums are over the sum of squared gradients where windows have no detail: NaN there.
"""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import slices_within

WINDOW = 15
"""Pixels along the side of a window."""
LEAST_DETAIL = 25.0
"""Least mean square of differences of neighbors in a window, over that of their noise, at which a
shift can be measured: below it a window's best shift is that of its noise."""
AT_ONCE = 1 << 20
"""Sums of windows that are held at once, about, without those of rows around: 8 MB."""
IN_USE = 1.25
"""Arrays of a band of rows in use at once, over the sums of windows among them."""
OF_PLACE = 36
"""What each place takes besides: both pictures, their light, the disparity [bytes]."""


def disparity(left: Array, right: Array, most: int, noise: Array | float = 0.0) -> Array:
    """Return the disparity of two pictures.

    Parameters
    ----------
    left, right : Array
        Pictures (rows, columns), in one unit.
    most : int
        Largest disparity that is looked for [pixels].
    noise : Array or float, optional
        Variance of both pictures' difference by noise, in that unit squared.

    Returns
    -------
    Array
        Disparity (rows, columns), position in `left` less that in `right` [pixels]; NaN where
        nothing tells it.
    """
    noise = np.broadcast_to(np.asarray(noise), left.shape)
    out = np.empty(left.shape)
    for rows in slices_within(slice(0, len(out)), _rows_at_once(left.shape[1], most)):
        around = slice(max(rows.start - WINDOW, 0), rows.stop + WINDOW)
        found = _disparity(left[around], right[around], most, noise[around])
        out[rows] = found[rows.start - around.start :][: rows.stop - rows.start]
    return out


def needed_bytes(rows: int, columns: int, most: int) -> int:
    """Return the memory that the disparity of two pictures takes, the pictures among it.

    Parameters
    ----------
    rows, columns : int
        Size of the pictures.
    most : int
        Largest disparity that is looked for [pixels].

    Returns
    -------
    int
        Bytes, at least those traced.
    """
    band = min(_rows_at_once(columns, most) + 2 * WINDOW, rows)
    sums = 8 * (2 * most + 3) * band * columns
    return round(IN_USE * sums) + OF_PLACE * rows * columns


def _rows_at_once(columns: int, most: int) -> int:
    return max(AT_ONCE // (columns * (2 * most + 3)), WINDOW)


def _disparity(left: Array, right: Array, most: int, noise: Array) -> Array:
    """Return the disparity of a few rows, as `disparity` does."""
    from scipy.ndimage import uniform_filter

    left, right = (np.asarray(side, float) for side in (left, right))
    shifts = np.arange(-most - 1, most + 2)
    costs, least = np.empty((len(shifts), *left.shape)), np.full(left.shape, np.inf)
    best = np.zeros(left.shape, int)
    for number, shift in enumerate(shifts.tolist()):  # `argmin` would copy all of them
        cost = uniform_filter(_differences(left, right, shift) ** 2, WINDOW, output=costs[number])
        best[cost < least] = number
        np.minimum(cost, least, out=least)
    best = np.clip(best, 1, len(shifts) - 2)
    before, least, after = (
        np.take_along_axis(costs, (best + step)[None], axis=0)[0] for step in (-1, 0, 1)
    )
    bend = before - 2 * least + after
    offset = np.where(bend > 0, (before - after) / np.where(bend > 0, 2 * bend, 1), 0.0)
    detail = uniform_filter(np.gradient(left + right, axis=1) ** 2, WINDOW)
    told = (detail > LEAST_DETAIL * noise) & (bend > 0)
    return np.where(told, shifts[best] + offset, np.nan)


def _differences(left: Array, right: Array, shift: int) -> Array:
    """Return left(x + shift / 2) - right(x - shift / 2), mirrored at the border.

    An odd shift is taken one pixel more on one side, and averaged with the other way.
    """
    low, high = shift // 2, -(-shift // 2)
    one = _shifted(left, high) - _shifted(right, -low)
    if low == high:
        return one
    return (one + _shifted(left, low) - _shifted(right, -high)) / 2


def _shifted(picture: Array, by: int) -> Array:
    """Return picture(x + by) with its border going on."""
    columns = np.arange(picture.shape[1]) + by
    return picture[:, np.clip(columns, 0, picture.shape[1] - 1)]
