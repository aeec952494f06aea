"""What layers hide of each other beyond the product of their means, tile by tile."""

from dataclasses import replace

import numpy as np
import pytest
from layered_reference import FOCAL, PITCH, Flat, Scene, changes, random_scene, ray_sum, write_exr
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.image_formation.layers import edge_tiles, layer_covariance, tile_sample
from vcam_cli.image_formation.layers.occlusion import BlurredLayer, aperture_points, covariance

LARGE = {"array.rows": 150, "array.columns": 190}
"""So that there are some tiles, the last ones smaller than the others."""


def light(folder, more=LARGE, seed=11) -> np.ndarray:
    """Mean electrons over white of three layers, two of them far out of focus."""
    scene = random_scene(np.random.default_rng(seed), 3)
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


def test_a_strip_ends_where_a_tile_is_missing_and_with_its_row():
    edges = np.ones((150, 390), bool)
    every, _ = edge_tiles.tiles_with(edges, 3.0, 4)
    across = len({columns.start for _, columns in every})
    edges[every[2]] = False
    tiles, _ = edge_tiles.tiles_with(edges, 3.0, 4)
    strips = edge_tiles.adjacent(tiles)
    assert [tile for strip in strips for tile in strip] == tiles
    lengths = [len(strip) for strip in strips]
    assert lengths == [2, across - 3] + [across] * (len(every) // across - 1)
    assert max(lengths) < edge_tiles.IN_A_STRIP
    wide, _ = edge_tiles.tiles_with(np.ones((60, 2000), bool), 3.0, 4)
    lengths = [len(strip) for strip in edge_tiles.adjacent(wide)]
    assert sum(lengths) == len(wide) > max(lengths) == edge_tiles.IN_A_STRIP


def test_covariance_of_stripes_is_that_of_their_waves():
    """A wave of cover before a wave of light: the mean over the aperture in closed form.

    With cover (1 + cos k x) / 2 of radius r before light (1 + cos k x) / 2 of radius s, rays
    through u miss cos(k (x - r u)) cos(k (x - s u)) / 4. The part of it that does not vary with x
    is cos(k (r - s) u) / 8.
    """
    n, r, s = 64, 5.0, -3.0
    k = 2 * np.pi * 4 / n
    wave = np.broadcast_to((1 + np.cos(k * np.arange(n))) / 2, (n, n))
    front = BlurredLayer(np.stack([np.zeros((n, n)), wave]), (r, 0.0))
    back = BlurredLayer(np.stack([wave, np.ones((n, n))]), (s, 0.0))
    found = covariance([front, back], 8)[0].mean()
    u, _, weights = np.array(list(aperture_points(60))).T
    mean = [np.sum(weights * np.cos(k * radius * u)) for radius in (r - s, r, s)]
    assert found == pytest.approx(-(mean[0] - mean[1] * mean[2]) / 8, rel=1e-6)


def mesh_before_mesh(period: float, front: float, back: float) -> Scene:
    """Stripes of a period and with blurs of these radii [pixels], and the same behind them."""
    samples, pixels = 1360, 136
    place = (np.arange(samples) + 0.5) * pixels / samples
    stripes = np.broadcast_to(np.floor(place / (period / 2)) % 2, (samples, samples))
    stripes, none = stripes.astype(np.float32), np.zeros((samples, samples), np.float32)

    def layer(radius: float, light: np.ndarray, opacity: np.ndarray) -> Flat:
        distance = 1 / (1 + radius / 1.25)
        return Flat(distance, light, opacity, pixels * PITCH * distance * (1 / FOCAL - 1))

    return Scene((layer(front, none, stripes), layer(back, stripes, none + 1)), 1.0)


@pytest.mark.parametrize(
    ("period", "front", "back", "accuracy"),
    [
        (4, 14, 12, "draft"),
        pytest.param(4, 14, 12, "reference", marks=pytest.mark.long),
        pytest.param(4, 20, 19, "reference", marks=pytest.mark.long),
    ],
)
def test_detail_within_cells_is_not_missed(period, front, back, accuracy, tmp_path):
    """Much finer than the blur, and hidden by the same: in their means there is nothing of it.

    The product of the means is 0.25; cells as coarse as the blur would find nothing missing.
    """
    scene = mesh_before_mesh(period, front, back)
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET | {"diffraction": "off"}}
    given["accuracy"] = accuracy
    frame = simulate(camera(tmp_path, given | changes(scene, tmp_path))).frame
    found = frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)
    truth = ray_sum(scene, 3000, 2)
    assert truth.mean() < 0.22
    assert found.mean() == pytest.approx(truth.mean(), rel=0.04)
    error = np.sqrt(np.mean(np.square(found - truth))) / truth.max()
    assert error <= frame.spectrum.depth.error


