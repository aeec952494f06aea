"""What the effects that act on a picture's pixels do to it: gains, glare, charges, the full well.

Their bounds assume full signal everywhere; with the signal at hand it is known, for a few
thousand pixels, what each of them changes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.pixel_signal import Charge, Gain, VeilingGlare
from vcam_cli.effects.signal_chain import Limit
from vcam_cli.records import dataclass

SAMPLE = 1 << 14
"""Pixels that are computed, at most. A matter of cost: an rms over them has a standard error of
0.6 %."""
LEAST = 1e-6
"""Factor below which the light in front of an effect is no longer known."""


@dataclass(frozen=True)
class _Factors:
    """A gain at some pixels."""

    factors: Array

    def apply(self, light: Array) -> Array:
        """Return the light behind the gain."""
        return light * self.factors

    def undo(self, signal: Array) -> Array:
        """Return the light in front of the gain."""
        return signal / np.maximum(self.factors, LEAST)


@dataclass(frozen=True)
class _Glare:
    """Veiling glare at some pixels, which keeps the mean of every color."""

    fraction: float
    colors: Sequence[Array]

    def apply(self, light: Array) -> Array:
        """Return the light behind the glare."""
        return (1 - self.fraction) * light + self.fraction * _means(light, self.colors)

    def undo(self, signal: Array) -> Array:
        """Return the light in front of the glare."""
        own = signal - self.fraction * _means(signal, self.colors)
        return own / max(1 - self.fraction, LEAST)


def changes_by_omission(
    rate: Array,
    geometry: Geometry,
    mosaic: Mosaic,
    present: Sequence[Effect],
    running: Sequence[Effect],
    time: float,
) -> dict[str, float]:
    """Return the rms change of the mean raw by leaving out each effect on pixels.

    Every n-th row and column is computed, n odd, so that every color of a mosaic is among them:
    the result is exact where the array has at most `SAMPLE` pixels.

    Parameters
    ----------
    rate : Array
        Photo-electrons per second (rows, columns) with the gains and the glare among `running` in
        them, anything where the mosaic has no pixel [e/s].
    geometry : Geometry
        Geometry of the array.
    mosaic : Mosaic
        Colors of its pixels.
    present : sequence of Effect
        All effects that are wanted, in the order of action.
    running : sequence of Effect
        Effects that run. For one that does not, the result is the change by simulating it.
    time : float
        Exposure time [s].

    Returns
    -------
    dict
        Name of each gain, glare, charge and limit -> rms change [e/s].
    """
    rows, columns = _every_nth(rate.shape[0], rate.shape), _every_nth(rate.shape[1], rate.shape)
    x, y = pixel_centers(geometry)
    colors = _colors(mosaic, np.arange(rate.shape[0])[rows], np.arange(rate.shape[1])[columns])
    on_pixels: dict[Effect, _Factors | _Glare] = {
        e: _Factors(_factors(e, x[columns], y[rows], dict(zip(mosaic.colors, colors, strict=True))))
        for e in of_kind(present, Gain)
    }
    on_pixels |= {e: _Glare(e.fraction, colors) for e in of_kind(present, VeilingGlare)}
    ordered = [e for e in present if e in on_pixels]
    has_pixel = np.any(colors, axis=0)
    photo = np.where(has_pixel, rate[rows, columns].astype(np.float64), 0.0) * time
    charges, limits = of_kind(present, Charge), of_kind(present, Limit)
    dark = sum(charge.rate() for charge in charges) * time
    light = photo
    for effect in reversed([e for e in ordered if e in running]):
        light = on_pixels[effect].undo(light)

    raw = _clip(photo + dark, limits)
    others: dict[str, Array] = {}
    for toggled in ordered:
        signal = light
        for effect in ordered:
            if (effect in running) != (effect is toggled):
                signal = on_pixels[effect].apply(signal)
        others[toggled.name] = _clip(signal + dark, limits)
    for charge in charges:
        others[charge.name] = _clip(photo + (dark - charge.rate() * time), limits)
    for limit in limits:
        others[limit.name] = _clip(photo + dark, [e for e in limits if e is not limit])
    pixels = slice(None) if has_pixel.all() else has_pixel
    return {
        name: float(np.sqrt(np.mean((other - raw)[pixels] ** 2))) / time
        for name, other in others.items()
    }


def percentiles(
    signal: Array, colors: Callable[[slice, slice], Array] | None, shares: Sequence[float]
) -> Array:
    """Return percentiles of a signal in every color, from every n-th row and column.

    Parameters
    ----------
    signal : Array
        Signal (rows, columns), in any unit.
    colors : callable or None
        Function that returns the indices of the pixels' colors in some rows and columns; None of
        pixels of one color.
    shares : sequence of float
        Percentages.

    Returns
    -------
    Array
        Percentiles (colors, shares), in the unit of the signal.
    """
    some = tuple(_every_nth(count, signal.shape) for count in signal.shape)
    kept = signal[some]
    if colors is None:
        return np.percentile(kept, shares)[None]
    color = colors(*some)
    return np.array([np.percentile(kept[color == one], shares) for one in np.unique(color)])


def _clip(signal: Array, limits: Iterable[Limit]) -> Array:
    """Return a mean signal behind clamps, which may reuse its array [electrons]."""
    for limit in limits:
        signal = limit.apply(signal)
    return signal


def _means(values: Array, colors: Sequence[Array]) -> Array:
    """Return for every pixel the mean over those of its color."""
    out = np.empty_like(values)
    for pixels in colors:
        out[pixels] = values[pixels].mean() if pixels.any() else 0.0
    return out


def _colors(mosaic: Mosaic, rows: Array, columns: Array) -> list[Array]:
    """Return masks (rows, columns) of the pixels of each color."""
    index = mosaic.color_at(rows, columns)
    return [index == number for number in range(len(mosaic.colors))]


def _factors(gain: Gain, x: Array, y: Array, colors: Mapping[str, Array]) -> Array:
    """Return a gain at pixels in columns x and rows y [m], each with that of its color."""
    if gain.is_neutral:
        return gain.of_color("").gain(x, y)
    out = np.ones((len(y), len(x)))
    for color, pixels in colors.items():
        out = np.where(pixels, gain.of_color(color).gain(x, y), out)
    return out


def _every_nth(count: int, shape: tuple[int, ...]) -> slice:
    """Return every n-th of `count`, n odd, such that the array has at most `SAMPLE` of them."""
    step = int(np.ceil(np.sqrt(shape[0] * shape[1] / SAMPLE)))
    return slice(min(step // 2, count - 1), None, step + 1 - step % 2)
