"""What the effects that act on a picture's pixels do to it: gains, veils, charges, the full well.

Their bounds assume full signal everywhere; with the signal at hand it is known, for a few
thousand pixels, what each of them changes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import Charge, Effect, Gain, VeilingGlare
from vcam_cli.effects.saturation import Saturation

SAMPLE = 1 << 14
"""Pixels looked at, at most."""
LEAST = 1e-6
"""Factor below which the light in front of an effect is no longer known."""

Gains = dict[Effect, NDArray]
"""Gain -> its factors."""


def changes(
    rate: NDArray,
    geometry: Geometry,
    mosaic: Mosaic,
    present: Sequence[Effect],
    running: Sequence[Effect],
    time: float,
) -> dict[str, float]:
    """Rms change of the mean raw by leaving out each gain, veil, charge and limit [electrons / s].

    rate: (rows, columns) photo-electrons per second with the gains and the veil among `running` in
    them, anything where the mosaic has no pixel; present: all effects that are wanted, in the order
    of action; time: exposure [s]. Of one that does not run: the change by simulating it. Every n-th
    row and column is looked at, n odd, so that every color of a mosaic is among them: exact where
    the array has at most `SAMPLE` pixels.
    """
    rows, columns = _thinned(rate.shape[0], rate.shape), _thinned(rate.shape[1], rate.shape)
    x, y = pixel_centers(geometry)
    gains: Gains = {e: e.gain(x[columns], y[rows]) for e in present if isinstance(e, Gain)}
    colors = _colors(mosaic, np.arange(rate.shape[0])[rows], np.arange(rate.shape[1])[columns])
    photo = rate[rows, columns].astype(np.float64) * time
    dark = sum(e.rate() for e in present if isinstance(e, Charge)) * time
    well = next((e.full_well for e in present if isinstance(e, Saturation)), np.inf)
    on_pixels = [e for e in present if isinstance(e, Gain | VeilingGlare)]
    chosen = [e for e in on_pixels if e in running]
    light = _light(photo, chosen, gains, colors)

    def clipped(signal: NDArray) -> NDArray:
        return np.minimum(signal, well)

    raw = clipped(photo + dark)
    seen = np.any(colors, axis=0)
    pixels = slice(None) if seen.all() else seen
    others: dict[str, NDArray] = {}
    for effect in present:
        if isinstance(effect, Gain | VeilingGlare):
            toggled = [e for e in on_pixels if (e in chosen) != (e is effect)]
            others[effect.name] = clipped(_signal(light, toggled, gains, colors) + dark)
        elif isinstance(effect, Charge):
            others[effect.name] = clipped(photo + (dark - effect.rate() * time))
        elif isinstance(effect, Saturation):
            others[effect.name] = photo + dark
    return {
        name: float(np.sqrt(np.mean((other - raw)[pixels] ** 2))) / time
        for name, other in others.items()
    }


def _signal(
    light: NDArray, effects: Collection[Effect], gains: Gains, colors: Sequence[NDArray]
) -> NDArray:
    """The light behind gains and veils."""
    for effect in effects:
        if isinstance(effect, VeilingGlare):
            light = (1 - effect.fraction) * light + effect.fraction * _means(light, colors)
        else:
            light = light * gains[effect]
    return light


def _light(
    signal: NDArray, effects: Sequence[Effect], gains: Gains, colors: Sequence[NDArray]
) -> NDArray:
    """The light in front of gains and veils, from the signal behind them."""
    for effect in reversed(effects):
        if isinstance(effect, VeilingGlare):
            signal = signal - effect.fraction * _means(signal, colors)  # a veil keeps the mean
            signal = signal / max(1 - effect.fraction, LEAST)
        else:
            signal = signal / np.maximum(gains[effect], LEAST)
    return signal


def _means(values: NDArray, colors: Sequence[NDArray]) -> NDArray:
    """Of every pixel, the mean over those of its color."""
    out = np.empty_like(values)
    for pixels in colors:
        out[pixels] = values[pixels].mean() if pixels.any() else 0.0
    return out


def _colors(mosaic: Mosaic, rows: NDArray, columns: NDArray) -> list[NDArray]:
    """Of each color, which of these rows and columns are its pixels."""
    block = np.array(mosaic.block)
    seen = block[np.ix_(rows % block.shape[0], columns % block.shape[1])]
    return [seen == color for color in mosaic.colors]


def _thinned(count: int, shape: tuple[int, ...]) -> slice:
    """Every n-th of `count`, n odd, such that at most `SAMPLE` pixels of the array are taken."""
    step = int(np.ceil(np.sqrt(shape[0] * shape[1] / SAMPLE)))
    return slice(min(step // 2, count - 1), None, step + 1 - step % 2)
