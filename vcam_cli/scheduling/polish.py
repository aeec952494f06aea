"""From the best schedule on a grid to the maximum beside it, by Newton's method.

J = sum of (M(i_k) - M(i_{k+1})) / i_k couples neighbours only: its Hessian is tridiagonal. J has
a kink at the ends of segments. Where the density drops the kink can be a maximum: the slope
towards it is positive from below and negative from above. A capture there stays, and one that
meets the end of its segment stops there.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solveh_banded

from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

STEPS = 50
HALVINGS = 40
SETTLED = 1e-13
"""Relative change of all captures that ends the search."""
ROUNDING = 1e-15
"""Relative loss of J that is no loss."""


def worth(pdf: Pdf, captures: Floats) -> float:
    """J of falling photocurrents `captures` (N,), the first the brightest.

    Of captures in any other order it gives no more than of the same ones sorted.
    """
    moments = np.append(pdf.first_moment(captures), 0.0)
    return float(np.sum(-np.diff(moments) / captures))


def polished(pdf: Pdf, captures: Floats) -> Floats:
    """A local maximum of J from falling `captures` (N,); the first stays."""
    now, value = captures, worth(pdf, captures)
    for _ in range(STEPS):
        low, high, step = _step(pdf, now)
        for halving in range(HALVINGS):
            new = np.clip(now * (1 + step / 2**halving), low, high)
            better = worth(pdf, new)
            if better >= value * (1 - ROUNDING):
                break
        else:
            return now
        moved = np.max(np.abs(new / now - 1))
        now, value = new, better
        if moved < SETTLED:
            break
    return np.sort(now)[::-1]


def _step(pdf: Pdf, captures: Floats) -> tuple[Floats, Floats, Floats]:
    """The ends between which each capture may move, and by what share of itself it should."""
    moments = np.append(pdf.first_moment(captures), 0.0)
    free, ratio = captures[1:], captures[1:] / captures[:-1]
    lost = (moments[1:-1] - moments[2:]) / free
    below, above = _segments(pdf, free)
    rising = _density(pdf, above, free) * free * (1 - ratio) - lost
    falling = _density(pdf, below, free) * free * (1 - ratio) - lost
    segment = np.where(rising > 0, above, below)
    slope = np.where(rising > 0, rising, np.minimum(falling, 0.0))
    low, high, step = captures.copy(), captures.copy(), np.zeros(captures.size)
    moving = np.flatnonzero(slope)
    if moving.size:
        low[moving + 1], high[moving + 1] = pdf.low[segment[moving]], pdf.high[segment[moving]]
        weight = pdf.density[segment] * free
        step[moving + 1] = _newton(weight, ratio, lost, slope, moving)
    return low, high, step


def _segments(pdf: Pdf, captures: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The segments just below and just above each capture, or the next ones above."""
    last = pdf.high.size - 1
    below = np.searchsorted(pdf.high, captures, side="left")
    above = np.searchsorted(pdf.high, captures, side="right")
    return np.minimum(below, last), np.minimum(above, last)


def _density(pdf: Pdf, segment: NDArray[np.intp], captures: Floats) -> Floats:
    """The density in `segment`, 0 where the capture is not in it nor at its end."""
    inside = (pdf.low[segment] <= captures) & (captures <= pdf.high[segment])
    return np.where(inside, pdf.density[segment], 0.0)


def _newton(
    weight: Floats, ratio: Floats, lost: Floats, slope: Floats, moving: NDArray[np.intp]
) -> Floats:
    """Newton's step of the captures `moving` (numbered from the second); uphill in any case.

    All is relative to the captures, hence free of units: weight = f i, ratio = i_k / i_{k-1},
    lost = (M(i_k) - M(i_{k+1})) / i_k.
    """
    diagonal = weight * (1 + ratio) - 2 * lost
    coupled = np.diff(moving) == 1
    bands = np.zeros((2, moving.size))
    bands[0, 1:][coupled] = -(weight * ratio)[moving[1:][coupled]]
    bands[1] = diagonal[moving]
    if moving.size == 1:
        bands = bands[1:]  # LAPACK takes no empty band
    try:
        return np.asarray(solveh_banded(bands, slope[moving]))
    except LinAlgError:  # not concave here
        return slope[moving] / (np.abs(diagonal) + weight)[moving]
