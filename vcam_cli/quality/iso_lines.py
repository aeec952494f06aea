"""Lines of equal difference on a map of Delta E: the iso-Delta E curves of a test chart.

The map of a picture of bars is itself barred: it swings with the bars, with their beat against the
pixels, and with noise. A line through it would wind around every bar. The difference that counts as
an error tolerance is the largest on a bar of a frequency and contrast: so of a chart the largest
within a period of its bars is taken first, then what swings still is averaged.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003, section 3.5, figures 3.6 and 3.7.
"""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array

MAX_WIDTH = 1 / 12
"""Widest mean along a map, as a part of its width: where bars are wider or there are none."""
MIN_WIDTH = 1 / 32
"""Narrowest mean along a map, as a part of its width.

Beats of the bars against the pixels are slower than the bars.
"""
HEIGHT = 1 / 32
"""Height of the means down a map, as a part of its height."""


def envelope(values: Array, widths: Array) -> Array:
    """Return the largest value of a map within a window around every column.

    Parameters
    ----------
    values : ndarray
        Map (rows, columns).
    widths : ndarray
        Width of the window of every column (columns,) [pixels]; at the borders a window lies beside
        its column.

    Returns
    -------
    ndarray
        Map (rows, columns) of the largest values.
    """
    n = values.shape[1]
    reach = np.asarray(widths, float) / 2
    first = np.ceil(np.arange(n) - reach).astype(int)
    last = np.floor(np.arange(n) + reach).astype(int)
    aside = np.maximum(-first, 0) - np.maximum(last - (n - 1), 0)
    first, last = np.maximum(first + aside, 0), np.minimum(last + aside, n - 1)
    parts = [values[:, low : high + 1].max(axis=1) for low, high in zip(first, last, strict=True)]
    return np.stack(parts, axis=1)


def moving_average(values: Array, widths: Array | float, height: float) -> Array:
    """Return the moving average of a map over windows around every pixel.

    Parts of pixels count in part. At the borders windows shrink on both sides alike, so that what
    rises steadily stays as it is.

    Parameters
    ----------
    values : ndarray
        Map (rows, columns).
    widths : ndarray or float
        Width of the window of every column (columns,), or of all [pixels].
    height : float
        Height of all windows [pixels].

    Returns
    -------
    ndarray
        Averages (rows, columns), float64.
    """
    out = np.asarray(values, np.float64)
    out = _row_means(out, np.broadcast_to(np.asarray(widths, float), (out.shape[1],)))
    return _row_means(out.T, np.full(out.shape[0], float(height))).T


def _row_means(values: Array, widths: Array) -> Array:
    """Return means along the rows of values (rows, n) over windows of widths (n,) [pixels]."""
    n = values.shape[1]
    center = np.arange(n) + 0.5
    half = np.minimum(np.maximum(widths, 1.0) / 2, np.minimum(center, n - center))
    total = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
    average: Array = (
        _interpolate_rows(total, center + half) - _interpolate_rows(total, center - half)
    ) / (2 * half)
    return average


def _interpolate_rows(total: Array, at: Array) -> Array:
    """Return values along rows between their points, straight: (rows, n)."""
    left = np.minimum(at.astype(int), total.shape[1] - 2)
    part = at - left
    interpolated: Array = (1 - part) * total[:, left] + part * total[:, left + 1]
    return interpolated


def averaging_widths(frequency: Array, pitch: float, columns: int) -> Array:
    """Return the widths to average a chart's columns over: a period of its bars, within limits.

    Parameters
    ----------
    frequency : ndarray
        Frequency of the bars at every column (columns,) [cycles/m].
    pitch : float
        Pitch of the columns [m].
    columns : int
        Number of columns.

    Returns
    -------
    ndarray
        Widths (columns,) [pixels].
    """
    with np.errstate(divide="ignore"):
        bars = 1 / (np.abs(frequency) * pitch)
    return np.clip(bars, MIN_WIDTH * columns, MAX_WIDTH * columns)


def level_heights(values: Array, scale: Array, level: float) -> Array:
    """Return where each column of a map first reaches a level.

    Parameters
    ----------
    values : ndarray
        Averaged map (rows, columns).
    scale : ndarray
        Values of the rows, rising (rows,); linear between them.
    level : float
        Level in the unit of the map.

    Returns
    -------
    ndarray
        Place on the scale (columns,): its lowest where the column begins above the level, NaN where
        the column never gets there.
    """
    above, columns = values >= level, np.arange(values.shape[1])
    k = np.maximum(above.argmax(axis=0), 1)
    low, high = values[k - 1, columns], values[k, columns]
    with np.errstate(divide="ignore", invalid="ignore"):
        found = scale[k - 1] + (level - low) / (high - low) * (scale[k] - scale[k - 1])
    found = np.where(above[0], scale[0], found)
    return np.where(above.any(axis=0), found, np.nan)


def contours(values: Array, x: Array, y: Array, level: float) -> list[Array]:
    """Return the lines along which a map is at a level.

    Parameters
    ----------
    values : ndarray
        Map (rows, columns).
    x, y : ndarray
        Places of the columns (columns,) and of the rows (rows,).
    level : float
        Level in the unit of the map.

    Returns
    -------
    list of ndarray
        Lines (n, 2) of x and y, from the longest to the shortest.
    """
    from contourpy import contour_generator

    lines = contour_generator(x, y, values).lines(level)
    return sorted((np.asarray(line) for line in lines), key=lambda line: -len(line))


def map_lines(values: Array, x: Array, y: Array, level: float) -> list[Array]:
    """Return the lines along which an averaged map of any scene is at a level.

    Parameters
    ----------
    values, x, y, level
        As those of `contours`.

    Returns
    -------
    list of ndarray
        Lines (n, 2) of x and y, from the longest to the shortest.
    """
    rows, columns = values.shape
    return contours(moving_average(values, columns * HEIGHT, rows * HEIGHT), x, y, level)


def chart_line(
    values: Array, frequency: Array, contrast: Array, pitch: float, level: float
) -> Array:
    """Return the contrast up to which the map of a chart of bars stays below a level [1].

    Parameters
    ----------
    values : ndarray
        Map (rows, columns).
    frequency : ndarray
        Frequency of the bars at every column (columns,) [cycles/m].
    contrast : ndarray
        Contrast of the bars at every row (rows,), falling from the top; NaN beside the chart.
    pitch : float
        Pitch of the columns [m].
    level : float
        Level in the unit of the map.

    Returns
    -------
    ndarray
        Contrast (columns,); NaN where the level is never reached.
    """
    widths = averaging_widths(frequency, pitch, values.shape[1])
    means = moving_average(envelope(values, widths), widths, len(values) * HEIGHT)
    chart = np.isfinite(contrast)
    return level_heights(means[chart][::-1], contrast[chart][::-1], level)
