"""The pixel that captures are planned for, and what its readout demands of capture times."""

import numpy as np
from numpy.typing import ArrayLike

from vcam_cli.records import dataclass
from vcam_cli.scheduling.pdf import Floats, Pdf

SLACK = 1e-12
"""Relative: a time worked out as well / i must not saturate i by a rounding error."""


@dataclass(frozen=True)
class Sensor:
    """A pixel: its well, dark current and noise. The default has shot noise and a well of 1 e.

    A pixel of photocurrent i is saturated at time t where (i + dark) t > well.

    Parameters
    ----------
    well : float
        Electrons that the well or the ADC holds, whichever is full first [e].
    dark : float
        Dark current [e/s].
    read, reset : float
        Standard deviation of the readout noise and of the reset noise [e].
    max_time : float
        Longest exposure [s].

    Raises
    ------
    ValueError
        If `well` or `max_time` is not above 0, or a noise is negative or not finite.
    """

    well: float = 1.0
    dark: float = 0.0
    read: float = 0.0
    reset: float = 0.0
    max_time: float = np.inf

    def __post_init__(self) -> None:
        """Check the values."""
        if not (0 < self.well < np.inf and self.max_time > 0):
            raise ValueError("well and max_time must be above 0")
        if not all(0 <= value < np.inf for value in (self.dark, self.read, self.reset)):
            raise ValueError("dark, read and reset must be finite and not negative")

    @property
    def noise_floor(self) -> float:
        """Variance of a sample without charge, of readout and reset [e^2]."""
        return self.read**2 + self.reset**2

    @property
    def noiseless(self) -> bool:
        """Whether shot noise of the signal is the only noise."""
        return self.noise_floor == 0 and self.dark == 0

    def saturation_limit(self, times: ArrayLike) -> Floats:
        """Return the photocurrent that just fills the well in each of some times.

        Parameters
        ----------
        times : array_like
            Exposure times [s], above 0.

        Returns
        -------
        array
            Photocurrents [e/s]; negative where dark current alone fills the well.
        """
        return self.well / np.asarray(times, float) - self.dark


SHOT_NOISE = Sensor()
"""Shot noise alone, a well of one electron: times are in 1/[photocurrent]."""


@dataclass(frozen=True)
class Constraints:
    """What the readout demands of capture times.

    Parameters
    ----------
    min_gap : float
        Least time between two captures that differ [s].
    frame_time : float
        Capture times are whole multiples of it [s]; 0 where they may be any.

    Raises
    ------
    ValueError
        If a value is negative or not finite.
    """

    min_gap: float = 0.0
    frame_time: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        if not all(0 <= value < np.inf for value in (self.min_gap, self.frame_time)):
            raise ValueError("min_gap and frame_time must be finite and not negative")

    @property
    def least_gap(self) -> float:
        """Least time between captures that differ [s]: `min_gap`, in whole frames."""
        gap, frame = self.min_gap, self.frame_time
        return frame * float(np.ceil(gap / frame * (1 - SLACK))) if frame else gap

    @property
    def read_interval(self) -> float:
        """Least time between two reads [s]: `least_gap`, and at most one read a frame."""
        return max(self.least_gap, self.frame_time)

    def whole_frames(self, times: ArrayLike) -> Floats:
        """Return the number of whole frames in each of some times.

        Parameters
        ----------
        times : array_like
            Times [s]; `frame_time` must be above 0.

        Returns
        -------
        array
            Numbers of frames, as floats.
        """
        return np.floor(np.asarray(times, float) / self.frame_time * (1 + SLACK))


UNCONSTRAINED = Constraints()
"""Captures at any time."""


def first_capture_time(pdf: Pdf, sensor: Sensor, constraints: Constraints = UNCONSTRAINED) -> float:
    """Return t_1, the longest time that does not saturate the brightest photocurrent [s].

    Parameters
    ----------
    pdf : Pdf
        Photocurrents [e/s].
    sensor : Sensor
        The pixel.
    constraints : Constraints
        What the readout demands of the time.

    Returns
    -------
    float
        Time [s], at most `sensor.max_time`, in whole frames where `frame_time` is given.

    Raises
    ------
    ValueError
        If no whole frame is that short.
    """
    time = min(sensor.well / (pdf.max + sensor.dark), sensor.max_time)
    if not constraints.frame_time:
        return time
    frames = constraints.whole_frames(time)
    if frames < 1:
        raise ValueError(
            f"one frame of {constraints.frame_time:g} s saturates the brightest photocurrent, "
            f"which allows {time:g} s"
        )
    return float(frames * constraints.frame_time)
