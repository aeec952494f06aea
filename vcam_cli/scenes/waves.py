"""Scenes that are a sum of waves: known in closed form, and exact through the whole linear part."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.spectra import Spectrum

Array = NDArray[Any]


@dataclass(frozen=True)
class Wave:
    """B_k(x, y) = weights[k] cos(2 pi (fx x + fy y) + phase); fx, fy [cycles/m], phase [rad]."""

    weights: tuple[float, ...]
    fx: float = 0.0
    fy: float = 0.0
    phase: float = 0.0


@dataclass(frozen=True)
class WaveScene:
    """A sum of waves, exact everywhere on the plane; `white` is the perfect white's radiance."""

    spectra: tuple[Spectrum, ...]
    waves: tuple[Wave, ...]
    white: Spectrum

    @property
    def darkest(self) -> float:
        """Bound below its light at all wavelengths, over the perfect white's."""
        if self.spectra != (self.white,):
            return 0.0
        steady = [wave for wave in self.waves if not (wave.fx or wave.fy)]
        level = sum(wave.weights[0] * math.cos(wave.phase) for wave in steady)
        return level - sum(abs(wave.weights[0]) for wave in self.waves if wave not in steady)

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return sum_k mix[r, k] B_k at the points (y[i], x[j]): (R, m, n)."""
        return wave_values(self.waves, x, y, mix)


def wave_values(waves: tuple[Wave, ...], x: Array, y: Array, mix: Array) -> Array:
    """Return the values of a sum of waves at points, separably.

    cos(a + b) = Re(exp(i a) exp(i b)).

    Parameters
    ----------
    waves : tuple of Wave
        The waves.
    x : Array
        Positions (n,) to the right of the array's center [m].
    y : Array
        Positions (m,) below the array's center [m].
    mix : Array
        Mixtures (R, K) of the components.

    Returns
    -------
    Array
        Values (R, m, n).
    """
    return _waves(waves, (x, np.zeros_like(x, float)), (y, np.zeros_like(y, float)), mix)


def wave_averages(waves: tuple[Wave, ...], x_edges: Array, y_edges: Array, mix: Array) -> Array:
    """Return the averages of a sum of waves over cells, exactly.

    They are the center's value times sinc(f width) along each axis.

    Parameters
    ----------
    waves : tuple of Wave
        The waves.
    x_edges : Array
        Edges (nx + 1,) of the cells along x, rising [m].
    y_edges : Array
        Edges (ny + 1,) of the cells along y, rising [m].
    mix : Array
        Mixtures (R, K) of the components.

    Returns
    -------
    Array
        Averages (R, ny, nx).
    """
    return _waves(waves, _cells(x_edges), _cells(y_edges), mix)


def _cells(edges: Array) -> tuple[Array, Array]:
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)


def _waves(
    waves: tuple[Wave, ...], x: tuple[Array, Array], y: tuple[Array, Array], mix: Array
) -> Array:
    out = np.zeros((len(mix), len(y[0]), len(x[0])))
    for wave in waves:
        along = _average_phasor(wave.fx, *x)
        down = _average_phasor(wave.fy, *y) * np.exp(1j * wave.phase)
        pattern = np.outer(down.real, along.real) - np.outer(down.imag, along.imag)
        out += (mix @ np.asarray(wave.weights))[:, None, None] * pattern
    return out


def _average_phasor(frequency: float, center: Array, width: Array) -> Array:
    return np.exp(2j * math.pi * frequency * center) * np.sinc(frequency * width)
