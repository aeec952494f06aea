"""How much of the light behind a layer some rays of a pixel alone may see: a bound.

Of a pixel's rays that meet opacities from m to M, A in the mean, no more can be missing from the
product of means than (M - m) A' (1 - A') of the brightest light behind, A' = (A - m) / (M - m):
there each ray meets either m or M, and sees nothing or all of that light.
"""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.temporal.motion import EvenMotion
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.image_formation.layers.ray_cells import BORDER, Window
from vcam_cli.image_formation.optical_path import LayerOptics
from vcam_cli.scenes.cells import window_extremes
from vcam_cli.scenes.layered import EVEN, LayerChart


def ray_reach(optics: LayerOptics) -> tuple[float, float]:
    """Return how far from their place on the sensor rays meet a layer, at most.

    Parameters
    ----------
    optics : LayerOptics
        What acts on the light of the layer.

    Returns
    -------
    tuple of float
        Distances along x and y, on the plane of the sensor [m].
    """
    travel = sum((motion.travel for motion in of_kind(optics.effects, ImageMotion)), 0.0)
    return abs(optics.radius) + travel, abs(optics.radius) + travel


def even_motion(optics: LayerOptics) -> EvenMotion | None:
    """Return the motion of a layer along a straight line.

    Parameters
    ----------
    optics : LayerOptics
        What acts on the light of the layer.

    Returns
    -------
    EvenMotion or None
        Motion; None where the layer has no such motion.
    """
    found = of_kind(optics.effects, EvenMotion)
    return found[0] if found else None


def moves_otherwise(optics: LayerOptics) -> bool:
    """Return whether a layer moves along a path that rays do not follow.

    Parameters
    ----------
    optics : LayerOptics
        What acts on the light of the layer.

    Returns
    -------
    bool
        True where it moves, and not along a straight line.
    """
    return bool(of_kind(optics.effects, ImageMotion)) and even_motion(optics) is None


def partly_hidden(
    g: Geometry, chart: LayerChart, optics: LayerOptics, window: Window, mean: Array
) -> Array:
    """Return the part of the light behind a layer that may be missing from the product of means.

    Parameters
    ----------
    g : Geometry
        Geometry of the array.
    chart : LayerChart
        The layer.
    optics : LayerOptics
        What acts on its light.
    window : Window
        Pixels that the layer's light reaches.
    mean : Array
        The layer's opacity behind the lens (C, rows, columns) there.

    Returns
    -------
    Array
        Bound (rows, columns), 0 where all rays see the same.
    """
    low, high = _opacity_range(g, chart, optics, window)
    spread = high - low
    varied = spread > EVEN
    share = np.clip((mean - low) / np.where(varied, spread, 1), 0, 1)
    return np.where(varied, spread * (share * (1 - share)).max(axis=0), 0)


def _opacity_range(
    g: Geometry, chart: LayerChart, optics: LayerOptics, window: Window
) -> tuple[Array, Array]:
    """Return the least and the largest opacity (rows, columns) that rays of each pixel meet."""
    far, centers = ray_reach(optics), pixel_centers(g, detector=True)
    edges, around = [], []
    for at, pitch, cells, reach in zip(
        centers, (g.pitch_x, g.pitch_y), (window.columns, window.rows), far, strict=True
    ):
        beyond = math.ceil(reach / pitch) + BORDER
        first = at[0] + (cells.start - beyond - 0.5) * pitch
        edges.append(first + np.arange(cells.stop - cells.start + 2 * beyond + 1) * pitch)
        around.append(beyond)
    low, high = chart.opacity_ends(*edges)
    size = 2 * around[1] + 1, 2 * around[0] + 1
    return window_extremes(np.minimum, low, size), window_extremes(np.maximum, high, size)
