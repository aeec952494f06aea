"""Whether points lie on the straight line that was fitted to them, and how far off its slope is.

The line of a photon transfer is one where the sensor is linear and its noise that of the electrons.
Where it bends, the slope of the line is not that at small signals, and its error by the noise of
the points says nothing of that: the difference from a parabola and from the points does.
"""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array

CHANCE = 1e-3
"""Probability of residuals that large below which they are no chance."""
STEADY = 2e-4
"""Relative error that any point may have beside its noise."""
LEAST_PART = 0.05
"""Part of the largest x below which a point's own slope means little."""


def slope_misfit(x: Array, y: Array, errors: Array, slope: float, is_free: bool = False) -> float:
    """Return how far a slope may be off because the points lie on no straight line.

    Parameters
    ----------
    x, y : Array
        Points (n,), x above 0.
    errors : Array
        Standard errors of y (n,).
    slope : float
        Slope of the line that was fitted.
    is_free : bool
        Whether the line has an intercept.

    Returns
    -------
    float
        0 where the residuals of the best line are chance; else the largest difference of the slope
        from that of a parabola at 0 and from those of the points, each beyond its error.
    """
    from scipy.special import chdtrc

    errors = np.hypot(errors, STEADY * abs(y))
    powers = np.arange(0 if is_free else 1, 3)
    freedom = len(x) - len(powers) + 1
    if freedom < 2 or not (errors > 0).all():
        return 0.0
    scale = float(x.max())
    bent = (x / scale)[:, None] ** powers / errors[:, None]
    line, *_ = np.linalg.lstsq(bent[:, :-1], y / errors, rcond=None)
    residual = y / errors - bent[:, :-1] @ line
    if chdtrc(freedom, float(residual @ residual)) > CHANCE:
        return 0.0
    covariance = np.linalg.pinv(bent.T @ bent)
    place = int(np.flatnonzero(powers == 1)[0])
    at_zero = float(covariance[place] @ bent.T @ (y / errors)) / scale
    doubt = 2 * float(np.sqrt(covariance[place, place])) / scale
    intercept = float(line[0]) if is_free else 0.0
    bright = x > LEAST_PART * scale
    each = abs((y - intercept) / x - slope) - 2 * errors / x
    return float(max(abs(at_zero - slope) + doubt, each[bright].max()))
