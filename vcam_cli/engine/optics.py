"""From the scene to the rate of photo-electrons in every pixel: the linear part.

All on-axis physics is one filter per scene component and color (`transfer.py`), applied in one of
three ways (`ways.py`); slowly varying factors multiply the result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import Geometry, pixel_centers
from vcam_cli.camera.photodiode import quantum_efficiency
from vcam_cli.effects.base import Blur, Effect, Gain, Veil
from vcam_cli.engine import ways
from vcam_cli.engine.layers import Followed, Layer, Optics
from vcam_cli.engine.mosaic import Mosaic
from vcam_cli.engine.parallel import each
from vcam_cli.engine.settings import Settings
from vcam_cli.engine.transfer import Band, Transfer, transfer
from vcam_cli.physics import radiometry
from vcam_cli.rng import blocks
from vcam_cli.scenes.base import SampledScene, View, WaveScene
from vcam_cli.spectra import Spectrum

MARGIN = 32
"""Pixels that a chart goes on beyond the array, at least: its far borders are mirrored, and the
light an Airy pattern throws further than this is below 1 % in any lens worth simulating. Never
more than the array itself: a chart nine times as wide as the picture costs more than it tells."""


def view(geometry: Geometry, settings: Settings, oversampling: int) -> View:
    """The rectangle that a scene has to fill, with a margin that makes fast transform sizes."""
    return View(
        rows=geometry.rows,
        columns=geometry.columns,
        pitch_x=geometry.pitch_x,
        pitch_y=geometry.pitch_y,
        oversampling=oversampling,
        margin=_margin(geometry),
        scene_width=geometry.scene_width_on_sensor,
        dtype=settings.dtype,
    )


def _margin(geometry: Geometry) -> int:
    """Smallest margin from `MARGIN` on that gives both axes sizes with small prime factors."""

    def slow(margin: int) -> int:
        return sum(_work(n + 2 * margin) for n in (geometry.rows, geometry.columns))

    per_pixel = max(1.0, geometry.pixel_width / geometry.pitch_x)
    least = min(round(MARGIN * per_pixel), max(geometry.rows, geometry.columns))
    most = least + min(32, least)
    return min(range(least, most + 1), key=lambda m: (slow(m), m))


def _work(size: int) -> int:
    """Sum of the prime factors of a transform's size: what it costs per sample."""
    total, factor = 0, 2
    while factor * factor <= size:
        while size % factor == 0:
            total += factor
            size //= factor
        factor += 1
    return total + (size if size > 1 else 0)


def responses(camera: Camera, mosaic: Mosaic) -> list[Spectrum]:
    """Electrons per photon for each color: transmittance x filter x QE."""
    common = (camera.optics.transmittance.resolve(), quantum_efficiency(camera))
    out = []
    for color in mosaic.colors:
        spec = camera.array.filters.get(color)
        filters = () if spec is None else (spec.resolve(),)
        out.append(common[0].times(common[1], *filters))
    return out


def scene_transfer(
    camera: Camera,
    geometry: Geometry,
    settings: Settings,
    spectra: Sequence[Spectrum],
    mosaic: Mosaic,
    effects: Sequence[Effect],
) -> Transfer:
    """H_kc of scene spectra [W / (sr m2 m)] on the axis, eq 2.18 and 2.23. [electrons / s]

    Of the effects: the blurs that are the same everywhere, and the gains as they are on the axis.
    """
    area = geometry.detector_area
    if camera.pixel.photodetector.quantum_efficiency.per_pixel:
        area = geometry.pixel_width * geometry.pixel_height
    area *= math.prod(e.on_axis for e in effects if isinstance(e, Gain))
    irradiance = float(
        radiometry.irradiance_per_radiance(geometry.f_number, geometry.magnification)
    )
    wavelengths = camera.scene.wavelengths
    return transfer(
        spectra,
        responses(camera, mosaic),
        irradiance * area,
        Band(wavelengths.start, wavelengths.stop, settings.wavelength_step),
        [e for e in effects if isinstance(e, Blur)],
    )


@dataclass(frozen=True)
class Rate:
    """What the linear part gives."""

    values: NDArray
    """(rows, columns) of the lattice, or (C, rows, columns) with every color [electrons / s]"""
    spectrum: Followed
    """How far the scene's spectrum was followed, and what each transfer does to the picture."""


