"""What one capture earns from the photocurrents that it is the last to see, in O(1) a pair.

A capture at time t, followed by one that the photocurrents above u' saturate, earns

    t * integral from u' to u of i^2 / (i + c) f(i) di,   c = dark + (read^2 + reset^2) / t,

u the photocurrent that just fills the well at t. With c the same for all captures (no read or
reset noise) this is a difference of two entries of one table of cumulative integrals. Otherwise
i^2 / (i + c), as a function of log c, is analytic up to +-pi i for every i > 0, and Chebyshev
interpolation between DEGREE values of c a factor of FACTOR apart at most is exact to
(9.17)^-DEGREE = 3e-13: a table for each of these values.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.objective import SLACK, TINY, Sensor, limits_of, mean_signal, pieces
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

DEGREE = 13
FACTOR = 4.0
NARROW = 0.02
"""Half-width of a piece over the distance of its middle from the pole at -c up to which four
Gauss points suffice: (2 / 0.02)^-8 = 1e-16."""
GAUSS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Stage:
    """Rewards of a capture at each of G candidate times."""

    own: Floats  # (G,) what it earns as the last capture
    block: Indices  # (G,) which block of the table its c lies in
    weights: Floats  # (G, P) times [s] interpolation weights
    sums: Floats  # (G, blocks, P) cumulative integrals up to each candidate's photocurrent

    def given_up(self, rows: Indices, columns: Indices) -> Floats:
        """(M,) what captures `rows` lose of `own` to captures `columns` that follow them."""
        if self.weights.shape[1] == 1:
            return self.weights[rows, 0] * self.sums[columns, self.block[rows], 0]
        table = self.sums[columns, self.block[rows]]
        return np.asarray(np.einsum("mp,mp->m", self.weights[rows], table))


def stage(pdf: Pdf, times: Floats, sensor: Sensor) -> Stage:
    """Rewards under eq 4.1 with the last sample before saturation; times (G,) rising [s]."""
    return stages(pdf, times, [(times, sensor.dark + sensor.floor / times)], sensor)[0]


def stages(
    pdf: Pdf, times: Floats, exposures: list[tuple[Floats, Floats]], sensor: Sensor
) -> list[Stage]:
    """Rewards t i^2 / (i + c) for several pairs of exposures t [s] and noises c [e/s], (G,) each,
    over one table; times (G,), rising, decide who is saturated [s]."""
    noises = np.concatenate([noise for _, noise in exposures])
    distinct, inverse = np.unique(noises, return_inverse=True)
    nodes, block, weights = _interpolation(distinct)
    sums = _cumulative(pdf, times, sensor, nodes)
    result = []
    for (reach, _), part in zip(exposures, np.split(inverse, len(exposures)), strict=True):
        weight = weights[part] * reach[:, None]
        own = np.einsum("gp,gp->g", weight, sums[np.arange(len(times)), block[part]])
        result.append(Stage(np.asarray(own), block[part], weight, sums))
    return result


def _interpolation(noise: Floats) -> tuple[Floats, Indices, Floats]:
    """nodes (blocks, P), and for each of (M,) distinct c its block and weights (M, P)."""
    if len(noise) <= DEGREE:
        return noise[:, None], np.arange(len(noise)), np.ones((len(noise), 1))
    depth = np.log(np.maximum(noise, TINY)) / np.log(FACTOR)  # a bound may be free of noise
    blocks, block = np.unique(np.floor(depth), return_inverse=True)
    angles = np.pi * (np.arange(DEGREE) + 0.5) / DEGREE
    nodes = FACTOR ** (blocks[:, None] + (1 + np.cos(angles)) / 2)
    place = np.clip(2 * (depth - blocks[block]) - 1, -1, 1)
    order = np.arange(DEGREE)
    basis = np.cos(np.outer(order, angles)) * (2 / DEGREE)
    basis[0] /= 2
    return nodes, block, np.cos(np.outer(np.arccos(place), order)) @ basis


def _cumulative(pdf: Pdf, times: Floats, sensor: Sensor, nodes: Floats) -> Floats:
    """(G, blocks, P) integrals of i^2 / (i + c) f(i) up to the photocurrent that fills the well.

    Summed from the dark end, where a schedule asks for the smallest differences.
    """
    limits = limits_of(pdf, times, sensor)
    low, high, probability = pieces(pdf, limits)
    if pdf.discrete:
        filled = sensor.well / times * (1 + SLACK)
        index = np.searchsorted(high + sensor.dark, filled, side="right")
    else:
        index = np.searchsorted(high, limits, side="right")
    sums = np.empty((len(times), *nodes.shape))
    for place, noise in np.ndenumerate(nodes):
        earned = probability * _mean(low, high, float(noise))
        sums[:, *place] = np.concatenate([[0.0], np.cumsum(earned)])[index]
    return sums


def _mean(low: Floats, high: Floats, noise: float) -> Floats:
    """Mean of i^2 / (i + c) over each piece; of a level its value."""
    half = (high - low) / 2
    middle = low + half
    if not half.any():
        return middle * middle / np.maximum(middle + noise, np.finfo(float).tiny)
    mean = np.zeros(len(low))
    for node, weight in zip(GAUSS, GAUSS_WEIGHTS, strict=True):
        i = middle + half * node
        mean += weight / 2 * i * (i / (i + noise))
    wide = half > NARROW * (middle + noise)
    if wide.any():
        mean[wide] = mean_signal(low[wide], high[wide], np.full(int(wide.sum()), noise))
    return mean
