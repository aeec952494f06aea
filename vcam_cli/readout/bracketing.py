"""One photocurrent of several exposures that were taken one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.parallel import each
from vcam_cli.physics import merging
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.exposure import mean_dark
from vcam_cli.records import dataclass
from vcam_cli.rng import blocks

LEVELS = 100
"""Signals over nine decades at which the variance of an exposure is computed, 23 % apart: between
them it is taken as a straight line, which it is but where readouts switch."""


@dataclass(frozen=True)
class BracketExposure:
    """An exposure of a bracket."""

    dn: Array
    """Its codes (..., rows, columns) [DN]."""
    time: float
    """Exposure time [s]."""
    chain: ReadoutChain
    """Its readout, with the effects that run."""

    @property
    def dark(self) -> float:
        """Mean dark signal [electrons]."""
        return mean_dark(self.time, self.chain.effects)

    def current(self, dn: Array) -> Array:
        """Return the photocurrent of codes [e/s]."""
        found: Array = (self.chain.to_electrons(dn) - self.dark) / self.time
        return found

    @property
    def top(self) -> float:
        """Photocurrent above which it saturates [e/s]."""
        return float(self.current(np.array([self.chain.saturated_dn - 0.5]))[0])

    def variances(self, currents: Array) -> Array:
        """Return the temporal variance at noise-free photocurrents (n,) [e^2/s^2]."""
        levels = np.maximum(currents, 0) * self.time + self.dark
        n = self.chain.summed_codes
        # The chain's variance is of one conversion, the currents are of the sum of n of them.
        noise = [n**2 * self.chain.noise(float(e) / n, self.dark).total for e in levels]
        return np.array(noise) / self.time**2


def photocurrent(exposures: Sequence[BracketExposure], rule: merging.Rule, workers: int) -> Array:
    """Return the photocurrent of every pixel, merged of exposures that do not saturate.

    Each has charge of its own: their shot noise is independent. The level at which variances are
    taken is that of the longest exposure that does not saturate.

    Parameters
    ----------
    exposures : sequence of BracketExposure
        Exposures, in any order.
    rule : str
        'snr' (inverse variance) or 'switch' (the longest that does not saturate).
    workers : int
        Number of threads; results do not depend on it.

    Returns
    -------
    Array
        Photocurrents (..., rows, columns), float32 [e/s]; of a pixel that saturates in all
        exposures a lower bound.
    """
    rising = sorted(exposures, key=lambda exposure: -exposure.top)
    tops = [exposure.top for exposure in rising]
    grid = np.concatenate([[0.0], np.geomspace(max(tops) * 1e-9, max(tops), LEVELS)])
    tables = [exposure.variances(grid) for exposure in rising]
    spreads = [
        float(np.sqrt(e.variances(np.array([top]))[0])) for e, top in zip(rising, tops, strict=True)
    ]
    out: Array = np.empty(exposures[0].dn.shape, np.float32)

    def estimate(block: slice) -> None:
        values = [e.current(e.dn[..., block, :].astype(np.float64)) for e in rising]
        level = values[0]
        for one, top in zip(values[1:], tops[1:], strict=True):
            level = np.where(one < top, one, level)
        readings = [
            merging.Reading(one, np.interp(level, grid, table), top, spread)
            for one, table, top, spread in zip(values, tables, tops, spreads, strict=True)
        ]
        out[..., block, :] = merging.merged(readings, rule).values

    each(estimate, blocks(out.shape[-2]), workers)
    return out
