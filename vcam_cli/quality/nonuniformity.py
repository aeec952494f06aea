"""Nonuniformity of pixels: the fixed pattern of a stack of frames, and its rows and columns.

The mean of many frames of equal light still holds some temporal noise; what the frames' own
scatter says of it is subtracted, so that the numbers do not depend on how many frames there were.

The standard's high-pass filter, which takes out a lamp's unevenness, is not applied: the light
here is even, and the filter would take part of the pattern with it.

References
----------
.. [1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021,
   sections 4.2, 4.3 and 8.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stack:
    """Mean and scatter of frames of equal light."""

    frames: int
    """Number of frames."""
    average: Floats
    """Mean of the frames <y> (..., rows, columns), eq 33 of [1] [DN].

    Leading axes are separate lattices of pixels.
    """
    variance: float
    """Temporal variance sigma^2_y.stack averaged over the pixels, eq 65 of [1] [DN^2]."""

    @property
    def mean(self) -> float:
        """Mean mu_y of all pixels, eq 34 of [1] [DN]."""
        return float(self.average.mean())


class RunningStack:
    """Statistics of a stack that grows: no frame is kept.

    Why Welford's recurrence: it takes no difference of large squares.
    """

    def __init__(self) -> None:
        self._count = 0
        self._average: Floats = np.zeros(())
        self._scatter: Floats = np.zeros(())

    def add(self, frame: Array) -> None:
        """Add one more frame.

        Parameters
        ----------
        frame : ndarray
            Numbers (..., rows, columns) [DN].
        """
        self._count += 1
        apart = frame - self._average
        self._average = self._average + apart / self._count
        self._scatter = self._scatter + apart * (frame - self._average)

    def result(self) -> Stack:
        """Return the statistics of all frames.

        Returns
        -------
        Stack
            Mean and scatter.

        Raises
        ------
        ValueError
            Fewer than two frames.
        """
        if self._count < 2:
            raise ValueError("two frames of equal light are needed at least")
        variance = float(self._scatter.mean()) / (self._count - 1)
        return Stack(self._count, self._average, variance)


@dataclass(frozen=True)
class SpatialVariance:
    """Spatial variance and its parts [DN^2]; near 0 statistics may make one negative."""

    total: float
    """Variance s^2_y over all pixels, eq 36 of [1]."""
    row: float
    """Variance of differences between rows, eq 42 of [1]."""
    column: float
    """Variance of differences between columns, eq 42 of [1]."""
    pixel: float
    """Variance of what belongs to no row and no column."""


def spatial_variance(stack: Stack) -> SpatialVariance:
    """Return the spatial variances of a stack, eqs 33 to 42 of [1].

    The means over columns and over rows hold a share of the pixels' own variance:
    s^2_cav = s^2_col + s^2_pixel / M, s^2_rav = s^2_row + s^2_pixel / N, s^2 = the sum of all,
    for M rows and N columns; solved for the three.

    Parameters
    ----------
    stack : Stack
        Mean and scatter of frames of equal light.

    Returns
    -------
    SpatialVariance
        Variance of the pixels, and of rows and columns [DN^2].

    Raises
    ------
    ValueError
        Fewer than 2 x 2 pixels.
    """
    rows, columns = stack.average.shape[-2:]
    if min(rows, columns) < 2:
        raise ValueError(f"{rows} x {columns} pixels have no rows and columns to tell apart")
    each = stack.average - stack.average.mean(axis=(-2, -1), keepdims=True)
    left = stack.variance / stack.frames
    total = float((each**2).sum(axis=(-2, -1)).mean()) / (rows * columns - 1) - left
    by_column = float((each.mean(axis=-2) ** 2).mean()) - left / rows
    by_row = float((each.mean(axis=-1) ** 2).mean()) - left / columns
    parts = np.array([[1, 0, 1 / rows], [0, 1, 1 / columns], [1, 1, 1]])
    if rows == columns == 2:
        return SpatialVariance(total, 0.0, 0.0, total)  # 2 of 3 unknowns are left
    column, row, pixel = np.linalg.solve(parts, [by_column, by_row, total])
    return SpatialVariance(total, float(row), float(column), float(pixel))


@dataclass(frozen=True)
class Nonuniformity:
    """A standard deviation over the pixels and its parts; 0 where statistics mask it."""

    total: float
    """Standard deviation over all pixels."""
    row: float
    """Standard deviation of differences between rows."""
    column: float
    """Standard deviation of differences between columns."""
    pixel: float
    """Standard deviation of what belongs to no row and no column."""


def dsnu(dark: SpatialVariance, gain: float) -> Nonuniformity:
    """Return DSNU1288, the nonuniformity of the dark signal, eq 66 of [1].

    Parameters
    ----------
    dark : SpatialVariance
        Spatial variance without light [DN^2].
    gain : float
        Overall system gain K [DN/e].

    Returns
    -------
    Nonuniformity
        Standard deviations [e].
    """
    parts = (dark.total, dark.row, dark.column, dark.pixel)
    return Nonuniformity(*(_root(part) / gain for part in parts))


def prnu(bright: SpatialVariance, dark: SpatialVariance, signal: float) -> Nonuniformity:
    """Return PRNU1288, the nonuniformity of the response, eq 67 of [1].

    Parameters
    ----------
    bright : SpatialVariance
        Spatial variance at half of saturation [DN^2].
    dark : SpatialVariance
        Spatial variance without light [DN^2].
    signal : float
        Mean of the bright frames above that of the dark ones [DN].

    Returns
    -------
    Nonuniformity
        Standard deviations relative to the signal [dimensionless].
    """
    parts = (
        (bright.total, dark.total),
        (bright.row, dark.row),
        (bright.column, dark.column),
        (bright.pixel, dark.pixel),
    )
    return Nonuniformity(*(_root(lit - unlit) / signal for lit, unlit in parts))


def _root(variance: float) -> float:
    return math.sqrt(max(variance, 0.0))
