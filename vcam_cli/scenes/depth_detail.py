"""The detail of a picture that pixels see, and what a blur changes of it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

BINS = 256
"""Frequencies of a power spectrum."""
FINEST = 4.0
"""Frequency up to which the edges of samples count, at least [cycles per pixel]. On samples in line
with the pixels those beyond add a tenth to what blurs of a tenth of a pixel change."""
BLOCKS = 64
"""Blocks of neighboring terms of a spectrum along an axis, beside its lowest terms."""


@dataclass(frozen=True)
class Detail:
    """What the pixels of a lens see of a picture's detail by length of the spatial frequency.

    Pixels cannot tell apart waves of each zone between multiples of their Nyquist frequency. Within
    a zone mean squares add up, those of zones as if all of them met in phase: where samples are in
    line with the pixels they do.
    """

    frequency: Array
    """(n,) [cycles/m]."""
    power: Array
    """Mean squares (zones, n) of the picture without its mean, relative to the square of full
    signal."""
    full: float
    """Full signal, relative to white."""

    def rms(self, transfer: Array) -> float:
        """Return the rms, over full signal, of the detail behind a transfer (n,), at most."""
        return float(np.sqrt(self.power @ np.square(transfer)).sum())

    def blur_change(self, *parts: tuple[float, float]) -> float:
        """Return the rms, over full signal, of a sum of blurs: pairs of a factor and radius [m]."""
        blurs = [factor * disc_transfer(self.frequency, radius) for factor, radius in parts]
        return self.rms(np.sum(blurs, axis=0))


def disc_transfer(frequency: Array, radius: float) -> Array:
    """Return the transfer 2 J1(z) / z, z = 2 pi f r, of an even disc.

    Parameters
    ----------
    frequency : Array
        Spatial frequencies (n,) [cycles/m].
    radius : float
        Radius of the disc; its sign does not matter [m].

    Returns
    -------
    Array
        Transfer (n,) without unit.

    References
    ----------
    .. [1] H. H. Hopkins, "The frequency response of a defocused optical system", Proc. R. Soc.
       London A 231, 91-103, 1955, doi:10.1098/rspa.1955.0158 (its limit by rays).
    """
    from scipy.special import j1

    z = 2 * np.pi * np.asarray(frequency, float) * abs(radius)
    return np.where(z > 1e-6, 2 * j1(z) / np.where(z > 1e-6, z, 1.0), 1.0)


def full_signal(picture: Array, pitch: float, pixel: float) -> float:
    """Return the brightest light (h, w) of a picture in the means over pixels, at most white."""
    together = max(int(pixel / pitch), 1)
    return min(float(block_means(picture, together).max(initial=0.0)), 1.0)


def picture_detail(
    picture: Array,
    pitch: float,
    aperture: tuple[float, float],
    lens: Callable[[Array], Array],
    full: float,
    pixel: float,
) -> Detail:
    """Return the detail of a picture in the color of all its channels together.

    Parameters
    ----------
    picture : Array
        Light (h, w) of its samples, relative to white.
    pitch : float
        Pitch of the samples on the sensor [m].
    aperture : tuple of float
        Width and height of the areas over which pixels average [m].
    lens : callable
        What the lens passes at frequencies (n,) [cycles/m] where it is in focus.
    full : float
        Full signal, relative to white.
    pixel : float
        Side of the pixels [m].

    Returns
    -------
    Detail
        The detail.
    """
    squares = np.square(scipy.fft.dctn(picture.astype(np.float32), type=2, norm="ortho"))
    squares[0, 0] = 0
    times = max(math.ceil(2 * FINEST * pitch / pixel), 2)
    axes = []
    for axis, (count, width) in enumerate(zip(squares.shape, aperture[::-1], strict=True)):
        starts = _starts(count)
        squares = np.add.reduceat(squares, starts, axis=axis)
        axes.append(_repeated(starts, count, times, pitch, width))
    (fy, from_y, passed_y), (fx, from_x, passed_x) = axes
    seen = squares[np.ix_(from_y, from_x)] * np.outer(passed_y, passed_x) / picture.size
    zones = [np.floor(2 * f * pixel).astype(int) for f in (fy, fx)]
    zone = zones[0][:, None] * (zones[1].max() + 1) + zones[1]
    length = np.hypot(fx[None, :], fy[:, None])
    number = np.minimum((np.sqrt(length / length.max()) * BINS).astype(int), BINS - 1)
    size = (int(zone.max()) + 1, BINS)
    power = np.bincount((zone * BINS + number).ravel(), seen.ravel(), math.prod(size)).reshape(size)
    weighted = np.bincount(number.ravel(), (seen * length).ravel(), BINS)
    lit = weighted > 0
    frequency = weighted[lit] / power.sum(axis=0)[lit]
    passed = np.square(lens(frequency))
    return Detail(frequency, power[:, lit] * passed / (full**2 or 1.0), full)


def _starts(count: int) -> Array:
    """Return the first terms of blocks along an axis of a spectrum."""
    return np.unique(
        np.concatenate([np.arange(min(16, count)), np.arange(0, count, -(-count // BLOCKS))])
    )


def _repeated(
    starts: Array, count: int, times: int, pitch: float, width: float
) -> tuple[Array, Array, Array]:
    """Return the blocks of the spectrum of squares of light, which repeats that of their samples.

    They are frequencies [cycles/m], the numbers of the samples' blocks, and what squares and
    photodetectors pass of their mean squares.
    """
    middle = (starts + np.append(starts[1:], count) - 1) / 2
    own = np.arange(len(starts))
    terms, source = [], []
    for number in range(times):
        backwards = number % 2 == 1
        terms.append((number + 1) * count - middle if backwards else number * count + middle)
        source.append(own)
    f = np.concatenate(terms) / (2 * count * pitch)
    passed = np.sinc(f * width) * np.sinc(f * pitch)
    return f, np.concatenate(source), np.square(passed)


def block_means(picture: Array, side: int) -> Array:
    """Return the means over whole blocks of samples; of a smaller picture over all of it."""
    down, across = (min(side, count) for count in picture.shape)
    rows, columns = picture.shape[0] // down, picture.shape[1] // across
    whole = picture[: rows * down, : columns * across]
    return np.asarray(whole.reshape(rows, down, columns, across).mean(axis=(1, 3)))
