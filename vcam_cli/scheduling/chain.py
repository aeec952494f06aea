"""Chains of captures: the best of all, by dynamic programming over candidate times.

A schedule is a chain of candidates. What capture j earns before capture l follows it, w(j, l), is
the signal-to-noise ratio at time j of the photocurrents that saturate between the two. A longer
exposure is worth more to every photocurrent, so that the gain of putting off l grows with j:

    w(j', l') - w(j', l) >= w(j, l') - w(j, l),   j < j', l < l'      (Monge)

for any pdf, any noise and any utility that grows with exposure. The best next capture therefore
moves one way only, and a row's best column bounds those of its neighbors: divide and conquer
finds all of them with O(G log G) entries of the G x G matrix. A least gap between captures makes
the matrix a staircase, which leaves this true.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.rewards import Stage

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

END = -1
"""Instead of a next capture: this one is the last."""


def row_maxima(
    value: Callable[[Indices, Indices], Floats], lower: Indices, upper: Indices
) -> tuple[Floats, Indices]:
    """Largest entry of each row and the first column that has it, where these columns rise.

    value : (rows, columns), (M,) each, to the (M,) entries there
    lower, upper : (R,) first and last column a row may use; neither falls from row to row

    Every step of the recursion (half the distance between rows that are done) is one call of
    `value`, over about as many entries as there are columns.
    """
    count = len(lower)
    best, found = np.empty(count), np.empty(count, np.intp)
    half = 1 << max(count.bit_length() - 1, 0)
    while half:
        rows = np.arange(half - 1, count, 2 * half)
        start, stop = lower[rows].copy(), upper[rows].copy()
        before, after = rows - half, rows + half
        known = before >= 0
        start[known] = np.maximum(start[known], found[before[known]])
        known = after < count
        stop[known] = np.minimum(stop[known], found[after[known]])
        best[rows], found[rows] = _segment_maxima(value, rows, start, np.maximum(stop, start))
        half //= 2
    return best, found


def _segment_maxima(
    value: Callable[[Indices, Indices], Floats], rows: Indices, start: Indices, stop: Indices
) -> tuple[Floats, Indices]:
    """Largest entry of each row in its own range of columns, all ranges laid end to end."""
    lengths = stop - start + 1
    ends = np.cumsum(lengths)
    begins = ends - lengths
    segment = np.repeat(np.arange(len(rows)), lengths)
    columns = np.arange(ends[-1]) - np.repeat(begins - start, lengths)
    entries = value(rows[segment], columns)
    best = np.maximum.reduceat(entries, begins)
    hits = np.flatnonzero(entries == best[segment])
    first = hits[np.searchsorted(segment[hits], np.arange(len(rows)))]
    return best, columns[first]


@dataclass(frozen=True)
class Chains:
    """Best chains of up to N captures from every candidate on."""

    values: Floats  # (N, G) worth of the best chain of n + 1 captures that begins at g
    choices: Indices  # (N, G) its second capture, or END

    def best(self, count: int) -> float:
        """Worth of the best `count` captures that begin with the first candidate."""
        return float(self.values[count - 1, 0])

    def path(self, count: int) -> Indices:
        """(<= count,) candidates of those captures, in the order of time."""
        path = [0]
        for left in range(count - 1, 0, -1):
            following = int(self.choices[left, path[-1]])
            if following == END:
                break
            path.append(following)
        return np.array(path, np.intp)


def longest_chains(stage: Stage, first: Indices, count: int) -> Chains:
    """Best chains of 1..count captures with the same reward at every capture.

    first : (G,) earliest candidate that may follow each, not falling; G where none may. With
        first[g] = g a capture may be repeated, which earns nothing and costs nothing.

    Among equals the shortest times win: the best chains form a lattice (the reward is
    supermodular), and its least member takes the first best column at every step.
    """
    size = len(stage.own)
    values = np.empty((count, size))
    choices = np.full((count, size), END, np.intp)
    values[0] = stage.own
    open_rows = int(np.searchsorted(first, size, side="left"))
    last = np.full(open_rows, size - 1, np.intp)
    for n in range(1, count):
        values[n] = stage.own
        if not open_rows:
            continue

        def after(rows: Indices, columns: Indices, ahead: Floats = values[n - 1]) -> Floats:
            return ahead[columns] - stage.given_up(rows, columns)

        best, choices[n, :open_rows] = row_maxima(after, first[:open_rows], last)
        values[n, :open_rows] += best
    return Chains(values, choices)
