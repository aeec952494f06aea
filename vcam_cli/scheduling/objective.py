"""What a capture schedule is worth: the mean signal-to-noise ratio over a scene's photocurrents.

A pixel of photocurrent i is read at every capture time; what counts is its last sample before
saturation (LSBS). With T the time of that sample, its SNR as a power ratio is (Chen, "Digital
Camera System Simulator and Applications", PhD thesis, Stanford University, 2003, eq 4.1)

    SNR = (i T)^2 / ((i + dark) T + read^2 + reset^2) = T i^2 / (i + c),
    c = dark + (read^2 + reset^2) / T,

and 0 where even the first capture saturates. All integrals here are closed forms. Over a piece
[a, b] they are written as sums of positive terms, with s = a + c, d = b - a, z = d / s:

    integral of i^2 / (i + c) = d/s (a^2 A_0 + 2 a d A_1 + d^2 A_2),  A_n = int_0^1 u^n/(1 + z u) du

Why not the primitive x^2/2 - c x + c^2 ln(1 + x/c): its terms cancel where x << c and where a
piece is narrow; A_n is one logarithm and two steps of a recurrence, or its series for small z.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

SLACK = 1e-12
"""Relative: a time worked out as well / i must not saturate i by a rounding error."""
SERIES_BELOW = 0.25
"""z up to which the series is used: 0.25^27 is below half a unit in the last place."""
SERIES_TERMS = 28
TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True)
class Sensor:
    """What a pixel does to the signal; the default has shot noise alone and a well of 1 electron.

    A pixel of photocurrent i is saturated at time t where (i + dark) t > well.
    """

    well: float = 1.0  # [e]
    dark: float = 0.0  # dark current [e/s]
    read: float = 0.0  # readout noise [e rms]
    reset: float = 0.0  # reset noise [e rms]
    max_time: float = np.inf  # longest exposure [s]

    def __post_init__(self) -> None:
        if not (0 < self.well < np.inf and self.max_time > 0):
            raise ValueError("well and max_time must be above 0")
        if not all(0 <= value < np.inf for value in (self.dark, self.read, self.reset)):
            raise ValueError("dark, read and reset must be finite and not negative")

    @property
    def floor(self) -> float:
        """Variance of a sample of no charge [e^2]."""
        return self.read**2 + self.reset**2

    @property
    def noiseless(self) -> bool:
        """Whether shot noise of the signal is the only noise."""
        return self.floor == 0 and self.dark == 0

    def limit(self, times: ArrayLike) -> Floats:
        """The photocurrent that fills the well in each of `times` [e/s]; below 0: dark does."""
        return self.well / np.asarray(times, float) - self.dark


SHOT = Sensor()


@dataclass(frozen=True)
class Constraints:
    """What the readout demands of capture times."""

    min_gap: float = 0.0  # between two captures [s]
    frame_time: float = 0.0  # times are whole multiples of it [s]; 0: they may be any

    def __post_init__(self) -> None:
        if not all(0 <= value < np.inf for value in (self.min_gap, self.frame_time)):
            raise ValueError("min_gap and frame_time must be finite and not negative")


@dataclass(frozen=True, eq=False)
class Schedule:
    """N capture times and the photocurrents that just fill the well in them."""

    times: Floats  # (N,) rising, equal where captures coincide [s]
    photocurrents: Floats  # (N,) well / times - dark [e/s]
    expected_snr: float  # power ratio
    gap: float | None = None  # certified relative distance from the global optimum

    @property
    def used(self) -> int:
        """Captures that differ."""
        return int(np.unique(self.times).size)


def expected_snr(pdf: Pdf, times: ArrayLike, sensor: Sensor = SHOT) -> float:
    """The exact mean of eq 4.1 over `pdf` with the last sample before saturation.

    times : (N,) capture times in any order, above 0 [s]. Without `sensor` photocurrents are in
    1/[s] and the well holds one electron: J, at most 1.
    """
    when = np.sort(np.atleast_1d(np.asarray(times, float)))
    if not (when[0] > 0 and np.isfinite(when[-1])):
        raise ValueError("capture times must be finite and above 0")
    limits = limits_of(pdf, when, sensor)
    low, high, probability = pieces(pdf, limits)
    last = np.searchsorted(-limits, -high, side="right") - 1
    seen = (last >= 0) & (high > 0)
    chosen = when[last[seen]]
    noise = sensor.dark + sensor.floor / chosen
    value = chosen * mean_signal(low[seen], high[seen], noise)
    return float(np.sum(probability[seen] * value))


def best_snr(pdf: Pdf, sensor: Sensor = SHOT) -> float:
    """The mean SNR if every photocurrent had its own longest unsaturated time (<= max_time).

    No schedule of any number of captures does better.
    """
    turn = sensor.well / sensor.max_time - sensor.dark  # darker ones end at max_time
    low, high, probability = pieces(pdf, np.array([turn]))
    bright = (high > turn) & (high > 0)
    full = sensor.well**2 / (sensor.well + sensor.floor)
    filled = full * mean_fill(low[bright], high[bright], sensor.dark)
    total = np.sum(probability[bright] * filled)
    dark = ~bright & (high > 0)
    if dark.any():
        noise = np.full(int(dark.sum()), sensor.dark + sensor.floor / sensor.max_time)
        value = sensor.max_time * mean_signal(low[dark], high[dark], noise)
        total += np.sum(probability[dark] * value)
    return float(total)


def shortest(pdf: Pdf, sensor: Sensor, constraints: Constraints = Constraints()) -> float:
    """t_1, the first capture: the longest time that does not saturate the brightest [s].

    Raises ValueError where no whole frame is that short.
    """
    time = min(sensor.well / (pdf.max + sensor.dark), sensor.max_time)
    if not constraints.frame_time:
        return time
    frames = np.floor(time / constraints.frame_time * (1 + SLACK))
    if frames < 1:
        raise ValueError(
            f"one frame of {constraints.frame_time:g} s saturates the brightest photocurrent, "
            f"which allows {time:g} s"
        )
    return float(frames * constraints.frame_time)


def at(pdf: Pdf, times: ArrayLike, sensor: Sensor = SHOT, gap: float | None = None) -> Schedule:
    """The schedule of these times with what it is worth."""
    when = np.sort(np.atleast_1d(np.asarray(times, float)))
    return Schedule(when, sensor.limit(when), expected_snr(pdf, when, sensor), gap)


def limits_of(pdf: Pdf, times: Floats, sensor: Sensor) -> Floats:
    """The brightest photocurrent unsaturated in each time; an end that is `SLACK` above it is it.

    Where no end is near, the limit is exact: slack for all would add 1e-12 to every mean.
    """
    limits = sensor.limit(times)
    last = np.searchsorted(pdf.high, sensor.limit(times / (1 + SLACK)), side="right") - 1
    ends = np.where(last >= 0, pdf.high[np.maximum(last, 0)], limits)
    return np.maximum(limits, ends)


def pieces(pdf: Pdf, cuts: Floats) -> tuple[Floats, Floats, Floats]:
    """low, high, probability of the pdf's segments cut at `cuts`; levels stay as they are."""
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


