"""What a capture schedule is worth: the mean signal-to-noise ratio over a scene's photocurrents.

A pixel of photocurrent i is read at every capture time; what counts is its last sample before
saturation (LSBS). With T the time of that sample, its SNR as a power ratio is ([1]_, eq 4.1)

    SNR = (i T)^2 / ((i + dark) T + read^2 + reset^2) = T i^2 / (i + c),
    c = dark + (read^2 + reset^2) / T,

and 0 where even the first capture saturates. All integrals here are closed forms. Over a segment
[a, b] they are written as sums of positive terms, with s = a + c, d = b - a, z = d / s:

    integral of i^2 / (i + c) = d/s (a^2 A_0 + 2 a d A_1 + d^2 A_2),  A_n = int_0^1 u^n/(1 + z u) du

Why not the primitive x^2/2 - c x + c^2 ln(1 + x/c): its terms cancel where x << c and where a
segment is narrow; A_n is one logarithm and two steps of a recurrence, or its series for small z.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Floats, Pdf
from vcam_cli.scheduling.sensor import SHOT_NOISE, SLACK, Sensor

SERIES_BELOW = 0.25
"""Largest z of the series: 0.25^27 is below half a unit in the last place."""
SERIES_TERMS = 28
TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, eq=False)
class Schedule:
    """N capture times and what they are worth.

    Parameters
    ----------
    times : (N,) array
        Capture times, rising, equal where captures coincide [s].
    photocurrents : (N,) array
        Photocurrents that just fill the well in each time, well / times - dark [e/s].
    expected_snr : float
        Mean SNR over the pdf, as a power ratio.
    gap : float or None
        Certified gap: how far another schedule may exceed `expected_snr` at most, relative. None
        where nothing is certified.
    """

    times: Floats
    photocurrents: Floats
    expected_snr: float
    gap: float | None = None

    @property
    def distinct_captures(self) -> int:
        """Number of captures that differ."""
        return int(np.unique(self.times).size)


def expected_snr(pdf: Pdf, times: ArrayLike, sensor: Sensor = SHOT_NOISE) -> float:
    """Return the exact mean of eq 4.1 of [1]_ over a pdf, for the last sample before saturation.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents of the scene [e/s].
    times : (N,) array_like
        Capture times in any order [s].
    sensor : Sensor
        The pixel. By default photocurrents are in 1/[s] and the well holds one electron, so that
        the mean SNR is the normalized objective J, at most 1.

    Returns
    -------
    float
        Mean SNR, as a power ratio.

    Raises
    ------
    ValueError
        If a time is not finite and above 0.

    References
    ----------
    .. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
       University, 2003.
    """
    when = sorted_times(times)
    limits = saturation_limits(pdf, when, sensor)
    low, high, probability = split_segments(pdf, limits)
    last = np.searchsorted(-limits, -high, side="right") - 1
    measured = (last >= 0) & (high > 0)
    exposure = when[last[measured]]
    noise = sensor.dark + sensor.noise_floor / exposure
    value = exposure * mean_snr_rate(low[measured], high[measured], noise)
    return float(np.sum(probability[measured] * value))


def expected_snr_bound(pdf: Pdf, sensor: Sensor = SHOT_NOISE) -> float:
    """Return the mean SNR if every photocurrent had its own longest unsaturated exposure.

    No schedule of any number of captures exceeds it. Exposures are at most `sensor.max_time`.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents [e/s].
    sensor : Sensor
        The pixel.

    Returns
    -------
    float
        Mean SNR, as a power ratio.
    """
    turn = sensor.well / sensor.max_time - sensor.dark  # darker ones end at max_time
    low, high, probability = split_segments(pdf, np.array([turn]))
    bright = (high > turn) & (high > 0)
    full = sensor.well**2 / (sensor.well + sensor.noise_floor)
    filled = full * mean_squared_signal_fraction(low[bright], high[bright], sensor.dark)
    total = np.sum(probability[bright] * filled)
    dark = ~bright & (high > 0)
    if dark.any():
        noise = np.full(int(dark.sum()), sensor.dark + sensor.noise_floor / sensor.max_time)
        value = sensor.max_time * mean_snr_rate(low[dark], high[dark], noise)
        total += np.sum(probability[dark] * value)
    return float(total)


def expected_snr_noisy_saturation(pdf: Pdf, times: ArrayLike, sensor: Sensor) -> float:
    """Return the mean SNR over levels where a pixel saturates by its noisy value.

    `expected_snr` takes a photocurrent to be saturated where its mean fills the well. Of real
    pixels at that limit one in two is full by noise, and is read a capture earlier. Over a broad
    pdf few pixels are that close, and the loss is about a percent; the best captures for a few
    levels stand exactly on them, and all pixels of a level are.

    Noise is taken as normal, and a pixel that is open in a capture as open in all before: within a
    percent of a simulation of wells of 1000 electrons and more.

    Parameters
    ----------
    pdf : Pdf
        Levels of photocurrent [e/s].
    times : (N,) array_like
        Capture times in any order [s].
    sensor : Sensor
        The pixel.

    Returns
    -------
    float
        Mean SNR, as a power ratio. The SNR of a level is its square over the mean squared error of
        its pixels, those that are full in every capture counted as 0.

    Raises
    ------
    ValueError
        If the pdf is of segments.
    """
    from scipy.special import ndtr

    if not pdf.discrete:
        raise ValueError("noisy saturation is of levels, not of segments")
    when = np.unique(np.asarray(times, float))
    lit = (pdf.low > 0) & (pdf.probability > 0)
    light, probability = pdf.low[lit][:, None], pdf.probability[lit]
    charge = (light + sensor.dark) * when
    variance = charge + sensor.noise_floor
    open_share = np.minimum.accumulate(ndtr((sensor.well - charge) / np.sqrt(variance)), axis=1)
    last_share = open_share - np.append(open_share[:, 1:], np.zeros((len(light), 1)), axis=1)
    measured = open_share[:, 0]
    error = np.sum(last_share * variance / (light * when) ** 2, axis=1)
    snr = np.divide(measured**2, error, out=np.zeros_like(measured), where=error > 0)
    return float(np.sum(probability * snr))


def evaluate_schedule(
    pdf: Pdf, times: ArrayLike, sensor: Sensor = SHOT_NOISE, gap: float | None = None
) -> Schedule:
    """Return the schedule of these times with its expected SNR over a pdf.

    Parameters
    ----------
    pdf : Pdf
        Photocurrents [e/s].
    times : (N,) array_like
        Capture times in any order [s].
    sensor : Sensor
        The pixel.
    gap : float or None
        Certified gap of the schedule, relative; None where nothing is certified.

    Returns
    -------
    Schedule
        Rising times [s], the photocurrents that just fill the well in them [e/s], the mean SNR.
    """
    when = np.sort(np.atleast_1d(np.asarray(times, float)))
    return Schedule(when, sensor.saturation_limit(when), expected_snr(pdf, when, sensor), gap)


def sorted_times(times: ArrayLike) -> Floats:
    """Return capture times in rising order.

    Parameters
    ----------
    times : (N,) array_like
        Capture times in any order [s].

    Returns
    -------
    (N,) array
        Rising times [s].

    Raises
    ------
    ValueError
        If a time is not finite and above 0.
    """
    when = np.sort(np.atleast_1d(np.asarray(times, float)))
    if not (when[0] > 0 and np.isfinite(when[-1])):
        raise ValueError("capture times must be finite and above 0")
    return when


def saturation_limits(pdf: Pdf, times: Floats, sensor: Sensor) -> Floats:
    """Return the brightest photocurrent unsaturated in each of the times.

    An end of a segment within `SLACK` above a limit is that limit. Where no end is near, the limit
    is exact: slack for all would add 1e-12 to every mean.

    Parameters
    ----------
    times : (N,) array
        Rising capture times [s].

    Returns
    -------
    (N,) array
        Falling photocurrents [e/s].
    """
    limits = sensor.saturation_limit(times)
    reach = sensor.saturation_limit(times / (1 + SLACK))
    last = np.searchsorted(pdf.high, reach, side="right") - 1
    ends = np.where(last >= 0, pdf.high[np.maximum(last, 0)], limits)
    return np.maximum(limits, ends)


def split_segments(pdf: Pdf, cuts: Floats) -> tuple[Floats, Floats, Floats]:
    """Split the segments of a pdf at some photocurrents.

    Parameters
    ----------
    pdf : Pdf
        Segments, or levels.
    cuts : (C,) array
        Photocurrents in any order; those outside of the pdf split nothing.

    Returns
    -------
    low, high, probability : (M,) arrays
        Ends and probabilities of the parts, rising. Levels stay as they are.
    """
    if pdf.discrete:
        return pdf.low, pdf.high, pdf.probability
    inside = cuts[(cuts > pdf.low[0]) & (cuts < pdf.high[-1])]
    points = np.unique(np.concatenate([pdf.low, pdf.high, inside]))
    low, high = points[:-1], points[1:]
    segment = np.searchsorted(pdf.high, low, side="right")
    covered = pdf.low[segment] <= low
    low, high, segment = low[covered], high[covered], segment[covered]
    share = (high - low) / (pdf.high - pdf.low)[segment]
    return low, high, share * pdf.probability[segment]


def mean_snr_rate(low: Floats, high: Floats, noise: Floats) -> Floats:
    """Return the mean of i^2 / (i + c), the SNR per unit of exposure, over segments.

    Parameters
    ----------
    low, high : (M,) arrays
        Ends of each segment, `high` above 0; equal ones are levels. Shapes broadcast.
    noise : (M,) array
        c of each, not negative, in the same unit.

    Returns
    -------
    (M,) array
        Means, in that unit.
    """
    width = high - low
    if not np.any(noise):
        return low + width / 2
    start = low + noise
    if not np.any(width):
        return low * (low / start)
    ratio = _finite_ratio(width, start)
    a0, a1, a2 = _moments(ratio)
    low_part = low / np.maximum(start, TINY)
    # d/s (a^2 A0 + 2 a d A1 + d^2 A2) / d, where z A2 = 1/2 - A1 keeps a start at 0 finite.
    last = np.where(ratio > 1, 0.5 - a1, ratio * a2)
    return low_part * (low * a0 + 2 * width * a1) + width * last


def mean_squared_signal_fraction(low: Floats, high: Floats, noise: float) -> Floats:
    """Return the mean of (i / (i + c))^2, the signal's squared share of a full well, over segments.

    Parameters
    ----------
    low, high : (M,) arrays
        Ends of each segment, `high` above 0; equal ones are levels.
    noise : float
        c, not negative, in the same unit.

    Returns
    -------
    (M,) array
        Means, from 0 to 1.
    """
    if noise == 0:
        return np.ones(low.shape)
    width = high - low
    start = low + noise
    z = width / start
    b0, b1, b2 = _squared_moments(z)
    part = low / start
    return part * part * b0 + 2 * part * z * b1 + z * z * b2


def _finite_ratio(width: Floats, start: Floats) -> Floats:
    """Return z = width / start, huge but finite where start vanishes."""
    return width / np.maximum(start, np.maximum(width * 1e-300, TINY))


def _moments(z: Floats) -> tuple[Floats, Floats, Floats]:
    """Return A_n(z) = integral over u in [0, 1] of u^n / (1 + z u), n = 0, 1, 2, for z >= 0."""
    large = np.maximum(z, SERIES_BELOW)
    a0 = np.log1p(large) / large
    a1 = (1 - a0) / large
    exact = (a0, a1, (0.5 - a1) / large)
    small = np.minimum(z, SERIES_BELOW)
    terms = np.arange(SERIES_TERMS)
    return _select(z, exact, [_power_series(small, 1 / (terms + n + 1)) for n in range(3)])


def _squared_moments(z: Floats) -> tuple[Floats, Floats, Floats]:
    """Return B_n(z) = integral over u in [0, 1] of u^n / (1 + z u)^2, n = 0, 1, 2, for z >= 0."""
    large = np.maximum(z, SERIES_BELOW)
    a0 = np.log1p(large) / large
    b0 = 1 / (1 + large)
    b1 = (a0 - b0) / large
    exact = (b0, b1, ((1 - a0) / large - b1) / large)
    small = np.minimum(z, SERIES_BELOW)
    k = np.arange(SERIES_TERMS)
    return _select(z, exact, [_power_series(small, (k + 1) / (k + n + 1)) for n in range(3)])


def _select(
    z: Floats, exact: tuple[Floats, ...], series: list[Floats]
) -> tuple[Floats, Floats, Floats]:
    """Return the series where z is small, the exact values elsewhere."""
    near = z < SERIES_BELOW
    first, second, third = (np.where(near, s, e) for s, e in zip(series, exact, strict=True))
    return first, second, third


def _power_series(z: Floats, coefficients: Floats) -> Floats:
    """Return the sum of coefficients[k] (-z)^k by Horner's scheme."""
    total = np.zeros(np.shape(z))
    for coefficient in coefficients[::-1]:
        total = total * -z + coefficient
    return total
