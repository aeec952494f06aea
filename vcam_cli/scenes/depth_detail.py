"""The detail of a picture that pixels see, and what a blur changes of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array

BINS = 256
"""Frequencies of a power spectrum."""


@dataclass(frozen=True)
class Detail:
    """What the pixels of a lens see of a picture's detail by length of the spatial frequency."""

    frequency: Array
    """(n,) [cycles/m]."""
    power: Array
    """Mean squares (n,) of the picture without its mean, relative to the square of full signal."""
    full: float
    """Full signal, relative to white."""

    def rms(self, transfer: Array) -> float:
        """Return the rms, over full signal, of the detail behind a transfer (n,)."""
        return float(np.sqrt((self.power * np.square(transfer)).sum()))

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

    Returns
    -------
    Detail
        The detail.
    """
    squares = np.square(scipy.fft.dctn(picture.astype(np.float32), type=2, norm="ortho"))
    squares[0, 0] = 0
    fy, fx = (np.arange(count) / (2 * count * pitch) for count in picture.shape)
    length = np.hypot(fx[None, :], fy[:, None])
    squares *= np.outer(np.square(np.sinc(fy * aperture[1])), np.square(np.sinc(fx * aperture[0])))
    top = float(np.hypot(0.5, 0.5) / pitch)
    bins = np.minimum((np.sqrt(length / top) * BINS).astype(int), BINS - 1).ravel()
    power = np.bincount(bins, squares.ravel(), BINS) / picture.size
    weighted = np.bincount(bins, (squares * length).ravel(), BINS) / picture.size
    seen = power > 0
    frequency = weighted[seen] / power[seen]
    passed = np.square(lens(frequency))
    return Detail(frequency, power[seen] * passed / (full**2 or 1.0), full)


def block_means(picture: Array, side: int) -> Array:
    """Return the means over whole blocks of samples; of a smaller picture over all of it."""
    down, across = (min(side, count) for count in picture.shape)
    rows, columns = picture.shape[0] // down, picture.shape[1] // across
    whole = picture[: rows * down, : columns * across]
    return np.asarray(whole.reshape(rows, down, columns, across).mean(axis=(1, 3)))
