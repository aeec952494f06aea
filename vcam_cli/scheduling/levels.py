"""The photocurrents of many pixels as a pdf of not too many levels.

Why levels of equal ratio: a histogram of equal bins that resolves the bright holds all of the dark
in one bin, and captures are as much for the dark. Each bin stands for its brightest pixel, so that
a capture that is chosen for a bin saturates no pixel of it.
"""

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.pdf import Pdf

BINS = 4096
"""Of the histogram; six decades of light in steps of a third of a percent."""
DARKEST = 1e-9
"""Of the brightest photocurrent: pixels below count as one bin."""


def levels(photocurrents: NDArray, bins: int = BINS, darkest: float = DARKEST) -> Pdf | None:
    """The histogram of photocurrents of any shape as levels; None where none is above 0.

    bins: at most so many levels, of equal ratio from the darkest pixel to the brightest, each the
    brightest pixel of its bin; darkest: over the brightest, what is below it is one bin. Pixels at
    0 or below are a level of their own, 0.
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
    there = counts > 0
    unlit = np.size(photocurrents) - light.size
    if not unlit:
        return Pdf.levels(brightest[there], counts[there])
    return Pdf.levels([0.0, *brightest[there]], [unlit, *counts[there]])
