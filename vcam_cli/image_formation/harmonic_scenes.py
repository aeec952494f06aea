"""Scenes in closed form: waves, and patterns that repeat. Each wave keeps its shape; exact.

Through a blur that changes over the field a wave's amplitude changes by place: the mean of all
zones, and a few maps of what differs from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import pixel_centers
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import (
    Blur,
    FieldTransfer,
    PlaneTransfer,
    RadialTransfer,
    SeparableTransfer,
)
from vcam_cli.image_formation.field_dependence import Map, zone_maps
from vcam_cli.image_formation.optical_path import Layer, Layers, OpticalPath, SpectrumReport
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.image_formation.transfer_tables import PARITIES, split_by_parity
from vcam_cli.physics.pupil_harmonics import in_directions
from vcam_cli.scenes.base import HarmonicScene
from vcam_cli.scenes.waves import Wave, WaveScene

MOST_HARMONICS = 512
"""Harmonics along an axis up to the lens's cut-off: a pattern with more of them is sampled."""
LEFT = 0.01
"""Part of the tolerance that the modes of the field may leave."""
ROWS = 64
"""Rows of pixels, about, on which changes are measured for the report: a matter of cost."""

Weight = Callable[[Array, Array], Array] | None
"""A factor at positions x (columns,), y (rows,) [m]; None for 1 everywhere."""


def wave_layers(path: OpticalPath, scene: WaveScene) -> tuple[Layers, SpectrumReport]:
    """Return the sum of waves at the photodetectors, each with its own transfer.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : WaveScene
        Waves.

    Returns
    -------
    layers : Layers
        Signal, one layer and one more for each mode of the field.
    report : SpectrumReport
        Changes by leaving out effects.
    """
    x, y = pixel_centers(path.geometry, detector=True)

    def shape(w: Wave) -> tuple[Array, Array]:
        turns, slope = path.seen_along((w.fx, w.fy))
        return np.exp(1j * (2 * np.pi * turns + w.phase)), np.exp(2j * np.pi * slope * y)

    shapes = [shape(w) for w in scene.waves]

    def layer(levels: Array, weight: Weight) -> Layer:
        def values(color: int, s: slice) -> Array:
            total = np.zeros((len(y[s]), len(x)))
            for level, (ex, ey) in zip(levels, shapes, strict=True):
                total += (level[color] * ey[s, None] * ex[None, :]).real
            return total

        return Layer(values, weight)

    zones = [_zone_otfs(path, w) for w in scene.waves]
    maps = cache(partial(zone_maps, path.zones, path.geometry))

    def layers(effects: tuple[Effect, ...]) -> list[tuple[Array, Weight]]:
        of_waves = [
            _wave_levels(path, effects, w, otfs if path.field in effects else np.ones((1, 1)))
            for w, otfs in zip(scene.waves, zones, strict=True)
        ]
        levels = np.stack(np.broadcast_arrays(*of_waves), axis=1)
        return _modes(levels, maps, path.settings.tolerance)

    whole = layers(path.effects)
    changes = _changes(path, whole, layers, layer)
    has_field = path.field is not None
    report = SpectrumReport(changes=changes, waves=scene.waves_that_vary, has_field=has_field)
    return (layer(*parts) for parts in whole), report


def _zone_otfs(path: OpticalPath, wave: Wave) -> Array:
    """Return the transfer (zones, J) of each zone's own blur; 1 where there is no zone.

    Zones are the rings, turned with the azimuth.
    """
    wavelengths = path.transfer.wavelengths
    if not path.zones or not (wave.fx or wave.fy):
        return np.ones((1, len(wavelengths)))
    around = len(path.zones) // len(path.field_rings)
    length, direction = math.hypot(wave.fx, wave.fy), math.atan2(wave.fy, wave.fx)
    angles = direction - 2 * np.pi * np.arange(around) / around
    found = []
    for ring in path.field_rings:
        frequency = np.array([0.0, length])
        found += [
            radial.spectral_otf(frequency, wavelengths)[None, :, 1]
            for radial in of_kind([ring.blur], RadialTransfer)
        ]
        found += [
            in_directions(directed.harmonics(frequency, wavelengths)[:, 1], angles).T
            for directed in of_kind([ring.blur], PlaneTransfer)
        ]
    return np.concatenate(found)


def _wave_levels(path: OpticalPath, effects: tuple[Effect, ...], wave: Wave, zones: Array) -> Array:
    """Return the complex amplitude (zones, C) of a wave's signal in each color [e/s].

    `zones` is the transfer (zones, J) of their own blurs.
    """
    fx, fy = np.array([wave.fx]), np.array([wave.fy])
    everywhere = path.transfer.with_effects(effects).otf(fx, fy)[:, 0, 0]
    weights = np.tensordot(wave.weights, path.transfer.weights, axes=1)
    amplitudes: Array = (zones * everywhere) @ weights.T * _separable(effects, fx, fy)[0, 0]
    return amplitudes


def _modes(
    levels: Array, maps: Callable[[], list[Map]], tolerance: float
) -> list[tuple[Array, Weight]]:
    """Return the mean of the zones' amplitudes, and what differs from it: amplitudes, and weights.

    `levels` are (zones, ...). As many singular vectors are kept as leave `LEFT` of the tolerance.
    """
    mean = levels.mean(axis=0)
    modes: list[tuple[Array, Weight]] = [(mean, None)]
    rest = np.ascontiguousarray((levels - mean).reshape(len(levels), -1)).view(np.float64)
    allowed = LEFT * tolerance * float(np.abs(levels).max())
    if np.linalg.norm(rest, axis=1).max() <= allowed:
        return modes
    vectors, strengths, amplitudes = np.linalg.svd(rest, full_matrices=False)
    shares = vectors * strengths
    left = np.sqrt(np.cumsum(np.square(shares[:, ::-1]), axis=1).max(axis=0))[::-1]
    weights = np.array([m.values for m in maps()])
    for number in np.flatnonzero(left > allowed):
        values = np.tensordot(shares[:, number], weights, axes=1)
        amplitude = amplitudes[number].view(levels.dtype).reshape(mean.shape)
        modes.append((amplitude, replace(maps()[0], values=values)))
    return modes


