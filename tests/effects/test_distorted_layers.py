"""Layers through lenses that distort, against sums over rays that look back through the lens.

A ray through the point (u, v) of the aperture that lands at x sees the place of a layer that the
lens images to x + blur (u, v): nothing here is shared with the package.
"""

import numpy as np
import pytest
from layered_reference import (
    PITCH,
    SIDE,
    Flat,
    Scene,
    changes,
    filling,
    random_scene,
    source,
    write_exr,
)
from making import QUIET, camera, radiance_for
from test_depth import FEW, RAYS, error, seen

from vcam_cli import load, simulate
from vcam_cli.errors import BadInput

FEWER = ("array.rows=24", "array.columns=32", "quality=[]")
"""A table-top on few pixels."""


def undistorted(z: np.ndarray, k1: float, focal: float) -> np.ndarray:
    """Where x (1 + k1 (r / focal)^2) images from: x + i y [m]."""
    bent, part = k1 / focal**2 * (z.real**2 + z.imag**2), 1.0
    for _ in range(4):  # Newton, of part (1 + bent part^2) = 1
        square = bent * part**2
        part = (1 + 2 * square * part) / (1 + 3 * square)
    return z * part


def covered(k1: float, focal: float) -> float:
    """How many times the array's width a layer has that fills the frame."""
    half = SIDE * PITCH / 2
    ends = undistorted(np.array([half, half * (1 + 1j)]), k1, focal)
    return float(ends.real.max() / half)


def look(picture: np.ndarray, size, z: np.ndarray, mirrored: bool) -> np.ndarray:
    """Samples of a picture at places x + i y [m], 0 beside it or mirrored."""
    width, height, cx, cy = size
    index, lit = [], np.ones(z.shape, bool)
    for place, count, length in (
        (z.imag - cy, picture.shape[0], height),
        (z.real - cx, picture.shape[1], width),
    ):
        own = np.floor(place / length * count + count / 2).astype(int)
        if mirrored:
            own = own % (2 * count)
            own = np.where(own < count, own, 2 * count - 1 - own)
        lit &= (own >= 0) & (own < count)
        index.append(np.clip(own, 0, count - 1))
    return picture[tuple(index)] * lit


def size_of(scene: Scene, layer: Flat, fills: float) -> tuple[float, ...]:
    """Width, height and center of a layer's undistorted image [m]."""
    width, height, *center = scene.size(layer)
    grown = fills if layer.width is None else 1.0
    return (grown * width, grown * height, *center)


def ray_sum(
    scene: Scene, k1: float, scale: float = 1.0, rays: int = 300, inside: int = 3, fills=None
):
    """Light (SIDE, SIDE) over white; `scale` is the magnification of lateral color.

    `fills` is the width of a layer that fills the frame, over the array's.
    """
    k = np.arange(rays) + 0.5
    radius, angle = np.sqrt(k / rays), np.pi * (1 + 5**0.5) * k
    jitter = (k[:, None] * np.array([0.8191725133961645, 0.6710436067037893])) % 1
    fills = fills or covered(k1, scene.image_distance)
    total = np.zeros((SIDE, SIDE))
    for p, (jx, jy) in zip(radius * np.exp(1j * angle), jitter, strict=True):
        x, y = (((np.arange(SIDE * inside) + j) / inside - SIDE / 2) * PITCH for j in (jx, jy))
        lands, light, clear = x + 1j * y[:, None], 0.0, 1.0
        for layer in scene.layers:
            z = lands + scene.blur_radius(layer) * p
            z = undistorted(z / scale, k1, scene.image_distance)
            size = size_of(scene, layer, fills)
            cover = look(layer.opacity, size, z, layer.width is None)
            light = light + clear * cover * look(layer.light, size, z, mirrored=True)
            clear = clear * (1 - cover)
        total += light.reshape(SIDE, inside, SIDE, inside).mean(axis=(1, 3))
    return total / rays


@pytest.mark.parametrize(("seed", "sharp", "k1"), [(1, True, -150.0), (3, False, 100.0)])
def test_layers_through_a_lens_that_distorts_are_a_sum_over_rays(seed, sharp, k1, tmp_path):
    """Barrel and pincushion of 10 % and 4 % in the corner; one of two in focus, or none."""
    scene = random_scene(np.random.default_rng(seed), 2, sharp)
    lens = {"optics.distortion": {"k1": k1}}
    given = changes(scene, tmp_path)
    found, frame = seen(tmp_path, given | lens, RAYS)
    truth = ray_sum(scene, k1)
    promised = frame.spectrum.depth.error
    assert promised <= 2e-3
    assert error(found, truth) <= promised + FEW
    straight, plain = seen(tmp_path, given, RAYS)
    assert error(straight, truth) > 2 * (promised + FEW)
    costs = [(own.warped_cells, own.cells) for *_, own in frame.spectrum.parts]
    assert max(costs) > (0, 0)
    assert all(warped == cells for warped, cells in costs)
    assert not any(own.warped_cells for *_, own in plain.spectrum.parts)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(400, 420))
def test_twenty_scenes_through_lenses_are_sums_over_rays(seed, tmp_path):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, 2 + seed % 3, bool(seed % 2))
    k1 = float(rng.uniform(-150, 100))
    given = changes(scene, tmp_path) | {"optics.distortion": {"k1": k1}}
    found, frame = seen(tmp_path, given, RAYS)
    assert error(found, ray_sum(scene, k1, rays=1500)) <= frame.spectrum.depth.error + FEW / 2


