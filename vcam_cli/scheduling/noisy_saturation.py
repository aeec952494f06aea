"""What a schedule loses because a pixel saturates by its noisy value, and not by its mean.

The objective takes a photocurrent to be saturated where its mean fills the well. Of real pixels at
that limit one in two is full by noise, and is read a capture earlier. Over a broad pdf few pixels
are that close, and the loss is about a percent; the best captures for a few levels stand exactly
on them, and all of a level is.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from vcam_cli.scheduling.objective import Sensor
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]


def expected_snr(pdf: Pdf, times: ArrayLike, sensor: Sensor) -> float:
    """The mean SNR, as a power ratio, with saturation decided on noisy values, of levels.

    times : (N,) capture times in any order [s]. The SNR of a level is its square over the mean
    squared error of its pixels, those that are full in every capture counted as 0. Noise is taken
    as normal, and a pixel that is open in a capture as open in all before: within a percent of a
    simulation of wells of 1000 electrons and more. Raises ValueError for a pdf of segments.
    """
    if not pdf.discrete:
        raise ValueError("noisy saturation is of levels, not of segments")
    when = np.unique(np.asarray(times, float))
    seen = (pdf.low > 0) & (pdf.probability > 0)
    light, probability = pdf.low[seen][:, None], pdf.probability[seen]
    charge = (light + sensor.dark) * when
    variance = charge + sensor.floor
    still = np.minimum.accumulate(ndtr((sensor.well - charge) / np.sqrt(variance)), axis=1)
    last = still - np.append(still[:, 1:], np.zeros((len(still), 1)), axis=1)
    known = still[:, 0]
    error = np.sum(last * variance / (light * when) ** 2, axis=1)
    snr = np.divide(known**2, error, out=np.zeros_like(known), where=error > 0)
    return float(np.sum(probability * snr))
