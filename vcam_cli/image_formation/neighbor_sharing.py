"""Signal that pixels give to their neighbors, on a mosaic: each color by its own kernel."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.camera.sensor.crosstalk import Kernels
from vcam_cli.effects.pixel_signal import NeighborSharing
from vcam_cli.image_formation.pixel_response import PixelResponse, axis_levels
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum


@dataclass(frozen=True, eq=False)
class Sharing:
    """The shares of an array's pixels."""

    before: tuple[Array, ...]
    """Kernels (C, h, w) of the colors, one after the other, before charge is counted."""
    after: Array | None
    """Kernel (1, h, w) behind; None where nothing couples."""
    mosaic: Mosaic
    planes: bool
    """Whether every pixel has all its colors, and gives of each to the same one."""

    @cached_property
    def sites(self) -> Array:
        """Indices (P, Q) of the colors in the block that repeats."""
        colors = self.mosaic.colors
        return np.array([[colors.index(c) for c in row] for row in self.mosaic.block])

    def arriving(self, rate: Array) -> Array:
        """Return the rates that arrive in pixels after crosstalk.

        Parameters
        ----------
        rate : Array
            Rates (..., rows, columns) that pixels generate [e/s].

        Returns
        -------
        Array
            Rates (..., rows, columns) [e/s].
        """
        for kernels in self.before:
            rate = self._spread(rate, kernels)
        return rate

    def coupled(self, charge: Array) -> Array:
        """Return the charges that sense nodes show after coupling.

        Parameters
        ----------
        charge : Array
            Charges (..., rows, columns) [electrons].

        Returns
        -------
        Array
            Charges (..., rows, columns) [electrons].
        """
        return charge if self.after is None else self._spread(charge, self.after)

    @cached_property
    def matrix(self) -> Array:
        """Mean signal (C, C) of the pixels of each color by even light of each, of 1 electron."""
        count = len(self.mosaic.colors)
        if self.planes:
            return np.eye(count)
        lit = [self.coupled(self.arriving((self.sites == k).astype(float))) for k in range(count)]
        return np.array([[light[self.sites == c].mean() for light in lit] for c in range(count)])

    def transfer(self, color: int, light: Array, fx: Array, fy: Array) -> Array:
        """Return the contrast that pixels of a color show of a gray wave, over that in front.

        Parameters
        ----------
        color : int
            Index of the color.
        light : Array
            Light (C,) of the colors in even gray, before pixels share it, in any unit.
        fx, fy : Array
            Spatial frequencies (n,) along x and y [cycles/pixel].

        Returns
        -------
        Array
            Contrast (n,), complex: sum_d w K(d) exp(-2 pi i f d) / sum_d w K(d), with w the light
            of the pixel at -d and K(d) its shares, in the mean over the sites of the color.
        """
        if self.planes:
            alone = [kernels[min(color, len(kernels) - 1)][None] for kernels in self._kernels]
            return _of_waves(alone, np.zeros((1, 1), int), np.ones((1, 1)), fx, fy)[:, 0, 0]
        waves = _of_waves(self._kernels, self.sites, light[self.sites], fx, fy)
        even = _of_waves(self._kernels, self.sites, light[self.sites], np.zeros(1), np.zeros(1))
        here = self.sites == color
        found: Array = waves[:, here].mean(axis=1) / even[:, here].mean(axis=1)
        return found

    @property
    def _kernels(self) -> tuple[Array, ...]:
        """All kernels, in the order of action."""
        return self.before if self.after is None else (*self.before, self.after)

    def _spread(self, signal: Array, kernels: Array) -> Array:
        if signal.ndim == 2:
            return spread(signal, kernels, self.sites)
        each = [kernels[min(c, len(kernels) - 1)] for c in range(len(signal))]
        even = np.zeros((1, 1), int)
        return np.array([spread(p, k[None], even) for p, k in zip(signal, each, strict=True)])


def _of_waves(kernels: Sequence[Array], sites: Array, light: Array, fx: Array, fy: Array) -> Array:
    """Return the amplitudes (n, P, Q) of waves at the sites of a block, behind its kernels.

    `light` (P, Q) are those in front; kernels are (C, h, w), as in `spread`, fx and fy (n,) in
    cycles per pixel.
    """
    out = np.broadcast_to(light, (len(fx), *light.shape)).astype(complex)
    for shares in kernels:
        gone, out = out, np.zeros_like(out)
        own = shares[sites if len(shares) > 1 else np.zeros_like(sites)]
        down, along = shares.shape[1] // 2, shares.shape[2] // 2
        for i, j in np.ndindex(shares.shape[1:]):
            moved = np.roll(own[..., i, j] * gone, (i - down, j - along), axis=(1, 2))
            phase = np.exp(-2j * np.pi * (fx * (j - along) + fy * (i - down)))
            out += phase[:, None, None] * moved
    return out


