"""The SNR of a capture schedule, measured over many simulated integrations.

Why twice: the closed form takes a pixel to be saturated where its mean fills the well. So decided,
simulation agrees with it. A real pixel is saturated where its noisy value is, and one that would
just not fill the well is half of the time read a capture earlier: that loss is measured as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.signal_chain import Limit
from vcam_cli.parallel import each
from vcam_cli.readout import nondestructive_samples
from vcam_cli.records import dataclass
from vcam_cli.rng import blocks
from vcam_cli.scheduling import estimators
from vcam_cli.scheduling.pdf import Floats
from vcam_cli.scheduling.sensor import SLACK, Sensor
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.solve.raised_codes import RaisedCodes

Flags = NDArray[np.bool_]

ENDLESS = 2**32 - 1
"""Highest code where neither well nor ADC ends [DN]."""
GROUP = 16
"""Pixels of nearly the same light whose errors are averaged where saturation is noisy."""


@dataclass(frozen=True)
class MeasuredSnr:
    """The mean SNR over all pixels, as power ratios, with standard errors.

    Parameters
    ----------
    snr, error : float
        Mean where a pixel is saturated when its mean fills the well, and its standard error.
    noisy_snr, noisy_error : float
        The same where a pixel is saturated when its noisy value is, as in a camera.
    """

    snr: float
    error: float
    noisy_snr: float
    noisy_error: float


class NoiseMeasurement:
    """The error of every pixel over many integrations, saturation decided in two ways.

    Parameters
    ----------
    ready : Prepared
        The camera with the mean rate of its pixels.
    sensor : Sensor
        Its pixel.
    times : tuple of float
        (N,) rising capture times [s].
    workers : int
        Threads.
    """

    def __init__(
        self,
        ready: Prepared,
        sensor: Sensor,
        times: tuple[float, ...],
        workers: int,
    ) -> None:
        self.ready, self.sensor, self.times = ready, sensor, times
        self.workers = workers
        self.rate = ready.rate.astype(np.float64)
        self.effects: tuple[Effect, ...] = tuple(
            e for e in ready.plan.active if e not in of_kind(ready.plan.active, Limit)
        )
        filled = np.multiply.outer(np.array(times), self.rate + sensor.dark)
        self.full = filled > sensor.well * (1 + SLACK)

    def measure(self, methods: Sequence[str], integrations: int) -> dict[str, MeasuredSnr]:
        """Return the mean SNR of each estimator over some integrations, at least 6."""
        squares = {method: np.zeros((2, *self.rate.shape)) for method in methods}
        measured = np.zeros(self.rate.shape)
        for number in range(integrations):
            charge = self._charge(number)
            full = np.logical_or.accumulate(charge >= self.sensor.well)
            real = np.minimum(charge, self.sensor.well)
            measured += ~full[0]
            for method, sums in squares.items():
                for square, samples, saturated in zip(
                    sums, (charge, real), (self.full, full), strict=True
                ):
                    self._add_errors(square, samples, saturated, method)
        return {m: self._mean_snr(sums, measured, integrations) for m, sums in squares.items()}

    def _add_errors(self, square: Floats, samples: Floats, saturated: Flags, method: str) -> None:
        """Add the squared errors of one integration, some rows at a time."""

        def block(rows: slice) -> None:
            estimate = self._estimate(samples[:, rows], saturated[:, rows], method)
            square[rows] += np.where(saturated[0, rows], 0.0, (estimate - self.rate[rows]) ** 2)

        each(block, blocks(len(square)), self.workers)

    def _charge(self, number: int) -> Floats:
        """Return samples of one integration in an endless well, rounded as the ADC does [e]."""
        seed = self.ready.solved.seed
        seeds = {"sensor": seed.sensor, "frame": seed.frame + 1 + number}
        chain = self.ready.chain
        # As many codes below black as above it, and far more: none of these samples is clipped.
        adc = RaisedCodes(chain.adc, chain.highest_dn, ENDLESS)
        _, dn = nondestructive_samples.samples(
            self.rate, self.times, self.effects, adc, seeds, self.workers
        )
        return chain.to_electrons(dn.astype(np.float64) - adc.pedestal)

    def _estimate(self, charge: Floats, full: Flags, method: str) -> Floats:
        s = self.sensor
        if method == "weighted":
            return estimators.weighted_estimate(
                charge, self.times, full, s.dark, s.read**2, s.reset**2
            )
        return estimators.last_sample_before_saturation(charge, self.times, full, s.dark)

    def _mean_snr(self, squares: Floats, measured: Floats, integrations: int) -> MeasuredSnr:
        """Return mean SNRs from sums of squared errors of each pixel.

        measured: integrations of each pixel whose first sample is not full; the others count as SNR
        0, as pixels whose mean fills the well do in the closed form.

        Of n normal errors the sum is distributed as chi squared, and the mean of its inverse is
        1 / (n - 2): so i^2 (n - 2) / sum has no bias, and the relative variance 2 / (n - 4).
        Where saturation is noisy, errors of a pixel near it are a mixture of two kinds; there
        pixels next to one another in brightness are grouped, so that n is large.
        """
        lit = ~self.full[0] & (self.rate > 0)
        power = np.where(lit, self.rate**2, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            single = np.where(squares[0] > 0, power * (integrations - 2) / squares[0], 0.0)
        order = np.flatnonzero(lit)[np.argsort(self.rate[lit])]
        groups = order[order.size % GROUP :].reshape(-1, GROUP)
        error = np.maximum(squares[1].ravel()[groups].sum(axis=1), np.finfo(float).tiny)
        known = measured.ravel()[groups].sum(axis=1)
        n, share = integrations * GROUP, GROUP / lit.size
        group_power = power.ravel()[groups].mean(axis=1)
        grouped = known / n * group_power * np.maximum(known - 2, 0) / error
        return MeasuredSnr(
            float(single.mean()),
            float(np.sqrt(np.sum(single**2) * 2 / (integrations - 4)) / lit.size),
            float(grouped.sum() * share),
            float(np.sqrt(np.sum(grouped**2) * 2 / (n - 4)) * share),
        )