def photo_rate(
    optics: Optics,
    scene_at: Callable[[int], WaveScene | SampledScene],
    planes: bool = False,
) -> Rate:
    """Photo-electrons per second in every place of the lattice, noise-free.

    scene_at: the scene with so many cells per pixel pitch, where it is a chart. planes: every
    color in every place, and not each place's own.
    Raises CannotDo where memory does not suffice.
    """
    layers, followed = ways.layers(optics, scene_at)
    at_once = optics.field is None and not followed.by_color
    g, mosaic = optics.geometry, optics.mosaic
    count = len(mosaic.colors) if planes else 1
    out: NDArray = np.zeros((count, g.rows, g.columns), optics.settings.dtype)
    x, y = (axis.astype(out.dtype) for axis in pixel_centers(g))
    before, veil, after = _in_order(optics.effects)
    on_axis = {e: out.dtype.type(1 / (e.on_axis or 1.0)) for e in (*before, *after)}

    def gain(effects: Sequence[Gain], block: slice) -> None:
        for effect in effects:
            factor = effect.gain(x, y[block])
            # The light has the gain of the axis in it: see `scene_transfer`.
            out[:, block] *= factor if on_axis[effect] == 1 else factor * on_axis[effect]

    def finish(block: slice) -> None:
        np.maximum(out[:, block], 0, out=out[:, block])
        gain(before, block)
        if veil is None:
            gain(after, block)

    def compute(layer: Layer, block: slice) -> None:
        if layer.weight is None:
            _fill(out[:, block], layer, mosaic, block)
        else:
            tile = np.zeros_like(out[:, block])
            _fill(tile, layer, mosaic, block)
            tile *= layer.weight(x, y[block])
            out[:, block] += tile
        if at_once:
            finish(block)

    for layer in layers:
        each(partial(compute, layer), blocks(g.rows), optics.workers)
        del layer  # before the next one is made
    if not at_once:
        each(finish, blocks(g.rows), optics.workers)
    if veil is not None:
        _spread(out, mosaic, veil)
        each(lambda block: gain(after, block), blocks(g.rows), optics.workers)
    return Rate(out if planes else out[0], followed)


def _in_order(effects: Sequence[Effect]) -> tuple[list[Gain], Veil | None, list[Gain]]:
    """The gains before the veil, the veil, and the gains after it."""
    veil = next((e for e in effects if isinstance(e, Veil)), None)
    gains = [e for e in effects if isinstance(e, Gain)]
    if veil is None:
        return gains, None, []
    early = [e for e in gains if effects.index(e) < effects.index(veil)]
    return early, veil, [e for e in gains if e not in early]


def _fill(tile: NDArray, layer: Layer, mosaic: Mosaic, block: slice) -> None:
    """Puts a layer's light where it belongs: every color in its plane, or each in its places."""
    if len(tile) > 1:
        for color in layer.of(len(tile)):
            tile[color] = layer.values(color, block)
        return
    period = len(mosaic.block)
    for phase in range(min(period, tile.shape[1])):
        row = block.start + phase
        there = layer.of(len(mosaic.colors))
        for color, places in mosaic.in_row(row):
            if color not in there:
                continue
            found = layer.values(color, slice(row, block.stop, period))
            for columns in places:
                tile[0, phase::period, columns] = found[:, columns]


def _spread(rate: NDArray, mosaic: Mosaic, veil: Veil) -> None:
    """Takes the veil's share of the light and lays it evenly over the pixels of its color."""
    if len(rate) > 1:
        for plane in rate:
            plane += veil.fraction * (plane.mean(dtype=np.float64) - plane)
        return
    light = rate[0]
    period = len(mosaic.block)
    sums, counts = np.zeros(len(mosaic.colors)), np.zeros(len(mosaic.colors))
    sites = [
        (row, color, columns)
        for row in range(period)
        for color, places in mosaic.in_row(row)
        for columns in places
    ]
    for row, color, columns in sites:
        here = light[row::period, columns]
        sums[color] += here.sum(dtype=np.float64)
        counts[color] += here.size
    light *= light.dtype.type(1 - veil.fraction)
    for row, color, columns in sites:
        light[row::period, columns] += veil.fraction * sums[color] / max(counts[color], 1)
