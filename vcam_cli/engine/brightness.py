"""How bright a picture is behind the lens, from its lowest frequencies.

A bound from below, whatever the picture: means of the light over patches, none of which is brighter
than the brightest place. Fejer's kernel makes them (L. Fejer, Math. Ann. 58, 1904): the first terms
of a cosine series, each weakened in proportion to its number, are a mean of the series with weights
of which none is negative.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcam_cli.engine.axis import Axis
from vcam_cli.engine.coefficients import Coefficients
from vcam_cli.engine.few_rows import FIRST
from vcam_cli.engine.lookup import Lookup, Rows
from vcam_cli.engine.sampling import Filter
from vcam_cli.engine.transfer import PARITIES

TERMS = FIRST
"""Along each axis: all of those rows are looked at, whatever the scene is."""
PLACES = 2 * TERMS
"""Along each axis at which the means are known."""


def least(filter: Filter, coefficients: Coefficients, terms: int = TERMS) -> float:
    """Signal of the brightest place on the array, at least [electrons / s].

    terms: along each axis, at most `TERMS`; of 1 it is the mean, which no lens changes.
    """
    rows = np.arange(min(terms, filter.y.terms))
    found = filter.rows(coefficients, rows)
    if found is None:
        return 0.0
    count = min(terms, found.count)
    planes = [plane[:, :count].astype(np.float64) for plane in found.planes]
    some = Rows(planes, found.fy, count)
    signal = np.zeros((filter.tables.values.shape[1], PLACES, PLACES))
    for parity in filter.tables.parities:
        odd_x, odd_y = PARITIES[parity]
        along_x = _means(filter.x, count, odd_x) * filter.along_x[:count]
        along_y = _means(filter.y, len(rows), odd_y) * filter.along_y[: len(rows)]
        lookup = Lookup(filter.tables, parity, filter.x.frequencies, np.dtype(np.float64), few=True)
        for color, tables in zip(signal, lookup.at(some, len(planes)), strict=True):
            color += along_y @ some.through(tables) @ along_x.T
    return max(0.0, float(signal.max()))


def _means(axis: Axis, count: int, odd: bool) -> NDArray:
    """What terms are at places on the array, weakened as Fejer has it: (places, count)."""
    k = np.arange(count)
    at = axis.first + np.linspace(0, axis.pixels - 1, PLACES) * axis.pixel_pitch
    waves = (np.sin if odd else np.cos)(np.pi * np.outer(at / axis.length, k))
    waves[:, 1:] *= 2  # a DCT-II's constant counts once
    return waves * (axis.weights[:count] * (1 - k / count))
