"""What layers hide of each other beyond the product of their means, ray by ray around edges."""

from dataclasses import replace

import numpy as np
import pytest
from every import every
from layered_reference import FOCAL, PITCH, Flat, Scene, changes, random_scene, ray_sum, write_exr
from making import QUIET, camera, long_except, radiance_for
from optical_paths import PITCH as PIXEL_PITCH
from optical_paths import aperture, path, sensor

from vcam_cli import simulate
from vcam_cli.camera.derived.mosaic import BLOCKS, Mosaic
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.estimates import chart_cells, scene_sampling
from vcam_cli.image_formation.layers import layered, ray_windows
from vcam_cli.image_formation.layers.gathering import Pixels
from vcam_cli.image_formation.layers.occlusion import RayLayer, covariance, rays
from vcam_cli.image_formation.layers.ray_cells import Cells, SharpImage, Window
from vcam_cli.image_formation.layers.ray_windows import LEVELS, _Sum, _too_coarse, windows_with
from vcam_cli.image_formation.optical_path import LayerOptics
from vcam_cli.physics import zernike
from vcam_cli.physics.aberration import otf_ratio_symmetric
from vcam_cli.physics.diffraction import otf_circular
from vcam_cli.physics.opening import Opening
from vcam_cli.scenes.cells import window_extremes

LARGE = {"array.rows": 150, "array.columns": 190}
"""So that there are some windows."""
RAYS_ALONE = QUIET | {"diffraction": "off"}
_COMPOSED = layered._composed


def light(folder, more=LARGE, seed=11) -> np.ndarray:
    """Mean electrons over white of three layers, two of them far out of focus."""
    scene = random_scene(np.random.default_rng(seed), 3)
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "0.2 %"}
    frame = simulate(camera(folder, given | changes(scene, folder) | more)).frame
    return frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)


def test_windows_give_the_light_of_the_whole_frame(tmp_path, monkeypatch):
    """Windows see all that blurs into them: their borders are not seen."""
    apart = light(tmp_path)
    monkeypatch.setattr(ray_windows, "SIDE", 1000)
    whole = light(tmp_path)
    assert np.sqrt(np.mean(np.square(apart - whole))) <= 0.001 * whole.max()


def test_windows_are_what_a_bound_does_not_allow_to_be_left_out():
    bound = np.zeros((100, 130))
    bound[40:60, 20:90] = 1.0
    bound[99, 129] = 0.1
    windows, left_out = windows_with(bound, 0.01)
    covered = np.zeros(bound.shape, int)
    for window in windows:
        covered[window.rows, window.columns] += 1
    assert covered.max() == 1
    assert covered[bound == 1].all()
    assert covered[99, 129] == 0
    assert left_out == pytest.approx(0.1 / np.sqrt(bound.size))
    assert not windows_with(np.zeros((5, 7)), 0.0)[0]


def test_windows_are_refined_that_err_most_for_their_cost():
    def summed(error: float, values: int) -> _Sum:
        nowhere = Window(slice(0, 0), slice(0, 0))
        return _Sum(nowhere, 1, np.zeros((1, 0, 0)), error, values)

    dear, cheap, good = summed(3.0, 900), summed(2.0, 100), summed(0.5, 100)
    assert not _too_coarse([dear, cheap, good], 5.5, len(LEVELS))
    assert _too_coarse([dear, cheap, good], 5.0, len(LEVELS)) == [cheap]
    assert len(_too_coarse([dear, cheap, good], 1.0, len(LEVELS))) == 3


def test_sets_of_rays_share_neither_radii_nor_angles():
    one, other = rays(40, 0), rays(64, 1)
    for rows in (one, other):
        assert np.hypot(rows[:, 0], rows[:, 1]).max() < 1
        assert rows[:, :2].mean(axis=0) == pytest.approx(0, abs=0.03)
    apart = np.abs(one[:, None, :2] - other[None, :, :2]).max(axis=2)
    assert apart.min() > 1e-4


