"""What makes even light even again that lens and pixels have let fall off toward the corners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.effects.pixel_signal import Gain
from vcam_cli.records import dataclass

LARGEST = 64.0
"""Of the factors: what is darker than that is left dark."""
PROBES = 9
"""Places along each side of a picture at which a falloff is looked for."""


def correction(gains: Sequence[Gain], color: str, x: Array, y: Array) -> Array:
    """Return how much brighter the axis is than places of the sensor.

    Parameters
    ----------
    gains : sequence of Gain
        The simulated factors on the light.
    color : str
        Name of the color in the mosaic.
    x, y : ndarray
        Positions (columns,) and (rows,) [m].

    Returns
    -------
    ndarray
        Factor (rows, columns), at most `LARGEST`, in the float type of the positions.
    """
    share: Array = np.ones((len(y), len(x)), x.dtype)
    for effect in gains:
        own = effect.of_color(color)
        share = share * own.gain(x, y) / own.on_axis
    return np.asarray(1 / np.maximum(share, x.dtype.type(1 / LARGEST)))


@dataclass(frozen=True, eq=False)
class ArrayShading:
    """Factors that make even light even, of the pixels of a picture."""

    gains: tuple[Gain, ...]
    x: Array
    """Places of the picture's columns [m], in the float type of the factors."""
    y: Array
    """Places of its rows [m]."""

    def correction(self, color: str, rows: Array, columns: slice) -> Array:
        """Return the factors of a color at some rows and columns of the picture (M, N)."""
        return correction(self.gains, color, self.x[columns], self.y[rows])

    def falls(self, colors: Sequence[str]) -> bool:
        """Return whether the light of any of the colors falls off."""
        places = (np.linspace(axis[0], axis[-1], PROBES) for axis in (self.x, self.y))
        x, y = places
        return any(np.ptp(correction(self.gains, color, x, y)) > 0 for color in colors)
