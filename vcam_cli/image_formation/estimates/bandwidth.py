"""How finely a scene is sampled: margin, cells of a chart, highest frequency.

Pixels fold every frequency that the lens passes into the picture, so a skipped one is an error.
Each of three approximations has its share of the tolerance:

- the margin beyond the array, behind which a chart is mirrored: from the tail of the line spread
  function, that of a measured spread included;
- the cells on which a chart is painted: `chart_cells.py`;
- the highest frequency that is filtered: from the power spectrum itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import PlaneTransfer, RadialTransfer
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.floats import rms
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.settings import Settings
from vcam_cli.image_formation.transfer_tables import TableSize
from vcam_cli.scenes.base import ChartScene, SampledScene, Scene

MARGIN_SHARE = 0.2
FREQUENCY_SHARE = 0.65
"""Parts of the tolerance that margin and highest frequency use: see `MARGIN_BOUND`."""
FIELD_SHARE = 0.2
"""The same for modes of a field that are left out before the picture is known: as if it had full
contrast and detail of all sizes."""
MARGIN_BOUND = 0.8
"""Part of the tolerance that light from beyond the margin takes at most, whatever the chart: of one
that is white all around where its mirror image is black. Charts are both in turn, and their means
over the tail of a line hardly differ: stars, an eye chart and a color checker before 6 x 8 to
144 x 192 pixels behind f/1.4 to f/8 err by `MARGIN_SHARE` of the tolerance at most."""
SMALLEST_MARGIN = 4
"""Pixels that a chart goes on beyond the array, at least; never more than the array. The search for
a wider margin starts here: with 1 to 8 a star behind f/2 errs alike, by a fifth of `draft`."""
MOST_MARGIN_CELLS = 4096
"""Cells along an axis, as fine as the lens's cut-off requires, that a margin may lead to."""
LARGEST_TRANSFORM = 1 << 24
"""Samples along an axis that no machine has the memory for."""
RESOLVED = 256
"""Periods of the highest frequency within which the tail of a line is integrated; farther away it
is that of a cusp: see `line_spread_tail`."""
LOWEST = 0.02
"""Lowest frequency at which a spectrum may end [pixel Nyquist]: below it no time is saved."""
HIGHEST = 64.0
"""Highest frequency that is considered where no lens ends the spectrum [pixel Nyquist]. A matter of
cost: a star without a lens is the same with 8 to 512."""
KINKS = 4.0
"""Factor on the highest frequency of a chart's own detail: where it is mirrored it has kinks, whose
spectrum falls with the square of the frequency. Beyond it lies less than a hundredth of the
tolerance of a CSF chart behind f/2; beyond half of it, an eighth."""
LEAST_PASSED = 0.01
"""Part of the tolerance below which what the lens passes of full contrast counts as nothing. A
matter of cost: below, power decides, and ten times as much leaves a star as it is."""