def test_covariance_of_stripes_is_that_of_their_waves():
    """A wave of cover before a wave of light: the mean over the aperture in closed form.

    With cover (1 + cos k x) / 2 of radius r before light (1 + cos k x) / 2 of radius s, rays
    through u miss cos(k (x - r u)) cos(k (x - s u)) / 4. The part of it that does not vary with x
    is cos(k (r - s) u) / 8.
    """
    n, r, s, reach = 256, 40.0, -24.0, 64
    inner = n - 2 * reach
    k = 2 * np.pi / 32
    wave = np.broadcast_to((1 + np.cos(k * np.arange(n))) / 2, (n, n))
    front = RayLayer(np.stack([np.zeros((n, n)), wave]), (r, 0.0))
    back = RayLayer(np.stack([wave, np.ones((n, n))]), (s, 0.0))

    def means(sums):
        ((own, light, cover),) = sums
        return light / len(own), cover[:, None] / len(own)

    def met(offsets):
        places = reach + np.floor(offsets).astype(int)
        return [(slice(y, y + inner), slice(x, x + inner)) for x, y in places.tolist()]

    rays_of_one = [rays(4000, 0)]
    found = covariance([front, back], rays_of_one, (inner, inner), met, means)[0].mean()
    u = rays(60_000, 1)[:, 0]
    mean = [np.cos(k * radius * u).mean() for radius in (r - s, r, s)]
    assert found == pytest.approx(-(mean[0] - mean[1] * mean[2]) / 8, abs=2e-4)


@pytest.mark.parametrize("kind", long_except(["rectangle"], ["rectangle", "half", "ramp"]))
def test_layers_out_of_focus_before_bars(kind, tmp_path):
    """Both out of focus: periodic backgrounds once fooled rings of points that agreed."""
    n = 16
    mask = {
        "rectangle": np.ones((n, n)),
        "half": np.full((n, n), 0.5),
        "ramp": np.broadcast_to((np.arange(n) + 0.5) / n, (n, n)),
    }[kind].astype(np.float32)
    bars = np.broadcast_to(np.arange(64) // 4 % 2, (64, 64)).astype(np.float32)
    scene = Scene(
        (
            Flat(0.45, np.full((n, n), 0.2, np.float32), mask, 0.012),
            Flat(0.7, bars, np.ones((64, 64), np.float32), None),
        ),
        1.0,
    )
    truth = ray_sum(scene, 1600, 6)

    def check(accuracy, tolerance):
        given = {"scene.radiance": radiance_for(5000), "effects": RAYS_ALONE, "accuracy": accuracy}
        frame = simulate(camera(tmp_path, given | changes(scene, tmp_path))).frame
        found = frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)
        error = np.sqrt(np.mean(np.square(found - truth))) / truth.max()
        assert error <= min(frame.spectrum.depth.error + 5e-4, tolerance)

    every([("draft", 0.02), ("standard", 0.005)], check)


@pytest.mark.long
def test_a_tighter_accuracy_is_never_worse(tmp_path):
    scene = random_scene(np.random.default_rng(4), 3)
    truth = ray_sum(scene, 3000, 4)
    given = {"scene.radiance": radiance_for(5000), "effects": RAYS_ALONE}
    made, errors = camera(tmp_path, given | changes(scene, tmp_path)), []
    for tolerance in (0.02, 0.005, 0.002):
        frame = simulate(made.with_({"accuracy": tolerance})).frame
        found = frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)
        errors.append(np.sqrt(np.mean(np.square(found - truth))) / truth.max())
        assert errors[-1] <= tolerance
    for tight, loose in zip(errors[1:], errors, strict=False):
        assert tight <= loose + 3e-4  # which the truth errs


