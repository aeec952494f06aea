"""A scene's spectrum, and the highest frequency that the tolerance requires."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.image_formation.closed_spectrum import closed_spectrum
from vcam_cli.image_formation.estimates.bandwidth import FREQUENCY_SHARE, LOWEST, axes, table_size
from vcam_cli.image_formation.estimates.chart_cells import cell_grid, closed_opacity
from vcam_cli.image_formation.estimates.power_spectrum import PowerSpectrum, power_spectrum
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.scene_spectrum import (
    JoinedSpectrum,
    SceneSpectrum,
    copied_to,
    painted_on,
    transform_on,
    transform_painted,
    transform_planes,
)
from vcam_cli.image_formation.transfer_tables import Mixing, Tables, bounding_tables, tabulate
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene, SampledScene

SINGLE = 5e-7
"""Rms error of transforms of 32-bit numbers, relative to the largest of what is transformed.
1.3e-7 was measured with 300 x 400 samples, 1.7e-7 with 2000 x 3000, 3.5e-7 with 1021 x 1031, which
are primes."""
SINGLE_SHARE = 0.1
"""Part of the tolerance that it may use: else numbers have 64 bits."""
BEYOND_CUTOFF = 1.1
"""Cells of a chart in closed form over the highest frequency: they scale its terms, no more."""
ENTRIES = 513
"""Entries of tables with which power is judged. A matter of cost: with 65 to 4097 the spectrum of a
star ends at the same frequency at every preset."""


@dataclass(frozen=True, eq=False)
class SampledImage:
    """A scene's spectrum, and how far up it is filtered."""

    scene: SampledScene
    spectrum: SceneSpectrum
    power: PowerSpectrum
    tables: Tables
    """The radial part of the lens, up to where power is judged."""
    lens_power: Array
    """Mean squares of the signal behind them, before the separable transfer functions."""
    highest: float
    """Frequency up to which it is filtered [pixel Nyquist]."""
    lost_rms: float
    """Rms of the signal beyond [electrons / s]."""
    peak: float
    """Bound on the signal before blur [electrons / s]."""
    density: float
    """Area of the scene over that of the array: as if all of its light fell on the array."""

    def rms(self, squares: Array) -> float:
        """Return the rms of a signal in the color of most [e/s].

        Parameters
        ----------
        squares : Array
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
    say of charts and of pictures.

    Parameters
    ----------
    path : OpticalPath
        The path of the light.
    scene : SampledScene
        The scene.

    Returns
    -------
    OpticalPath
        The path, its settings with that `float_width` [bits].
    """
    knobs = path.settings
    suffices = _single_error(path, scene) <= SINGLE_SHARE * knobs.tolerance * path.full
    least = knobs.chart_width if isinstance(scene, ChartScene) else knobs.float_width
    return replace(path, settings=replace(knobs, float_width=least if suffices else 64))


def rounding_error(path: OpticalPath, scene: SampledScene) -> float:
    """Return the rms error of the transforms [e/s]: 0 of 64-bit numbers.

    Parameters
    ----------
    path : OpticalPath
        The path of the light, its settings with the `float_width` of the transforms.
    scene : SampledScene
        The scene.
    """
    return _single_error(path, scene) if path.settings.float_width == 32 else 0.0


