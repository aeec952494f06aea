"""Chains of captures: their rewards, and the best of all chains by dynamic programming.

A schedule is a chain of candidate times. What capture j earns before capture l follows it, w(j, l),
is the mean SNR at time j of the photocurrents that saturate between the two:

    w = t * integral from u' to u of i^2 / (i + c) f(i) di,   c = dark + (read^2 + reset^2) / t,

u and u' the photocurrents that just fill the well at j and at l. A longer exposure is worth more
to every photocurrent, so that the gain of delaying l grows with j:

    w(j', l') - w(j', l) >= w(j, l') - w(j, l),   j < j', l < l'      (Monge)

for any pdf, any noise and any utility that grows with exposure. The best next capture therefore
moves one way only, and a row's best column bounds those of its neighbors: divide and conquer
finds all of them with O(G log G) entries of the G x G matrix ([1]_). A least gap between captures
makes the matrix a staircase, which leaves this true.

A reward costs O(1). With c the same for all captures (no read or reset noise) it is a difference
of two entries of one table of cumulative integrals. Otherwise i^2 / (i + c), as a function of
log c, is analytic up to +-pi i for every i > 0, and Chebyshev interpolation between DEGREE values
of c a factor of FACTOR apart at most is exact to (9.17)^-DEGREE = 3e-13: a table for each of these
values.

References
----------
.. [1] A. Aggarwal, M. M. Klawe, S. Moran, P. Shor and R. Wilber, "Geometric applications of a
   matrix-searching algorithm", Algorithmica 2, 195-208, 1987, doi:10.1007/BF01840359.
"""

from collections.abc import Callable

import numpy as np

from vcam_cli.records import dataclass
from vcam_cli.scheduling.objective import TINY, mean_snr_rate, saturation_limits, split_segments
from vcam_cli.scheduling.pdf import Floats, Indices, Pdf
from vcam_cli.scheduling.sensor import SLACK, Constraints, Sensor

NO_CAPTURE = -1
"""Index in place of a next capture: this one is the last."""
DEGREE = 13
FACTOR = 4.0
NARROW = 0.02
"""Largest half-width of a segment, over the distance of its middle from the pole at -c, for which
four Gauss points suffice: (2 / 0.02)^-8 = 1e-16."""
GAUSS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Rewards:
    """Rewards of a capture at each of G candidate times.

    Parameters
    ----------
    own : (G,) array
        What a capture earns as the last of its chain, a part of the mean SNR.
    block : (G,) array
        Block of the table that its c lies in.
    weights : (G, P) array
        Times [s] interpolation weights in that block.
    sums : (G, blocks, P) array
        Integrals of i^2 / (i + c) f(i) up to each candidate's photocurrent.
    """

    own: Floats
    block: Indices
    weights: Floats
    sums: Floats

    def loss(self, captures: Indices, followers: Indices) -> Floats:
        """Return (M,) what each capture loses of `own` to the capture that follows it.

        Parameters
        ----------
        captures : (M,) array
            Indices of the captures' candidates.
        followers : (M,) array
            Index of the candidate that follows each.

        Returns
        -------
        (M,) array
            Loss of mean SNR.
        """
        if self.weights.shape[1] == 1:
            lost: Floats = self.weights[captures, 0] * self.sums[followers, self.block[captures], 0]
            return lost
        table = self.sums[followers, self.block[captures]]
        return np.asarray(np.einsum("mp,mp->m", self.weights[captures], table))


def last_sample_rewards(pdf: Pdf, times: Floats, sensor: Sensor) -> Rewards:
    """Return the rewards under eq 4.1 with the last sample before saturation.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents [e/s].
    times : (G,) array
        Candidate times, rising [s].
    sensor : Sensor
        The pixel.

    Returns
    -------
    Rewards
        Mean SNR of each candidate, and what it loses to a later one.
    """
    noise, inverse = np.unique(sensor.dark + sensor.noise_floor / times, return_inverse=True)
    nodes, block, weights = _interpolation(noise)
    sums = _cumulative_integrals(pdf, times, sensor, nodes)
    block, weights = block[inverse], weights[inverse] * times[:, None]
    own = np.einsum("gp,gp->g", weights, sums[np.arange(len(times)), block])
    return Rewards(np.asarray(own), block, weights, sums)