@pytest.mark.parametrize("period", long_except([8, 32], [8, 16, 32]))
@pytest.mark.parametrize("angle", [0.0, np.pi / 2])
@pytest.mark.parametrize(("rings", "sectors", "error"), [(4, 8, 8e-3), (8, 16, 4e-3)])
def test_waves_diffract_from_rays_between_pairs_of_points(period, angle, rings, sectors, error):
    """A wave out of focus, each ray moved by its own blur, against the pupil's exact OTF.

    Rays of a part of the pupil diffract alike: four times as many parts halve the error, at least.
    """
    radius, per_pixel, lens = 2e-6, 4, Diffraction(4.0, 0.0)
    g = sensor(16, 16)
    layer = LayerOptics((lens,), radius)
    sharp = SharpImage(replace(path(g, lens, aperture(g)), layers=(layer,)))
    cells = Cells(g, Window(slice(0, 16), slice(0, 16)), per_pixel, (0, 0), (0, 0), single=False)
    cell = PIXEL_PITCH / per_pixel
    at = (np.arange(64) + 0.5) / period
    x, y = (at[None, :], 0) if angle == 0 else (0, at[:, None])
    groups = []
    for own in sharp.groups(rays(4000, 0), rings, sectors):
        moved = (own[:, 0] if angle == 0 else own[:, 1]) * radius / cell / period
        wave = sum(np.cos(2 * np.pi * (x + y + by)) for by in moved)
        wave = np.broadcast_to(wave, (64, 64))
        groups.append((own, wave[None, None], wave[None]))
    light, cover = sharp.at_pixels(cells, len(groups), groups)
    frequency = np.array(1 / (period * cell))
    terms = zernike.defocus(2 * 4.0 * radius, 4.0)
    otf = otf_circular(frequency, 550e-9, 4.0, 0.0)
    otf = otf * otf_ratio_symmetric(frequency, 550e-9, 4.0, terms)
    middles = (np.arange(16) + 0.5) * per_pixel / period
    box = np.sinc(per_pixel / period) / np.sinc(1 / period)  # of even cells
    expected = otf * box * np.cos(2 * np.pi * middles)
    expected = np.broadcast_to(expected if angle == 0 else expected[:, None], (16, 16))
    np.testing.assert_allclose(light[0, 0], expected, atol=error)
    np.testing.assert_allclose(cover[0, 0], expected, atol=error)


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (9, 17), (40, 1)])
def test_extremes_are_those_of_every_window(size):
    plane = np.random.default_rng(1).random((40, 50))
    windows = np.lib.stride_tricks.sliding_window_view(plane, size)
    for larger, expected in ((np.maximum, windows.max((2, 3))), (np.minimum, windows.min((2, 3)))):
        np.testing.assert_array_equal(window_extremes(larger, plane, size), expected)


def test_pixels_of_a_window_take_their_own_color():
    mosaic = Mosaic((("B", "R", "G"), ("R", "G", "G")))
    whole = replace(path(sensor(16, 16), colors=mosaic), is_mosaic=True)
    image = np.random.default_rng(3).random((3, 5, 6))
    found = Pixels(whole, Window(slice(3, 8), slice(5, 11))).own(image)
    colors = mosaic.color_at(np.arange(3, 8), np.arange(5, 11))
    np.testing.assert_array_equal(found, np.take_along_axis(image, colors[None], 0))


@pytest.mark.parametrize("divided", [(1.0, 1.0), (0.6, 1.0), (0.3, 0.85)])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.4, 2.7), (-3.3, 5.1), (1.6, -4.9)])
def test_rays_meet_the_cells_that_they_lie_in(divided, offset):
    """Cells divide photodetectors, or whole pixels: also where gaps lie between them."""
    g, count = sensor(16, 16), 3
    cells = Cells(g, Window(slice(2, 7), slice(5, 9)), count, (0, 0), (10, 10), divided=divided)
    (indices,) = cells.met(np.array([offset]))
    for axis, (pixels, index) in enumerate(zip(((5, 9), (2, 7)), indices[::-1], strict=True)):
        edges, side = cells.edges()[axis], cells.sides[axis]
        middle = (np.arange(*pixels) - 7.5) * PIXEL_PITCH
        first = middle - PIXEL_PITCH * divided[axis] / 2
        place = (first[:, None] + (np.arange(count) + offset[axis]) * side).ravel()
        index = np.arange(len(edges) - 1)[index].ravel()
        rounding = 1e-6 * PIXEL_PITCH
        assert (edges[index] <= place + rounding).all()
        assert (place < edges[index + 1] + rounding).all()
        assert np.diff(edges).max() <= PIXEL_PITCH / count + rounding


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


def stripes_by_rays(scene: Scene, pixels: int = 4) -> np.ndarray:
    """Light over a period of stripes, whose mean over the aperture is a sum along x alone.

    The part of the aperture at u is as high as a chord; 400 points are taken within each pixel.
    """
    angle = ((np.arange(8001) + 0.5) / 8001 - 0.5) * np.pi
    u, weight = np.sin(angle), np.cos(angle) ** 2 / np.square(np.cos(angle)).sum()
    x = ((np.arange(pixels * 400) + 0.5) / 400 * PITCH)[:, None]

    def met(layer: Flat, line: np.ndarray) -> np.ndarray:
        width, at = scene.size(layer)[0], x + scene.blur_radius(layer) * u
        return line[np.floor(at / width * len(line) + len(line) / 2).astype(int)]

    front, back = scene.layers
    light = (1 - met(front, front.opacity[0])) * met(back, back.light[0])
    return (light @ weight).reshape(pixels, 400).mean(axis=1)