def test_dim_layers_err_as_bright_ones(tmp_path):
    """Relative to their own full signal: opacity does not count as if white lay behind it."""
    scene = random_scene(np.random.default_rng(11), 3)
    dim = replace(scene, layers=tuple(replace(x, light=x.light * 0.02) for x in scene.layers))
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET}
    found = []
    for made in (scene, dim):
        frame = simulate(camera(tmp_path, given | changes(made, tmp_path))).frame
        found.append((frame.mean_electrons, frame.spectrum.depth.error))
    np.testing.assert_allclose(found[1][0], 0.02 * found[0][0], rtol=2e-4, atol=1e-3)
    assert found[1][1] == pytest.approx(found[0][1], rel=0.01)


def test_layers_in_a_corner_and_nothing_behind(tmp_path):
    """Light that diffraction throws far makes an edge where a tile sees no layer."""
    white = write_exr(tmp_path / "white.exr", np.ones((8, 8), np.float32))
    layers = []
    for distance in (0.5, 0.6):
        pixel = PITCH * distance * (1 / FOCAL - 1)
        layers.append(
            {
                "source": {"kind": "image", "file": white},
                "distance": f"{distance} m",
                "width": f"{20 * pixel} m",
                "position": [f"{-90 * pixel} m", f"{-90 * pixel} m"],
            }
        )
    given = {
        "scene.source": {"kind": "layers", "layers": layers},
        "scene.radiance": radiance_for(5000),
        "effects": QUIET,
        "accuracy": "reference",
        "array.rows": 200,
        "array.columns": 200,
        "optics": {"f_number": 8, "focal_length": "5 mm", "focus_distance": "1 m"},
    }
    frame = simulate(camera(tmp_path, given)).frame
    assert frame.mean_electrons[10, 10] > 100 * frame.mean_electrons[-10, -10]
    assert frame.spectrum.depth.rings > 0


def test_of_layers_that_move_nothing_is_added(tmp_path):
    """At rest they would hide other light of each other: what they do counts as an error."""
    scene = random_scene(np.random.default_rng(3), 2, sharp=False)
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET} | changes(scene, tmp_path)
    still = simulate(camera(tmp_path, given)).frame.spectrum.depth
    for layer in given["scene.source"]["layers"][:1]:
        layer["motion"] = {"x": "0.1 m/s"}
    moved = simulate(camera(tmp_path, given | {"exposure.time": "20 ms"})).frame.spectrum.depth
    assert still.rings > 0
    assert moved.rings == 0
    assert moved.error > 2 * still.error


def test_covariance_that_does_not_count_is_left_out_and_said(tmp_path, monkeypatch):
    """Of more tiles than are looked at: what is missing is within what is told of it."""
    scene = random_scene(np.random.default_rng(2), 3)
    more = {"array.rows": 300, "array.columns": 380, "scene.radiance": radiance_for(5000)}
    given = more | {"effects": QUIET, "accuracy": "standard"}
    made = camera(tmp_path, changes(scene, tmp_path) | given)
    every = simulate(made).frame
    monkeypatch.setattr(tile_sample, "MOST", 3)
    found = simulate(made).frame
    full = float(every.mean_electrons.max())
    missing = float(np.sqrt(np.mean(np.square(found.mean_electrons - every.mean_electrons)))) / full
    depth = found.spectrum.depth
    assert depth.rings == 0 < every.spectrum.depth.rings
    assert 0.1 * depth.left_out < missing <= depth.left_out <= depth.error <= 0.005
    assert every.spectrum.depth.left_out == 0


