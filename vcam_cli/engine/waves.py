"""Scenes known as waves: each keeps its shape, its transfer is a number per color. Exact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.geometry import pixel_centers
from vcam_cli.effects.base import Blur, Effect, FieldTransfer, SeparableTransfer
from vcam_cli.engine.layers import Followed, Layer, Layers, Optics
from vcam_cli.engine.transfer import Transfer
from vcam_cli.scenes.base import Wave, WaveScene


def layers(optics: Optics, scene: WaveScene) -> tuple[Layers, Followed]:
    """The sum of waves at the photodetectors, each with its own transfer."""
    x, y = pixel_centers(optics.geometry, detector=True)
    shapes = [
        (np.exp(1j * (2 * np.pi * w.fx * x + w.phase)), np.exp(2j * np.pi * w.fy * y))
        for w in scene.waves
    ]
    whole = _wave_levels(optics, scene, optics.effects)

    def layer(levels: NDArray, weight: Callable | None) -> Layer:
        def values(color: int, s: slice) -> NDArray:
            total = np.zeros((len(y[s]), len(x)))
            for level, (ex, ey) in zip(levels, shapes, strict=True):
                total += (level[color] * ey[s, None] * ex[None, :]).real
            return total

        return Layer(values, weight)

    changes = {}
    some = slice(None, None, max(1, len(y) // 64))
    for effect in optics.effects:
        if isinstance(effect, Blur | SeparableTransfer | FieldTransfer):
            others = tuple(e for e in optics.effects if e is not effect)
            difference = [
                (layer(levels, None), weight)
                for levels, weight in _differences(optics, scene, whole, others)
            ]
            changes[effect.name] = _rms_of(difference, optics, some)
    found = (layer(levels, weight) for levels, weight in whole)
    return found, Followed(changes=changes)


Levels = list[tuple[NDArray, Callable | None]]
"""Of each zone: complex amplitudes of the waves in every color (waves, C), and its weight."""


def _wave_levels(optics: Optics, scene: WaveScene, effects: tuple[Effect, ...]) -> Levels:
    """What the waves become through some of the effects [electrons / s]."""
    through = optics.transfer.through(effects)
    parts: list[tuple[Callable | None, tuple[Blur, ...]]] = [(None, through.effects)]
    if optics.field in effects:
        parts = [(zone.weight, (*through.effects, zone.blur)) for zone in optics.zones]
    out: Levels = []
    for weight, blurs in parts:
        blurred = through.through(blurs)
        out.append((np.array([_level(blurred, effects, w) for w in scene.waves]), weight))
    return out


def _level(blurred: Transfer, effects: tuple[Effect, ...], wave: Wave) -> NDArray:
    """Complex amplitude of a wave's signal in each color, (C,) [electrons / s]."""
    fx, fy = np.array([wave.fx]), np.array([wave.fy])
    level: NDArray = np.asarray(wave.weights) @ blurred.at_plane(fx, fy)[..., 0, 0]
    for e in effects:
        if isinstance(e, SeparableTransfer):
            level = level * e.along_x(fx) * e.along_y(fy)
    return level


def _differences(
    optics: Optics, scene: WaveScene, whole: Levels, others: tuple[Effect, ...]
) -> Levels:
    """What the waves lose by the effects that are not among the others."""
    rest = _wave_levels(optics, scene, others)
    if len(rest) == len(whole):
        return [(a - b, weight) for (a, _), (b, weight) in zip(rest, whole, strict=True)]
    return [(rest[0][0] - levels, weight) for levels, weight in whole]


def _rms_of(parts: list, optics: Optics, some: slice) -> float:
    """Rms of weighted layers in the color where it is most, on some rows [electrons / s]."""
    x, y = pixel_centers(optics.geometry)
    squares = []
    for color in range(len(optics.mosaic.colors)):
        total = np.zeros((len(y[some]), len(x)))
        for layer, weight in parts:
            values = layer.values(color, some)
            total += values if weight is None else values * weight(x, y[some])
        squares.append(np.square(total).mean())
    return float(np.sqrt(max(squares)))