@pytest.mark.long
@pytest.mark.parametrize(("front", "back"), [(14, 12), (20, 19)])
def test_detail_that_blur_hides_is_not_missed(front, back, tmp_path):
    """Much finer than the blur, and hidden by the same: in their means there is nothing of it.

    The product of the means is 0.25; what stripes of one period hide of each other is more. Two
    sets of rays may err alike: by up to twice as much as is stated, how far they are apart.
    """
    scene = mesh_before_mesh(4, front, back)
    given = {"scene.radiance": radiance_for(5000), "effects": RAYS_ALONE, "accuracy": "standard"}
    frame = simulate(camera(tmp_path, given | changes(scene, tmp_path))).frame
    found = frame.mean_electrons / (frame.white_rate[0] * frame.exposure_time)
    truth = np.tile(stripes_by_rays(scene), 8)
    assert truth.max() < 0.24
    error = np.sqrt(np.mean(np.square(found - truth))) / truth.max()
    assert error <= min(2 * frame.spectrum.depth.error, 0.005)


def test_dim_layers_err_as_bright_ones(tmp_path):
    """Relative to their own full signal: opacity does not count as if white lay behind it."""
    scene = random_scene(np.random.default_rng(11), 3)
    dim = replace(scene, layers=tuple(replace(x, light=x.light * 0.02) for x in scene.layers))
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "standard"}
    found = []
    for made in (scene, dim):
        frame = simulate(camera(tmp_path, given | changes(made, tmp_path))).frame
        found.append((frame.mean_electrons, frame.spectrum.depth.error))
    np.testing.assert_allclose(found[1][0], 0.02 * found[0][0], rtol=2e-4, atol=1e-3)
    assert found[1][1] == pytest.approx(found[0][1], rel=0.01)


@pytest.mark.parametrize("accuracy", long_except(["standard"], ["standard", "reference"]))
def test_layers_in_a_corner_and_nothing_behind(accuracy, tmp_path):
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
        "accuracy": accuracy,
        "array.rows": 200,
        "array.columns": 200,
        "optics": {"f_number": 8, "focal_length": "5 mm", "focus_distance": "1 m"},
    }
    frame = simulate(camera(tmp_path, given)).frame
    assert frame.mean_electrons[10, 10] > 100 * frame.mean_electrons[-10, -10]
    assert frame.spectrum.depth.rays > 0


def wedge_before_star(speed: float) -> list[dict]:
    """A step wedge that moves, before a star chart."""
    wedge = {
        "source": {"kind": "chart", "chart": "step-wedge"},
        "distance": "0.6 m",
        "width": "60 mm",
    }
    if speed:
        wedge["motion"] = {"x": f"{speed} m/s"}
    star = {"source": {"kind": "chart", "chart": "siemens-star"}, "distance": "2 m"}
    return [wedge, star]


def cards_before_an_edge() -> list[dict]:
    """Two layers of even rectangles, one out of focus, before a slanted edge."""
    card = {"kind": "chart", "chart": "colorchecker"}
    edge = {"kind": "chart", "chart": "slanted-edge"}
    return [
        {"source": card, "distance": "0.5 m", "width": "60 mm", "position": ["-40 mm", "0 mm"]},
        {"source": edge, "distance": "0.8 m", "width": "100 mm", "position": ["20 mm", "10 mm"]},
        {"source": edge, "distance": "2 m"},
    ]


@pytest.mark.parametrize(
    ("effects", "tails"),
    [
        (QUIET, ray_windows.BEYOND * 3e-4),
        pytest.param(RAYS_ALONE, 1e-9, marks=pytest.mark.long),
    ],
)
def test_what_even_light_behind_hides_is_within_its_bound(effects, tails, tmp_path, monkeypatch):
    """Against windows that are chosen as if all light behind were black and white.

    Tails of what diffracts from beyond windows, which are not the same, have a share of their own.
    """
    given = {
        "scene.source": {"kind": "layers", "layers": cards_before_an_edge()},
        "scene.radiance": radiance_for(5000),
        "optics": {"f_number": 2, "focal_length": "5 mm", "focus_distance": "1.2 m"},
        "accuracy": "0.03 %",
        "effects": effects,
        "array.rows": 120,
        "array.columns": 150,
    }

    def frame():
        found = simulate(camera(tmp_path, given)).frame
        return found.mean_electrons, found.spectrum.depth

    def black_and_white(g, parts, optics, level, beyond, side):
        return [np.full((g.rows, g.columns), level[-1].max())] * (len(parts) - 1)

    some, depth = frame()
    monkeypatch.setattr(layered, "spread_behind", black_and_white)
    most, whole = frame()
    assert depth.ray_values < 0.7 * whole.ray_values
    apart = np.sqrt(np.mean(np.square(some - most))) / most.max()
    assert apart <= depth.left_out + whole.left_out + tails


