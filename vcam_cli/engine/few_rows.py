"""Which rows of a picture's spectrum are looked at, to tell what is in all of it.

All of the first, into which edges along the array put their energy, and ever fewer of the others;
and those that stand out among the rows around them, as a grating's do: between two that are looked
at they would be missed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import Coefficients, OfRuns, Passing
from vcam_cli.engine.parallel import at_once, pieces

FIRST = 24
"""Rows that are all looked at."""
OTHERS = 40
"""Rows that are looked at beyond those, at most."""
OUTSTANDING = 32
"""Terms along an axis that stand out, at most: those with most energy."""
STANDS_OUT = 3.0
"""Energy of such a term over the mean of those around it."""


def of(y: Axis, coefficients: Coefficients) -> tuple[NDArray, NDArray]:
    """Terms along y of a scene that are looked at, and what they stand for: see `rows`.

    Planes that pass are let go before all are known: the first one says which rows are kept.
    """
    if isinstance(coefficients, Passing):
        return rows(y, coefficients.energy[0], coefficients.energy.sum(axis=0))
    return rows(y, energy(coefficients))


def energy(coefficients: Coefficients) -> NDArray:
    """Sum of squares of every row of coefficients, all planes together: (ny,)."""
    if isinstance(coefficients, OfRuns):
        alike = sum(values.astype(np.float64) @ values.T for values in coefficients.values)
        return np.asarray(np.einsum("yd,yd->y", coefficients.along @ alike, coefficients.along))
    planes = np.asarray(coefficients)
    out = np.zeros(planes.shape[1])
    for plane in planes:
        for rows in pieces(len(plane), at_once(plane.shape[1])):
            out[rows] += np.einsum("yx,yx->y", plane[rows], plane[rows])
    return out


def rows(y: Axis, energy: NDArray, every: NDArray | None = None) -> tuple[NDArray, NDArray]:
    """Terms along y that are looked at, rising, and the number of rows that each stands for.

    energy: (ny,) of the coefficients' rows. Of rows that are stood for the one with the most
    usual energy is taken, as often as gives the energy of all: a chart's rise and fall from row to
    row. every: the energy that is stood for, where another one tells rows apart.
    """
    own = _on_axis(y, energy)
    outstanding = standing_out(own)
    rest = np.delete(np.arange(y.terms), outstanding)
    count = len(rest)
    first, others = np.arange(min(FIRST, count)), np.geomspace(FIRST, max(FIRST, count), OTHERS)
    at = np.unique(np.concatenate([first, others]).astype(int))
    at = at[at < count]
    starts = np.append(0, np.ceil((at[1:] + at[:-1]) / 2).astype(int))
    usual = _usual(own[rest], starts)
    counted = (own if every is None else _on_axis(y, every))[rest]
    sizes = np.diff(starts, append=count).astype(float)
    total, one = np.add.reduceat(counted, starts), counted[usual]
    times = np.divide(total, one, out=sizes, where=one > 0)
    terms = np.concatenate([rest[usual], outstanding])
    stand_for = np.concatenate([times, np.ones(len(outstanding))])
    order = np.argsort(terms)
    return terms[order], stand_for[order]


def _on_axis(y: Axis, energy: NDArray) -> NDArray:
    """Of every term along y; 0 where it is not known."""
    index, sign = y.base(np.arange(y.terms))
    known = energy if np.isfinite(energy).all() else np.zeros_like(energy)
    return known[index] * np.square(sign * y.weights)


def _usual(energy: NDArray, starts: NDArray) -> NDArray:
    """Of every group of rows the one whose energy is nearest to the mean, the middle one of
    several."""
    sizes = np.diff(starts, append=len(energy))
    group, mean = np.repeat(np.arange(len(starts)), sizes), np.add.reduceat(energy, starts) / sizes
    mean, middle = mean[group], (starts + sizes // 2)[group]
    away = np.abs(energy - mean) + 1e-9 * mean * np.abs(np.arange(len(energy)) - middle)
    return np.lexsort((away, group))[starts]


def standing_out(energy: NDArray) -> NDArray:
    """Terms far above the mean of those around them, the strongest: (n,).

    energy: (terms,) along an axis.
    """
    if len(energy) <= FIRST + 1:
        return np.zeros(0, int)
    starts = np.unique(np.geomspace(FIRST, len(energy), OTHERS).astype(int))[:-1]
    sizes = np.diff(starts, append=len(energy))
    around = np.repeat(np.add.reduceat(energy, starts) / sizes, sizes)
    found = FIRST + np.flatnonzero(energy[FIRST:] > STANDS_OUT * around)
    return found[np.argsort(energy[found])[::-1][:OUTSTANDING]]
