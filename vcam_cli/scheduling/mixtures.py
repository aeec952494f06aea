"""The best mixture of a few points under a concave function and a linear one."""

from collections.abc import Callable

import numpy as np

from vcam_cli.scheduling.pdf import Floats

STEPS = 400
ENOUGH = 1e-5
"""Relative distance from the best mixture, by concavity, that ends the search."""


def best_mixture(
    value: Callable[[Floats], tuple[float, Floats]], points: Floats, worth: Floats, start: Floats
) -> Floats:
    """Return shares of points that make value(mixture) + worth of the shares large.

    Pairwise steps: weight moves from the worst point of the mixture to the best one, up to the
    optimum of a line search by bisection of the slope.

    Parameters
    ----------
    value : callable
        A concave function of a point (T,), with its derivative.
    points : (P, T) array
        The points.
    worth : (P,) array
        What each share adds by itself.
    start : (P,) array
        Shares to begin with, of sum 1.

    Returns
    -------
    (P,) array
        Shares, of sum 1.
    """
    shares = start.copy()
    for _ in range(STEPS):
        total, slope = value(shares @ points)
        gains = points @ slope + worth
        best = int(np.argmax(gains))
        held = np.flatnonzero(shares > 0)
        worst = int(held[np.argmin(gains[held])])
        if gains[best] - gains @ shares <= ENOUGH * abs(total + worth @ shares):
            break
        low, high = 0.0, float(shares[worst])
        for trial in range(20):
            step = high if trial == 0 else (low + high) / 2
            moved = shares.copy()
            moved[[best, worst]] += step, -step
            after = points @ value(moved @ points)[1] + worth
            if after[best] >= after[worst]:
                low = step
                if trial == 0:
                    break
            else:
                high = step
        shares[[best, worst]] += low, -low
        shares = np.maximum(shares, 0.0)
        shares /= shares.sum()
    return shares
