"""Bounds on what a blur changes of a scene, against what it changes of points of that scene."""

import math
from dataclasses import replace

import numpy as np
import pytest
from optical_paths import PITCH, sensor

from vcam_cli.camera.scene.scene import Scene
from vcam_cli.scenes.base import View
from vcam_cli.scenes.blur_change import BlurLoss
from vcam_cli.scenes.build import build
from vcam_cli.scenes.image import image_scene
from vcam_cli.spectra import Spectrum

ROWS, COLUMNS = 12, 16
POINTS = 24
"""Points along each side of a pixel, whose sums err by a few parts in a hundred of the change."""
DISPLACED = 0.25 * PITCH
LOOSEST = 50.0
WHITE = Spectrum.flat(1.0)
CHARTS = [
    {"chart": "slanted-edge", "angle": "5 deg", "contrast": 0.8},
    {"chart": "slanted-edge", "angle": "-60 deg"},
    {"chart": "step-wedge", "steps": 7, "density_range": 1.5},
    {"chart": "colorchecker"},
    {"chart": "uniform", "reflectance": 0.4},
]


def blur(components: int, colors: int) -> BlurLoss:
    """Half of the light goes left, half of it right: 1 - H = 1 - cos(2 pi f d) <= 2 pi f d."""
    weights = np.random.default_rng(2).uniform(0.2, 1.0, (components, colors, 1))
    return BlurLoss(weights, np.array([DISPLACED]), 2.0)


def pixels(scene, loss: BlurLoss, displaced: float) -> np.ndarray:
    """Mean signals (C, rows, columns) of the light that comes from beside every point."""
    x, y = ((np.arange(n * POINTS) + 0.5) * PITCH / POINTS - n * PITCH / 2 for n in (COLUMNS, ROWS))
    values = scene.values_at(x + displaced, y, loss.level.T)
    return values.reshape(-1, ROWS, POINTS, COLUMNS, POINTS).mean((2, 4))


def check(scene) -> None:
    """Hold both bounds to brute force; means over pixels change factors less than points do."""
    geometry = replace(sensor(ROWS, COLUMNS), pitch_x=PITCH, pitch_y=PITCH)
    loss = blur(len(scene.spectra), 2)
    found = scene.change_bounds([loss], geometry, math.inf, math.inf)
    sharp = pixels(scene, loss, 0.0)
    soft = (pixels(scene, loss, DISPLACED) + pixels(scene, loss, -DISPLACED)) / 2
    change = np.sqrt(np.square(soft - sharp).mean((1, 2))).max()
    assert found.full <= min(sharp.max(), soft.max()) * (1 + 1e-9)
    assert change <= found.changes[0] * (1 + 1e-9)
    assert found.changes[0] <= LOOSEST * change


@pytest.mark.parametrize("source", CHARTS, ids=lambda s: s["chart"])
def test_the_change_of_a_chart_is_within_its_bound(source):
    """Edges blur along x alone here, and count along y as well: within factors, not percents."""
    said = Scene.model_validate({"source": {"kind": "chart", **source}, "luminance": "100 cd/m2"})
    check(build(said, View(ROWS, COLUMNS, PITCH, PITCH), None))


@pytest.mark.parametrize("kind", ["lone", "line", "texture", "black"])
@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("channels", [1, 3])
def test_the_change_of_a_picture_is_within_its_bound(kind, samples, channels):
    """A lone sample, a column, noise, no light; of one to nine samples a pixel."""
    rng = np.random.default_rng(5)
    picture = np.full((ROWS * samples, COLUMNS * samples, channels), 0.01)
    if kind == "lone":
        picture[5, 7 * samples] = 1.0
    elif kind == "line":
        picture[:, 9 * samples] = 1.0
    elif kind == "texture":
        picture = rng.random(picture.shape)
    else:
        picture[:] = 0.0
    view = View(ROWS, COLUMNS, PITCH, PITCH)
    shown = image_scene(picture, (WHITE,) * channels, WHITE, view)
    check(shown)


@pytest.mark.parametrize("value", [0.0, 0.4])
def test_an_even_picture_changes_by_no_blur(value):
    """Not by one of which no bound is known either, as one that changes over the field."""
    shown = image_scene(
        np.full((ROWS, COLUMNS, 1), value), (WHITE,), WHITE, View(ROWS, COLUMNS, PITCH, PITCH)
    )
    over_field = replace(blur(1, 2), is_uniform=False)
    found = shown.change_bounds([over_field], sensor(ROWS, COLUMNS), math.inf, math.inf)
    assert found.changes == [0.0]