def test_what_is_hidden_beyond_the_product_of_means_is_within_its_bound(tmp_path, monkeypatch):
    """A card behind the blurred edge of another one: each ray that passes one meets the other."""
    seen = []

    def composed(*arguments):
        light, bound, widest = _COMPOSED(*arguments)
        seen.append((light, light.copy(), bound))
        return light, bound, widest

    def whole(bound, *_):
        return [Window(*(slice(0, count) for count in bound.shape))], 0.0

    monkeypatch.setattr(layered, "_composed", composed)
    monkeypatch.setattr(layered, "windows_with", whole)
    layers = []
    for number, (value, distance) in enumerate(((0.05, 0.5), (1.0, 0.7), (0.05, 2.0))):
        card = write_exr(tmp_path / f"{number}.exr", np.full((4, 4), value, np.float32))
        source = {"kind": "image", "file": card}
        layers.append({"source": source, "distance": f"{distance} m", "width": f"{distance} m"})
        if number < 2:  # they end on the axis
            layers[-1]["position"] = [f"{-distance / 2} m", "0 m"]
    given = {
        "scene.source": {"kind": "layers", "layers": layers},
        "scene.radiance": radiance_for(5000),
        "optics": {"f_number": 2, "focal_length": "5 mm", "focus_distance": "2 m"},
        "accuracy": "0.5 %",
        "effects": RAYS_ALONE,
        "array.rows": 8,
        "array.columns": 40,
    }
    frame = simulate(camera(tmp_path, given)).frame
    (after, before, bound), *_ = seen
    hidden, full = np.abs(after - before).max(axis=0), float(after.max())
    # Rays err by half of the tolerance in the mean over pixels; by four times that in some.
    assert (hidden <= bound + 4 * frame.spectrum.depth.error * full).all()
    assert hidden.max() > 0.6 * bound.max() > 0.1 * full


def test_opacity_in_closed_form_is_that_of_fine_cells(tmp_path, monkeypatch):
    """A slanted edge in its frame: its opacity as a rectangle, and painted with its light."""
    given = {
        "scene.source": {"kind": "layers", "layers": cards_before_an_edge()[1:]},
        "scene.radiance": radiance_for(5000),
        "optics": {"f_number": 2, "focal_length": "5 mm", "focus_distance": "1.2 m"},
        "effects": QUIET,
        "accuracy": "0.2 %",
        "array.rows": 120,
        "array.columns": 150,
    }
    closed = simulate(camera(tmp_path, given)).frame
    for module in (chart_cells, scene_sampling):
        monkeypatch.setattr(module, "closed_opacity", lambda path, scene: None)
    given["accuracy"] = "0.05 %"
    painted = simulate(camera(tmp_path, given)).frame.mean_electrons
    apart = np.sqrt(np.mean(np.square(closed.mean_electrons - painted))) / painted.max()
    assert apart <= 0.002
    assert closed.spectrum.parts[0][2].planes == 2


@pytest.mark.long
@pytest.mark.parametrize("exposure", [{"exposure.time": "100 ms"}, {"exposure": {"auto": {}}}])
def test_a_layer_may_move_far(exposure, tmp_path):
    """Beyond the frame, while it is exposed."""
    source = {"kind": "layers", "layers": wedge_before_star(0.5)}
    made = camera(
        tmp_path, {"scene.source": source, "effects": QUIET, "accuracy": "standard", **exposure}
    )
    frame = simulate(made).frame
    assert np.isfinite(frame.mean_electrons).all()
    assert frame.spectrum.depth.error <= 1.05 * made.accuracy.tolerance


