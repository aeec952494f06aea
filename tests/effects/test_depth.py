"""Depth against sums over rays and over points of the pupil, and against closed forms."""

import math

import numpy as np
import pytest
from layered_reference import (
    F_NUMBER,
    FOCAL,
    PITCH,
    SIDE,
    Flat,
    Scene,
    changes,
    composed,
    pupil_sum,
    random_scene,
    ray_sum,
)
from making import QUIET, camera, radiance_for
from scipy.special import j1

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.errors import BadInput
from vcam_cli.simulation import checks
from vcam_cli.simulation.simulate import prepare

STILL = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "0.2 %"}
RAYS = {"effects": QUIET | {"diffraction": "off"}}
WAVELENGTH = 550e-9
CLOSE = 2e-3
"""Of full signal, rms: what a picture may differ from the sum over rays."""
FEW = 1e-3
"""Of full signal, rms: what sums over few points err."""
LENS = {"f_number": 2, "focal_length": "5 mm", "transmittance": 1, "off_axis": "none"}


def seen(folder, *given: dict):
    """The picture of a camera relative to white, and its frame."""
    merged = dict(STILL)
    for one in given:
        merged |= one
    frame = simulate(camera(folder, merged)).frame
    return frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time), frame


def error(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(found - truth))) / truth.max())


def check(scene: Scene, truth: np.ndarray, folder, *more: dict, unsure: float = 0.0) -> None:
    """`unsure` is what the truth errs itself, of full signal."""
    found, frame = seen(folder, changes(scene, folder), *more)
    assert frame.spectrum.depth.error <= CLOSE
    assert error(found, truth) <= frame.spectrum.depth.error + unsure


@pytest.mark.parametrize(("seed", "sharp"), [(1, True), (3, False)])
def test_layers_are_a_sum_over_rays(seed, sharp, tmp_path):
    """One of two in focus, or none."""
    scene = random_scene(np.random.default_rng(seed), 2, sharp)
    check(scene, ray_sum(scene, 700, 3), tmp_path, RAYS, unsure=FEW)


def test_photodetectors_that_do_not_fill_their_pixels(tmp_path):
    scene = random_scene(np.random.default_rng(2), 3, sharp=True)
    small = {"pixel.photodetector.fill_factor": 0.36}
    check(scene, ray_sum(scene, 700, 3, 0.6), tmp_path, RAYS, small, unsure=FEW)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(100, 140))
def test_forty_scenes_are_sums_over_rays(seed, tmp_path):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, 2 + seed % 3, bool(seed % 2))
    check(scene, ray_sum(scene), tmp_path, RAYS)


def test_layers_are_a_sum_over_points_of_the_pupil(tmp_path):
    scene = random_scene(np.random.default_rng(5), 2)
    check(scene, pupil_sum(scene, WAVELENGTH, 350, 4), tmp_path, unsure=FEW)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(200, 240))
def test_forty_scenes_are_sums_over_points_of_the_pupil(seed, tmp_path):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, 2 + seed % 3, bool(seed % 2))
    check(scene, pupil_sum(scene, WAVELENGTH), tmp_path)


@pytest.mark.long
def test_the_error_is_no_more_than_was_promised(tmp_path):
    """Of layers on both sides of the focus, at every preset; full signal is their brightest."""
    scene = random_scene(np.random.default_rng(0), 3)
    truth = ray_sum(scene)
    for name, tolerance in (("draft", 0.02), ("standard", 0.005)):
        found, frame = seen(tmp_path, changes(scene, tmp_path), RAYS, {"accuracy": name})
        predicted = frame.spectrum.depth.error
        assert error(found, truth) <= predicted <= tolerance


