"""The distribution of photocurrents over a scene, which a capture schedule is planned for.

A pdf is either a set of levels (a histogram of a scene with discrete photocurrents) or piecewise
uniform over segments (a histogram of anything else), as in [1]_, section 4.3. Photocurrents have
any unit; the schedule for shot noise alone depends on their ratios only.

Why sums start at the dark end: a schedule that captures a range of 1e8 needs differences of the
first moment at its dark end, where a sum from the bright end has lost all digits.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

BINS = 4096
"""Levels that pixels are gathered in: six decades of light in steps of a third of a percent."""
DARKEST = 1e-9
"""Fraction of the brightest photocurrent below which pixels share one level."""


@dataclass(frozen=True, eq=False)
class Pdf:
    """Probability over photocurrents: K ascending segments, or K ascending levels (low == high).

    Parameters
    ----------
    low, high : (K,) array
        Ends of each segment, in any unit of photocurrent. Segments may touch but not overlap.
    probability : (K,) array
        Weight of each segment, of any sum; it is normalized to sum 1.

    Raises
    ------
    ValueError
        If the arrays make no such pdf; the message gives the reason.
    """

    low: Floats
    high: Floats
    probability: Floats

    def __post_init__(self) -> None:
        """Copy, check and normalize the arrays."""
        for name in ("low", "high", "probability"):
            values = np.array(getattr(self, name), dtype=np.float64, ndmin=1)  # our own copy
            object.__setattr__(self, name, values)
        _check_values(self.low, self.high, self.probability)
        _check_order(self.low, self.high)
        share = self.probability / self.probability.max()  # a sum of huge counts may overflow
        object.__setattr__(self, "probability", share / share.sum())
        if self.max <= 0:
            raise ValueError("no photocurrent is above 0")
        for values in (self.low, self.high, self.probability):
            values.setflags(write=False)

    @staticmethod
    def uniform(min: float, max: float) -> "Pdf":
        """Return the uniform pdf between two photocurrents.

        Parameters
        ----------
        min, max : float
            Ends of the photocurrents, of any unit, min < max.

        Returns
        -------
        Pdf
            One segment.

        Raises
        ------
        ValueError
            If the ends make no pdf.
        """
        return Pdf.segments([min], [max], [1.0])

    @staticmethod
    def segments(low: ArrayLike, high: ArrayLike, probability: ArrayLike) -> "Pdf":
        """Return the piecewise uniform pdf of K segments.

        Parameters
        ----------
        low, high : (K,) array_like
            Ends of each segment, in any unit of photocurrent.
        probability : (K,) array_like
            Weight of each segment, of any sum.

        Returns
        -------
        Pdf
            The pdf.

        Raises
        ------
        ValueError
            If a segment has no width, or the arrays make no pdf.
        """
        starts, ends = (np.atleast_1d(np.asarray(end, float)) for end in (low, high))
        if ends.shape == starts.shape and np.any(ends == starts):
            raise ValueError("a segment's max must be above its min")
        return Pdf(starts, ends, np.atleast_1d(np.asarray(probability, float)))

    @staticmethod
    def levels(values: ArrayLike, weights: ArrayLike) -> "Pdf":
        """Return the pdf of discrete photocurrents.

        Parameters
        ----------
        values : (K,) array_like
            Levels in any order and unit; weights of equal ones add up.
        weights : (K,) array_like
            Their weights, of any sum.

        Returns
        -------
        Pdf
            The pdf, its levels rising.

        Raises
        ------
        ValueError
            If there are not as many weights as levels, or they make no pdf.
        """
        where, weight = (np.atleast_1d(np.asarray(v, float)) for v in (values, weights))
        if where.ndim != 1 or where.shape != weight.shape:
            raise ValueError("as many weights as levels are needed")
        _check_values(where, where, weight)
        distinct, index = np.unique(where, return_inverse=True)
        total = np.bincount(index, weights=weight / weight.max()).astype(np.float64)
        return Pdf(distinct, distinct, total)

    @staticmethod
    def histogram(edges: ArrayLike, counts: Sequence[float] | ArrayLike) -> "Pdf":
        """Return the piecewise uniform pdf of a histogram.

        Parameters
        ----------
        edges : (K + 1,) array_like
            Rising edges of the bins, in any unit of photocurrent.
        counts : (K,) array_like
            Weight of each bin, of any sum.

        Returns
        -------
        Pdf
            The pdf.

        Raises
        ------
        ValueError
            If there are fewer than two edges, or they make no pdf.
        """
        ends = np.asarray(edges, float)
        if ends.ndim != 1 or ends.size < 2:
            raise ValueError("a histogram needs at least two edges")
        return Pdf.segments(ends[:-1], ends[1:], counts)

    @property
    def discrete(self) -> bool:
        """Whether this is a set of levels."""
        return bool(self.low[0] == self.high[0])

    @cached_property
    def min(self) -> float:
        """The darkest photocurrent that occurs."""
        return float(self.low[self.probability > 0][0])

    @cached_property
    def max(self) -> float:
        """The brightest photocurrent that occurs."""
        return float(self.high[self.probability > 0][-1])

    @property
    def mean(self) -> float:
        """The mean photocurrent, E(I)."""
        return float(self._moments[-1])

    @cached_property
    def density(self) -> Floats:
        """(K,) probability per unit of photocurrent; infinite at levels that occur."""
        if self.discrete:
            return np.where(self.probability > 0, np.inf, 0.0)
        return self.probability / (self.high - self.low)

    @cached_property
    def _cumulative(self) -> Floats:
        """(K + 1,) probability below each segment, and of all."""
        return np.concatenate([[0.0], np.cumsum(self.probability)])

    @cached_property
    def _moments(self) -> Floats:
        """(K + 1,) first moment below each segment, and of all."""
        centers = self.low + (self.high - self.low) / 2
        return np.concatenate([[0.0], np.cumsum(self.probability * centers)])

    def cdf(self, x: ArrayLike) -> Floats:
        """Return P(i <= x), the cumulative distribution function.

        Parameters
        ----------
        x : array_like
            Photocurrents, in the unit of the pdf.

        Returns
        -------
        array
            Probabilities, in the shape of `x`.
        """
        segment, share, _ = self._position(np.asarray(x, float))
        return self._cumulative[segment] + self._padded_probabilities[segment] * share

    def first_moment(self, x: ArrayLike) -> Floats:
        """Return the integral of i f(i) up to and including x.

        Parameters
        ----------
        x : array_like
            Photocurrents, in the unit of the pdf.

        Returns
        -------
        array
            Integrals in that unit, in the shape of `x`.
        """
        segment, share, center = self._position(np.asarray(x, float))
        return self._moments[segment] + self._padded_probabilities[segment] * share * center

    @cached_property
    def _padded_probabilities(self) -> Floats:
        """(K + 1,) probabilities, and 0 above the last."""
        return np.append(self.probability, 0.0)

    def _position(self, x: Floats) -> tuple[Indices, Floats, Floats]:
        """Return the first segment that ends above x, its share up to x and the middle of that."""
        segment = np.searchsorted(self.high, x, side="right")
        if self.discrete:  # x lies below that level
            return segment, np.zeros(x.shape), np.zeros(x.shape)
        low, high = np.append(self.low, self.high[-1])[segment], np.append(self.high, np.inf)
        reach = np.maximum(x - low, 0.0)
        return segment, reach / (high[segment] - low), low + reach / 2


def photocurrent_levels(
    photocurrents: Array, bins: int = BINS, darkest: float = DARKEST
) -> Pdf | None:
    """Gather the photocurrents of many pixels in levels of equal ratio.

    Why equal ratio: a histogram of equal bins that resolves the bright holds all of the dark in one
    bin, and captures are as much for the dark. Each bin represents its brightest pixel, so that a
    capture that is chosen for a bin saturates no pixel of it.

    Parameters
    ----------
    photocurrents : array
        Photocurrents of the pixels, of any shape. Pixels at 0 or below are a level of their own, 0.
    bins : int
        The most levels above 0, from the darkest pixel to the brightest.
    darkest : float
        Fraction of the brightest photocurrent; the pixels below it are one level.

    Returns
    -------
    Pdf or None
        The levels; None where no photocurrent is above 0.
    """
    light = np.asarray(photocurrents)[np.asarray(photocurrents) > 0].astype(np.float64)
    if light.size == 0:
        return None
    high = float(light.max())
    low = max(float(light.min()), darkest * high)
    scale = bins / np.log(high / low) if high > low else 0.0
    index = np.clip((np.log(light / low) * scale).astype(int), 0, bins - 1)
    brightest = np.zeros(bins)
    np.maximum.at(brightest, index, light)
    counts = np.bincount(index, minlength=bins)
    occupied = counts > 0
    unlit = np.size(photocurrents) - light.size
    if not unlit:
        return Pdf.levels(brightest[occupied], counts[occupied])
    return Pdf.levels([0.0, *brightest[occupied]], [unlit, *counts[occupied]])


def _check_values(low: Floats, high: Floats, probability: Floats) -> None:
    if low.ndim != 1 or low.shape != high.shape or low.shape != probability.shape:
        raise ValueError("as many probabilities as segments or levels are needed")
    if low.size == 0:
        raise ValueError("the pdf is empty")
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise ValueError("photocurrents must be finite numbers")
    if not np.isfinite(probability).all():
        raise ValueError("probabilities must be finite numbers")
    if (low < 0).any():
        raise ValueError("photocurrents must not be negative")
    if (probability < 0).any():
        raise ValueError("probabilities must not be negative")
    if not probability.any():
        raise ValueError("all probabilities are zero")


def _check_order(low: Floats, high: Floats) -> None:
    if (high < low).any():
        raise ValueError("a segment's max must not be below its min")
    level = high == low
    if level.any() and not level.all():
        raise ValueError("a pdf has either segments or levels, not both")
    if level.all():
        if (np.diff(low) <= 0).any():
            raise ValueError("levels must rise")
    elif (low[1:] < high[:-1]).any():
        raise ValueError("segments must ascend and must not overlap")
