"""Some of many places, the more likely the more they count, and what each stands for.

The sum over all of what is found at the chosen ones, times what they stand for, is right in the
mean (D. G. Horvitz and D. J. Thompson, J. Am. Stat. Assoc. 47, 1952).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def chosen_places(
    importance: NDArray, count: int, anywhere: float, rng: np.random.Generator
) -> tuple[NDArray, NDArray]:
    """Return some of many places, the most likely first.

    Parameters
    ----------
    importance : NDArray
        How much each place (n,) is expected to count, in any unit.
    count : int
        Places that are chosen; one may be so more than once.
    anywhere : float
        Share of them for which all places are alike.
    rng : Generator
        Random numbers, of which one is drawn.

    Returns
    -------
    places : NDArray
        Their numbers (count,).
    shares : NDArray
        Share of all places that each stands for (count,).
    """
    size = importance.size
    chance = np.full(size, 1 / size)
    if importance.any():
        chance = anywhere * chance + (1 - anywhere) * importance / importance.sum()
    ticks = (np.arange(count) + rng.random()) / count
    places = np.minimum(np.searchsorted(np.cumsum(chance), ticks), size - 1)
    places = places[np.argsort(-chance[places])]
    return places, 1 / (count * size * chance[places])