@pytest.mark.parametrize("distance", [0.3, 0.5, 3.0])
def test_a_flat_scene_out_of_focus_keeps_what_a_disc_leaves(distance, tmp_path):
    """Contrast 2 J1(z) / z of rays, z = pi f A v |1/d - 1/s|: the blur's radius within 0.5 %."""
    focus, frequency = 1.0, 10e3
    image = 1 / (1 / FOCAL - 1 / focus)
    radius = FOCAL / F_NUMBER / 2 * image * abs(1 / distance - 1 / focus)
    source = {"kind": "chart", "chart": "sinusoid", "frequency": "10 lp/mm", "contrast": 1}
    given = {
        "scene.source": source,
        "scene.distance": f"{distance} m",
        "optics": LENS | {"focus_distance": f"{focus} m"},
        "pixel.photodetector.fill_factor": 1,
        "accuracy": "reference",
    }
    found, _ = seen(tmp_path, given, RAYS)
    x = (np.arange(found.shape[1]) + 0.5 - found.shape[1] / 2) * PITCH
    wave = np.cos(2 * np.pi * frequency * x)
    columns = np.stack([wave, np.ones_like(wave)], axis=1)
    kept, _ = np.linalg.lstsq(columns, found.mean(axis=0), rcond=None)[0]
    kept /= 0.5 * np.sinc(frequency * PITCH)
    # Within 0.5 % of the radius: the contrast lies between those of radii so far apart.
    ends = [2 * j1(z) / z for z in 2 * np.pi * frequency * radius * np.array([0.995, 1.005])]
    assert min(ends) <= kept <= max(ends)


def test_what_is_further_looks_smaller(tmp_path):
    """A black square on white, twice as far away: half as wide, by its mean."""
    widths = []
    for distance in (1.0, 2.0):
        dark = np.zeros((8, 8), np.float32)
        back = Flat(50.0, np.ones((8, 8), np.float32), np.ones((8, 8)), None)
        scene = Scene((Flat(distance, dark, np.ones((8, 8)), 0.012), back), distance)
        found, _ = seen(tmp_path, changes(scene, tmp_path))
        widths.append(math.sqrt((1 - found).sum()) * PITCH)
        scale = scene.image_distance / distance
        assert widths[-1] == pytest.approx(0.012 * scale, rel=2e-3)


def test_one_layer_that_fills_the_frame_is_the_flat_scene(tmp_path):
    source = {"kind": "chart", "chart": "slanted-edge"}
    flat = {"scene.source": source, "scene.distance": "0.5 m"}
    layer = {
        "scene.source": {"kind": "layers", "layers": [{"source": source, "distance": "0.5 m"}]}
    }
    optics = {"optics": LENS | {"focus_distance": "1 m"}}
    one, other = (seen(tmp_path, given, optics)[0] for given in (flat, layer))
    assert one.tobytes() == other.tobytes()


def test_without_depth_all_layers_are_sharp(tmp_path):
    """The picture of a pinhole, by means over points in the pixels."""
    scene, fine = random_scene(np.random.default_rng(1), 2), 32
    off = {"effects": QUIET | {"diffraction": "off", "depth": "off"}}
    found, frame = seen(tmp_path, changes(scene, tmp_path), off)
    at = ((np.arange(SIDE * fine) + 0.5) / fine - SIDE / 2) * PITCH
    truth = composed(scene, at, at, 0, 0).reshape(SIDE, fine, SIDE, fine).mean(axis=(1, 3))
    assert frame.spectrum.depth is None
    assert error(found, truth) <= CLOSE