@pytest.mark.long
def test_what_moving_layers_hide_is_the_mean_over_instants(tmp_path):
    """Against still frames of the layers at places along their paths."""
    scene = random_scene(np.random.default_rng(3), 2, sharp=False)
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "0.2 %"}
    given |= {"exposure.time": "20 ms"} | changes(scene, tmp_path)
    near, speed = given["scene.source"]["layers"][0], 0.05
    place = [float(length.split()[0]) for length in near["position"]]
    near["motion"] = {"x": f"{speed} m/s"}
    moved = simulate(camera(tmp_path, given)).frame
    del near["motion"]
    total, instants = 0.0, 24
    for share in (np.arange(instants) + 0.5) / instants - 0.5:
        near["position"] = [f"{place[0] + share * speed * 0.02} m", f"{place[1]} m"]
        total = total + simulate(camera(tmp_path, given)).frame.mean_electrons / instants
    error = np.sqrt(np.mean(np.square(moved.mean_electrons - total))) / total.max()
    assert error <= 0.002


@pytest.mark.parametrize("chart", long_except(["eye-chart"], ["dead-leaves", "eye-chart"]))
def test_layers_beside_the_array_are_not_seen(chart, tmp_path):
    """Charts need not know what they show at no places at all."""
    even = {"source": {"kind": "chart", "chart": "uniform"}, "distance": "2 m"}
    beside = {
        "source": {"kind": "chart", "chart": chart},
        "distance": "0.8 m",
        "width": "10 mm",
        "position": ["2 m", "2 m"],
    }
    given = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "draft"}
    found = [
        simulate(camera(tmp_path, given | {"scene.source": source})).frame.mean_electrons
        for source in ({"kind": "layers", "layers": [beside, even]}, even["source"])
    ]
    np.testing.assert_allclose(*found, rtol=1e-5)


def test_bounds_of_a_honeycomb_are_those_of_its_pixels(tmp_path, monkeypatch):
    """Half of the places of its lattice have no pixel: as zeros they would halve mean squares."""
    bounds = []

    def kept(bound, *rest):
        bounds.append(bound)
        return windows_with(bound, *rest)

    monkeypatch.setattr(layered, "windows_with", kept)
    pattern = {"array.pattern": "honeycomb", "output.render": "none"}
    light(tmp_path, {"array.rows": 24, "array.columns": 24} | pattern)
    (bound,) = bounds
    has_pixel = Mosaic(BLOCKS["honeycomb"]).color_at(*map(np.arange, bound.shape)) >= 0
    over_pixels, over_all = (np.square(b).mean() for b in (bound[has_pixel], bound))
    assert 0 < over_pixels <= 1.1 * over_all


@pytest.mark.parametrize("f_number", long_except([1000], [1000, 3000]))
def test_what_a_cut_margin_changes_is_predicted(f_number, tmp_path, monkeypatch):
    """Behind such a lens light comes from hundreds of arrays around: against so wide a margin."""
    found, predicted = [], []
    for widest in (layered.WIDEST, 200):
        monkeypatch.setattr(layered, "WIDEST", widest)
        scene = random_scene(np.random.default_rng(3), 2)
        size = {"array.rows": 12, "array.columns": 16, "optics.f_number": f_number}
        given = {"scene.radiance": radiance_for(5000), "effects": QUIET, "accuracy": "reference"}
        frame = simulate(camera(tmp_path, given | changes(scene, tmp_path) | size)).frame
        found.append(frame.mean_electrons)
        predicted.append(frame.spectrum.depth.error)
    off = float(np.sqrt(np.square(found[0] - found[1]).mean())) / found[1].max()
    assert 5e-4 < off <= predicted[0]  # there is something to predict
    assert predicted[1] < 1e-3


def test_rays_fill_an_aperture_that_is_no_circle():
    opening = Opening(5, 0.2, 0.3, 3, 0.03)
    at = (np.arange(500) + 0.5) / 250 - 1
    x, y = (a.ravel() for a in np.meshgrid(at, at))
    inside = opening.contains(x, y)
    for kind in (0, 1):
        found = rays(4000, kind, opening)
        assert len(found) == pytest.approx(4000, rel=0.01)
        assert opening.contains(found[:, 0], found[:, 1]).all()
        for power in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
            expected = np.mean(x[inside] ** power[0] * y[inside] ** power[1])
            mean = np.mean(found[:, 0] ** power[0] * found[:, 1] ** power[1])
            assert mean == pytest.approx(expected, abs=3e-3)
