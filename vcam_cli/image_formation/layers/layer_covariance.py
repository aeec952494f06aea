"""Covariance over the aperture of the layers of a scene, sampled as coarsely as their blur allows.

`occlusion.py` has the mathematics. Only layers that are out of focus take part, and only around
those that do not fill the frame: what is opaque all over hides all alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.layers.layer_lattice import Lattice
from vcam_cli.image_formation.layers.occlusion import RINGS, BlurredLayer, Covariance, covariance
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.scenes.layered import LayeredScene

SHARP = 0.1
"""Radius of a blur below which a layer counts as sharp [pixels]."""
FINEST = 8
"""Samples per pixel pitch, at most."""
SHARE = 0.2
"""Part of the tolerance that the sum over few points of the aperture may miss, and as much the
cells."""
SAMPLED = 0.5
"""Error of the covariance by its cells, relative to it, as measured on layers of discs and bars,
over the square of their side. That is counted in the geometric mean of a pixel and the radius of
the sharpest layer, at least a pixel: its light has its detail in the covariance of those before
it, however wide they are."""
NARROWEST = 0.25
"""Width of the strips along edges that have a covariance, at least [pixels]. Where they are
narrower than pixels, they have less of it on coarse cells: that error grows with the inverse root
of their width."""


@dataclass(frozen=True)
class Hidden:
    """What is known of the covariance."""

    rings: int = 0
    """Rings of points of the aperture over which it was summed; 0 where there was no need to."""
    error: float = 0.0
    """Predicted, rms [e/s]."""
    values: int = 0
    """Values that were moved to where rays see them."""


def add_covariance(path: OpticalPath, scene: LayeredScene, light: NDArray, full: float) -> Hidden:
    """Add what layers that are out of focus hide of each other to the light of pixels.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    scene : LayeredScene
        The scene.
    light : NDArray
        Light (C, rows, columns) that is changed [e/s].
    full : float
        Full signal, to which the tolerance is relative [e/s].

    Returns
    -------
    Hidden
        By how many rings it was summed, and its error.
    """
    widest = sorted((abs(optics.radius) for optics in path.layers), reverse=True)
    pitch = max(path.geometry.pitch_x, path.geometry.pitch_y)
    period = _period(path)
    if len(widest) < 2 or widest[0] < SHARP * pitch or widest[1] + period < SHARP * pitch:
        return Hidden()
    coarsest, detail = (max(radius, pitch) for radius in (widest[1], widest[-1]))
    strip = min(max(widest[1] + period, NARROWEST * pitch), pitch)
    squared = SAMPLED / (detail * math.sqrt(pitch * strip))
    rows, columns = _around_edges(scene, path.geometry, widest[0] + 2 * widest[1])
    if not (rows.stop > rows.start and columns.stop > columns.start):
        return Hidden()
    x, y = pixel_centers(path.geometry, detector=True)
    centers = x[columns], y[rows]
    allowed = SHARE * path.settings.tolerance * full

    def sampled(cell: float, rings: Sequence[int]) -> _Sampled:
        return _covariance(path, scene, centers, cell, widest[0], allowed, rings)

    def cell_error() -> float:
        return squared * found.cell**2 * found.light.rms

    found = sampled(_aligned(coarsest, pitch), RINGS[:1])
    values = found.light.values
    if found.light.rms <= 0.0:
        return Hidden()
    if cell_error() > allowed or found.light.error > allowed:
        asked = found.cell * math.sqrt(min(allowed / cell_error(), 1))
        found = sampled(_aligned(max(asked, pitch / FINEST), pitch), RINGS)
        values += found.light.values
    for plane, own in zip(light, found.light.light, strict=True):
        across = box_means(own.T, found.at_x, path.geometry.collecting_width / found.cell).T
        plane[rows, columns] += box_means(
            across, found.at_y, path.geometry.collecting_height / found.cell
        )
    np.maximum(light, 0, out=light)
    share = math.sqrt(len(centers[0]) * len(centers[1]) / light[0].size)
    return Hidden(found.light.rings, share * math.hypot(found.light.error, cell_error()), values)


def _aligned(cell: float, pitch: float) -> float:
    """Return the side of cells, at most as large, that divides the pixels or is whole pixels [m].

    What is sharp behind what is not then loses nothing between the two.
    """
    return pitch * math.floor(cell / pitch) if cell >= pitch else pitch / math.ceil(pitch / cell)


@dataclass(frozen=True)
class _Sampled:
    """Covariance on cells of its own."""

    light: Covariance
    cell: float
    """Side of a cell [m]."""
    at_x: NDArray
    """Where the pixels' columns lie, counted in cells from the edge of the first."""
    at_y: NDArray
    """Where their rows lie."""


