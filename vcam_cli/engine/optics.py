"""From the scene to the rate of photo-electrons in every pixel: the linear part.

All on-axis physics is one filter per scene component and color (`transfer.py`), applied in one of
three ways (`ways.py`); slowly varying factors multiply the result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import Effect, Gain, RadialTransfer
from vcam_cli.engine import ways
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

    least = min(MARGIN, max(geometry.rows, geometry.columns))
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
    common = (
        camera.optics.transmittance.resolve(),
        (camera.pixel.photodetector.quantum_efficiency.spectrum.resolve()),
    )
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
    """H_kc of scene spectra [W / (sr m2 m)] in this camera, eq 2.18 and 2.23. [electrons / s]"""
    area = geometry.detector_area
    if camera.pixel.photodetector.quantum_efficiency.per_pixel:
        area = geometry.pixel_width * geometry.pixel_height
    irradiance = float(
        radiometry.irradiance_per_radiance(geometry.f_number, geometry.magnification)
    )
    wavelengths = camera.scene.wavelengths
    return transfer(
        spectra,
        responses(camera, mosaic),
        irradiance * area,
        Band(wavelengths.start, wavelengths.stop, settings.wavelength_step),
        [e for e in effects if isinstance(e, RadialTransfer)],
    )


@dataclass(frozen=True)
class Rate:
    """What the linear part gives."""

    values: NDArray
    """(rows, columns) [electrons / s]"""
    spectrum: ways.Followed
    """How far the scene's spectrum was followed, and what each transfer does to the picture."""


def photo_rate(optics: ways.Optics, scene_at: Callable[[int], WaveScene | SampledScene]) -> Rate:
    """Photo-electrons per second in every pixel, noise-free.

    scene_at: the scene with so many cells per pixel pitch, where it is a chart.
    Raises CannotDo where memory does not suffice.
    """
    rows, followed = ways.rows(optics, scene_at)
    g = optics.geometry
    out: NDArray = np.empty((g.rows, g.columns), optics.settings.dtype)
    gains = [e for e in optics.effects if isinstance(e, Gain)]
    x, y = (axis.astype(out.dtype) for axis in pixel_centers(g))

    def compute(block: slice) -> None:
        tile = out[block]
        _assemble(rows, optics.mosaic, block, tile)
        np.maximum(tile, 0, out=tile)
        for effect in gains:
            tile *= effect.gain(x, y[block])

    each(compute, blocks(g.rows), optics.workers)
    return Rate(out, followed)


def _assemble(rows: Sequence[ways.Rows], mosaic: Mosaic, block: slice, tile: NDArray) -> None:
    """Puts the values of each color where that color's pixels are."""
    period = len(mosaic.block)
    for phase in range(min(period, len(tile))):
        row = block.start + phase
        for color, columns in mosaic.in_row(row):
            values = rows[color](slice(row, block.stop, period))
            tile[phase::period, columns] = values[:, columns]
