"""Tone mapping of the render: which light becomes white, and how what is brighter fades into it.

It acts on the render alone, before the tone curve of the display: metrics compare pictures in which
the scene's perfect white is 1, whatever the render shows.

References
----------
.. [1] K. Narkowicz, "ACES filmic tone mapping curve", 2016: a fit by (2.51 x^2 + 0.03 x) /
   (2.43 x^2 + 0.59 x + 0.14) to the curve of the Academy Color Encoding System.
"""

import numpy as np

from vcam_cli.records import dataclass


@dataclass(frozen=True)
class ToneMap:
    """A factor on linear light, and a curve behind it."""

    factor: float = 1.0
    """What linear light in which the perfect white is 1 is multiplied by."""
    is_filmic: bool = False
    """Whether highlights are rolled off instead of clipped [1]."""

    def apply(self, plane: np.ndarray) -> np.ndarray:
        """Return linear light as the render shows it; it may overwrite its argument.

        Parameters
        ----------
        plane : ndarray
            Linear light of any shape, perfect white = 1, float32.

        Returns
        -------
        ndarray
            Linear light, 1 = the brightest that a display shows.
        """
        if self.factor != 1:
            plane *= plane.dtype.type(self.factor)
        return filmic(plane) if self.is_filmic else plane


def filmic(linear: np.ndarray) -> np.ndarray:
    """Return light behind the filmic curve of [1].

    Parameters
    ----------
    linear : ndarray
        Linear light; what is below 0 counts as 0.

    Returns
    -------
    ndarray
        Linear light from 0 to 1.03, which a display clips at 1.
    """
    x = np.maximum(linear, 0)
    return np.asarray(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), linear.dtype)


def sensor_white(
    white: np.ndarray, black: float, saturated: float, black_level: float = 0.0
) -> float:
    """Return the linear light of a picture's white patch that just saturates the sensor.

    Parameters
    ----------
    white : ndarray
        Signal of a perfect white in each color (C,), behind a linear ADC [DN].
    black, saturated : float
        Signal of black, and of a saturated pixel [DN].
    black_level : float
        What the picture shows of black, perfect white = 1.

    Returns
    -------
    float
        Light, perfect white = 1; 0 where white gives no signal.
    """
    signal = float(np.max(white)) - black
    if signal <= 0:
        return 0.0
    return black_level + (saturated - black) / signal * (1 - black_level)
