"""What layers hide of each other beyond the product of their means, tile by tile."""

import numpy as np
import pytest
from layered_reference import changes, random_scene
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.image_formation.layers import edge_tiles, layer_covariance
from vcam_cli.image_formation.layers.occlusion import BlurredLayer, aperture_points, covariance

LARGE = {"array.rows": 150, "array.columns": 190}
"""So that there are some tiles, the last ones smaller than the others."""


def light(folder, more=LARGE) -> np.ndarray:
    """Mean electrons over white of three layers, two of them far out of focus."""
    scene = random_scene(np.random.default_rng(11), 3)
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "0.2 %"}
    frame = simulate(camera(folder, given | changes(scene, folder) | more)).frame
    return frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)


def test_tiles_give_the_light_of_the_whole_frame(tmp_path, monkeypatch):
    """Tiles see all that blurs into them, so that there is nothing to be seen of their borders."""
    tiled = light(tmp_path)
    monkeypatch.setattr(edge_tiles, "SIDE", 1000)
    whole = light(tmp_path)
    monkeypatch.setattr(layer_covariance, "SHARP", 1e9)
    without = light(tmp_path)
    assert np.abs(whole - without).max() > 0.02 * whole.max()
    # Left out are pixels whose cover is within half the tolerance of none or all.
    assert np.abs(tiled - whole).max() <= 0.001 * whole.max()


def test_tiles_without_an_edge_are_left_out():
    edges = np.zeros((150, 190), bool)
    edges[149, 0] = True
    tiles, size = edge_tiles.tiles_with(edges, 3.0, 4)
    assert size[0] % 4 == size[1] % 4 == 0
    assert [edges[tile].sum() for tile in tiles] == [1]
    edges[:] = True
    tiles, _ = edge_tiles.tiles_with(edges, 3.0, 4)
    seen = np.zeros(edges.shape, int)
    for tile in tiles:
        seen[tile] += 1
    assert (seen == 1).all()


def test_covariance_of_stripes_is_that_of_their_waves():
    """A wave of cover before a wave of light: the mean over the aperture in closed form.

    With cover (1 + cos k x) / 2 of radius r before light (1 + cos k x) / 2 of radius s, rays
    through u miss cos(k (x - r u)) cos(k (x - s u)) / 4. The part of it that does not vary with x
    is cos(k (r - s) u) / 8.
    """
    n, r, s = 64, 5.0, -3.0
    k = 2 * np.pi * 4 / n
    wave = np.broadcast_to((1 + np.cos(k * np.arange(n))) / 2, (n, n))
    front = BlurredLayer(np.stack([np.zeros((n, n)), wave]), r)
    back = BlurredLayer(np.stack([wave, np.ones((n, n))]), s)
    found = covariance([front, back], 8)[0].mean()
    u, _, weights = np.array(list(aperture_points(60))).T
    mean = [np.sum(weights * np.cos(k * radius * u)) for radius in (r - s, r, s)]
    assert found == pytest.approx(-(mean[0] - mean[1] * mean[2]) / 8, rel=1e-6)
