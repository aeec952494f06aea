"""Merging of several readings of one signal; the finer ones saturate first.

A fine reading x is weighed in while it does not saturate: of the coarse estimate y

    z = y + a(x) (x - y),   a = w f(x),

f falls from 1 to 0 over a ramp below the level S where x saturates. w is 1 (`switch`), or makes
the variance least (`snr`): w = var y / (var x + var y).

Who chooses by a noisy reading chooses its low values: E z = E y + E a' var x, by Stein's lemma.
With a' = -w / ramp this is known and added again: the mean goes straight through the switch.

References
----------
C. Stein, Ann. Statist. 9(6), 1981, doi:10.1214/aos/1176345632; M. Granados et al., Optimal HDR
reconstruction with linear digital cameras, CVPR 2010, doi:10.1109/CVPR.2010.5540208.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

Rule = Literal["snr", "switch"]

RAMP = 2.0
"""Standard deviations over which a saturating reading fades. Of fewer the correction of the mean is
noise by itself; of more a reading is lost below its saturation: 2 cost 0.7 % of a well of 22 ke."""


@dataclass(frozen=True)
class Reading:
    """A reading of the signal, in the common unit of all of them."""

    values: Array
    variance: Array | float
    """Of what is new in this reading, or of all of it where readings share no charge."""
    top: float
    """Level above which it saturates."""
    spread: float
    """Standard deviation at that level."""


def share(values: Array, variance: Array | float, fine: Reading, rule: Rule) -> tuple[Array, Array]:
    """Return the share a of a fine reading in the estimate, and its slope over the reading.

    Parameters
    ----------
    values : Array
        The fine reading.
    variance : Array or float
        Variance of the coarse estimate, of what the two do not share.
    fine : Reading
        Variance, top and spread of the fine reading.
    rule : str
        'snr' or 'switch'.
    """
    ramp = max(RAMP * fine.spread, 1e-12 * fine.top)
    fade = np.clip((fine.top - values) / ramp, 0, 1)
    weight = variance / (variance + fine.variance) if rule == "snr" else 1.0
    return fade * weight, ((fade > 0) & (fade < 1)) * (-weight / ramp)


def merged(readings: Sequence[Reading], rule: Rule) -> Reading:
    """Return one reading of several, from the coarsest to the finest.

    Parameters
    ----------
    readings : sequence of Reading
        Readings whose tops fall.
    rule : str
        'snr' or 'switch'.

    Returns
    -------
    Reading
        Estimate and its variance, with the top of the coarsest.
    """
    first = readings[0]
    values, variance = first.values, first.variance
    for fine in readings[1:]:
        a, slope = share(fine.values, variance, fine, rule)
        values = values + a * (fine.values - values) - slope * fine.spread**2
        variance = (1 - a) ** 2 * variance + a**2 * fine.variance
    return Reading(values, variance, first.top, first.spread)
