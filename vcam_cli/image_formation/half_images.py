"""The light of each pixel through the left and the right half of the lens."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.sensor.phase_detection import Masked
from vcam_cli.effects.optics.half_pupil import LEFT, RIGHT, halved
from vcam_cli.image_formation.optical_path import OpticalPath


def half_path(path: OpticalPath, radius: float, half: int) -> OpticalPath:
    """Return a path through one half of its lens.

    Parameters
    ----------
    path : OpticalPath
        Path through the whole lens.
    radius : float
        Radius of the blur of a flat scene; positive where it is nearer than the focus [m].
    half : int
        LEFT or RIGHT of `effects.optics.half_pupil`.

    Returns
    -------
    OpticalPath
        Path that lets the light of the whole lens through, blurred as that of the half is.
    """
    effects = halved(path.effects, radius, half)
    layers = tuple(
        replace(layer, effects=halved(layer.effects, layer.radius, half)) for layer in path.layers
    )
    transfer = path.transfer.with_effects(effects)
    return replace(path, transfer=transfer, effects=effects, optional=(), layers=layers)


def sites(masked: Masked) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the pixels of an array that see the left half of the lens, and the right.

    Parameters
    ----------
    masked : Masked
        Pattern of the masked pixels.

    Returns
    -------
    tuple of tuple of slice
        Slices (rows, columns) of those pixels, of the left half and of the right.
    """
    (down, along), (row, column) = masked.period, masked.offset
    rows = slice(row, None, down)
    left, right = (slice(column + i * along, None, 2 * along) for i in (0, 1))
    return (rows, left), (rows, right)


def masked(rate: Array, halves: tuple[Array, Array], pixels: Masked) -> Array:
    """Return rates in which masked pixels have those of one of their halves.

    Parameters
    ----------
    rate : Array
        Rates (rows, columns) of whole pixels [e/s].
    halves : tuple of Array
        Rates (rows, columns) of the left and of the right half [e/s].
    pixels : Masked
        Pattern of the masked pixels.

    Returns
    -------
    Array
        Rates (rows, columns) [e/s].
    """
    out = rate.copy()
    for at, half in zip(sites(pixels), halves, strict=True):
        out[at] = half[at]
    return out


def unmasked(dn: Array, pixels: Masked, period: int) -> Array:
    """Return codes with those of masked pixels taken from their neighbors.

    They are the mean of the nearest of the same color in the row.

    Parameters
    ----------
    dn : Array
        Codes (rows, columns) [DN].
    pixels : Masked
        Pattern of the masked pixels.
    period : int
        Columns from a pixel to the nearest of the same color.

    Returns
    -------
    Array
        Codes (rows, columns) in 32 bits [DN].
    """
    out = dn.astype(np.float32)
    columns = np.arange(dn.shape[1])
    for rows, along in sites(pixels):
        at = columns[along]
        before, after = at - period, at + period
        before, after = (
            np.where(before < 0, after, before),
            np.where(after >= dn.shape[1], before, after),
        )
        out[rows, along] = (out[rows][:, before] + out[rows][:, after]) / 2
    return out


def half_rates(
    whole: Array, separation: float, form: Callable[[int], Array]
) -> tuple[Array, Array]:
    """Return the rates of the halves of all pixels, which add up to those of the pixels.

    Parameters
    ----------
    whole : Array
        Rates of the pixels, of any shape [e/s].
    separation : float
        How well the halves tell the halves of the lens apart, 1 of ideal ones.
    form : callable
        Function from LEFT or RIGHT to what pixels would have of all the light, blurred as by that
        half of the lens, in the shape of `whole` [e/s].

    Returns
    -------
    left, right : Array
        Rates in the shape of `whole` [e/s].
    """
    # Their sum is blurred by rays, the pixels' light by waves: only the difference is taken.
    apart = separation * (form(LEFT) - form(RIGHT)) / 2
    left = np.clip((whole + apart) / 2, 0, whole)
    return left, whole - left