def array_sharing(
    effects: Sequence[NeighborSharing],
    response: PixelResponse,
    white: Spectrum,
    mosaic: Mosaic,
    planes: bool,
) -> Sharing | None:
    """Return the shares of an array's pixels under a light; None without any.

    Parameters
    ----------
    effects : sequence of NeighborSharing
        Effects that run, one at most.
    response : PixelResponse
        Response of the pixels.
    white : Spectrum
        Spectral radiance over whose electrons kernels by wavelength are averaged.
    mosaic : Mosaic
        Colors of the pixels.
    planes : bool
        Whether every pixel has all its colors.
    """
    if not effects:
        return None
    [effect] = effects
    before = tuple(_color_kernels(kernels, response, white) for kernels in effect.before)
    after = None if effect.after is None else np.array([effect.after])
    return Sharing(before, after, mosaic, planes)


def _color_kernels(kernels: Kernels, response: PixelResponse, white: Spectrum) -> Array:
    """Return the mean kernel (C, h, w) of each color, or (1, h, w) of all where they are equal."""
    found = [np.array(kernel) for _, kernel in kernels.points]
    if not kernels.by_wavelength:
        return found[0][None]
    wavelengths = np.array([wavelength for wavelength, _ in kernels.points])
    hats = [
        Spectrum.from_samples(wavelengths, np.eye(len(wavelengths))[i], outside="hold")
        for i in range(len(wavelengths))
    ]
    levels = axis_levels(response, [white.multiply(hat) for hat in hats], ())
    total = levels.sum(axis=0)
    weights = np.where(total > 0, levels / np.where(total > 0, total, 1), 1 / len(hats))
    height, width = (max(kernel.shape[axis] for kernel in found) for axis in (0, 1))
    same_size = [
        np.pad(k, [((height - k.shape[0]) // 2,) * 2, ((width - k.shape[1]) // 2,) * 2])
        for k in found
    ]
    return np.asarray(np.einsum("jc,jhw->chw", weights, np.array(same_size)))


def spread(signal: Array, kernels: Array, sites: Array) -> Array:
    """Return a signal after every pixel has given shares to its neighbors.

    Beyond the border lie pixels that hold what those a period of the block further in do: the
    pattern of colors goes on.

    Parameters
    ----------
    signal : Array
        Signal (rows, columns), in any unit.
    kernels : Array
        Shares (C, h, w) by color of the pixel that gives, or (1, h, w) of all; each sums to 1.
    sites : Array
        Index of the color (P, Q) in the block that repeats.

    Returns
    -------
    Array
        Signal in the shape, unit and float type of the given one.
    """
    rows, columns = signal.shape
    down, along = kernels.shape[1] // 2, kernels.shape[2] // 2
    row = _continued(rows, down, sites.shape[0])
    column = _continued(columns, along, sites.shape[1])
    around = signal[np.ix_(row, column)]
    color = None
    if len(kernels) > 1:
        height, width = sites.shape
        color = sites[np.ix_(row % height, column % width)]
    out = np.zeros_like(signal)
    for i in range(kernels.shape[1]):
        for j in range(kernels.shape[2]):
            shares = kernels[:, i, j].astype(signal.dtype)
            if not shares.any():
                continue
            # What comes by (i - down, j - along) started as far on the other side.
            source = (
                slice(2 * down - i, 2 * down - i + rows),
                slice(2 * along - j, 2 * along - j + columns),
            )
            share = shares[0] if color is None else shares[color[source]]
            out += share * around[source]
    return out


def _continued(count: int, margin: int, period: int) -> Array:
    """Return the indices of `count` pixels with a margin, whole periods further in beyond them."""
    index = np.arange(-margin, count + margin)
    before = -(-np.maximum(-index, 0) // period) * period
    behind = -(-np.maximum(index - (count - 1), 0) // period) * period
    return np.asarray(np.clip(index + before - behind, 0, count - 1))