@dataclass(frozen=True)
class Chains:
    """Best chains of up to N captures from each of G candidates on.

    Parameters
    ----------
    values : (N, G) array
        Mean SNR of the best chain of n + 1 captures that begins at g.
    choices : (N, G) array
        Its second capture, or `NO_CAPTURE`.
    """

    values: Floats
    choices: Indices

    def value(self, count: int) -> float:
        """Return the mean SNR of the best `count` captures, the first at the first candidate.

        Parameters
        ----------
        count : int
            Captures, from 1 to N.

        Returns
        -------
        float
            Mean SNR, as a power ratio.
        """
        return float(self.values[count - 1, 0])

    def path(self, count: int) -> Indices:
        """Return the candidates of those captures, in the order of time.

        Parameters
        ----------
        count : int
            Captures, from 1 to N.

        Returns
        -------
        (<= count,) array
            Indices of candidates; fewer where further captures gain nothing.
        """
        path = [0]
        for left in range(count - 1, 0, -1):
            following = int(self.choices[left, path[-1]])
            if following == NO_CAPTURE:
                break
            path.append(following)
        return np.array(path, np.intp)


def best_chains(
    pdf: Pdf, times: Floats, sensor: Sensor, constraints: Constraints, most: int
) -> Chains:
    """Find the best chains of up to `most` captures at candidate times, the first at times[0].

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    times : (G,) array
        Rising candidate times [s].
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands; of these the least gap counts here.
    most : int
        The largest number of captures.
    """
    first = first_followers(times, times, constraints.least_gap)
    return longest_chains(last_sample_rewards(pdf, times, sensor), first, most)


def first_followers(begin: Floats, end: Floats, gap: float) -> Indices:
    """Return the first candidate that may lie `gap` after each, (G,).

    Without a gap that is the candidate itself, a repetition.

    Parameters
    ----------
    begin, end : (G,) arrays
        Earliest and latest time that each candidate represents [s].
    gap : float
        Least time between two captures [s].
    """
    own = np.arange(len(begin))
    if not gap:
        return own
    return np.maximum(np.searchsorted(end * (1 + SLACK), begin + gap), own)


def longest_chains(rewards: Rewards, first: Indices, count: int) -> Chains:
    """Find the best chains of 1..count captures with the same rewards at every capture.

    Among equals the shortest times win: the best chains form a lattice (the reward is
    supermodular), and its least member takes the first best column at every step.

    Parameters
    ----------
    rewards : Rewards
        Of G candidates.
    first : (G,) array
        The earliest candidate that may follow each, not falling; G where none may. With
        first[g] = g a capture may be repeated, which earns nothing and costs nothing.
    count : int
        The largest number of captures.
    """
    size = len(rewards.own)
    values = np.empty((count, size))
    choices = np.full((count, size), NO_CAPTURE, np.intp)
    values[0] = rewards.own
    open_rows = int(np.searchsorted(first, size, side="left"))
    last = np.full(open_rows, size - 1, np.intp)
    for n in range(1, count):
        values[n] = rewards.own
        if not open_rows:
            continue

        def gain(rows: Indices, columns: Indices, ahead: Floats = values[n - 1]) -> Floats:
            return ahead[columns] - rewards.loss(rows, columns)

        best, choices[n, :open_rows] = row_maxima(gain, first[:open_rows], last)
        values[n, :open_rows] += best
    return Chains(values, choices)