def test_covariance_that_counts_is_added_on_all_tiles(tmp_path, monkeypatch):
    """Some tiles tell that it does: the frame is that of which all tiles were looked at."""
    more = {"array.rows": 300, "array.columns": 380, "accuracy": "0.1 %"}
    by_all = light(tmp_path, more, 2)
    monkeypatch.setattr(tile_sample, "MOST", 3)
    by_some = light(tmp_path, more, 2)
    # Cells and rings may differ, both within the tolerance.
    assert np.sqrt(np.mean(np.square(by_some - by_all))) <= 0.001 * by_all.max()
    monkeypatch.setattr(layer_covariance, "SHARP", 1e9)
    assert np.abs(by_some - light(tmp_path, more, 2)).max() > 0.02 * by_all.max()


@pytest.mark.long
@pytest.mark.parametrize(("seed", "accuracy"), [(2, "0.1 %"), (5, "0.05 %"), (8, "0.05 %")])
def test_rings_that_a_sample_finds_sufficient(seed, accuracy, tmp_path, monkeypatch):
    """Fewer than a doubling asks for: the error is still what is told, against many more."""
    scene = random_scene(np.random.default_rng(seed), 3)
    more = {"array.rows": 300, "array.columns": 380, "scene.radiance": radiance_for(5000)}
    given = more | {"effects": QUIET, "accuracy": "0.01 %"}
    made = camera(tmp_path, changes(scene, tmp_path) | given)
    truth = simulate(made).frame
    monkeypatch.setattr(tile_sample, "MOST", 3)
    found = simulate(made.with_({"accuracy": accuracy})).frame
    assert found.spectrum.depth.rings == 3 < truth.spectrum.depth.rings
    error = np.sqrt(np.mean(np.square(found.mean_electrons - truth.mean_electrons)))
    told = found.spectrum.depth.error + truth.spectrum.depth.error
    assert error <= told * truth.mean_electrons.max()


def test_sample_of_tiles_tells_of_all_of_them():
    """Light of which a few tiles have most: its mean square and its error over many samples."""
    rng = np.random.default_rng(5)
    strength = rng.pareto(1.5, (12, 15))
    plane = np.kron(strength, np.ones((8, 8))) * rng.standard_normal((96, 120))
    tiles, _ = edge_tiles.tiles_with(np.ones(plane.shape, bool), 0.0, 8)
    small = [
        (slice(row, row + 8), slice(column, column + 8))
        for row in range(0, 96, 8)
        for column in range(0, 120, 8)
    ]
    assert len(tiles) < tile_sample.MOST < len(small)
    truth = float(np.sqrt(np.square(plane).mean()))
    whole = tile_sample.telling_tiles(tiles, np.abs(plane))
    of_all = whole.rms([plane[None][:, *tile] for tile in whole.tiles])
    assert of_all == pytest.approx(truth, rel=1e-12)
    assert whole.drawn == 0 == whole.chance_error([plane[None][:, *tile] for tile in tiles])
    squares, within = [], 0
    for seed in range(200):
        seen = np.abs(plane) * np.random.default_rng(seed).uniform(0.2, 1.0, plane.shape)
        sample = tile_sample.telling_tiles(small, seen)
        light = [plane[None][:, *tile] for tile in sample.tiles]
        squares.append(sample.rms(light) ** 2)
        within += truth**2 <= squares[-1] * (1 + 2 * sample.chance_error(light))
    # Means of 200 samples of 16 tiles, of which each tells to some tenths.
    assert np.mean(squares) == pytest.approx(truth**2, rel=0.05)
    assert within >= 180