def test_lateral_color_magnifies_layers(tmp_path):
    scene = random_scene(np.random.default_rng(1), 2, True)
    color = {"optics.lateral_color": {"table": {500: "2 %", 550: "4 %"}}}
    found, frame = seen(tmp_path, changes(scene, tmp_path) | color, RAYS)
    # the frame is what the least magnified color of the table shows of the array
    truth = ray_sum(scene, 0.0, 1.04, fills=1 / 1.02)
    assert error(found, truth) <= frame.spectrum.depth.error + FEW


def test_ideal_and_depth_of_layers_are_distorted_as_the_raw_frame_is(tmp_path):
    """A bright checkerboard of openings before something dark, by the place in the scene."""
    k1, focus, distances = -150.0, 1.0, (0.4, 1.0)
    squares = (np.add.outer(np.arange(12), np.arange(12)) % 2).astype(np.float32)
    wide = 1.3 * filling(focus, distances[0])
    near = Flat(distances[0], np.full((12, 12), 0.9, np.float32), squares, wide)
    far = Flat(distances[1], np.full((8, 8), 0.2, np.float32), np.ones((8, 8)), None)
    scene = Scene((near, far), focus)
    lens = {"optics.distortion": {"k1": k1}}
    _, frame = seen(tmp_path, changes(scene, tmp_path) | lens, RAYS)
    at = (np.arange(SIDE) - (SIDE - 1) / 2) * PITCH
    straight = at + 1j * at[:, None]
    seen_from = undistorted(straight, k1, scene.image_distance)
    hides, flat = (look(near.opacity, scene.size(near), z, False) for z in (seen_from, straight))
    # between points a quarter of a pixel apart or less the picture is straight
    around = 0.25 * PITCH * np.array([1, 1j, 1 + 1j, 1 - 1j, -1, -1j, -1 - 1j, -1 + 1j])
    sure = [look(near.opacity, scene.size(near), seen_from + at, False) == hides for at in around]
    clear = np.all(sure, axis=0)
    assert clear.mean() > 0.6
    depth = frame.depth()
    assert (depth == np.where(hides, *distances))[clear].all()
    assert (depth != np.where(flat, *distances))[clear].mean() > 0.03
    ideal = (frame.ideal_dn()[0] - frame.black_dn) / (frame.white_dn[0] - frame.black_dn)
    np.testing.assert_allclose(ideal[clear], np.where(hides, 0.9, 0.2)[clear], atol=1e-4)


REFUSED = {
    "motion": ({"scene.camera_motion": {"pan": "1 deg/s"}}, "layers in motion"),
    "map": ({"scene.source": "depth"}, "map of depth"),
    "map and color": (
        {
            "scene.source": "depth",
            "optics.distortion": "none",
            "optics.lateral_color": {"table": {550: "1 %"}},
        },
        "optics.lateral_color: a map of depth",
    ),
    "prescription": (
        {"optics": {"prescription": {"use": "double-gauss", "scale": 0.1, "f_number": 8}}},
        "images flat scenes",
    ),
}


@pytest.mark.parametrize(("change", "said"), REFUSED.values(), ids=REFUSED)
def test_what_a_lens_that_distorts_does_not_image_is_refused(change, said, tmp_path):
    scene = random_scene(np.random.default_rng(1), 2)
    given = {"scene.radiance": radiance_for(5000), "scene.source": source(scene, tmp_path)}
    given |= {"optics.distortion": {"k1": -10}} | change
    if change.get("scene.source") == "depth":
        names = [
            write_exr(tmp_path / f"{name}.exr", np.full((8, 8), value))
            for name, value in (("light", 0.5), ("distances", 1.0))
        ]
        given["scene.source"] = {"kind": "image", "file": names[0], "depth": names[1]}
    if "optics" in change:
        del given["optics.distortion"]
    with pytest.raises(BadInput, match=said):
        camera(tmp_path, given)


@pytest.mark.long
def test_a_flat_layer_is_the_picture_itself(tmp_path):
    """A single layer that fills the frame, and the same behind another that is beside the array."""
    scene = random_scene(np.random.default_rng(2), 2)
    far = scene.layers[-1]
    beside = Flat(
        far.distance * 0.9, far.light, np.ones(far.light.shape), 0.001, (far.distance, 0.0)
    )
    lens = {"optics.distortion": {"k1": -100}, "scene.radiance": radiance_for(5000)}
    lens |= {"effects": QUIET, "accuracy": "0.2 %"}
    one, two = (
        simulate(camera(tmp_path, changes(own, tmp_path) | lens)).mean_electrons.astype(float)
        for own in (Scene((far,), scene.focus), Scene((beside, far), scene.focus))
    )
    assert np.sqrt(np.mean((one - two) ** 2)) <= 2e-3 * one.max()


@pytest.mark.long
def test_layers_seen_through_a_map_cost_the_cells_that_are_painted():
    """Each cell of each layer, whatever its planes; without a lens that distorts none."""
    for lens, painted in (["optics.distortion={k1: -0.1}"], True), ([], False):
        spectrum = simulate(load("table-top", [*lens, *FEWER])).frame.spectrum
        parts = [own for *_, own in spectrum.parts]
        assert len(parts) == (4 if painted else 3)  # one lies beside so small an array
        for own in parts:
            assert own.warped_cells == (own.cells if painted else 0)
            assert own.cells > 0 or not painted
