"""The light of slopes of depth, which rays see denser on their one side.

The rays through the point u of the aperture (in its radii) see the sample at x of a picture at
p = x - r u, where r(x) is the radius of its blur. A surface whose r rises by g = grad r a length
lies under them 1 - g u times as densely, which its image has exactly where nothing folds,

    E(p) = integral L(x) mean_u[(1 - g u) delta(p - x + r u)] dx.

A sample that faces the lens has the 1 alone: a disc. The rest is a disc weighted by the distance
from its center, and so the gradient of a paraboloid: the source

    Q = -div(r g L) / 4,

behind the transfer 8 J2(z) / z^2, z = 2 pi |f| r, of a paraboloid (`Paraboloid`).
"""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.physics.aberration import paraboloid_transfer
from vcam_cli.scenes.depth_cut import Detail, block_means

STEEPEST = 1.0
"""Difference of the radii of samples side by side from which on they are no slope, whatever else
says so: it would fold under the rays [samples]."""
FINE = 8
"""Samples along a pixel's side on which differences are taken, at least."""


def slopes(radius: Array, jump: float = STEEPEST) -> tuple[Array, Array]:
    """Return by how much the radius of the blur rises from sample to sample, on slopes.

    Parameters
    ----------
    radius : Array
        Radius (h, w) of the blur at every sample's distance, with its sign [samples].
    jump : float, optional
        Difference of radii from which on one sample hides another, and is no slope [samples].

    Returns
    -------
    down, right : Array
        Rises (h - 1, w) and (h, w - 1) [samples]. A rise is at most what it is on one side, and 0
        where it stands alone: planes one behind the other have no slope.
    """
    found = []
    for axis in (0, 1):
        rise = np.moveaxis(np.diff(radius, axis=axis), axis, 0)
        rise = np.where(np.abs(rise) < min(jump, STEEPEST), rise, 0)
        if not len(rise):
            found.append(np.moveaxis(rise, 0, axis))
            continue
        before, after = (
            np.concatenate(pair) for pair in ((rise[:1], rise[:-1]), (rise[1:], rise[-1:]))
        )
        alike = [np.where(rise * other > 0, np.abs(other), 0) for other in (before, after)]
        most = np.maximum(*alike)
        found.append(np.moveaxis(np.clip(rise, -most, most), 0, axis))
    return found[0], found[1]


def source(light: Array, rises: tuple[Array, Array], radius: float, finer: int) -> Array:
    """Return Q of samples of one radius, on samples that are so many times as fine.

    Parameters
    ----------
    light : Array
        Light (R, h, w) of the samples, even in each.
    rises : tuple of Array
        Those of `slopes`.
    radius : float
        Radius of the blur, with its sign [samples].
    finer : int
        Fine samples along the side of one.

    Returns
    -------
    Array
        Source (R, finer h, finer w), in the light's unit.
    """
    fine = light.repeat(finer, axis=1).repeat(finer, axis=2)
    out = np.zeros_like(fine)
    for axis, rise in ((1, rises[0]), (2, rises[1])):
        along, across = axis - 1, 2 - axis
        faces = _on_faces(rise, along, finer).repeat(finer, axis=across).astype(fine.dtype)
        low, high = (
            tuple(slice(*ends) if k == axis else slice(None) for k in range(3))
            for ends in ((None, -1), (1, None))
        )
        flux = faces * (fine[low] + fine[high]) * fine.dtype.type(radius * finer / 8)
        out[low] -= flux
        out[high] += flux
    return out


def _on_faces(rise: Array, axis: int, finer: int) -> Array:
    """Return the rise of the radius a length, along an axis, between fine samples.

    Between the middles of two samples it is that from one to the other, in the ends of a row none.
    """
    rise = np.moveaxis(rise, axis, 0)
    ends = np.zeros_like(rise, shape=(1, *rise.shape[1:]))
    padded = np.concatenate([ends, rise, ends]) if len(rise) else np.concatenate([ends, ends])
    count = (len(padded) - 1) * finer
    at = (np.arange(1, count) / finer + 0.5).astype(int)
    middle = np.arange(1, count) % finer * 2 == finer  # in the middle of a sample: of both sides
    found = padded[at]
    if middle.any():
        found[middle] = (padded[at[middle]] + padded[at[middle] - 1]) / 2
    return np.moveaxis(found, 0, axis)


def steepest(rises: tuple[Array, Array]) -> float:
    """Return a bound on what slopes change of light that is 1 at most.

    It is two thirds of the steepest slope, the mean of |u| over the aperture.

    Parameters
    ----------
    rises : tuple of Array
        Rises of the blur's radius from sample to sample, down and to the right.

    Returns
    -------
    float
        Bound, in the unit of the light.
    """
    down, right = (float(np.abs(rise).max(initial=0.0)) for rise in rises)
    return 2 / 3 * math.hypot(down, right)


def slope_error(detail: Detail, radius: Array, pitch: float, side: int, finer: int) -> float:
    """Return the rms error, over full signal, by differences between fine samples.

    Parameters
    ----------
    detail : Detail
        Detail of the picture.
    radius : Array
        Radius (h, w) of the blur at every sample's distance, with its sign [m].
    pitch : float
        Pitch of the samples [m].
    side : int
        Side of a pixel, within which steps of a map are taken together [samples].
    finer : int
        Fine samples along the side of one; 0 where slopes are not computed.

    Returns
    -------
    float
        Error without unit.
    """
    middle = float(np.sqrt(np.square(radius).mean()))
    z = 2 * np.pi * detail.frequency * middle
    lost = 1 - np.sinc(2 * detail.frequency * pitch / finer) if finer else np.ones_like(z)
    tilt = detail.rms(z / 4 * paraboloid_transfer(detail.frequency, middle) * lost)
    return mean_slope(radius / pitch, side) * tilt


def mean_slope(radius: Array, side: int) -> float:
    """Return by how much the radius rises over a length, rms, where nothing is hidden.

    Parameters
    ----------
    radius : Array
        Radius (h, w) of the blur at every sample's distance, with its sign [samples].
    side : int
        Side of a pixel, within which steps of a map are taken together [samples].

    Returns
    -------
    float
        Slope without unit.
    """
    squares = 0.0
    for axis in (0, 1):
        rise = np.diff(radius, axis=axis)
        if rise.size:
            means = block_means(np.where(np.abs(rise) < STEEPEST, rise, 0), side)
            squares += float(np.square(means).mean())
    return math.sqrt(squares)
