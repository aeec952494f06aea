"""Layers behind the lens, and where they hide of each other what some rays alone see."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.image_formation.layers.layer_lattice import Window
from vcam_cli.image_formation.optical_path import OpticalPath, SpectrumReport

FAINT = 0.02
"""Part of the light behind a layer that counts as its detail where it looks even."""


@dataclass(frozen=True)
class SeenLayer:
    """A layer behind the lens."""

    window: Window
    light: NDArray
    """Light (C, rows, columns) in the window [e/s]."""
    cover: NDArray
    """Opacity (C, rows, columns)."""
    path: OpticalPath
    report: SpectrumReport

    def lost_rms(self, g: Geometry) -> float:
        """Return the rms over all of an array of what the layer's own image lacks [e/s]."""
        cells = self.window.geometry
        return self.report.lost_rms * math.sqrt(cells.rows * cells.columns / (g.rows * g.columns))


def partly_hidden(layers: Sequence[SeenLayer], path: OpticalPath) -> NDArray:
    """Return what of the light behind layers some rays alone may see, about.

    Parameters
    ----------
    layers : sequence of SeenLayer
        The layers, the nearest first.
    path : OpticalPath
        Lens, pixels and settings.

    Returns
    -------
    NDArray
        What that light changes by from pixel to pixel, times the part of the rays that is stopped,
        or that passes if that is less (rows, columns) [e/s]. It is 0 where all rays see as good as
        the same, or nothing.
    """
    g, least = path.geometry, path.settings.tolerance / 2
    behind: NDArray = np.zeros((g.rows, g.columns), path.settings.dtype)
    found = np.zeros_like(behind)
    for layer in reversed(layers):
        here = layer.window.rows, layer.window.columns
        low, high = layer.cover.min(axis=0), layer.cover.max(axis=0)
        part = np.minimum(high, 1 - low)  # of the rays, to which it is neither 0 nor 1
        found[here] *= 1 - low >= least
        found[here] += np.where(part > least, part, 0) * _variation(behind[here])
        behind[here] = layer.light.max(axis=0) + (1 - low) * behind[here]
    return found


def _variation(light: NDArray) -> NDArray:
    """Return how much light (rows, columns) changes from pixel to pixel, and a little of itself."""
    found = FAINT * light
    for axis in (0, 1):
        found += np.abs(np.diff(light, axis=axis, append=light.take([-1], axis)))
    return found
