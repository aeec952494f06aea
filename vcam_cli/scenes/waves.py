"""Scenes that are a sum of waves: known in closed form, and exact through the whole linear part."""

import math
from collections.abc import Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.records import dataclass
from vcam_cli.scenes.blur_change import BlurLoss, ChangeBounds
from vcam_cli.scenes.closed_form import Products
from vcam_cli.spectra import Spectrum


@dataclass(frozen=True)
class Wave:
    """B_k(x, y) = weights[k] cos(2 pi (fx x + fy y) + phase); fx, fy [cycles/m], phase [rad]."""

    weights: tuple[float, ...]
    fx: float = 0.0
    fy: float = 0.0
    phase: float = 0.0

    @property
    def frequency(self) -> float:
        """Length of its spatial frequency [cycles/m]."""
        return math.hypot(self.fx, self.fy)


@dataclass(frozen=True)
class WaveScene:
    """A sum of waves, exact everywhere on the plane; `white` is the perfect white's radiance."""

    spectra: tuple[Spectrum, ...]
    waves: tuple[Wave, ...]
    white: Spectrum

    @property
    def darkest(self) -> float:
        """Bound below its light at all wavelengths, over the perfect white's."""
        steady, swing = self._steady_and_swing
        return steady - swing if self.spectra == (self.white,) else 0.0

    @property
    def brightest(self) -> float:
        """Bound above its light at all wavelengths, likewise."""
        return sum(self._steady_and_swing) if self.spectra == (self.white,) else math.inf

    @property
    def _steady_and_swing(self) -> tuple[float, float]:
        """Light that is the same all over, and the largest difference from it."""
        steady = [wave for wave in self.waves if not (wave.fx or wave.fy)]
        level = sum(wave.weights[0] * math.cos(wave.phase) for wave in steady)
        return level, sum(abs(wave.weights[0]) for wave in self.waves if wave not in steady)

    @property
    def waves_that_vary(self) -> int:
        """Number of its waves, even light aside."""
        return sum(1 for wave in self.waves if wave.frequency)

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return sum_k mix[r, k] B_k at points.

        Parameters
        ----------
        x, y : Array
            Places (n,) along the rows and (m,) along the columns [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Array
            Values (R, m, n), in the unit of `mix`.
        """
        return wave_values(self.waves, x, y, mix)

    def change_bounds(
        self, losses: Sequence[BlurLoss], geometry: Geometry, ceiling: float, allowed: float
    ) -> ChangeBounds:
        """Return what blurs change, as `SampledScene` does: of each wave by itself.

        Parameters
        ----------
        losses : sequence of BlurLoss
            The blurs, all of one light.
        geometry : Geometry
            Geometry of the array.
        ceiling : float
            Rate that fills a pixel [e/s].
        allowed : float
            Change over full signal that matters.

        Returns
        -------
        ChangeBounds
            The bounds.
        """
        full = min(float(self._least_mean(losses[0].level, geometry).max()), ceiling)
        waves = [(np.array(w.weights), w.frequency) for w in self.waves if w.fx or w.fy]
        of_waves = ([loss.of_wave(*wave) for wave in waves] for loss in losses)
        return ChangeBounds(full, [float(np.max(np.sum(found, axis=0))) for found in of_waves])

    def _least_mean(self, level: Array, geometry: Geometry) -> Array:
        """Return the least that the mean over the pixels can be, in each color (C,).

        Of a wave the pixels' mean has the part sin(pi f N p) / (N sin(pi f p)) along each axis.
        """
        total = np.zeros(level.shape[1])
        for wave in self.waves:
            amplitude = np.asarray(wave.weights) @ level
            if not (wave.fx or wave.fy):
                total += amplitude * math.cos(wave.phase)
                continue
            along = _mean_of_phasors(wave.fx * geometry.pitch_x, geometry.columns)
            down = _mean_of_phasors(wave.fy * geometry.pitch_y, geometry.rows)
            total -= np.abs(amplitude) * along * down
        return total


def _mean_of_phasors(turns: float, count: int) -> float:
    """Return the size of the mean of `count` phasors, each `turns` turns further."""
    step = math.sin(math.pi * turns)
    return 1.0 if abs(step) < 1e-12 else abs(math.sin(math.pi * turns * count) / (count * step))


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


def wave_products(waves: tuple[Wave, ...], x_edges: Array, y_edges: Array, mix: Array) -> Products:
    """Return the averages over cells as products of functions of y and x, two for each wave.

    Parameters are those of `wave_averages`.

    Parameters
    ----------
    waves : tuple of Wave
        The waves.
    x_edges, y_edges : Array
        Rising edges of the cells [m].
    mix : Array
        Mixtures (R, K) of the components.

    Returns
    -------
    Products
        Functions of y and of x whose products add up to the light.
    """
    down, along = [], []
    for wave in waves:
        level = np.asarray(mix, float) @ np.asarray(wave.weights)
        x = _average_phasor(wave.fx, *_cells(x_edges))
        y = _average_phasor(wave.fy, *_cells(y_edges)) * np.exp(1j * wave.phase)
        down += [y.real, -y.imag]
        along += [np.outer(level, x.real), np.outer(level, x.imag)]
    return Products(np.stack(down, axis=1), np.stack(along, axis=1))


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
