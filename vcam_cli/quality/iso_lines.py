"""Lines of equal difference on a map of Delta E: the iso-Delta E curves of a test chart.

The map of a picture of bars is itself barred: it swings with the bars, with their beat against the
pixels, and with noise. A line through it would wind around every bar. The difference that counts as
an error tolerance is the largest on a bar of a frequency and contrast: so of a chart the largest
within a period of its bars is taken first, then what swings still is averaged.

Reference: T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
University, 2003, section 3.5, figures 3.6 and 3.7.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WIDEST = 1 / 12
"""Of a map's width: the widest mean along it, where bars are wider than that or there are none."""
NARROWEST = 1 / 32
"""Of a map's width: the narrowest mean along it; beats of the bars against the pixels are slower
than the bars."""
TALL = 1 / 32
"""Of a map's height: what is averaged over down it."""


def envelope(values: NDArray, widths: NDArray) -> NDArray:
    """The largest of a map (rows, columns) within windows around every column.

    widths: of the windows (columns,) [pixels]; at the borders they lie beside the column.
    """
    n = values.shape[1]
    reach = np.asarray(widths, float) / 2
    first = np.ceil(np.arange(n) - reach).astype(int)
    last = np.floor(np.arange(n) + reach).astype(int)
    aside = np.maximum(-first, 0) - np.maximum(last - (n - 1), 0)
    first, last = np.maximum(first + aside, 0), np.minimum(last + aside, n - 1)
    parts = [values[:, low : high + 1].max(axis=1) for low, high in zip(first, last, strict=True)]
    return np.stack(parts, axis=1)


def smoothed(values: NDArray, widths: NDArray | float, height: float) -> NDArray:
    """Running means of a map (rows, columns) over windows around every pixel, float64.

    widths: of the windows, of every column (columns,) or of all [pixels]; height: of all [pixels].
    Parts of pixels count in part. At the borders windows shrink on both sides alike, so that what
    rises steadily stays as it is.
    """
    out = np.asarray(values, np.float64)
    out = _means(out, np.broadcast_to(np.asarray(widths, float), (out.shape[1],)))
    return _means(out.T, np.full(out.shape[0], float(height))).T


def _means(values: NDArray, widths: NDArray) -> NDArray:
    """Means along the rows of values (rows, n) over windows of widths (n,) [pixels]."""
    n = values.shape[1]
    center = np.arange(n) + 0.5
    half = np.minimum(np.maximum(widths, 1.0) / 2, np.minimum(center, n - center))
    total = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
    return (_read(total, center + half) - _read(total, center - half)) / (2 * half)


def _read(total: NDArray, at: NDArray) -> NDArray:
    """Values along rows between their points, straight: (rows, n)."""
    left = np.minimum(at.astype(int), total.shape[1] - 2)
    part = at - left
    return (1 - part) * total[:, left] + part * total[:, left + 1]


def periods(frequency: NDArray, pitch: float, columns: int) -> NDArray:
    """Widths to average a chart's columns over: a period of its bars, within limits [pixels].

    frequency: of the bars at every column (columns,) [cycles/m]; pitch: of the columns [m].
    """
    with np.errstate(divide="ignore"):
        bars = 1 / (np.abs(frequency) * pitch)
    return np.clip(bars, NARROWEST * columns, WIDEST * columns)


def heights(values: NDArray, scale: NDArray, level: float) -> NDArray:
    """How far each column stays below a level: where it first reaches it, (columns,).

    values: a smoothed map (rows, columns); scale: what the rows stand for, rising (rows,). Straight
    between rows. The lowest of the scale where the column begins above the level, nan where it
    never gets there.
    """
    above = values >= level
    first = above.argmax(axis=0)
    found = np.full(values.shape[1], np.nan)
    for column in np.flatnonzero(above.any(axis=0)):
        k = int(first[column])
        if k == 0:
            found[column] = scale[0]
            continue
        low, high = values[k - 1, column], values[k, column]
        part = (level - low) / (high - low)
        found[column] = scale[k - 1] + part * (scale[k] - scale[k - 1])
    return found


def contours(values: NDArray, x: NDArray, y: NDArray, level: float) -> list[NDArray]:
    """Lines along which a map (rows, columns) is at a level: each (n, 2), x and y.

    x: (columns,), y: (rows,) places of the pixels. From the longest to the shortest.
    """
    from contourpy import contour_generator

    lines = contour_generator(x, y, values).lines(level)
    return sorted((np.asarray(line) for line in lines), key=lambda line: -len(line))
