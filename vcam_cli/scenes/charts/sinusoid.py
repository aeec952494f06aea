"""A sinusoidal grating of one frequency, exact everywhere on the plane.

Reflectance mean (1 + contrast cos(2 pi f u + phase)), with u the distance [m] on the sensor from
the array's center along the direction of modulation: along a row for orientation 0, turning
counterclockwise as seen, so that at 90 degrees it runs up a column.
"""

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart
from vcam_cli.scenes.closed_form import Products
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region
from vcam_cli.scenes.waves import Wave, wave_averages, wave_products, wave_values


def waves(
    frequency: float, contrast: float, mean: float, orientation: float, phase: float
) -> tuple[Wave, ...]:
    """Return mean and modulation of a grating.

    Parameters
    ----------
    frequency : float
        Frequency on the sensor [cycles/m].
    contrast : float
        Michelson contrast, 0..1.
    mean : float
        Mean reflectance.
    orientation : float
        Direction of modulation, counterclockwise from the rows [rad].
    phase : float
        Phase at the array's center [rad].

    Returns
    -------
    tuple of Wave
        A constant, and a cosine.
    """
    fx = frequency * _round_to_zero(math.cos(orientation))
    fy = -frequency * _round_to_zero(math.sin(orientation))
    return (Wave((mean,)), Wave((mean * contrast,), fx, fy, phase))


def _round_to_zero(value: float) -> float:
    """Return 0 for the rounding error that a multiple of 90 degrees leaves (cos 90 = 6e-17)."""
    return 0.0 if abs(value) < 1e-15 else value


@dataclass(frozen=True)
class WaveChart(Chart):
    """Waves as a chart, for a scene that ends within the view and so must be sampled."""

    waves: tuple[Wave, ...]

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the exact averages over the cells into `out`."""
        out[:] = wave_averages(self.waves, x_edges, y_edges, mix)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy that steps would have which change as much as the waves do."""
        amplitudes = [abs(float(np.dot(w.weights, level))) for w in self.waves]
        energies = (4 * w.frequency * a**2 for w, a in zip(self.waves, amplitudes, strict=True))
        return EdgeEnergy(aligned=sum(energies))

    separates = True

    def products(self, x_edges: Array, y_edges: Array, mix: Array) -> Products:
        """Return cosines and sines along both axes, which wave for wave make the light."""
        return wave_products(self.waves, x_edges, y_edges, mix)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        return wave_values(self.waves, x, y, mix)