@remembered(16)  # 6 % of a frame of 64 x 64 pixels of a data set
def margin(
    geometry: Geometry,
    effects: Sequence[Effect],
    band: tuple[float, float],
    knobs: Settings,
    overexposure: float = 1.0,
) -> int:
    """Return the pixels that a chart goes on beyond the array.

    Beyond them it is mirrored: light from there is that of another place. The rms over the array of
    what that changes at most is kept below `MARGIN_BOUND` of the tolerance, relative to white.
    Where pixels fill at a small part of white, or a lamp is brighter, it is more of full signal.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the array.
    effects : sequence of Effect
        Effects of the camera; blurs are used.
    band : tuple of float
        Shortest and longest wavelength [m].
    knobs : Settings
        Settings of image formation.
    overexposure : float, optional
        Brightest light of the chart over the full signal of the array; below 1 it counts as 1.

    Returns
    -------
    int
        Pixels on every side, such that transforms of the whole are fast.
    """
    budget = _margin_part(knobs, overexposure)
    distance = _distances(geometry)
    radial = of_kind(effects, RadialTransfer)
    tail = line_spread_tail(radial, band[1], distance)
    tail += _directed_tail(of_kind(effects, PlaneTransfer), distance)
    cutoff = min((b.cutoff(band[1]) for b in radial), default=math.inf)
    widest = max((effect.reach for effect in effects), default=0.0)
    widest += sum((motion.travel for motion in of_kind(effects, ImageMotion)), 0.0)
    inside = (np.arange(32) + 0.5) / 32
    pitches = (geometry.pitch_y, geometry.rows), (geometry.pitch_x, geometry.columns)
    finest = min(cutoff, 0.5 / min(geometry.pitch_x, geometry.pitch_y))
    most = min((MOST_MARGIN_CELLS / (2 * pitch * finest) - n) / 2 for pitch, n in pitches)
    pixels = max(
        min(SMALLEST_MARGIN, geometry.rows, geometry.columns),
        math.ceil(widest / min(geometry.pitch_x, geometry.pitch_y)),
    )
    while pixels < most:
        both_axes = []
        for pitch, count in pitches:
            beyond = max(pixels * pitch - widest, 0.0) + inside * (count * pitch)
            one_side = np.interp(beyond, distance, tail)
            both_axes.append(one_side + one_side[::-1])
        if rms(np.add.outer(*both_axes)) <= budget:
            break
        pixels = math.ceil(1.25 * pixels)
    return fast_margin(geometry, round(pixels * knobs.margin_scale))


def _margin_part(knobs: Settings, overexposure: float) -> float:
    """Return the part of a line's light that may come from another place."""
    return MARGIN_BOUND * knobs.tolerance / max(overexposure, 1.0)


def _distances(geometry: Geometry) -> Array:
    """Return distances at which tails are tabulated, rising [m]."""
    return np.geomspace(0.25 * min(geometry.pitch_x, geometry.pitch_y), 1.0, 80)


def _directed_tail(blurs: Sequence[PlaneTransfer], distance: Array) -> Array:
    """Return the part of a line's light beyond the reach of blurs with a direction: (n,)."""
    tail = np.zeros(len(distance))
    for blur in blurs:
        tail += blur.line_tail(distance)
    return tail


def directed_tail_length(path: OpticalPath) -> float:
    """Return how far beyond its reach a blur with a direction still throws light that counts.

    Parameters
    ----------
    path : OpticalPath
        The path of the light.

    Returns
    -------
    float
        Distance [m]; less than a pixel where it throws none.
    """
    distance = _distances(path.geometry)
    tail = _directed_tail(path.transfer.plane_blurs, distance)
    white = float(path.transfer.level.max())
    allowed = _margin_part(path.settings, white / path.full if path.full else math.inf)
    return float(distance[np.searchsorted(-tail, -allowed).clip(max=len(distance) - 1)])


