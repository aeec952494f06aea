"""A histogram approximated by few segments, for schedules that are planned segment by segment.

Two neighboring bins are merged at a time, those that leave the least total sum of absolute
differences (SAD) from the original histogram, until as many segments are left as wanted: the
iterative histogram binning of [1]_, section 4.5.1. A merged bin has the mean of the original counts
in it; of bins of unequal width it has their mean density, and differences count by width:

    SAD = sum over original bins of |c_b - w_b C / W|,  C, W the counts and width of its segment

which with equal widths is that of [1]_, and no other for bins split in two. Of merges that are
equally good the one of the darkest bins is made.

Why two ways to compare: which merge comes first decides all that follow, and equal ones are
common (empty bins, bins of a few pixels). Where counts are whole numbers and widths multiples of
one another, SADs are compared as the fractions they are. Otherwise, so with probabilities that
were normalized, two that agree to 1e-12 of the counts involved are taken as equal.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf

Histogram = tuple[ArrayLike, ArrayLike]
"""(K + 1,) rising edges and (K,) counts."""
Number = Fraction | float

CLOSE = 1e-12
"""Relative difference of sums of floating-point counts that are taken as equal."""
ALMOST_WHOLE = 1e-9
"""Relative error of a width computed as the difference of two edges."""
LARGEST_INT = 2**62


@dataclass(frozen=True)
class Merge:
    """One merge of two neighbors.

    Parameters
    ----------
    first, middle, end : int
        Bins first..middle-1 and middle..end-1 of the original become one.
    sad : float
        Total sum of absolute differences after it.
    """

    first: int
    middle: int
    end: int
    absolute_deviation: float


def merge_bins(histogram: Pdf | Histogram, segments: int) -> tuple[Pdf, tuple[Merge, ...]]:
    """Approximate a histogram by at most `segments` segments.

    Parameters
    ----------
    histogram : Pdf or pair of arrays
        Edges and counts, or a pdf as `histogram_of_pdf` converts it. Counts of whole numbers make
        ties exact; a pdf's probabilities are no longer whole.
    segments : int
        The most segments.

    Returns
    -------
    pdf : Pdf
        Segments that touch. A pdf that has so few segments already is returned as it is.
    merges : tuple of Merge
        The merges in their order, for `merged_histogram` and plots.

    Raises
    ------
    ValueError
        If `segments` is below 1, or the histogram makes no pdf.
    """
    if segments < 1:
        raise ValueError("at least one segment is needed")
    if isinstance(histogram, Pdf):
        if not histogram.discrete and histogram.low.size <= segments:
            return histogram, ()
        histogram = histogram_of_pdf(histogram)
    edges, counts = (np.asarray(part, float) for part in histogram)
    Pdf.histogram(edges, counts)  # raises for what is no pdf
    steps = tuple(_merges(np.diff(edges), counts, segments))
    bounds = _remaining_edges(counts.size, steps)
    total = np.add.reduceat(counts / counts.max(), bounds[:-1])
    return Pdf.histogram(edges[bounds], total), steps


def histogram_of_pdf(pdf: Pdf) -> tuple[Floats, Floats]:
    """Return a pdf as a histogram.

    A gap between segments is an empty bin. A level is a bin from the level below up to itself, so
    that the brightest photocurrent stays the brightest; the first is as wide as the second, and a
    level of 0, which no schedule can serve, goes with the next one.

    Parameters
    ----------
    pdf : Pdf
        Segments, or levels.

    Returns
    -------
    edges : (K + 1,) array
        Rising edges.
    probabilities : (K,) array
        Probability of each bin.
    """
    if not pdf.discrete:
        edges = np.unique(np.concatenate([pdf.low, pdf.high]))
        counts = np.zeros(edges.size - 1)
        counts[np.searchsorted(edges, pdf.low)] = pdf.probability
        return edges, counts
    levels, counts = pdf.low, pdf.probability.copy()
    if levels[0] == 0:
        counts[1] += counts[0]
        return levels, counts[1:]
    second = levels[1] if levels.size > 1 else 2 * levels[0]
    return np.append(max(0.0, 2 * levels[0] - second), levels), counts


def merged_histogram(histogram: Histogram, merges: Sequence[Merge]) -> tuple[Floats, Floats]:
    """Return a histogram after some merges.

    Parameters
    ----------
    histogram : pair of arrays
        The original edges and counts.
    merges : sequence of Merge
        The first merges of `merge_bins`. All of them give the final approximation, none the
        histogram itself.

    Returns
    -------
    edges : (S + 1,) array
        Edges of the segments that are left.
    counts : (S,) array
        Mean counts of an original bin in each; densities where bins have unequal widths.
    """
    edges, counts = (np.asarray(part, float) for part in histogram)
    widths = np.diff(edges)
    unit = widths.mean() if np.allclose(widths, widths.mean(), rtol=ALMOST_WHOLE, atol=0) else 1.0
    bounds = _remaining_edges(counts.size, merges)
    total, width = (np.add.reduceat(part, bounds[:-1]) for part in (counts, widths))
    return edges[bounds], total / (width / unit)


def _remaining_edges(size: int, merges: Sequence[Merge]) -> Indices:
    """Return the indices of the edges that are left."""
    left = np.ones(size + 1, bool)
    left[[merge.middle for merge in merges]] = False
    return np.flatnonzero(left)


def _merges(widths: Floats, counts: Floats, segments: int) -> Iterator[Merge]:
    """Yield the merges in their order.

    A pair of neighbors is named by the first bin of its left one.
    """
    size = counts.size
    end, before = list(range(1, size + 1)), list(range(-1, size))
    sums = _Sums.from_histogram(widths, counts)
    pairs = _Pairs(size)
    absolute_deviation: list[Number] = [
        Fraction(0) if sums.exact else 0.0
    ] * size  # of the segment at a bin
    joined = absolute_deviation.copy()  # of a pair

    def increase(first: int) -> Number:
        """Return what a merge adds, below 0 where it brings both closer to their medians."""
        return joined[first] - absolute_deviation[first] - absolute_deviation[end[first]]

    def enter(first: int) -> None:
        last = end[end[first]]
        joined[first] = sums.absolute_deviation(first, last)
        pairs.put(first, increase(first), sums.margin(first, last))

    for first in range(size - 1):
        enter(first)
    total = 0.0
    for _ in range(size - segments):
        first = pairs.first_minimum()
        middle, last = end[first], end[end[first]]
        total = max(total + float(increase(first)), 0.0)
        yield Merge(first, middle, last, total)
        absolute_deviation[first] = joined[first]
        end[first], before[last] = last, first
        pairs.drop(middle)
        if last < size:
            enter(first)
        else:
            pairs.drop(first)
        if before[first] >= 0:
            enter(before[first])


class _Sums:
    """Sums over bins first..end-1, of whole numbers (as fractions) or of floats."""

    def __init__(self, widths: Array, counts: Array, exact: bool) -> None:
        self.widths, self.counts, self.exact = widths, counts, exact
        zero = widths[:1] * 0
        self.width_below = np.concatenate([zero, np.cumsum(widths)])
        self.count_below = np.concatenate([zero, np.cumsum(counts)])

    @classmethod
    def from_histogram(cls, widths: Floats, counts: Floats) -> "_Sums":
        units = np.round(widths / widths.min())
        whole = np.allclose(units * widths.min(), widths, rtol=ALMOST_WHOLE, atol=0)
        if not whole or (counts != np.round(counts)).any():
            return cls(widths, counts, exact=False)
        # |c W - w C| is at most twice this; beyond 64 bits Python's own integers do it
        largest = 2 * float(units.sum()) * float(counts.sum())
        kind = np.int64 if largest < LARGEST_INT else object
        wide, many = (np.array([int(v) for v in part], dtype=kind) for part in (units, counts))
        return cls(wide, many, exact=True)

    def margin(self, first: int, end: int) -> float:
        """Return the error of a sum of absolute differences over these bins, at most."""
        if self.exact:
            return 0.0
        return CLOSE * float(self.count_below[end] - self.count_below[first])

    def absolute_deviation(self, first: int, end: int) -> Number:
        """Return the sum of absolute differences of these bins from their mean density."""
        c, w = self.counts[first:end], self.widths[first:end]
        if self.exact:
            width = self.width_below[end] - self.width_below[first]
            count = self.count_below[end] - self.count_below[first]
            return Fraction(int(np.abs(c * width - w * count).sum()), int(width))
        return float(np.abs(c - w * (c.sum() / w.sum())).sum())


class _Pairs:
    """Values by index, and the first of the smallest of them without a scan of all.

    They lie in blocks whose least is known, low and high by the margin within which two count as
    equal. Fractions have none. Their floats are rounded correctly, so that equal ones have equal
    floats and the order is kept; where different ones have the same float, `crowded`, the
    fractions themselves are compared.
    """

    def __init__(self, size: int) -> None:
        self.side = int(np.ceil(np.sqrt(size)))
        self.low = np.full((self.side, self.side), np.inf)
        self.high = self.low.copy()
        self.least_low, self.least_high = self.low[0].copy(), self.low[0].copy()
        self.fractions: dict[int, Fraction] = {}
        self.exact_values: dict[float, Fraction] = {}
        self.ambiguous: set[float] = set()

    def put(self, index: int, value: Number, margin: float) -> None:
        """Set a value, known up to a margin."""
        rounded = float(value)
        self._set(index, rounded - margin, rounded + margin)
        if isinstance(value, Fraction):
            self.fractions[index] = value
            if self.exact_values.setdefault(rounded, value) != value:
                self.ambiguous.add(rounded)

    def drop(self, index: int) -> None:
        """Remove a value."""
        self._set(index, np.inf, np.inf)

    def first_minimum(self) -> int:
        """Return the first index of the least value."""
        bar = float(self.least_high.min())
        if bar in self.ambiguous:
            same = np.flatnonzero(self.low.ravel() == bar)
            return min((int(index) for index in same), key=self.fractions.__getitem__)
        block = int(np.argmax(self.least_low <= bar))
        return block * self.side + int(np.argmax(self.low[block] <= bar))

    def _set(self, index: int, low: float, high: float) -> None:
        block, place = divmod(index, self.side)
        self.low[block, place], self.high[block, place] = low, high
        self.least_low[block] = self.low[block].min()
        self.least_high[block] = self.high[block].min()
