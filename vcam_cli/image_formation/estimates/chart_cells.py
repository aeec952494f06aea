"""The cells on which a chart is painted, by a rule.

Cells of the side d hold means over their area. What an edge has at frequencies beyond theirs is
folded onto those that the lens passes: at f the part (f d / (f d + k))^2 of what it has there
from f + k / d, k = +-1, +-2, ... What lies beyond the cells' Nyquist frequency is lost. Summed over
all edges of the chart, with what lens and pixels pass, that is the error of the cells.

    aligned edges    energy 1 / (2 pi f)^2 along the axes
    oblique edges    energy 2 / (2 pi |f|)^3 in the plane, in all directions alike
    a single line    as aligned edges, but wherever it lies to cells and pixels: a bound

`scenes.edge_energy` says how much edge a chart has.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.image_formation.estimates.lens_contrast import lens_contrast
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene, SampledScene
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region
from vcam_cli.scenes.layered import LayerChart

CELLS_SHARE = 0.4
"""Part of the tolerance that cells may use."""
SURE = 1.3
"""Error over what is expected of edges that lie anywhere: those of one chart may lie alike to its
cells. The largest of edges at 0.3 degrees, stars, letters, leaves and cards at f/1.4 to f/11."""
AROUND = 0, 2
"""Pixels around the array whose edges count with its own: most where edges lie beside it, none
where they meet within it."""
FINER = 1.02
"""Step between numbers of cells that are tried."""
LEAST, MOST = 1.1, 256.0
"""Cells per pixel pitch, at least and at most."""
FREQUENCIES = 24
"""Frequencies along each axis at which what is folded is summed."""


def closed_opacity(path: OpticalPath, scene: SampledScene) -> LayerChart | None:
    """Return the opacity of a painted layer that has a spectrum in closed form.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : SampledScene
        The scene.

    Returns
    -------
    LayerChart or None
        The rectangle that the layer covers evenly, whose edges no cells fold; None of others, and
        where a device holds all planes.
    """
    if not path.has_opacity or path.device.whole or not isinstance(scene, ChartScene):
        return None
    chart = scene.chart
    return chart.even_opacity if isinstance(chart, LayerChart) and scene.is_painted else None


class ChosenCells(NamedTuple):
    """How finely a chart is painted."""

    per_pixel: float
    """Cells per pixel pitch."""
    error: float = 0.0
    """Their rms error [e/s]; 0 where the camera file states them."""


def cell_grid(scene: ChartScene, geometry: Geometry, per_pixel: float) -> tuple[int, int]:
    """Return the cells of a chart on which transforms are fast.

    Parameters
    ----------
    scene : ChartScene
        The chart.
    geometry : Geometry
        Geometry of the array.
    per_pixel : float
        Cells per pixel pitch, at least.

    Returns
    -------
    ny, nx : int
        Cells along y and x.
    """
    ny = scene.shape[0] * scene.pitch_y / geometry.pitch_y * per_pixel
    nx = scene.shape[1] * scene.pitch_x / geometry.pitch_x * per_pixel
    fast = [scipy.fft.next_fast_len(max(1, math.ceil(n - 1e-9)), real=True) for n in (ny, nx)]
    return fast[0], fast[1]


def cells_per_pixel(
    path: OpticalPath, scene: ChartScene, highest: float, error: CellError | None = None
) -> ChosenCells:
    """Return the fewest cells whose error keeps its share of the tolerance.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : ChartScene
        The chart.
    highest : float
        Frequency beyond which lens and pixels pass nothing [pixel Nyquist].
    error : CellError, optional
        That of the chart, where it is known already.

    Returns
    -------
    ChosenCells
        Cells per pixel pitch, and their error.
    """
    asked = path.settings.oversampling
    if asked is not None:
        return ChosenCells(asked)
    error = error or CellError.of_chart(path, scene, highest)
    budget = CELLS_SHARE * path.settings.tolerance * path.full
    low, high = 0, math.ceil(math.log(MOST / LEAST) / math.log(FINER))
    while low < high:
        middle = (low + high) // 2
        if error.rms(LEAST * FINER**middle) <= budget:
            high = middle
        else:
            low = middle + 1
    cells = _with_undivided(path, scene, LEAST * FINER**low)
    return ChosenCells(cells, error.rms(cells))


def _with_undivided(path: OpticalPath, scene: ChartScene, cells: float) -> float:
    """Return more cells where the chart would paint such wide ones in parts, and gain by more.

    Painting a cell takes as long as transforming it, about.
    """
    finer = max(path.geometry.pitch_x, path.geometry.pitch_y) / scene.chart.undivided
    painted = math.ceil(finer / cells) * cells
    return finer if painted**2 - finer**2 > finer**2 - cells**2 > 0 else cells


@dataclass(frozen=True, eq=False)
class CellError:
    """What cells of a chart err on the pixels of an array, rms."""

    path: OpticalPath
    energy: EdgeEnergy
    """Of the light in the color of most [(e/s)^2 / m]."""
    top: float
    """Frequency beyond which lens and pixels pass nothing [cycles/m]."""

    @classmethod
    def of_chart(cls, path: OpticalPath, scene: ChartScene, highest: float) -> CellError:
        """Return that of a chart before the pixels.

        Parameters
        ----------
        path : OpticalPath
            The path of the light.
        scene : ChartScene
            The chart.
        highest : float
            Highest frequency that the image has [pixel Nyquist].

        Returns
        -------
        CellError
            The error of its cells.
        """
        g = path.geometry
        level = path.judged_weights.sum(axis=1)
        if closed_opacity(path, scene) is not None:  # cells hold the light alone
            levels = path.transfer.level
            level = levels[:, int(levels[:-1].sum(axis=0).argmax())]
        sizes = (
            (g.sensor_width + 2 * around * g.pitch_x, g.sensor_height + 2 * around * g.pitch_y)
            for around in AROUND
        )
        found = [
            scene.chart.edge_energy(Region((0.0, 0.0), size), level, path.ceiling) for size in sizes
        ]
        energy = found[0].at_least(found[1])
        pitch = max(g.pitch_x, g.pitch_y)
        return cls(path, energy, min(path.transfer.cutoff, highest / (2 * pitch)))

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """Frequencies (n,) [cycles/m], and what the lens passes of the color of most light."""
        f = np.linspace(0, self.top, 8 * FREQUENCIES + 1)
        return f, np.square(lens_contrast(self.path, f))

    def _squared_transfer(self, fx: Array, fy: Array) -> Array:
        """Return the squared transfer at frequencies of one shape [cycles/m]."""
        f, squares = self._table
        passed = np.interp(np.hypot(fx, fy), f, squares, right=0.0)
        for effect in self.path.separable:
            passed = passed * np.square(effect.along_x(fx) * effect.along_y(fy))
        return passed

    def end(self, error: float) -> float:
        """Return the frequency beyond which edges have no more than an rms error [cycles/m].

        Parameters
        ----------
        error : float
            Rms error [e/s].
        """
        (f, _), (passed, _) = self._table, self._passed_across
        across = 2 * passed / np.square(2 * np.pi * (f + 1e-9 * f[-1]))
        steps = (across[1:] + across[:-1]) / 2 * np.diff(f)
        beyond = (self.energy.aligned + self.energy.oblique) * steps[::-1].cumsum()[::-1]
        return float(f[np.count_nonzero(beyond > error**2)])

    def rms(self, per_pixel: float) -> float:
        """Return the rms error that cells cause.

        Parameters
        ----------
        per_pixel : float
            Cells along a pixel pitch.

        Returns
        -------
        float
            Error [e/s].
        """
        g = self.path.geometry
        side = max(g.pitch_x, g.pitch_y) / per_pixel
        energy, squares = self.energy, 0.0
        if anywhere := energy.aligned - energy.alike:
            squares += anywhere * self._of_aligned(side)
        if energy.oblique:
            squares += energy.oblique * self._of_oblique(side)
        squares *= SURE**2 * self.path.scatter
        if energy.alike:
            squares += energy.alike * self._of_alike(side)
        return math.sqrt(squares)

    def _of_aligned(self, side: float) -> float:
        """Return the mean square for edges along rows and columns of energy 1 [m]."""
        f, _ = self._table
        turns = np.minimum(f * side, 0.5)
        # of k: the contrast turns / (turns + k), squared, times the energy (d / 2 pi (turns + k))^2
        parts = (1 / np.square(np.square(turns + np.array(FOLDS)[:, None]))).sum(axis=0)
        folded = np.where(
            turns < 0.5, np.square(turns * side / (2 * np.pi)) * parts, self._edge_squares
        )
        return float((self._weights_across @ folded).max())

    def _of_alike(self, side: float) -> float:
        """Return a bound on the mean square for a line along rows or columns of energy 1 [m].

        Wherever it lies to the cells, what they fold is at most the sum of the magnitudes, of all k
        together f (pi^2 / sin^2(pi f d) - 1 / (f d)^2) d^2 / 2 pi. Wherever it lies to the pixels,
        these fold at most the sum of what they sample.
        """
        f, _ = self._table
        turns = np.clip(f * side, 1e-9, 0.5)
        folded = turns * side / (2 * np.pi) * (np.square(np.pi / np.sin(np.pi * turns)) - turns**-2)
        error = np.where(turns < 0.5, folded, self._unit_edge)
        g, found = self.path.geometry, []
        for passed, pitch in zip(self._passed_across, (g.pitch_x, g.pitch_y), strict=True):
            own = np.linspace(-0.5, 0.5, len(f)) / pitch
            most = math.ceil(self.top * pitch + 0.5)
            places = np.abs(np.add.outer(np.arange(-most, most + 1) / pitch, own))
            seen = np.interp(places, f, np.sqrt(passed) * error, right=0.0).sum(axis=0)
            found.append(float(np.trapezoid(np.square(seen), own)))
        return max(found)

    @cached_property
    def _passed_across(self) -> tuple[Array, Array]:
        """The squared transfer (n,) of waves along x, and along y."""
        f, _ = self._table
        still = np.zeros_like(f)
        return self._squared_transfer(f, still), self._squared_transfer(still, f)

    @cached_property
    def _weights_across(self) -> Array:
        """Weights (2, n) of an integral over the frequencies, both signs: along x, and along y."""
        f, _ = self._table
        weights = np.full(len(f), 2 * f[1])
        weights[[0, -1]] /= 2
        return weights * self._passed_across

    @cached_property
    def _edge_squares(self) -> Array:
        """What edges of energy 1 have at the frequencies (n,) [m^2]."""
        return np.asarray(np.square(self._unit_edge))

    @cached_property
    def _unit_edge(self) -> Array:
        """What an edge of energy 1 has at the frequencies (n,) [m]."""
        f, _ = self._table
        return np.asarray(1 / (2 * np.pi * np.maximum(f, 1e-9 * self.top)))

    def _of_oblique(self, side: float) -> float:
        """Return the same for edges of all directions."""
        f, passed, own = self._oblique_table
        turns = np.minimum(f * side, 0.5)
        contrasts = {k: np.square(_folded(turns, k)) for k in (0, *FOLDS)}
        folded = np.zeros_like(passed)
        for k, m in product(contrasts, repeat=2):
            if k or m:
                square = np.square(turns + k) + np.square(turns + m)[:, None]
                folded += contrasts[k] * contrasts[m][:, None] / (square * np.sqrt(square))
        folded *= 2 * (side / (2 * np.pi)) ** 3
        inside = np.maximum(turns, turns[:, None]) < 0.5
        area = 4 * (self.top / FREQUENCIES) ** 2
        return float((passed * np.where(inside, folded, own)).sum()) * area

    @cached_property
    def _oblique_table(self) -> tuple[Array, Array, Array]:
        """Frequencies (n,) along each axis [cycles/m], and at pairs of them (n, n) two factors.

        They are the squared transfer, and the energy of edges of all directions of energy 1 [m].
        """
        f = (np.arange(FREQUENCIES) + 0.5) * (self.top / FREQUENCIES)
        fx, fy = np.meshgrid(f, f)
        return f, self._squared_transfer(fx, fy), 2 / (2 * np.pi * np.hypot(fx, fy)) ** 3


FOLDS = (-2, -1, 1, 2)
"""Multiples of the cells' frequency from which edges are folded that count."""


def _folded(turns: Array, k: int) -> Array:
    """Return the contrast of a wave of f + k / d after the mean over cells, over that of f."""
    if not k:
        return np.ones_like(turns)
    # A frequency of a multiple of the cells' lies outside what is folded: its value does not count.
    found = np.divide(turns, turns + k, out=np.zeros_like(turns), where=turns != -k)
    return np.asarray(found)
