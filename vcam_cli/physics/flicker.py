"""Light that goes up and down: its mean over an exposure."""

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.arrays import Array


def sinusoid_mean(
    start: ArrayLike, time: float, frequency: float, depth: float, phase: float = 0.0
) -> Array:
    """Return the mean over an exposure of 1 + depth cos(2 pi frequency t + phase).

    The mean of a cosine is its value in the middle of the exposure times sinc(frequency time), so
    that an exposure of a whole number of periods sees steady light.

    Parameters
    ----------
    start : array_like
        Starts of exposures, of any shape [s].
    time : float
        Exposure time, above 0 [s].
    frequency : float
        Frequency of the light [Hz].
    depth : float
        Modulation (brightest - darkest) / (brightest + darkest).
    phase : float, optional
        Phase at the time 0 [rad].

    Returns
    -------
    Array
        Light relative to its mean over all times, in the shape of `start`.

    References
    ----------
    CIE TN 006:2016 (modulation depth); R. N. Bracewell, The Fourier Transform and Its Applications,
    3rd ed., 2000 (running means).
    """
    middle = 2 * np.pi * frequency * (np.asarray(start) + time / 2) + phase
    return np.asarray(1 + depth * np.sinc(frequency * time) * np.cos(middle))


def pulse_mean(
    start: ArrayLike, time: float, frequency: float, depth: float, duty: float, phase: float = 0.0
) -> Array:
    """Return the mean over an exposure of a light that is switched between two levels.

    Parameters
    ----------
    start, time, frequency, depth
        As those of `sinusoid_mean`.
    duty : float
        Bright part of a period, above 0.
    phase : float, optional
        Phase at the time 0 [rad]; at the phase 0 the bright part begins.

    Returns
    -------
    Array
        Light relative to its mean over all times, in the shape of `start`.

    References
    ----------
    CIE TN 006:2016 (modulation depth, duty cycle).
    """
    mean = (1 - depth) + 2 * depth * duty
    begin = frequency * np.asarray(start, dtype=float) + phase / (2 * np.pi)
    end = begin + frequency * time

    def bright(turns: Array) -> Array:
        whole = np.floor(turns)
        return np.asarray(whole * duty + np.minimum(turns - whole, duty))

    share = (bright(end) - bright(begin)) / (end - begin)
    return np.asarray(((1 - depth) + 2 * depth * share) / mean)


def most_change(time: float, frequency: float, depth: float, duty: float | None = None) -> float:
    """Return the largest change of an exposure's light from its mean, relative to it.

    It is exact for a sinusoid (`duty` None) and a bound for a light that is switched: that of an
    exposure short against a period, and at most a period's light over that of the exposure.

    Parameters
    ----------
    time, frequency, depth, duty
        As in `sinusoid_mean` and `pulse_mean`.

    Returns
    -------
    float
        Change without unit.
    """
    if duty is None:
        return abs(depth * float(np.sinc(frequency * time)))
    low, high = (1 - depth), (1 + depth)
    mean = low + 2 * depth * duty
    swing = max(high / mean - 1, 1 - low / mean)
    return min(swing, 2 * depth * duty * (1 - duty) / mean / (frequency * time))