def line_spread_tail(blurs: Sequence[RadialTransfer], wavelength: float, distance: Array) -> Array:
    """Return the part of the light of a line that falls further to one side than a distance.

    It is 1/2 - (1/pi) integral of H(f) sin(2 pi f x) / f over f > 0. From where that cancels to
    rounding on, light behind a lens with a cut-off has the tail of a cusp at 0, H = 1 - a |f|:
    a / (2 pi^2 x).

    Parameters
    ----------
    blurs : sequence of RadialTransfer
        Blurs whose transfers multiply.
    wavelength : float
        Wavelength [m].
    distance : Array
        Distances (n,), rising [m].

    Returns
    -------
    Array
        Parts (n,) of the light, 0 to 1/2, falling.
    """
    if not blurs:
        return np.zeros(len(distance))
    cutoff = min(blur.cutoff(wavelength) for blur in blurs)

    def otf(f: Array) -> Array:
        transfer: Array = np.prod([blur.otf(f, wavelength) for blur in blurs], axis=0)
        return transfer

    if math.isinf(cutoff):
        periods, weights = _periods()
        transfer = otf(np.divide.outer(1 / distance, 1 / periods))
        tail = 0.5 - transfer @ (weights * np.sin(2 * np.pi * periods) / periods) / np.pi
        return np.maximum.accumulate(np.clip(tail, 0, 0.5)[::-1])[::-1]
    top, small = cutoff, np.array([1e-4 * cutoff])
    cusp = float((1 - otf(small))[0] / small[0])
    tail = cusp / (2 * np.pi**2 * distance)
    for fewest, most in pairwise((0, RESOLVED // 16, RESOLVED // 4, RESOLVED)):
        near = (fewest <= distance * top) & (distance * top < most)
        count = min(32 * most, 16 * RESOLVED)
        step = top / count
        f = (np.arange(count) + 0.5) * step
        phase = 2 * np.pi * np.outer(distance[near], f)
        tail[near] = 0.5 - np.sin(phase) @ (otf(f) / f) * step / np.pi
    return np.maximum.accumulate(np.clip(tail, 0, 0.5)[::-1])[::-1]


def _periods() -> tuple[Array, Array]:
    """Return nodes (n,) of an integral over the periods of a wave, and their weights (n,).

    Weights fall to 0 within 48 periods, as if a line were as wide as a fiftieth of the distance:
    what ends there has no edge.
    """
    edges = np.concatenate([[0.0], 0.5 ** np.arange(10, 1, -1), np.arange(1, 97) / 2])
    place, weight = np.polynomial.legendre.leggauss(8)
    half = np.diff(edges)[:, None] / 2
    periods = (edges[:-1, None] + half * (1 + place)).ravel()
    return periods, (half * weight).ravel() * np.exp(-np.square(periods / 8) / 2)


def fast_margin(geometry: Geometry, least: int) -> int:
    """Return the smallest margin at which transforms along both sides are fast.

    One whose transforms no machine has the memory for stays as it is.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the array.
    least : int
        Pixels on every side that it has at least.

    Returns
    -------
    int
        Pixels on every side.
    """
    return fast_margin_around((geometry.rows, geometry.columns), least)


def fast_margin_around(sizes: Sequence[int], least: int) -> int:
    """Return the same of lengths that get one margin.

    Parameters
    ----------
    sizes : sequence of int
        Pixels along every axis.
    least : int
        Pixels on every side that it has at least.

    Returns
    -------
    int
        Pixels on every side.
    """
    if least > LARGEST_TRANSFORM:
        return least

    def cost(margin: int) -> int:
        return sum((n + 2 * margin) * _work(n + 2 * margin) for n in sizes)

    return min(range(least, least + 33), key=lambda margin: (cost(margin), margin))


@lru_cache(1 << 10)
def _work(size: int) -> int:
    """Return the sum of the prime factors of a transform's size: what it costs per sample."""
    total, factor = 0, 2
    while factor * factor <= size:
        while size % factor == 0:
            total += factor
            size //= factor
        factor += 1
    return total + (size if size > 1 else 0)


def highest_passed(path: OpticalPath, scene: Scene) -> float:
    """Return the frequency beyond which lens and pixels pass nothing that counts.

    It is no higher than the detail of a chart.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : Scene
        The scene.

    Returns
    -------
    float
        Frequency [pixel Nyquist].
    """
    g = path.geometry
    pitch = max(g.pitch_x, g.pitch_y)
    limit = min(2 * pitch * path.transfer.cutoff, HIGHEST)
    f = np.linspace(0, limit, 257)
    values = np.abs(path.transfer.radial_response(f / (2 * pitch))).sum(axis=0).max(axis=0)
    envelope = values / (values[0] or 1.0)
    envelope = envelope / np.maximum(1, np.pi * f / (2 * pitch) * path.averaged_width)
    if math.isinf(path.transfer.cutoff):
        envelope = envelope * _passed_by_rays(path, f / (2 * pitch))
        if isinstance(scene, SampledScene) and scene.samples == "squares":
            size = min(scene.pitch_x, scene.pitch_y)
            envelope = envelope / np.maximum(1, np.pi * f / (2 * pitch) * size)
    counts = np.flatnonzero(envelope > LEAST_PASSED * path.settings.tolerance)
    limit = float(f[min(counts[-1] + 1, len(f) - 1)]) if len(counts) else 1.0
    if isinstance(scene, ChartScene):
        half_width = scene.pitch_x * scene.shape[1] / 2
        limit = min(limit, KINKS * 2 * pitch * scene.chart.highest_frequency(half_width))
    return max(limit, LOWEST)


def _passed_by_rays(path: OpticalPath, frequency: Array) -> Array:
    """Return the contrast (n,) that blurs with a direction or over the field leave at most."""
    passed = np.ones(frequency.shape)
    green = float(np.median(path.transfer.wavelengths))  # rays have no wavelength
    for blur in path.transfer.plane_blurs:
        passed = passed * blur.largest(frequency, green)
    if path.field_rings:
        rings = [ring.blur.largest(frequency, green) for ring in path.field_rings]
        passed = passed * np.max(rings, axis=0)
    return passed


_axis = remembered(64)(Axis)
"""Axes of pictures of one size are the same, with all that follows from them."""


def axes(path: OpticalPath, scene: SampledScene, highest: float) -> tuple[Axis, Axis]:
    """Return samples, pixels and terms along both axes, up to a frequency.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : SampledScene
        Scene on its grid of samples.
    highest : float
        Highest frequency [pixel Nyquist].

    Returns
    -------
    x, y : Axis
        The axes.
    """
    g, cutoff = path.geometry, path.transfer.axis_cutoff
    ny, nx = scene.shape
    squares = scene.samples == "squares"

    (drift_x, drift_y), (moved_x, moved_y) = path.drift, path.displacement

    def axis(
        samples: int,
        pitch: float,
        pixels: int,
        pixel: float,
        shift: float,
        moved: float,
        seen: float = 1.0,
    ) -> Axis:
        # Rows are read one after the other, wherever in its pixel a photodetector is.
        first = samples * pitch / 2 + seen * (0.5 - pixels / 2) * pixel + shift - moved
        bandwidth = min(highest * 0.5 / pixel, cutoff)
        return _axis(samples, pitch, pixels, seen * pixel, first, squares, bandwidth)

    pitch_x, pitch_y = g.collecting_pitch
    x = axis(nx, scene.pitch_x, g.columns, pitch_x, g.collecting_x, moved_x)
    y = axis(ny, scene.pitch_y, g.rows, pitch_y, g.collecting_y, moved_y, 1 - drift_y)
    if drift_x:
        _, rows = pixel_centers(g)
        x = replace(x, row_shifts=-drift_x * g.sampling_scale * rows)
    return x, y


def table_size(path: OpticalPath, highest: float, entries: int | None = None) -> TableSize:
    """Return how fine tables are that reach to a frequency along both axes.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    highest : float
        Highest frequency along each axis [pixel Nyquist].
    entries : int, optional
        Entries over |f|; by default those of the settings.

    Returns
    -------
    TableSize
        Size of the tables.
    """
    knobs, g = path.settings, path.geometry
    corner = math.hypot(0.5 / g.pitch_x, 0.5 / g.pitch_y)
    tolerance = knobs.mixing_tolerance
    if path.field_rings:
        tolerance = max(tolerance, FIELD_SHARE * knobs.tolerance)
    return TableSize(
        top=min(path.transfer.cutoff, highest * corner),
        entries=entries or knobs.table_size,
        tolerance=tolerance,
        steps_per_period=knobs.plane_steps,
        rank=knobs.spectral_rank,
    )


def reach(path: OpticalPath) -> float:
    """Return how far the blurs of a lens throw light, its diffraction aside.

    Parameters
    ----------
    path : OpticalPath
        The path of the light.

    Returns
    -------
    float
        Distance [m].
    """
    blurs = [*path.transfer.effects, *(ring.blur for ring in path.field_rings)]
    return max((blur.reach for blur in blurs), default=0.0)
