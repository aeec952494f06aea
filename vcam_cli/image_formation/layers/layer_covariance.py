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
from vcam_cli.scenes.cells import cell_edges
from vcam_cli.scenes.layered import LayeredScene

SHARP = 0.1
"""Radius of a blur below which a layer counts as sharp [pixels]."""
COARSEST = 1.0
"""Side of a cell for layers that are nearly sharp, at most [pixels]."""
FINEST = 8
"""Samples per pixel pitch, at most."""
SHARE = 0.2
"""Part of the tolerance that the covariance may miss by a sum over few points of the aperture."""
SAMPLED = 0.6
"""Error of the covariance by its samples, relative to it, times the square of the samples over the
radius: as measured on layers of discs and bars."""


@dataclass(frozen=True)
class Hidden:
    """What is known of the covariance."""

    rings: int = 0
    """Rings of points of the aperture over which it was summed; 0 where there was no need to."""
    error: float = 0.0
    """Predicted, rms [e/s]."""


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
    scale = max(widest[1], COARSEST * pitch)
    rows, columns = _around_edges(scene, path.geometry, widest[0] + 2 * widest[1])
    if not (rows.stop > rows.start and columns.stop > columns.start):
        return Hidden()
    x, y = pixel_centers(path.geometry, detector=True)
    centers = x[columns], y[rows]
    allowed = SHARE * path.settings.tolerance * full

    def sampled(cell: float, rings: Sequence[int]) -> _Sampled:
        return _covariance(path, scene, centers, cell, widest[0], allowed, rings)

    found = sampled(scale, RINGS[:1])
    if found.light.rms <= 0.0:
        return Hidden()
    asked = scale * math.sqrt(allowed / (SAMPLED * found.light.rms))
    if asked < scale or found.light.error > allowed:
        cell = min(max(asked, pitch / FINEST), scale)
        found = sampled(cell, RINGS)
    for plane, own in zip(light, found.light.light, strict=True):
        across = box_means(own.T, found.at_x, path.geometry.collecting_width / found.cell).T
        plane[rows, columns] += box_means(
            across, found.at_y, path.geometry.collecting_height / found.cell
        )
    np.maximum(light, 0, out=light)
    share = math.sqrt(len(centers[0]) * len(centers[1]) / light[0].size)
    coarse = min(SAMPLED * (found.cell / scale) ** 2, 1.0) * found.light.rms
    return Hidden(found.light.rings, share * math.hypot(found.light.error, coarse))


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
    """Return the covariance around columns and rows of a lattice, and what blurs into them [m]."""
    edges = []
    for at in centers:
        count = math.ceil((at[-1] - at[0] + 2 * widest) / cell) + 2
        count = scipy.fft.next_fast_len(count, real=True)
        edges.append((at[0] + at[-1]) / 2 + cell_edges(count, cell))
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
