"""How much of the light behind a layer some rays of a pixel alone may see: a bound.

Of a pixel's rays that meet opacities from m to M, A in the mean, no more can be missing from the
product of means than (M - m) A' (1 - A') of the brightest light behind, A' = (A - m) / (M - m):
there each ray meets either m or M, and sees nothing or all of that light. Where rays see light
from l to h behind, that holds of the light beyond l: even light hides nothing, whatever is before
it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.temporal.motion import EvenMotion
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.image_formation.layers.ray_cells import BORDER, Window
from vcam_cli.image_formation.optical_path import LayerOptics
from vcam_cli.scenes.cells import Spans
from vcam_cli.scenes.layered import EVEN, LayerChart, LayerPart


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
    out: Array = np.zeros_like(mean[0])
    apart = high - low
    varied = np.flatnonzero(apart > EVEN)
    least, spread = low.take(varied), apart.take(varied)
    share = mean.reshape(len(mean), -1).take(varied, axis=1) - least
    share /= spread
    np.clip(share, 0, 1, out=share)
    out.flat[varied] = spread * (share * (1 - share)).max(axis=0)
    return out


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
    return chart.opacity_extremes(edges[0], edges[1], (2 * around[1] + 1, 2 * around[0] + 1))


def spread_behind(
    g: Geometry,
    parts: Sequence[LayerPart],
    optics: Sequence[LayerOptics],
    level: Array,
    beyond: float,
    side: int,
) -> list[Array]:
    """Return how far apart lights are that rays of a pixel may see behind layers: a bound.

    The light of a ray is a mean of the lights of layers, so it lies between the least and the
    largest of them. A layer's light is not counted where it is beside all rays, nor that of those
    behind it where it covers all.

    Parameters
    ----------
    g : Geometry
        Geometry of the array.
    parts : sequence of LayerPart
        The layers, the nearest first.
    optics : sequence of LayerOptics
        What acts on the light of each.
    level : Array
        Signal (K, C) of the scene's components, white the last one [e/s].
    beyond : float
        How far from a ray's place lens and silicon bring light, besides [m].
    side : int
        Side of a tile of pixels.

    Returns
    -------
    list of Array
        Of each layer but the last what there is behind it, by tile (m, n) in the color of most
        [e/s].
    """
    spans = []
    for at, pitch, count in zip(
        pixel_centers(g, detector=True), (g.pitch_x, g.pitch_y), (g.columns, g.rows), strict=True
    ):
        first = np.arange(0, count, side)
        spans.append((at[first] - pitch / 2, at[np.minimum(first + side, count) - 1] + pitch / 2))
    shape = level.shape[1], len(spans[1][0]), len(spans[0][0])
    low, high = np.zeros(shape), np.zeros(shape)
    found: list[Array] = []
    for part, own in reversed(list(zip(parts, optics, strict=True))):
        found.append((high - low).max(axis=0))
        (first_x, last_x), (first_y, last_y) = spans
        far_x, far_y = (reach + beyond for reach in ray_reach(own))
        around = (first_x - far_x, last_x + far_x), (first_y - far_y, last_y + far_y)
        ends = part.chart.light_ends(*around, level[part.components].T)
        if ends is None:
            most = part.brightest * level[-1][:, None, None]
            ends = np.zeros(shape), np.broadcast_to(most, shape)
        beside, within = _place_in(part, *around)
        low = np.where(beside, low, np.where(within, ends[0], np.minimum(low, ends[0])))
        high = np.where(beside, high, np.where(within, ends[1], np.maximum(high, ends[1])))
    return found[:0:-1]


def _place_in(part: LayerPart, x: Spans, y: Spans) -> tuple[Array, Array]:
    """Return whether rectangles (m, n) lie beside a layer, and whether it covers all of them."""
    if part.size is None:
        beside, within = np.zeros((1, 1), bool), np.ones((1, 1), bool)
    else:
        outside, inside = [], []
        lengths = part.size.width, part.size.height
        for (first, last), center, length in zip((x, y), part.chart.center, lengths, strict=True):
            outside.append((last <= center - length / 2) | (first >= center + length / 2))
            inside.append((first >= center - length / 2) & (last <= center + length / 2))
        beside, within = outside[1][:, None] | outside[0], inside[1][:, None] & inside[0]
    if not part.chart.covers_frame:
        within = np.zeros_like(within)
    return beside, within
