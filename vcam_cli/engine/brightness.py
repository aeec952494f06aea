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

PLACES = 2 * FIRST
"""Along each axis at which the means are known."""


def least(filter: Filter, coefficients: Coefficients) -> float:
    """Signal of the brightest place on the array, at least [electrons / s].

    Of a transfer over |f| alone. From the rows of the spectrum that are looked at whatever the
    scene is.
    """
    terms = np.arange(min(FIRST, filter.y.terms))
    found = filter.rows(coefficients, terms)
    if found is None:
        return 0.0
    count = min(FIRST, found.count)
    planes = [plane[:, :count].astype(np.float64) for plane in found.planes]
    rows = Rows(planes, found.fy, count)
    along_x = _means(filter.x, count) * filter.along_x[:count]
    along_y = _means(filter.y, len(terms)) * filter.along_y[: len(terms)]
    lookup = Lookup(filter.tables, 0, filter.x.frequencies, np.dtype(np.float64), few=True)
    signals = map(rows.through, lookup.at(rows, len(planes)))
    return max(float((along_y @ signal @ along_x.T).max()) for signal in signals)


def _means(axis: Axis, count: int) -> NDArray:
    """What terms are at places on the array, weakened as Fejer has it: (places, count)."""
    k = np.arange(count)
    at = axis.first + np.linspace(0, axis.pixels - 1, PLACES) * axis.pixel_pitch
    waves = np.cos(np.pi * np.outer(at / axis.length, k))
    waves[:, 1:] *= 2  # a DCT-III counts its constant once
    return waves * (axis.weights[:count] * (1 - k / count))
