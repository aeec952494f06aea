"""A chart as a picture: uniform squares of light, each with the chart's mean over it.

A picture is all that a file holds of a chart. Squares of the side d blur what they sample by one
more box: a wave of f keeps 1 - (pi f d)^2 / 6 of its contrast, and an edge is displaced by d / 2 at
most.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vcam_cli.scenes.base import ChartScene, HarmonicScene, SampledScene, Scene, View
from vcam_cli.scenes.charts.sinusoid import WaveChart
from vcam_cli.scenes.framed import chart_scene
from vcam_cli.scenes.image import ImageScene, extent_with_margin, image_scene, placement
from vcam_cli.scenes.waves import WaveScene

SLIVER = 1e-6
"""Part of a sample below which the scene's width beyond whole samples is a rounding error."""


def sampled_chart(scene: Scene, view: View, per_pixel: float, goes_on: bool) -> SampledScene:
    """Return a scene as the picture that a file of it is.

    Parameters
    ----------
    scene : Scene
        Scene on the view.
    view : View
        The array, and the margin that the scene fills.
    per_pixel : float
        Samples over the shorter pixel pitch.
    goes_on : bool
        Whether the picture goes on through the margin, and so has a width of its own; else it
        covers the array, and is mirrored at its border.

    Returns
    -------
    SampledScene
        Picture of the chart; the scene itself where it is a picture.
    """
    if isinstance(scene, WaveScene):
        scene = chart_scene(WaveChart(scene.waves), scene.spectra, scene.white, view)
    elif isinstance(scene, HarmonicScene):
        scene = scene.chart
    if not isinstance(scene, ChartScene):
        return scene
    view = replace(view, scene_width=None, margin=view.margin if goes_on else 0)
    pitch = min(view.pitch_x, view.pitch_y) / per_pixel
    columns, rows = (math.ceil(size / pitch - SLIVER) for size in extent_with_margin(view))
    if goes_on:
        view = replace(view, scene_width=columns * pitch)
    side = placement(rows, columns, view).pitch
    grid = replace(scene, shape=(rows, columns), pitch_x=side, pitch_y=side)
    planes = grid.planes(np.eye(len(scene.spectra)))
    picture: ImageScene = image_scene(np.moveaxis(planes, 0, -1), scene.spectra, scene.white, view)
    return picture