def row_maxima(
    value: Callable[[Indices, Indices], Floats], lower: Indices, upper: Indices
) -> tuple[Floats, Indices]:
    """Find the largest entry of each row of a matrix whose rows' best columns rise.

    Every step of the recursion (half the distance between rows that are done) is one call of
    `value`, over about as many entries as there are columns.

    Parameters
    ----------
    value : callable
        Entries of the matrix: rows and columns, (M,) each, to (M,) values.
    lower, upper : (R,) arrays
        First and last column that a row may use; neither falls from row to row.

    Returns
    -------
    values : (R,) array
        The largest entry of each row.
    columns : (R,) array
        The first column that has it.
    """
    count = len(lower)
    best, chosen = np.empty(count), np.empty(count, np.intp)
    half = 1 << max(count.bit_length() - 1, 0)
    while half:
        rows = np.arange(half - 1, count, 2 * half)
        start, stop = lower[rows].copy(), upper[rows].copy()
        before, after = rows - half, rows + half
        known = before >= 0
        start[known] = np.maximum(start[known], chosen[before[known]])
        known = after < count
        stop[known] = np.minimum(stop[known], chosen[after[known]])
        best[rows], chosen[rows] = _segment_maxima(value, rows, start, np.maximum(stop, start))
        half //= 2
    return best, chosen


def _segment_maxima(
    value: Callable[[Indices, Indices], Floats], rows: Indices, start: Indices, stop: Indices
) -> tuple[Floats, Indices]:
    """Return the largest entry of each row in its own columns, all ranges laid end to end."""
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


def _interpolation(noise: Floats) -> tuple[Floats, Indices, Floats]:
    """Return nodes (blocks, P), and for each of (M,) distinct c its block and weights (M, P)."""
    if len(noise) <= DEGREE:
        return noise[:, None], np.arange(len(noise)), np.ones((len(noise), 1))
    depth = np.log(np.maximum(noise, TINY)) / np.log(FACTOR)  # a bound may be free of noise
    blocks, block = np.unique(np.floor(depth), return_inverse=True)
    angles = np.pi * (np.arange(DEGREE) + 0.5) / DEGREE
    nodes = FACTOR ** (blocks[:, None] + (1 + np.cos(angles)) / 2)
    position = np.clip(2 * (depth - blocks[block]) - 1, -1, 1)
    order = np.arange(DEGREE)
    basis = np.cos(np.outer(order, angles)) * (2 / DEGREE)
    basis[0] /= 2
    return nodes, block, np.cos(np.outer(np.arccos(position), order)) @ basis


def _cumulative_integrals(pdf: Pdf, times: Floats, sensor: Sensor, nodes: Floats) -> Floats:
    """Return the integrals of i^2 / (i + c) f(i) up to each time's photocurrent, (G, blocks, P).

    They are summed from the dark end, where a schedule needs the smallest differences.
    """
    limits = saturation_limits(pdf, times, sensor)
    low, high, probability = split_segments(pdf, limits)
    if pdf.discrete:
        filled = sensor.well / times * (1 + SLACK)
        index = np.searchsorted(high + sensor.dark, filled, side="right")
    else:
        index = np.searchsorted(high, limits, side="right")
    sums = np.empty((len(times), *nodes.shape))
    for node, noise in np.ndenumerate(nodes):
        earned = probability * _segment_means(low, high, float(noise))
        sums[:, *node] = np.concatenate([[0.0], np.cumsum(earned)])[index]
    return sums


def _segment_means(low: Floats, high: Floats, noise: float) -> Floats:
    """Return the mean of i^2 / (i + c) over each segment; of a level its value."""
    half = (high - low) / 2
    middle = low + half
    if not half.any():
        return middle * middle / np.maximum(middle + noise, TINY)
    mean = np.zeros(len(low))
    for node, weight in zip(GAUSS, GAUSS_WEIGHTS, strict=True):
        i = middle + half * node
        mean += weight / 2 * i * (i / (i + noise))
    wide = half > NARROW * (middle + noise)
    if wide.any():
        mean[wide] = mean_snr_rate(low[wide], high[wide], np.full(int(wide.sum()), noise))
    return mean
