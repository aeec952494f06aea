"""The distribution of photocurrents over a scene, which a capture schedule is planned for.

A pdf is either a set of levels (a histogram of a scene with discrete photocurrents) or piecewise
uniform over segments (a histogram of anything else), as in Chen, "Digital Camera System Simulator
and Applications", PhD thesis, Stanford University, 2003, section 4.3. Photocurrents have any
unit; the schedule for shot noise alone depends on their ratios only.

Why sums from the dark end: a schedule that captures a range of 1e8 asks for differences of the
first moment at its dark end, where a sum from the bright end has lost all digits.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pdf:
    """Probability over photocurrents: K ascending segments, or K ascending levels (low == high).

    low, high, probability : (K,); the last is normalized to sum 1. Segments may touch but not
    overlap. Raises ValueError, with the reason, for anything that is no such pdf.
    """

    low: Floats
    high: Floats
    probability: Floats

    def __post_init__(self) -> None:
        for name in ("low", "high", "probability"):
            values = np.array(getattr(self, name), dtype=np.float64, ndmin=1)  # our own copy
            object.__setattr__(self, name, values)
        _check_values(self.low, self.high, self.probability)
        _check_order(self.low, self.high)
        share = self.probability / self.probability.max()  # a sum of huge counts may overflow
        object.__setattr__(self, "probability", share / share.sum())
        if self.max <= 0:
            raise ValueError("no photocurrent is above 0: there is nothing to capture")
        for values in (self.low, self.high, self.probability):
            values.setflags(write=False)

    @staticmethod
    def uniform(min: float, max: float) -> "Pdf":
        """Uniform between two photocurrents."""
        return Pdf.segments([min], [max], [1.0])

    @staticmethod
    def segments(low: ArrayLike, high: ArrayLike, probability: ArrayLike) -> "Pdf":
        """Piecewise uniform: (K,) lower ends, upper ends and probabilities (of any sum)."""
        starts, ends = (np.atleast_1d(np.asarray(end, float)) for end in (low, high))
        if ends.shape == starts.shape and np.any(ends == starts):
            raise ValueError("a segment's max must be above its min")
        return Pdf(starts, ends, np.atleast_1d(np.asarray(probability, float)))

    @staticmethod
    def levels(values: ArrayLike, weights: ArrayLike) -> "Pdf":
        """Discrete photocurrents in any order and their weights, added up where values repeat."""
        where, weight = (np.atleast_1d(np.asarray(v, float)) for v in (values, weights))
        if where.ndim != 1 or where.shape != weight.shape:
            raise ValueError("as many weights as levels are needed")
        _check_values(where, where, weight)
        distinct, index = np.unique(where, return_inverse=True)
        total = np.bincount(index, weights=weight / weight.max()).astype(np.float64)
        return Pdf(distinct, distinct, total)

    @staticmethod
    def histogram(edges: ArrayLike, counts: Sequence[float] | ArrayLike) -> "Pdf":
        """Piecewise uniform between (K + 1,) edges with (K,) counts."""
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
        """E(I)."""
        return float(self._moments[-1])

    @cached_property
    def density(self) -> Floats:
        """(K,) probability a unit of photocurrent; infinite at levels that occur."""
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

    def below(self, x: ArrayLike) -> Floats:
        """P(i <= x), shape of `x`."""
        segment, share, _ = self._place(np.asarray(x, float))
        return self._cumulative[segment] + self._padded[segment] * share

    def first_moment(self, x: ArrayLike) -> Floats:
        """The integral of i f(i) up to and including x, shape of `x`."""
        segment, share, center = self._place(np.asarray(x, float))
        return self._moments[segment] + self._padded[segment] * share * center

    @cached_property
    def _padded(self) -> Floats:
        """(K + 1,) probabilities, and 0 above the last."""
        return np.append(self.probability, 0.0)

    def _place(self, x: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
        """The first segment that ends above x, the share of it up to x and the middle of that."""
        segment = np.searchsorted(self.high, x, side="right")
        if self.discrete:  # x lies below that level
            return segment, np.zeros(x.shape), np.zeros(x.shape)
        low, high = np.append(self.low, self.high[-1])[segment], np.append(self.high, np.inf)
        reach = np.maximum(x - low, 0.0)
        return segment, reach / (high[segment] - low), low + reach / 2


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