def _covariance(
    path: OpticalPath,
    scene: LayeredScene,
    centers: tuple[NDArray, NDArray],
    cell: float,
    widest: float,
    allowed: float,
    rings: Sequence[int],
) -> _Sampled:
    """Return the covariance around columns and rows of a lattice, and what blurs into them [m].

    Cells begin at the first pixel's border.
    """
    pitches = path.geometry.pitch_x, path.geometry.pitch_y
    beyond = math.ceil(widest / cell) + 1
    edges = []
    for at, pitch in zip(centers, pitches, strict=True):
        count = math.ceil((at[-1] - at[0] + pitch) / cell) + 2 * beyond
        count = scipy.fft.next_fast_len(count, real=True)
        edges.append(at[0] - pitch / 2 + (np.arange(count + 1) - beyond) * cell)
    layers = []
    for part, optics in zip(scene.parts, path.layers, strict=True):
        level = path.transfer.level[part.components].T
        mix = np.zeros((len(level) + 1, level.shape[1] + 1), path.settings.dtype)
        mix[:-1, :-1], mix[-1, -1] = level, 1
        planes = part.chart.averages(edges[0], edges[1], mix)
        layers.append(BlurredLayer(planes[:-1], planes[-1], optics.radius / cell))
    at_x, at_y = ((at - own[0]) / cell for at, own in zip(centers, edges, strict=True))
    light = covariance(layers, allowed, _period(path) / cell, rings)
    return _Sampled(light, cell, at_x, at_y)


def _period(path: OpticalPath) -> float:
    """Return the period of the lens's cut-off in the scene's mean light; 0 without diffraction."""
    white = path.transfer.weights[-1].sum(axis=0)
    mean = float(np.average(path.transfer.wavelengths, weights=white))
    lens = of_kind(path.layers[0].effects, Diffraction)
    return max((1 / effect.cutoff(mean) for effect in lens), default=0.0)


def _around_edges(scene: LayeredScene, g: Geometry, beyond: float) -> tuple[slice, slice]:
    """Return the rows and columns of a lattice within reach of an edge of a layer [m]."""
    spans = [Lattice(g).window(part, beyond) for part in scene.parts[:-1]]
    rows = slice(min(w.rows.start for w in spans), max(w.rows.stop for w in spans))
    columns = slice(min(w.columns.start for w in spans), max(w.columns.stop for w in spans))
    return rows, columns


def box_means(plane: NDArray, at: NDArray, width: float) -> NDArray:
    """Return the means of even rows over boxes of a width around places, counted in rows."""
    sums = np.concatenate([np.zeros_like(plane[:1]), np.cumsum(plane, axis=0)])
    low, high = (_interpolated(sums, at + side * width / 2) for side in (-1, 1))
    return (high - low) / plane.dtype.type(width)


def _interpolated(plane: NDArray, at: NDArray) -> NDArray:
    """Return a plane straight between its rows, at places counted in rows."""
    index = np.clip(at.astype(int), 0, len(plane) - 2)
    part = (at - index).astype(plane.dtype)[:, None]
    return np.asarray(plane[index] * (1 - part) + plane[index + 1] * part)