@pytest.mark.long
def test_light_from_beyond_the_frame_counts(tmp_path):
    """A bright layer beside the array, out of focus, lights its border."""
    white, black = np.ones((8, 8), np.float32), np.zeros((8, 8), np.float32)
    distance, focus = 0.3, 1.0
    scale = 1 / (1 / FOCAL - 1 / focus) / distance
    place = (SIDE * PITCH / scale, 0.0)
    beside = Flat(distance, white, np.ones((8, 8)), SIDE * PITCH / scale, place)
    scene = Scene((beside, Flat(2.0, black, np.ones((8, 8)), None)), focus)
    found, _ = seen(tmp_path, changes(scene, tmp_path), RAYS)
    truth = ray_sum(scene, 400)
    assert truth[SIDE // 2, -1] > 0.2
    assert found == pytest.approx(truth, abs=0.01)


def test_the_plan_says_how_far_layers_are_out_of_focus(tmp_path):
    scene = random_scene(np.random.default_rng(1), 2)
    ready, notes = prepare(camera(tmp_path, STILL | RAYS | changes(scene, tmp_path)))
    [depth] = [d for d in ready.plan.decisions if d.name == "depth"]
    widths = [2 * abs(scene.blur_radius(layer)) / PITCH for layer in scene.layers]
    assert depth.state == "on"
    assert " and ".join(f"{width:.3g}" for width in widths) in depth.reason
    assert any("layers" in note and "full signal" in note for note in notes)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ({"layers": []}, "no list of layers"),
        ({"layers": [{"source": {"kind": "chart", "chart": "uniform"}}]}, "distance"),
        (
            {
                "layers": [
                    {"source": {"kind": "chart", "chart": "uniform"}, "distance": "2 m"},
                    {"source": {"kind": "chart", "chart": "uniform"}, "distance": "1 m"},
                ]
            },
            "nearer than the layer before",
        ),
        (
            {
                "layers": [
                    {
                        "source": {"kind": "chart", "chart": "uniform"},
                        "distance": "2 m",
                        "position": ["1 m", "0 m"],
                    }
                ]
            },
            "fills the frame",
        ),
    ],
)
def test_layers_that_cannot_be_are_refused(source, said, tmp_path):
    with pytest.raises(BadInput, match=said):
        camera(tmp_path, {"scene.source": {"kind": "layers"} | source})


def test_a_layer_within_the_focal_length_is_refused(tmp_path):
    near = {"source": {"kind": "chart", "chart": "uniform"}, "distance": "4 mm"}
    made = camera(tmp_path, {"scene.source": {"kind": "layers", "layers": [near]}})
    with pytest.raises(BadInput, match="focal length"):
        checks.check_layers(made)


def test_the_focus_is_at_the_scene_unless_it_is_given(tmp_path):
    near = geometry(camera(tmp_path, {"scene.distance": "0.5 m"}))
    far = geometry(
        camera(tmp_path, {"scene.distance": "0.5 m", "optics": LENS | {"focus_distance": "2 m"}})
    )
    assert near.focus_shift == 0
    assert near.scene_scale == -near.magnification
    assert far.scene_scale == pytest.approx(far.image_distance / 0.5)
    assert far.focus_shift == pytest.approx(far.image_distance**2 * (1 / 0.5 - 1 / 2))


@pytest.mark.parametrize(
    "pattern",
    [
        pytest.param("bayer-grbg", marks=pytest.mark.long),
        {"block": [["B", "R", "G"], ["R", "G", "G"], ["G", "B", "R"]]},
    ],
)
def test_a_mosaic_has_what_pixels_of_all_colors_have_of_its_own(pattern, tmp_path):
    """Layers are composed in each pixel's own color, wherever their windows begin."""
    places = ("0.3 m", 0.009, (1, -2)), ("0.4 m", 0.012, (4, 1)), ("1 m", None, None)
    layers: list[dict] = []
    for distance, width, place in places:
        layers.append({"source": {"kind": "chart", "chart": "colorchecker"}, "distance": distance})
        if width is not None:
            position = [f"{n / 5} mm" for n in place]
            layers[-1] |= {"width": f"{width} m", "position": position}
    made = {
        "scene.source": {"kind": "layers", "layers": layers},
        "scene.illuminant": "equal-energy",
        "optics": LENS | {"focus_distance": "0.5 m"},
        "array.rows": 71,
        "array.columns": 96,
        "array.filters": "generic-rgb",
    }
    every, alike = seen(tmp_path, RAYS, made, {"array.pattern": "stacked"})
    found, frame = seen(tmp_path, RAYS, made, {"array.pattern": pattern})
    colors = frame.mosaic.color_at(np.arange(71), np.arange(96))
    own = np.take_along_axis(every, colors[None], 0)[0] * (
        alike.white_rate[0] / frame.white_rate[0]
    )
    assert error(found, own) <= frame.spectrum.depth.error + alike.spectrum.depth.error
    for color in range(3):
        other = np.where(colors == color, every[(color + 1) % 3], own)
        assert error(other, own) > 5 * CLOSE  # colors differ
