"""The times at which a camera samples one integration, where it chooses them for its scene.

`captures: {schedule: optimal, count: 8, max: 100 ms}` takes the times of the largest mean SNR over
the pixels, up to the time `max`. The camera plans with what it has: the noise-free
photocurrents of its pixels, its full well or the end of its ADC, whichever comes first, and its
dark current, readout and reset noise, as the file describes them; so a schedule does not depend on
which effects a plan leaves out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.exposure import Exposure
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.exposure import mean_dark

if TYPE_CHECKING:  # the search for times is imported where a camera has one
    from vcam_cli.scheduling.sensor import Sensor


def sensor(chain: ReadoutChain, longest: float) -> Sensor:
    """Return the pixel as its schedule models it.

    Rounding of the ADC counts as readout noise, as it does in the reconstruction.

    Parameters
    ----------
    chain : ReadoutChain
        Well, ADC and noise, with the effects that the camera's file describes.
    longest : float
        Longest exposure time [s].

    Returns
    -------
    Sensor
        Model of the pixel.
    """
    from vcam_cli.readout.nondestructive_samples import variances
    from vcam_cli.scheduling.sensor import Sensor

    read, reset = variances(chain)
    return Sensor(
        well=chain.saturation,
        dark=mean_dark(1.0, chain.effects),
        read=float(np.sqrt(read)),
        reset=float(np.sqrt(reset)),
        max_time=longest,
    )


def choose_sample_times(
    exposure: Exposure,
    rate: Array,
    chain: ReadoutChain,
) -> tuple[float, ...]:
    """Return the times of the samples of one integration.

    Parameters
    ----------
    exposure : Exposure
        The file's exposure: times, or a requested schedule.
    rate : Array
        Photo-electrons per second of every pixel, of any shape [e/s].
    chain : ReadoutChain
        Well, ADC and noise, with the effects that the camera has.

    Returns
    -------
    tuple of float
        Times, rising [s]; empty where there is a single exposure. Scheduled samples are as many as
        requested, fewer where more would coincide.
    """
    asked = exposure.schedule
    if asked is None:
        return exposure.samples
    return optimal_times(rate, asked.count, sensor(chain, asked.max))


def optimal_times(rate: Array, count: int, pixel: Sensor) -> tuple[float, ...]:
    """Return the times of at most `count` samples whose mean SNR is largest.

    Parameters
    ----------
    rate : Array
        Photo-electrons per second of every pixel, of any shape [e/s].
    count : int
        Number of samples.
    pixel : Sensor
        Model of the pixel.

    Returns
    -------
    tuple of float
        Times, rising [s]; in the dark one sample of the longest time that the dark current allows.

    References
    ----------
    T. Chen, PhD thesis, Stanford University, 2003, chapter 4.
    """
    from vcam_cli.scheduling.full_noise import optimal_schedules
    from vcam_cli.scheduling.pdf import photocurrent_levels

    pdf = photocurrent_levels(rate)
    if pdf is None:
        filled = pixel.well / pixel.dark if pixel.dark > 0 else np.inf
        return (float(min(filled, pixel.max_time)),)
    found = optimal_schedules(pdf, [count], pixel)[count].times
    return tuple(float(time) for time in np.unique(found))
