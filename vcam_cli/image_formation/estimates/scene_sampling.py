"""A scene's spectrum, and how far up the tolerance asks for it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.image_formation.estimates.bandwidth import FREQUENCY_SHARE, LOWEST, axes, table_size
from vcam_cli.image_formation.estimates.chart_cells import BEYOND_CUTOFF, cell_grid
from vcam_cli.image_formation.estimates.peak_bound import brightest_of_mosaic
from vcam_cli.image_formation.estimates.power_spectrum import PowerSpectrum, power_spectrum
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.scene_spectrum import (
    SceneSpectrum,
    rectangle_spectrum,
    transform_painted,
    transform_planes,
)
from vcam_cli.image_formation.transfer_tables import Mixing, Tables, bounding_tables, tabulate
from vcam_cli.scenes.base import ChartScene, SampledScene

SINGLE = 5e-7
"""Rms error of transforms of 32-bit numbers, relative to the rms of what is transformed."""
SINGLE_SHARE = 0.1
"""Part of the tolerance that it may use: else numbers have 64 bits."""
ENTRIES = 513
"""Entries of tables with which power is judged."""


@dataclass(frozen=True, eq=False)
class SampledImage:
    """A scene's spectrum, and how far up it is filtered."""

    scene: SampledScene
    spectrum: SceneSpectrum
    power: PowerSpectrum
    tables: Tables
    """The radial part of the lens, up to where power is judged."""
    lens_power: NDArray
    """Mean squares of the signal behind them, before the separable transfer functions."""
    highest: float
    """Frequency up to which it is filtered [pixel Nyquist]."""
    lost_rms: float
    """Rms of the signal beyond [electrons / s]."""
    full_signal: float
    """Largest signal on the array, at least; at most the ceiling [electrons / s]."""
    peak: float
    """Bound on the signal before blur [electrons / s]."""
    density: float
    """Area of the scene over that of the array: as if all of its light fell on the array."""

    def rms(self, squares: NDArray) -> float:
        """Return the rms of a signal in the color of most [e/s].

        Parameters
        ----------
        squares : NDArray
            Mean squares over the scene (C, ...) [(e/s)^2].

        Returns
        -------
        float
            Rms over the array, as if all of the scene's light fell on it [e/s].
        """
        total = squares.reshape(len(squares), -1).sum(axis=1).max()
        return float(np.sqrt(self.density * total))


def with_sufficient_precision(path: OpticalPath, scene: SampledScene) -> OpticalPath:
    """Return the path with as many bits as its spectrum calls for.

    They are 64 where 32 would take more than their share of the tolerance; else what the settings
    say of charts and of pictures. Full signal is at least the mean over the array, or the ceiling.
    """
    g, knobs = path.geometry, path.settings
    mean, rms = scene.mean_and_rms(path.transfer.level.T, (g.sensor_width, g.sensor_height))
    full = min(float(mean.max()), path.ceiling)
    suffices = float(rms.max()) * SINGLE <= SINGLE_SHARE * knobs.tolerance * full
    least = knobs.chart_width if isinstance(scene, ChartScene) else knobs.float_width
    return replace(path, settings=replace(knobs, float_width=least if suffices else 64))


def sampled_image(
    path: OpticalPath,
    scene: SampledScene,
    highest: float,
    mixing: Mixing,
    least: float = LOWEST,
) -> SampledImage:
    """Transform a scene, and find how far up its spectrum is needed.

    Aberrations only weaken a picture, so that how far to go is found for the radial part of the
    lens.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : SampledScene
        The scene on its grid.
    highest : float
        Frequency beyond which nothing counts [pixel Nyquist].
    mixing : Mixing
        Mixtures of the scene's components, and the error that they leave.
    least : float, optional
        Frequency up to which the spectrum goes at least [pixel Nyquist].

    Returns
    -------
    SampledImage
        The spectrum, and how far up it is filtered.
    """
    g, knobs, exact = path.geometry, path.settings, path.transfer
    size = table_size(path, highest, ENTRIES)
    tables = tabulate(exact.with_effects(exact.radial_blurs), size, mixing)
    scene, spectrum, peak = _scene_spectrum(path, scene, highest, mixing[0])
    x, y = axes(path, scene, highest)
    power = power_spectrum(spectrum, x, y, path.separable, path.workers)
    lens_power = power.lens_power(tables)
    directed = (*exact.plane_blurs, *(zone.blur for zone in path.zones))
    squares = (
        power.upper_bound(bounding_tables(exact, size, mixing))
        if directed
        else power.pixel_power(lens_power)
    )
    rms = float(np.sqrt(squares.reshape(len(squares), -1).sum(axis=1).max()))
    aside = max((blur.reach for blur in directed), default=0.0)
    pitch = g.pitch_y, g.pitch_x
    top = 2 * min(pitch[0] * y.bandwidth, pitch[1] * x.bandwidth)

    def rms_beyond(part: float) -> float:
        return power.tail_rms(squares, part * top, pitch)

    brightest = brightest_of_mosaic(
        path.mosaic, spectrum, (x, y), tables, path.separable, rms, rms_beyond, aside
    )
    full = min(brightest, path.ceiling)
    density = math.prod(scene.extent) / (g.sensor_width * g.sensor_height)
    if knobs.oversampling is None:
        allowed = FREQUENCY_SHARE * knobs.tolerance * full
        budget = allowed / math.sqrt(density * _more_than_mean(g.rows * g.columns))
        needed = power.needed_frequency(squares, budget, pitch) * (1 + 1e-9)
        highest = min(max(needed, least), highest)
    else:
        highest = min(highest, knobs.oversampling)
    return SampledImage(
        scene=scene,
        spectrum=spectrum,
        power=power,
        tables=tables,
        lens_power=lens_power,
        highest=highest,
        lost_rms=float(np.sqrt(density)) * power.tail_rms(squares, highest, pitch),
        full_signal=full,
        peak=peak,
        density=density,
    )


def _more_than_mean(pixels: int) -> float:
    """Return how many times the mean square of all places that of some pixels may be.

    It is two standard errors of the mean of so many squares of normal numbers: the middle of a
    picture, where its waves meet in phase, is all that a single pixel sees.
    """
    return 1 + 2 * math.sqrt(2 / pixels)


def _scene_spectrum(
    path: OpticalPath, scene: SampledScene, highest: float, mix: NDArray
) -> tuple[SampledScene, SceneSpectrum, float]:
    """Return the spectrum of a scene's planes, and a bound on the signal before blur [e/s]."""
    dtype = path.settings.dtype
    level = np.abs(path.transfer.with_mixtures(mix).level)
    rectangles = scene.rectangles(mix)
    if isinstance(scene, ChartScene) and rectangles is not None:
        scene = scene.with_cells(cell_grid(scene, path.geometry, BEYOND_CUTOFF * highest))
        x, y = axes(path, scene, highest)
        brightest = np.abs(rectangles.values).max(axis=(1, 2))
        known = rectangle_spectrum(rectangles, scene.shape, (y, x), dtype)
        return scene, known, float((level.T @ brightest).max())
    if isinstance(scene, ChartScene):
        x, y = axes(path, scene, highest)
        terms = y.terms, x.terms
        painted, brightest = transform_painted(scene, mix, terms, dtype, path.workers)
        return scene, painted, float((level.T @ brightest).max())
    planes: NDArray = scene.planes(mix, path.workers).astype(dtype, copy=False)
    brightest = np.array([max(float(p.max()), -float(p.min())) for p in planes])
    return scene, transform_planes(planes, path.workers), float((level.T @ brightest).max())
