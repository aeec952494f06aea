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
from vcam_cli.parallel import pieces
from vcam_cli.physics.aberration import paraboloid_transfer
from vcam_cli.scenes.depth_detail import Detail, block_means

AT_ONCE = 1 << 18
"""Rises that are looked at together: temporary arrays of all of them take 80 bytes a sample."""
STEEPEST = 1.0
"""Difference of the radii of samples side by side above which they are no slope under any
other criterion: it would fold under the rays [samples]."""
MOST_FINE = 16
"""Samples along a pixel's side into which samples are divided, at most."""
RIGID = 1.2
"""Error of slopes by samples that move as a whole and by differences between them, over their
change and (pi f w)^2, with samples of the side w: 2 / 3 by differences, 1 / 3 by the width that a
sample keeps along a slope, and as much by what it moves aside."""


def slopes(radius: Array) -> tuple[Array, Array]:
    """Return by how much the radius of the blur rises from sample to sample, on slopes.

    Parameters
    ----------
    radius : Array
        Radius (h, w) of the blur at every sample's distance, with its sign [samples].

    Returns
    -------
    down, right : Array
        Rises (h - 1, w) and (h, w - 1) [samples]. A rise is at most what it is on one side, and 0
        where it stands alone: planes one behind the other have no slope.
    """
    down, right = (np.diff(radius, axis=axis) for axis in (0, 1))
    for lines in (down, right.T):
        for some in pieces(lines.shape[1], max(1, AT_ONCE // max(len(lines), 1))):
            rise = lines[:, some]
            rise[np.abs(rise) >= STEEPEST] = 0
            size, most = np.abs(rise), np.zeros_like(rise)
            alike = rise[1:] * rise[:-1] > 0
            most[1:] = np.where(alike, size[:-1], 0)
            np.maximum(most[:-1], np.where(alike, size[1:], 0), out=most[:-1])
            np.clip(rise, -most, most, out=rise)
    return down, right


def divided(radius: Array, count: int) -> Array:
    """Return the radius on `count` parts along the sides of samples.

    On slopes it is straight between the middles of samples.

    Parameters
    ----------
    radius : Array
        Radius (h, w) of the blur at every sample's distance, with its sign [samples].
    count : int
        Parts along a sample's side.

    Returns
    -------
    Array
        Radius (count h, count w) [samples].
    """
    height, width = radius.shape
    out = np.zeros((height, count, width, count)) + radius[:, None, :, None]
    place = (np.arange(count) + 0.5) / count - 0.5
    for axis, rise in enumerate(slopes(radius)):
        ahead, behind = ([(0, 0)] * 2 for _ in range(2))
        ahead[axis], behind[axis] = (0, 1), (1, 0)  # in the ends of a row there is no slope
        after, before = (np.pad(rise, pads)[:, None, :, None] for pads in (ahead, behind))
        at = place[:, None, None] if axis == 0 else place
        out += np.maximum(at, 0) * after + np.minimum(at, 0) * before
    return out.reshape(height * count, width * count)


def source(light: Array, rises: tuple[Array, Array], radius: float) -> Array:
    """Return Q of samples of one radius.

    Parameters
    ----------
    light : Array
        Light (R, h, w) of the samples, even in each.
    rises : tuple of Array
        Those of `slopes`.
    radius : float
        Radius of the blur, with its sign [samples].

    Returns
    -------
    Array
        Source (R, h, w), in the light's unit.
    """
    out = np.zeros_like(light)
    for axis, rise in ((1, rises[0]), (2, rises[1])):
        low, high = (
            tuple(slice(*ends) if k == axis else slice(None) for k in range(3))
            for ends in ((None, -1), (1, None))
        )
        flux = rise.astype(light.dtype) * (light[low] + light[high]) * light.dtype.type(radius / 8)
        out[low] -= flux
        out[high] += flux
    return out


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


def slope_error(detail: Detail, radius: Array, pitch: float, side: int) -> float:
    """Return the rms error, over full signal, by samples that move as a whole.

    It falls as the square of the parts into which samples are divided.

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

    Returns
    -------
    float
        Error without unit.
    """
    return _slope_change(
        detail, radius, pitch, side, RIGID * (np.pi * detail.frequency * pitch) ** 2
    )


def slope_change(detail: Detail, radius: Array, pitch: float, side: int) -> float:
    """Return what slopes change, rms, over full signal; parameters as of `slope_error`."""
    return _slope_change(detail, radius, pitch, side, np.ones_like(detail.frequency))


def _slope_change(detail: Detail, radius: Array, pitch: float, side: int, part: Array) -> float:
    middle = float(np.sqrt(np.square(radius).mean()))
    z = 2 * np.pi * detail.frequency * middle
    tilt = detail.rms(z / 4 * paraboloid_transfer(detail.frequency, middle) * part)
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