def _single_error(path: OpticalPath, scene: SampledScene) -> float:
    """Return the rms error of transforms of 32-bit numbers [e/s]."""
    return SINGLE * scene.brightest * path.transfer.largest_level


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
    power = power_spectrum(spectrum, x, y, path.separable, path.workers, tables.pairs)
    lens_power, largest = power.lens_powers(tables)
    directed = (*exact.plane_blurs, *(ring.blur for ring in path.field_rings))
    squares = (
        power.upper_bound(bounding_tables(exact, size, mixing))
        if directed
        else power.pixel_power(largest)
    )
    tails = power.tails(squares, (g.pitch_y, g.pitch_x))
    density = math.prod(scene.extent) / (g.sensor_width * g.sensor_height)
    if knobs.oversampling is None:
        budget = FREQUENCY_SHARE * knobs.tolerance * path.full / math.sqrt(density * path.scatter)
        needed = tails.needed_frequency(budget) * (1 + 1e-9)
        highest = min(max(needed, least), highest)
    else:
        highest = min(highest, knobs.oversampling)
    if path.device.whole and isinstance(scene, ChartScene) and not scene.is_painted:
        x, y = axes(path, scene, highest)
        spectrum = copied_to(path.device, spectrum, (y.terms, x.terms), path.workers)
    return SampledImage(
        scene=scene,
        spectrum=spectrum,
        power=power,
        tables=tables,
        lens_power=lens_power,
        highest=highest,
        lost_rms=float(np.sqrt(density)) * tails.rms(highest),
        peak=peak,
        density=density,
    )


def closed_planes(path: OpticalPath, scene: SampledScene, mix: Array) -> Array:
    """Return which mixtures (R,) of a painted chart have a spectrum in closed form.

    They are the opacity of a layer that is the same all over its frame: a rectangle. Its edges fold
    on no cells.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : SampledScene
        The scene.
    mix : Array
        Mixtures (R, K) of its components.
    """
    if closed_opacity(path, scene) is None:
        return np.zeros(len(mix), bool)
    return np.asarray((mix[:, -1] != 0) & ~mix[:, :-1].any(axis=1))


def _scene_spectrum(
    path: OpticalPath, scene: SampledScene, highest: float, mix: Array
) -> tuple[SampledScene, SceneSpectrum, float]:
    """Return the spectrum of a scene's planes, and a bound on the signal before blur [e/s]."""
    dtype = path.settings.dtype
    level = np.abs(path.transfer.with_mixtures(mix).level)
    if isinstance(scene, ChartScene) and not scene.is_painted:
        scene = scene.with_cells(cell_grid(scene, path.geometry, BEYOND_CUTOFF * highest))
        x, y = axes(path, scene, highest)
        known = closed_spectrum(scene, mix, (y, x), dtype)
        return scene, known, scene.brightest * path.transfer.largest_level
    if isinstance(scene, ChartScene):
        x, y = axes(path, scene, highest)
        terms = y.terms, x.terms
        if path.device.whole:
            cells, brightest = painted_on(
                path.device, replace(scene, dtype=dtype), mix, path.workers
            )
            found = transform_on(path.device, cells, terms)
            return scene, found, float((level.T @ brightest).max())
        closed = closed_planes(path, scene, mix)
        own, others = np.flatnonzero(~closed), np.flatnonzero(closed)
        painted, brightest = transform_painted(scene, mix[own], terms, dtype, path.workers)
        peak = float((level[own].T @ brightest).max())
        if not len(others):
            return scene, painted, peak
        opacity = closed_opacity(path, scene)
        assert opacity is not None
        cover = replace(scene, chart=opacity, spectra=scene.spectra[-1:])
        known = closed_spectrum(cover, mix[others, -1:], (y, x), dtype)
        parts: list[tuple[SceneSpectrum, int]] = [(known, 0)] * len(mix)
        for spectrum, numbers in ((painted, own), (known, others)):
            for number, plane in enumerate(numbers):
                parts[plane] = spectrum, number
        bright = float((level[others].T @ np.abs(mix[others, -1])).max())
        return scene, JoinedSpectrum(tuple(parts)), max(peak, bright)
    planes: Array = scene.planes(mix, path.workers).astype(dtype, copy=False)
    brightest = np.array([max(float(p.max()), -float(p.min())) for p in planes])
    peak = float((level.T @ brightest).max())
    if path.device.whole:
        return scene, transform_on(path.device, path.device.put(planes), scene.shape), peak
    return scene, transform_planes(planes, path.workers), peak