def mean_signal(low: Floats, high: Floats, noise: Floats) -> Floats:
    """Mean of i^2 / (i + c) over [low, high], shapes broadcast; of a level its value.

    noise : c >= 0, with high > 0.
    """
    width = high - low
    if not np.any(noise):
        return low + width / 2
    start = low + noise
    if not np.any(width):
        return low * (low / start)
    ratio = _ratio(width, start)
    a0, a1, a2 = _moments(ratio)
    low_part = low / np.maximum(start, TINY)
    # d/s (a^2 A0 + 2 a d A1 + d^2 A2) / d, where z A2 = 1/2 - A1 keeps a start at 0 finite.
    return low_part * (low * a0 + 2 * width * a1) + width * _scaled(ratio, a1, a2)


def mean_fill(low: Floats, high: Floats, noise: float) -> Floats:
    """Mean of (i / (i + c))^2 over [low, high], c >= 0: the signal's share of a full well."""
    if noise == 0:
        return np.ones(low.shape)
    width = high - low
    start = low + noise
    z = width / start
    b0, b1, b2 = _squared_moments(z)
    part = low / start
    return part * part * b0 + 2 * part * z * b1 + z * z * b2


def _ratio(width: Floats, start: Floats) -> Floats:
    """z = width / start, huge but finite where start vanishes."""
    return width / np.maximum(start, np.maximum(width * 1e-300, TINY))


def _scaled(z: Floats, a1: Floats, a2: Floats) -> Floats:
    """z A_2."""
    return np.where(z > 1, 0.5 - a1, z * a2)


def _moments(z: Floats) -> tuple[Floats, Floats, Floats]:
    """A_n(z) = integral over u in [0, 1] of u^n / (1 + z u), n = 0, 1, 2, for z >= 0."""
    large = np.maximum(z, SERIES_BELOW)
    a0 = np.log1p(large) / large
    a1 = (1 - a0) / large
    exact = (a0, a1, (0.5 - a1) / large)
    small = np.minimum(z, SERIES_BELOW)
    terms = np.arange(SERIES_TERMS)
    return _choose(z, exact, [_power_series(small, 1 / (terms + n + 1)) for n in range(3)])


def _squared_moments(z: Floats) -> tuple[Floats, Floats, Floats]:
    """B_n(z) = integral over u in [0, 1] of u^n / (1 + z u)^2, n = 0, 1, 2, for z >= 0."""
    large = np.maximum(z, SERIES_BELOW)
    a0 = np.log1p(large) / large
    b0 = 1 / (1 + large)
    b1 = (a0 - b0) / large
    exact = (b0, b1, ((1 - a0) / large - b1) / large)
    small = np.minimum(z, SERIES_BELOW)
    k = np.arange(SERIES_TERMS)
    return _choose(z, exact, [_power_series(small, (k + 1) / (k + n + 1)) for n in range(3)])


def _choose(
    z: Floats, exact: tuple[Floats, ...], series: list[Floats]
) -> tuple[Floats, Floats, Floats]:
    near = z < SERIES_BELOW
    first, second, third = (np.where(near, s, e) for s, e in zip(series, exact, strict=True))
    return first, second, third


def _power_series(z: Floats, coefficients: Floats) -> Floats:
    """Sum of coefficients[k] (-z)^k by Horner."""
    total = np.zeros(np.shape(z))
    for coefficient in coefficients[::-1]:
        total = total * -z + coefficient
    return total
