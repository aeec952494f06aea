"""The photon transfer of a linear camera: gain, noise, efficiency and range from flat frames.

A camera whose numbers are a straight line of its electrons adds noise of three kinds: that of the
light, with equal mean and variance; that of the dark; and that of rounding. So the slope
of the variance over the mean is the gain K, whatever else is unknown, and from K follows the rest.

Frames come in pairs of equal light, since their difference knows no fixed pattern. Names and
equation numbers are those of the standard; y are numbers [DN], e electrons, p photons.

Why a free intercept below 0.24 DN^2: so little noise is lost between two codes, the variance of
the dark means nothing, and must not be subtracted.

References
----------
.. [1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021.
.. [2] J. Janesick, "Photon Transfer", SPIE Press, 2007, doi:10.1117/3.725073.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.records import dataclass

Floats = NDArray[np.float64]

ROUNDING = 1 / 12
"""Variance of rounding to whole numbers [DN^2], eq 11 of [1]."""
MIN_DARK_VARIANCE = 0.24
"""Variance in the dark below which rounding hides it [DN^2], section 6 of [1]."""
GAIN_RANGE = 0.7
"""Part of saturation up to which gain and responsivity are fitted, section 6 of [1]."""
LINEAR_RANGE = (0.05, 0.95)
"""Parts of saturation between which the error of linearity is measured, section 6 of [1]."""


def pair_statistics(first: ArrayLike, second: ArrayLike) -> tuple[float, float]:
    """Return mean and temporal variance of two frames of equal light, section 6 of [1].

    variance = mean((y0 - y1)^2) / 2 - (mean(y0) - mean(y1))^2 / 2: what differs between pixels
    drops out, and so does a lamp that flickers.

    Parameters
    ----------
    first, second : array_like
        Frames of one shape [DN].

    Returns
    -------
    mean : float
        Mean of both frames [DN].
    variance : float
        Temporal variance [DN^2].

    Raises
    ------
    ValueError
        The shapes differ, or there are no pixels.
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
    """Photons on a pixel in the exposure (n,), rising."""
    mean: Floats
    """Mean of each pair of frames (n,) [DN]."""
    variance: Floats
    """Temporal variance of each pair of frames (n,) [DN^2]."""
    dark_mean: float
    """Mean of frames without light [DN]."""
    dark_variance: float
    """Temporal variance of frames without light [DN^2]."""

    @property
    def signal(self) -> Floats:
        """Mean above the dark (n,) [DN]."""
        return self.mean - self.dark_mean

    @property
    def noise(self) -> Floats:
        """Variance above the dark's (n,) [DN^2]."""
        return self.variance - self.dark_variance

    @property
    def snr(self) -> Floats:
        """Signal over temporal noise (n,), eq 20 of [1]; inf where there is no noise."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.signal / np.sqrt(self.variance)

    @property
    def saturation_index(self) -> int:
        """Index of the saturation point: where the variance is largest, section 6 of [1]."""
        return int(np.argmax(self.variance))


@dataclass(frozen=True)
class PhotonTransfer:
    """Gain, noise and range of a linear camera, from a series of flat frames."""

    series: Series
    """The flat frames that were measured."""
    gain: float
    """Overall system gain K, eq 50 of [1] [DN/e]."""
    offset: float
    """Noise at no signal of the line that gave K [DN^2]."""
    responsivity: float
    """Responsivity R, eq 49 of [1] [DN/photon]."""

    @property
    def quantum_efficiency(self) -> float:
        """Quantum efficiency eta = R / K of the whole pixel, eq 52 of [1]."""
        return self.responsivity / self.gain

    @property
    def dark_noise(self) -> float:
        """Dark noise sigma_d, eqs 53 and 54 of [1] [e]; its upper bound where rounding hides it."""
        return electrons_of_variance(self.series.dark_variance, self.gain)

    @property
    def saturation_photons(self) -> float:
        """Photons at saturation mu_p.sat [photons]."""
        return float(self.series.photons[self.series.saturation_index])

    @property
    def saturation_capacity(self) -> float:
        """Saturation capacity mu_e.sat = eta mu_p.sat, eq 24 of [1] [e]."""
        return self.quantum_efficiency * self.saturation_photons

    @property
    def threshold_electrons(self) -> float:
        """Signal that equals its noise mu_e.min, eqs 26 and 27 of [1] [e]."""
        return sensitivity_threshold(self.dark_noise**2 + ROUNDING / self.gain**2)

    @property
    def threshold_photons(self) -> float:
        """Absolute sensitivity threshold mu_p.min, eq 26 of [1] [photons]."""
        return self.threshold_electrons / self.quantum_efficiency

    @property
    def snr_max(self) -> float:
        """Largest ratio of signal to noise, eq 55 of [1]."""
        return math.sqrt(self.saturation_capacity)

    @property
    def dynamic_range(self) -> float:
        """Dynamic range mu_p.sat / mu_p.min, eq 28 of [1]."""
        return self.saturation_photons / self.threshold_photons

    def measured_snr(self, electrons: float) -> float:
        """Return the measured signal-to-noise ratio at a signal, log-log between two levels.

        Parameters
        ----------
        electrons : float
            Signal [e].

        Returns
        -------
        float
            Ratio of signal to noise [dimensionless].

        Raises
        ------
        ValueError
            The series does not reach so far.
        """
        signal = self.series.signal / self.gain
        used = (signal > 0) & (np.arange(len(signal)) <= self.series.saturation_index)
        if not used.any() or not signal[used].min() <= electrons <= signal[used].max():
            raise ValueError(f"no frames around {electrons:.6g} electrons")
        x, y = np.log(signal[used]), np.log(self.series.snr[used])
        return float(np.exp(np.interp(math.log(electrons), x, y)))


def photon_transfer(series: Series) -> PhotonTransfer:
    """Return gain and responsivity, by straight lines over 0..70 % of saturation, section 6 of [1].

    Lines through the dark point, as the standard draws them; a free intercept of the variance
    where the dark's is below `MIN_DARK_VARIANCE`.

    Parameters
    ----------
    series : Series
        Pairs of flat frames at rising light.

    Returns
    -------
    PhotonTransfer
        Gain, noise and range.

    Raises
    ------
    ValueError
        Fewer than 3 levels lie in the range, or signal or variance do not rise.
    """
    used = series.signal <= GAIN_RANGE * series.signal[series.saturation_index]
    used &= np.arange(len(used)) <= series.saturation_index
    signal, noise, photons = series.signal[used], series.noise[used], series.photons[used]
    if len(signal) < 3:
        raise ValueError(f"{len(signal)} levels up to 70 % of saturation are too few for a line")
    responsivity = _slope_through_zero(photons, signal)
    if series.dark_variance < MIN_DARK_VARIANCE:
        gain, offset = (float(c) for c in np.polyfit(signal, noise, 1))
    else:
        gain, offset = _slope_through_zero(signal, noise), 0.0
    if not (responsivity > 0 and gain > 0):
        raise ValueError("signal and variance do not rise with the light")
    return PhotonTransfer(series, gain, offset, responsivity)


def _slope_through_zero(x: Floats, y: Floats) -> float:
    """Return the slope of the least-squares line through (0, 0); 0 where x is 0 everywhere."""
    return float(x @ y / ((x @ x) or math.inf))


def electrons_of_variance(variance: float, gain: float) -> float:
    """Return the dark noise of a dark variance, sqrt(variance - 1/12) / K, eqs 53 and 54 of [1].

    Parameters
    ----------
    variance : float
        Temporal variance without light [DN^2].
    gain : float
        Overall system gain K [DN/e].

    Returns
    -------
    float
        Dark noise [e].
    """
    return math.sqrt(max(variance, MIN_DARK_VARIANCE) - ROUNDING) / gain


def sensitivity_threshold(variance: float) -> float:
    """Return the signal that equals its noise over a dark variance, eq 27 of [1].

    Parameters
    ----------
    variance : float
        Variance without light, rounding included [e^2].

    Returns
    -------
    float
        Signal [e].
    """
    return math.sqrt(variance + 0.25) + 0.5


@dataclass(frozen=True)
class Linearity:
    """Deviation of the response from a straight line."""

    slope: float
    """Slope of the line [DN/photon]."""
    offset: float
    """Value of the line without light [DN]."""
    deviation: Floats
    """Deviation from the line, relative to it, at every level of the series (n,), eq 62 of [1]."""
    in_range: NDArray[np.bool_]
    """Whether each level counts (n,)."""

    @property
    def error(self) -> float:
        """Linearity error LE, mean of the absolute deviations, eq 63 of [1]."""
        return float(np.abs(self.deviation[self.in_range]).mean())

    @property
    def min_deviation(self) -> float:
        """Smallest deviation."""
        return float(self.deviation[self.in_range].min())

    @property
    def max_deviation(self) -> float:
        """Largest deviation."""
        return float(self.deviation[self.in_range].max())


def linearity(series: Series) -> Linearity:
    """Return the deviation from the line of least relative deviations, section 6 of [1].

    Parameters
    ----------
    series : Series
        Pairs of flat frames at rising light; those in 5..95 % of saturation are used.

    Returns
    -------
    Linearity
        The line, and the deviations from it.

    Raises
    ------
    ValueError
        Fewer than 3 levels lie in the range.
    """
    signal, full = series.signal, series.signal[series.saturation_index]
    in_range = (signal >= LINEAR_RANGE[0] * full) & (signal <= LINEAR_RANGE[1] * full)
    in_range &= np.arange(len(signal)) <= series.saturation_index
    if in_range.sum() < 3:
        raise ValueError(f"{in_range.sum()} levels between 5 and 95 % of saturation are too few")
    x, y = series.photons[in_range], signal[in_range]
    slope, offset = (float(c) for c in np.polyfit(x, y, 1, w=1 / y))
    line = slope * series.photons + offset
    with np.errstate(divide="ignore", invalid="ignore"):
        deviation = (signal - line) / line
    return Linearity(slope, offset, deviation, in_range)


@dataclass(frozen=True)
class DarkSignal:
    """Mean of the dark over the exposure time, as a straight line."""

    current: float
    """Dark current mu_I.mean, section 7 of [1] [DN/s]."""
    offset: float
    """Dark signal at no exposure time [DN]."""


def dark_signal(times: ArrayLike, means: ArrayLike) -> DarkSignal:
    """Return the straight line of the means of dark frames over their times, section 7 of [1].

    Parameters
    ----------
    times : array_like
        Exposure times (n,) [s].
    means : array_like
        Means of dark frames (n,) [DN].

    Returns
    -------
    DarkSignal
        Dark current and offset.

    Raises
    ------
    ValueError
        Fewer than 3 different times.
    """
    t, y = (np.asarray(a, dtype=np.float64) for a in (times, means))
    if len(np.unique(t)) < 3:
        raise ValueError("dark frames of three different times are needed")
    scale = t.max()
    slope, offset = np.polyfit(t / scale, y, 1)
    return DarkSignal(float(slope / scale), float(offset))
