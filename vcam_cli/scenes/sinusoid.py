"""A sinusoidal grating of one frequency, exact everywhere on the plane.

Reflectance mean (1 + contrast cos(2 pi f u + phase)), with u the distance [m] on the sensor from
the array's centre along the direction of modulation: along a row for orientation 0, turning
counterclockwise as seen, so that at 90 degrees it runs up a column.
"""

import math
from dataclasses import dataclass

from vcam_cli.scenes.base import Array, Chart, Wave, wave_averages, wave_values


def waves(
    frequency: float, contrast: float, mean: float, orientation: float, phase: float
) -> tuple[Wave, ...]:
    """Mean and modulation; frequency [cycles/m] on the sensor, orientation and phase [rad]."""
    fx = frequency * _clean(math.cos(orientation))
    fy = -frequency * _clean(math.sin(orientation))
    return (Wave((mean,)), Wave((mean * contrast,), fx, fy, phase))


def _clean(value: float) -> float:
    """0 where a multiple of 90 degrees leaves a rounding error (cos 90 degrees = 6e-17)."""
    return 0.0 if abs(value) < 1e-15 else value


@dataclass(frozen=True)
class WaveChart(Chart):
    """Waves as a chart, for a scene that ends within the view and so must be sampled."""

    waves: tuple[Wave, ...]

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        out[:] = wave_averages(self.waves, x_edges, y_edges, mix)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        return wave_values(self.waves, x, y, mix)
