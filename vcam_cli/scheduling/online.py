"""Capture times chosen while a picture is taken, from the captures so far.

A camera that does not know its scene looks at each capture before it sets the next one. After
capture k it knows the photocurrents of the pixels that are not yet saturated, up to noise; the past
is fixed, and the best times for the N - k captures left are the offline problem again: the best
schedule of N - k + 1 captures whose first is at t_k, over the pixels still open. A pixel that is
saturated has its last sample and gains nothing. Of that plan only the next time is used; the
capture there tells more. With the pdf known this is the offline optimum step by step, so what is
lost is due to errors of the estimates.

When nothing is known, the first capture is short and each next one longer by a factor until the
brightest pixels are measured: see `ExposureSearch`. Online scheduling is left open in [1]_,
sections 4.7 and 5.2.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scheduling import full_noise
from vcam_cli.scheduling.pdf import Floats, Pdf, photocurrent_levels
from vcam_cli.scheduling.sensor import UNCONSTRAINED, Constraints, Sensor

ANCHOR = 1e-12
"""Weight of the level that keeps the first capture of a plan where the last one was."""
DARKEST = 1e-6
"""Fraction of the brightest open pixel below which estimates are one level: they differ by noise
alone."""


@dataclass(frozen=True)
class ExposureSearch:
    """How the first captures are set when nothing is known of the scene.

    Parameters
    ----------
    first : float
        Time of the first capture [s].
    factor : float
        Largest ratio from one capture to the next.
    percentile : float
        Percentile of the pixels by brightness that has to be measured.
    least_snr : float
        Ratio of its signal to its noise above which it is measured.

    Raises
    ------
    ValueError
        If `first` or `least_snr` is not above 0, or `factor` not above 1.
    """

    first: float
    factor: float = 8.0
    percentile: float = 99.9
    least_snr: float = 10.0

    def __post_init__(self) -> None:
        """Check the values."""
        if not (self.first > 0 and self.factor > 1 and self.least_snr > 0):
            raise ValueError("first and least_snr must be above 0, and factor above 1")

    def next_time(self, charge: Array, time: float, sensor: Sensor) -> float | None:
        """Return the next capture that still searches [s].

        The longer exposure fills no pixel of that percentile: three sigma are kept from the well.

        Parameters
        ----------
        charge : array
            Charge of every pixel in the capture at `time` [e], saturated ones at the full well.
        time : float
            Time of that capture [s].
        sensor : Sensor
            The pixel.

        Returns
        -------
        float or None
            Time of the next capture; None when the brightest pixels are measured.
        """
        dark = sensor.dark * time
        signal = max(float(np.percentile(charge, self.percentile)) - dark, 0.0)
        noise = float(np.sqrt(signal + dark + sensor.noise_floor))
        if 0 < self.least_snr * noise <= signal or time >= sensor.max_time:
            return None
        most = signal + dark + 3 * max(noise, 1.0)
        longer = time * min(self.factor, max(sensor.well / most, 1.0))
        return float(min(longer, sensor.max_time)) if longer > time else None


def plan_times(
    estimates: Array,
    time: float,
    count: int,
    sensor: Sensor,
    constraints: Constraints = UNCONSTRAINED,
) -> Floats:
    """Find the best captures after the one at `time`.

    Parameters
    ----------
    estimates : array
        Photocurrents of the pixels not saturated at `time` [e/s], of any shape, negative ones
        counted as dark. All pixels have the same weight.
    time : float
        Time of the last capture [s].
    count : int
        Number of captures that are left.
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands.

    Returns
    -------
    (<= count,) array
        Rising times [s], fewer where more gain nothing, none where no pixel or no time is left.
    """
    limit = float(sensor.saturation_limit(time))
    pdf = photocurrent_levels(np.minimum(estimates, limit), darkest=DARKEST)
    if count < 1 or pdf is None or limit <= 0 or time >= sensor.max_time:
        return np.empty(0)
    anchored = Pdf.levels([*pdf.low, limit], [*pdf.probability, ANCHOR])
    schedules = full_noise.optimal_schedules(anchored, [count + 1], sensor, constraints)
    times = np.unique(schedules[count + 1].times)
    return times[times > time * (1 + 1e-9)]
