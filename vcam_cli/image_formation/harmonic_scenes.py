"""Scenes in closed form: waves, and patterns that repeat. Each wave keeps its shape; exact."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import pixel_centers
from vcam_cli.effects.base import Blur, Effect, FieldTransfer, SeparableTransfer, of_kind
from vcam_cli.image_formation.optical_path import Layer, Layers, OpticalPath, SpectrumReport
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.image_formation.transfer_tables import PARITIES, split_by_parity
from vcam_cli.scenes.base import HarmonicScene
from vcam_cli.scenes.waves import Wave, WaveScene

MOST_HARMONICS = 512
"""Harmonics along an axis up to the lens's cut-off: a pattern with more of them is sampled."""
ROWS = 64
"""Rows of pixels, about, on which changes are measured."""

Weight = Callable[[NDArray, NDArray], NDArray] | None
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
        Signal, one layer for each zone of the field.
    report : SpectrumReport
        Changes by leaving out effects.
    """
    x, y = pixel_centers(path.geometry, detector=True)
    shapes = [
        (np.exp(1j * (2 * np.pi * w.fx * x + w.phase)), np.exp(2j * np.pi * w.fy * y))
        for w in scene.waves
    ]

    def layer(levels: NDArray, weight: Weight) -> Layer:
        def values(color: int, s: slice) -> NDArray:
            total = np.zeros((len(y[s]), len(x)))
            for level, (ex, ey) in zip(levels, shapes, strict=True):
                total += (level[color] * ey[s, None] * ex[None, :]).real
            return total

        return Layer(values, weight)

    def layers(effects: tuple[Effect, ...]) -> list[tuple[NDArray, Weight]]:
        return [
            (np.array([_wave_level(transfer, effects, w) for w in scene.waves]), weight)
            for transfer, weight in _zone_transfers(path, effects)
        ]

    whole = layers(path.effects)
    changes = _changes(path, whole, layers, layer)
    return (layer(*parts) for parts in whole), SpectrumReport(changes=changes)


def _wave_level(transfer: Transfer, effects: tuple[Effect, ...], wave: Wave) -> NDArray:
    """Return the complex amplitude (C,) of a wave's signal in each color [e/s]."""
    fx, fy = np.array([wave.fx]), np.array([wave.fy])
    level: NDArray = np.asarray(wave.weights) @ transfer.plane_response(fx, fy)[..., 0, 0]
    return level * _separable(effects, fx, fy)[0, 0]


def _separable(effects: tuple[Effect, ...], fx: NDArray, fy: NDArray) -> NDArray:
    """Return the product of the separable transfer functions: (fy, fx)."""
    total = np.ones((len(fy), len(fx)))
    for effect in of_kind(effects, SeparableTransfer):
        total *= np.outer(effect.along_y(fy), effect.along_x(fx))
    return total


def _zone_transfers(
    path: OpticalPath, effects: tuple[Effect, ...]
) -> list[tuple[Transfer, Weight]]:
    """Return the transfer through some effects, and through each zone where the field has them."""
    everywhere = path.transfer.with_effects(effects)
    if path.field not in effects:
        return [(everywhere, None)]
    return [
        (everywhere.with_effects((*everywhere.effects, zone.blur)), zone.weight)
        for zone in path.zones
    ]


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
        Signal, one layer for each zone of the field.
    report : SpectrumReport
        Changes by leaving out effects.
    """
    x, y = pixel_centers(path.geometry, detector=True)
    fx, fy = (np.arange(n) / p for n, p in zip(count, scene.harmonics.period, strict=True))
    amplitudes = scene.harmonics.amplitudes(*count)
    along_x = [wave(2 * np.pi * np.outer(fx, x)) for wave in (np.cos, np.sin)]
    along_y = [wave(2 * np.pi * np.outer(y, fy)) for wave in (np.cos, np.sin)]

    def layers(effects: tuple[Effect, ...]) -> list[tuple[NDArray, Weight]]:
        return [
            (
                _harmonic_levels(transfer, fx, fy) * (amplitudes * _separable(effects, fx, fy)),
                weight,
            )
            for transfer, weight in _zone_transfers(path, effects)
        ]

    def layer(levels: NDArray, weight: Weight) -> Layer:
        def values(color: int, s: slice) -> NDArray:
            total = np.zeros((len(y[s]), len(x)))
            for (odd_x, odd_y), part in zip(PARITIES, levels[:, color], strict=True):
                if part.any():
                    total += along_y[odd_y][s] @ part @ along_x[odd_x]
            return total

        return Layer(values, weight)

    whole = layers(path.effects)
    changes = _changes(path, whole, layers, layer)
    return (layer(*parts) for parts in whole), SpectrumReport(changes=changes)


def _harmonic_levels(transfer: Transfer, fx: NDArray, fy: NDArray) -> NDArray:
    """Return the signal of harmonics of amplitude 1 by parity: (4, C, fy, fx) [e/s]."""
    if not transfer.plane_blurs:
        radial = transfer.radial_response(np.hypot(fx[None, :], fy[:, None]))[0]
        return np.stack([radial, *[np.zeros_like(radial)] * 3])
    plus, minus = (transfer.plane_response(fx, sign * fy)[0] for sign in (1, -1))
    return split_by_parity(plus, minus)


def _changes(
    path: OpticalPath,
    whole: list[tuple[NDArray, Weight]],
    layers: Callable[[tuple[Effect, ...]], list[tuple[NDArray, Weight]]],
    layer: Callable[[NDArray, Weight], Layer],
) -> dict[str, float]:
    """Return the rms change of the signal by leaving out each effect, on some rows [e/s]."""
    g = path.geometry
    x, y = pixel_centers(g)
    some = slice(None, None, max(1, g.rows // ROWS))
    changes = {}
    for effect in of_kind(path.effects, Blur, SeparableTransfer, FieldTransfer):
        rest = layers(tuple(e for e in path.effects if e is not effect))
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