def _separable(effects: tuple[Effect, ...], fx: Array, fy: Array) -> Array:
    """Return the product of the separable transfer functions: (fy, fx)."""
    total = np.ones((len(fy), len(fx)))
    for effect in of_kind(effects, SeparableTransfer):
        total *= np.outer(effect.along_y(fy), effect.along_x(fx))
    return total


def _zone_transfers(path: OpticalPath, effects: tuple[Effect, ...]) -> list[Transfer]:
    """Return the transfer through some effects, and through each zone where the field has them."""
    everywhere = path.transfer.with_effects(effects)
    if path.field not in effects:
        return [everywhere]
    return [everywhere.with_effects((*everywhere.effects, z.blur)) for z in path.zones]


def harmonics_count(path: OpticalPath, scene: HarmonicScene) -> tuple[int, int] | None:
    """Return the harmonics that the lens passes along x and y.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : HarmonicScene
        A pattern that repeats.

    Returns
    -------
    tuple[int, int] or None
        Numbers along x and y; None where they are too many to be summed.
    """
    cutoff = path.transfer.cutoff
    counts = [
        math.floor(period * cutoff) + 1 if math.isfinite(cutoff) else MOST_HARMONICS + 1
        for period in scene.harmonics.period
    ]
    return None if max(counts) > MOST_HARMONICS else (counts[0], counts[1])


def harmonic_layers(
    path: OpticalPath, scene: HarmonicScene, count: tuple[int, int]
) -> tuple[Layers, SpectrumReport]:
    """Return a pattern that repeats at the photodetectors: its series up to the lens's cut-off.

    However its period and the pixel pitch are related, every harmonic folds where it belongs.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : HarmonicScene
        The pattern.
    count : tuple of int
        Harmonics along x and y, from `harmonics_count`.

    Returns
    -------
    layers : Layers
        Signal, one layer and one more for each mode of the field.
    report : SpectrumReport
        Changes by leaving out effects.
    """
    x, y = pixel_centers(path.geometry, detector=True)
    fx, fy = (np.arange(n) / p for n, p in zip(count, scene.harmonics.period, strict=True))
    amplitudes = scene.harmonics.amplitudes(*count)
    along_x = [wave(2 * np.pi * np.outer(fx, x)) for wave in (np.cos, np.sin)]
    along_y = [wave(2 * np.pi * np.outer(y, fy)) for wave in (np.cos, np.sin)]

    maps = cache(partial(zone_maps, path.zones, path.geometry))

    def layers(effects: tuple[Effect, ...]) -> list[tuple[Array, Weight]]:
        common = amplitudes * _separable(effects, fx, fy)
        levels = [_harmonic_levels(t, fx, fy) * common for t in _zone_transfers(path, effects)]
        return _modes(np.array(levels), maps, path.settings.tolerance)

    def layer(levels: Array, weight: Weight) -> Layer:
        def values(color: int, s: slice) -> Array:
            total = np.zeros((len(y[s]), len(x)))
            for (odd_x, odd_y), part in zip(PARITIES, levels[:, color], strict=True):
                if part.any():
                    total += along_y[odd_y][s] @ part @ along_x[odd_x]
            return total

        return Layer(values, weight)

    whole = layers(path.effects)
    changes = _changes(path, whole, layers, layer)
    report = SpectrumReport(changes=changes, waves=1, has_field=path.field is not None)
    return (layer(*parts) for parts in whole), report


def _harmonic_levels(transfer: Transfer, fx: Array, fy: Array) -> Array:
    """Return the signal of harmonics of amplitude 1 by parity: (4, C, fy, fx) [e/s]."""
    if not transfer.plane_blurs:
        radial = transfer.radial_response(np.hypot(fx[None, :], fy[:, None]))[0]
        return np.stack([radial, *[np.zeros_like(radial)] * 3])
    plus, minus = (transfer.plane_response(fx, sign * fy)[0] for sign in (1, -1))
    return split_by_parity(plus, minus)


def _changes(
    path: OpticalPath,
    whole: list[tuple[Array, Weight]],
    layers: Callable[[tuple[Effect, ...]], list[tuple[Array, Weight]]],
    layer: Callable[[Array, Weight], Layer],
) -> dict[str, float]:
    """Return the rms change of the signal by leaving out each effect, on some rows [e/s]."""
    g = path.geometry
    x, y = pixel_centers(g)
    some = slice(None, None, max(1, g.rows // ROWS))
    changes = {}
    for effect in of_kind(path.effects, Blur, SeparableTransfer, FieldTransfer):
        rest = layers(tuple(e for e in path.effects if e is not effect))
        if len(rest) == len(whole) == 1 and np.array_equal(rest[0][0], whole[0][0]):
            changes[effect.name] = 0.0  # of even light
            continue
        squares = []
        for color in range(len(path.mosaic.colors)):
            total = np.zeros((len(y[some]), len(x)))
            for sign, parts in ((1, rest), (-1, whole)):
                for levels, weight in parts:
                    values = layer(levels, None).values(color, some)
                    total += sign * (values if weight is None else values * weight(x, y[some]))
            squares.append(np.square(total).mean())
        changes[effect.name] = float(np.sqrt(max(squares)))
    return changes
