"""Means over photodetectors behind round spots of rays: exact, without a spectrum.

Spots much smaller than a pixel, of a lens that does not diffract, pass detail far finer than
pixels: behind a disc of a tenth of a pixel harmonics of 32 waves in a pixel still have a
thousandth of their light, and where samples and pixels are in line all of them fold in phase.
Squares of light are a sum of corners, which are elementary behind a spot (`physics.ray_spot`):

    E = W_y B W_x^T + sum_q sign_q F_qy B F_qx^T,

with B the samples, W the means over the pixel's sides behind the spot's projection, and F what the
spot does beyond its two projections where corners of samples and of pixels are closer than its
radius. All are sparse.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.parallel import results
from vcam_cli.physics.ray_spot import RaySpot
from vcam_cli.scenes.base import SampledScene

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def spot_averages(
    scene: SampledScene,
    mix: Array,
    geometry: Geometry,
    axes: tuple[Axis, Axis],
    spot: RaySpot,
    workers: int,
) -> Array:
    """Return the means of squares of light behind a spot over the collecting areas of all pixels.

    Parameters
    ----------
    scene : SampledScene
        Samples that are even squares, mirrored at the borders.
    mix : Array
        Signal (C, K) of each component in each color [e/s].
    geometry : Geometry
        Geometry of the array.
    axes : tuple of Axis
        Samples and pixels along x and y.
    spot : RaySpot
        What the lens makes of a point.
    workers : int
        Number of threads; the result does not depend on it.

    Returns
    -------
    Array
        Signal (C, rows, columns) [e/s].
    """
    planes = scene.planes(mix, workers)
    x, y = axes
    across = _sides(x, geometry.collecting_width, spot, planes.dtype)
    down = _sides(y, geometry.collecting_height, spot, planes.dtype)
    signs = (1.0, *spot.products()[0])

    def averages(plane: Array) -> Array:
        total: Array = np.zeros((y.pixels, x.pixels), planes.dtype)
        for sign, rows, columns in zip(signs, down, across, strict=True):
            light = columns @ np.ascontiguousarray((rows @ plane).T)
            total += planes.dtype.type(sign) * light.T
        return total

    return np.array(results(averages, list(planes), workers))


def _sides(axis: Axis, size: float, spot: RaySpot, dtype: np.dtype) -> list[csr_array]:
    """Return what samples give to each pixel along one axis (pixels, samples): W, then every F."""
    nodes = np.linspace(0, 1, spot.products()[1].shape[1])

    def corner(values: Array) -> Callable[[Array], Array]:
        return lambda place: np.interp(np.abs(place), nodes, values, right=0.0)

    seen = [spot.ramp, *map(corner, spot.products()[1])]
    return [_shares(axis, size, spot.radius, one).astype(dtype) for one in seen]


def _shares(axis: Axis, size: float, radius: float, seen: Callable[[Array], Array]) -> csr_array:
    """Return the sparse matrix (pixels, samples) of a function of the place beyond a border.

    A sample is the light beyond its first border less that beyond its last one, a pixel what lies
    before its last border less what lies before its first. Places are in radii.
    """
    from scipy.sparse import csr_array

    center = axis.first + np.arange(axis.pixels) * axis.pixel_pitch
    pitch, low, high = axis.sample_pitch, center - size / 2, center + size / 2
    first = np.floor((low - radius) / pitch).astype(int)
    count = int((np.ceil((high + radius) / pitch).astype(int) - first).max())
    borders = first[:, None] + np.arange(count + 1)
    before = [seen((end[:, None] - borders * pitch) / radius) for end in (low, high)]
    shares = np.diff(before[0] - before[1], axis=1) * (radius / size)
    place = borders[:, :-1] % (2 * axis.samples)
    mirrored = np.minimum(place, 2 * axis.samples - 1 - place)
    rows = np.repeat(np.arange(axis.pixels), count)
    found = csr_array((shares.ravel(), (rows, mirrored.ravel())), (axis.pixels, axis.samples))
    found.eliminate_zeros()
    return found
