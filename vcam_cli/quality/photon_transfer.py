"""The photon transfer of a linear camera: gain, noise, efficiency and range from flat frames.

A camera whose numbers are a straight line of its electrons adds noise of three kinds: that of the
light, of which mean and variance are equal; that of the dark; and that of rounding. So the slope
of the variance over the mean is the gain K, whatever else is unknown, and from K follows the rest.

Frames come in pairs of equal light, since their difference knows no fixed pattern. Names and
equation numbers are those of the standard; y are numbers [DN], e electrons, p photons.

Why a free intercept below 0.24 DN^2: so little noise is lost between two codes, the variance of
the dark means nothing, and must not be subtracted.

References
----------
[1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021.
[2] J. Janesick, "Photon Transfer", SPIE Press, 2007, DOI 10.1117/3.725073.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

ROUNDING = 1 / 12
"""Variance of rounding to whole numbers [DN^2], eq 11 of [1]."""
LEAST_DARK = 0.24
"""Variance in the dark below which rounding hides it [DN^2], section 6 of [1]."""
GAIN_RANGE = 0.7
"""Part of saturation up to which gain and responsivity are fitted, section 6 of [1]."""
LINEAR_RANGE = (0.05, 0.95)
"""Parts of saturation between which the error of linearity is told, section 6 of [1]."""


def pair(first: ArrayLike, second: ArrayLike) -> tuple[float, float]:
    """Mean [DN] and temporal variance [DN^2] of two frames of equal light, section 6 of [1].

    variance = mean((y0 - y1)^2) / 2 - (mean(y0) - mean(y1))^2 / 2: what differs between pixels
    drops out, and so does a lamp that flickers. Raises ValueError where shapes differ.
    """
    a, b = (np.asarray(frame, dtype=np.float64) for frame in (first, second))
    if a.shape != b.shape or a.size == 0:
        raise ValueError(f"two frames of one shape are needed, not {a.shape} and {b.shape}")
    apart = a - b
    return float(a.mean() + b.mean()) / 2, float(np.var(apart)) / 2


@dataclass(frozen=True)
class Series:
    """Pairs of flat frames at rising light, all of one exposure time."""

    photons: Floats
    """(n,) On a pixel in the exposure, rising."""
    mean: Floats
    """(n,) [DN]"""
    variance: Floats
    """(n,) Temporal [DN^2]."""
    dark_mean: float
    """Of frames without light [DN]."""
    dark_variance: float
    """[DN^2]"""

    @property
    def signal(self) -> Floats:
        """Mean above the dark [DN]."""
        return self.mean - self.dark_mean

    @property
    def noise(self) -> Floats:
        """Variance above the dark's [DN^2]."""
        return self.variance - self.dark_variance

    @property
    def snr(self) -> Floats:
        """Signal over temporal noise, eq 20 of [1]; inf where there is no noise."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.signal / np.sqrt(self.variance)

    @property
    def saturated(self) -> int:
        """Index of the saturation point: where the variance is largest, section 6 of [1]."""
        return int(np.argmax(self.variance))


@dataclass(frozen=True)
class PhotonTransfer:
    """What a series of flat frames tells of a linear camera."""

    series: Series
    gain: float
    """K, overall system gain, eq 50 of [1] [DN/e]."""
    offset: float
    """Noise at no signal of the line that gave K [DN^2]."""
    responsivity: float
    """R, eq 49 of [1] [DN/photon]."""

    @property
    def quantum_efficiency(self) -> float:
        """eta = R / K, of the whole pixel, eq 52 of [1]."""
        return self.responsivity / self.gain

    @property
    def dark_noise(self) -> float:
        """sigma_d, eqs 53 and 54 of [1] [e]; where rounding hides it the most it can be."""
        return electrons_of_variance(self.series.dark_variance, self.gain)

    @property
    def saturation_photons(self) -> float:
        """mu_p.sat [photons]."""
        return float(self.series.photons[self.series.saturated])

    @property
    def saturation_capacity(self) -> float:
        """mu_e.sat = eta mu_p.sat, eq 24 of [1] [e]."""
        return self.quantum_efficiency * self.saturation_photons

    @property
    def threshold_electrons(self) -> float:
        """mu_e.min, the signal that equals its noise, eqs 26 and 27 of [1] [e]."""
        return sensitivity_threshold(self.dark_noise**2 + ROUNDING / self.gain**2)

    @property
    def threshold_photons(self) -> float:
        """mu_p.min, absolute sensitivity threshold, eq 26 of [1] [photons]."""
        return self.threshold_electrons / self.quantum_efficiency

    @property
    def snr_max(self) -> float:
        """Largest ratio of signal to noise, eq 55 of [1]."""
        return math.sqrt(self.saturation_capacity)

    @property
    def dynamic_range(self) -> float:
        """mu_p.sat / mu_p.min, eq 28 of [1]."""
        return self.saturation_photons / self.threshold_photons

    def snr_model(self, photons: ArrayLike) -> Floats:
        """Ratio of signal to noise at any number of photons, eq 21 of [1]."""
        e = self.quantum_efficiency * np.asarray(photons, dtype=np.float64)
        return e / np.sqrt(self.dark_noise**2 + ROUNDING / self.gain**2 + e)

    def snr_at(self, electrons: float) -> float:
        """Measured ratio at a signal [e], between the two levels around it (log-log).

        Raises ValueError where the series does not reach so far.
        """
        signal = self.series.signal / self.gain
        used = (signal > 0) & (np.arange(len(signal)) <= self.series.saturated)
        if not used.any() or not signal[used].min() <= electrons <= signal[used].max():
            raise ValueError(f"no frames around {electrons:.6g} electrons")
        x, y = np.log(signal[used]), np.log(self.series.snr[used])
        return float(np.exp(np.interp(math.log(electrons), x, y)))


def photon_transfer(series: Series) -> PhotonTransfer:
    """Gain and responsivity by straight lines over 0..70 % of saturation, section 6 of [1].

    Lines through the dark point, as the standard draws them; a free intercept of the variance
    where the dark's is below `LEAST_DARK`. Raises ValueError where fewer than 3 levels lie in the
    range, or where signal or variance do not rise.
    """
    used = series.signal <= GAIN_RANGE * series.signal[series.saturated]
    used &= np.arange(len(used)) <= series.saturated
    signal, noise, photons = series.signal[used], series.noise[used], series.photons[used]
    if len(signal) < 3:
        raise ValueError(f"{len(signal)} levels up to 70 % of saturation are too few for a line")
    responsivity = _through_zero(photons, signal)
    if series.dark_variance < LEAST_DARK:
        gain, offset = (float(c) for c in np.polyfit(signal, noise, 1))
    else:
        gain, offset = _through_zero(signal, noise), 0.0
    if not (responsivity > 0 and gain > 0):
        raise ValueError("signal and variance do not rise with the light")
    return PhotonTransfer(series, gain, offset, responsivity)


def _through_zero(x: Floats, y: Floats) -> float:
    """Slope of the least-squares line through (0, 0); 0 where x is 0 everywhere."""
    return float(x @ y / ((x @ x) or math.inf))


def electrons_of_variance(variance: float, gain: float) -> float:
    """Dark noise sqrt(variance - 1/12) / K [e] of a variance [DN^2], eqs 53 and 54 of [1]."""
    return math.sqrt(max(variance, LEAST_DARK) - ROUNDING) / gain


def sensitivity_threshold(variance: float) -> float:
    """Electrons whose signal equals their noise over a dark variance [e^2], eq 27 of [1]."""
    return math.sqrt(variance + 0.25) + 0.5


@dataclass(frozen=True)
class Linearity:
    """How straight the response is."""

    slope: float
    """[DN/photon]"""
    offset: float
    """[DN]"""
    deviation: Floats
    """(n,) From the line, relative to it, at every level of the series, eq 62 of [1]."""
    inside: NDArray[np.bool_]
    """(n,) The levels that count."""

    @property
    def error(self) -> float:
        """LE, mean of the absolute deviations, eq 63 of [1]."""
        return float(np.abs(self.deviation[self.inside]).mean())

    @property
    def least(self) -> float:
        """Smallest deviation."""
        return float(self.deviation[self.inside].min())

    @property
    def largest(self) -> float:
        """Largest deviation."""
        return float(self.deviation[self.inside].max())


def linearity(series: Series) -> Linearity:
    """Deviation from the line of least relative deviations over 5..95 % of saturation.

    Section 6 of [1]. Raises ValueError where fewer than 3 levels lie in the range.
    """
    signal, full = series.signal, series.signal[series.saturated]
    inside = (signal >= LINEAR_RANGE[0] * full) & (signal <= LINEAR_RANGE[1] * full)
    inside &= np.arange(len(signal)) <= series.saturated
    if inside.sum() < 3:
        raise ValueError(f"{inside.sum()} levels between 5 and 95 % of saturation are too few")
    x, y = series.photons[inside], signal[inside]
    slope, offset = (float(c) for c in np.polyfit(x, y, 1, w=1 / y))
    line = slope * series.photons + offset
    with np.errstate(divide="ignore", invalid="ignore"):
        deviation = (signal - line) / line
    return Linearity(slope, offset, deviation, inside)


@dataclass(frozen=True)
class DarkSignal:
    """The mean of the dark over the exposure time."""

    current: float
    """mu_I.mean, section 7 of [1] [DN/s]."""
    offset: float
    """At no time [DN]."""


def dark_signal(times: ArrayLike, means: ArrayLike) -> DarkSignal:
    """Straight line of the means [DN] of dark frames over their times [s], section 7 of [1].

    Raises ValueError for fewer than 3 different times.
    """
    t, y = (np.asarray(a, dtype=np.float64) for a in (times, means))
    if len(np.unique(t)) < 3:
        raise ValueError("dark frames of three different times are needed")
    scale = t.max()
    slope, offset = np.polyfit(t / scale, y, 1)
    return DarkSignal(float(slope / scale), float(offset))
