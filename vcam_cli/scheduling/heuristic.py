"""A schedule without any search: captures in proportion to the probability of each segment.

Within a segment captures are spread evenly in photocurrent, the first at its bright end, as in
Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University, 2003,
section 4.4.1. It costs nothing and lies within some tenths of a decibel of the optimum on
ordinary scenes.

Why a slack: the counts are decided by a ceiling and by halves that round up. 0.07 x 100 is
7.000000000000001 in floating point, and must still be 7.
"""

import numpy as np
from numpy.typing import NDArray

from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

SLACK = 1e-12
"""By how much a count may lie on the wrong side of a whole or half number; relative above 1."""


def heuristic(pdf: Pdf, count: int) -> Floats:
    """Photocurrents that just fill the well in each capture: (count,), descending from pdf.max.

    Segments without probability get no captures. Raises ValueError for fewer than one capture and
    for a pdf of levels, which has no segments to spread captures over.
    """
    if count < 1:
        raise ValueError("at least one capture is needed")
    if pdf.discrete:
        raise ValueError("the heuristic schedule needs segments, not levels")
    seen = pdf.probability > 0
    bright_first = (end[seen][::-1] for end in (pdf.low, pdf.high, pdf.probability))
    low, high, probability = bright_first
    spread = zip(low, high, captures_per_segment(probability, count), strict=True)
    return np.concatenate([
        top - (top - bottom) * np.arange(share) / max(share, 1) for bottom, top, share in spread
    ])  # fmt: skip


def captures_per_segment(probability: Floats, count: int) -> list[int]:
    """How many of `count` captures each segment gets, brightest first; they sum to `count`.

    probability : (M,) above 0, of any sum. The brightest segment's share is rounded up, so that
    it has a capture; each other's share of those that are left to the nearest, halves up.
    """
    left_over = np.cumsum(probability[::-1])[::-1]  # of this segment and all darker ones
    shares = probability / left_over
    counts = [max(1, int(np.ceil(_slacken(shares[0] * count, -SLACK))))]
    for share in shares[1:]:
        exact = (count - sum(counts)) * share
        counts.append(int(np.floor(_slacken(exact, SLACK) + 0.5)))
    return counts


def _slacken(value: float, slack: float) -> float:
    return value + slack * max(1.0, value)
