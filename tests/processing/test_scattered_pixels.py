"""The picture of scattered pixels, against its definition, and what any picture must keep."""

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from tests.processing.layouts import LAYOUTS, RGB, Layout, centered, honeycomb, moved, square
from tests.processing.test_processing_steps import Step
from vcam_cli.errors import BadInput
from vcam_cli.processing import Context, process
from vcam_cli.processing.scattered_pixels import (
    MAX_WEIGHT_SUM,
    NEIGHBORS,
    Samples,
    interpolate_to_grid,
)

WHITE, BLACK = np.array([520.0, 1020.0, 270.0]), 20.0


def steps(**given):
    return tuple(Step(name, value) for name, value in given.items())


FULL = steps(black_level="subtract", demosaic="bilinear", white_balance="illuminant")


def taken(layout, chart):
    return interpolate_to_grid(layout.sampled(chart), layout.sampled(chart), layout, 3).planes


def by_definition(x, y, values, at_x, at_y):
    """The value at a point of the plane that fits the eight nearest samples best."""
    distance = np.hypot(x - at_x, y - at_y)
    order = np.argsort(distance, kind="stable")
    reach, near = distance[order[NEIGHBORS]], order[:NEIGHBORS]
    d = np.maximum(distance[near], 1e-9)
    root = np.maximum(reach - d, 0) / (reach * d)  # the weight is its square
    design = np.stack([np.ones(NEIGHBORS), x[near] - at_x, y[near] - at_y], axis=1)
    return np.linalg.lstsq(design * root[:, None], values[near] * root, rcond=None)[0][0]


def test_is_the_best_plane_through_the_nearest_samples():
    layout = moved(16)
    rng = np.random.default_rng(3)
    values = rng.random(layout.x.shape)
    planes = interpolate_to_grid(values, values, layout, 3).planes
    compared = 0
    for color in range(3):
        here = layout.color == color
        samples = Samples(layout.x[here], layout.y[here])
        for i in range(0, 16, 3):
            for j in range(0, 16, 3):
                at = layout.picture_x[j], layout.picture_y[i]
                _, weight = samples.weights_at(*np.array(at)[:, None])
                if np.abs(weight).sum() > MAX_WEIGHT_SUM - 1e-6:
                    continue  # tilted less
                compared += 1
                expected = by_definition(layout.x[here], layout.y[here], values[here], *at)
                # float32 of the picture
                assert planes[color, i, j] == pytest.approx(expected, abs=2e-6)
    assert compared > 90  # of 108


@pytest.mark.parametrize("name", LAYOUTS)
def test_even_colors_stay_even_up_to_the_corners(name):
    planes = taken(LAYOUTS[name](), lambda x, y, color: np.choose(color, [0.2, 0.5, 0.9]))
    for plane, level in zip(planes, (0.2, 0.5, 0.9), strict=True):
        np.testing.assert_allclose(plane, level, rtol=2e-7)  # float32


def slope(x, y, color):
    return 3.0 * x - 2.0 * y + 5.0 * color


@pytest.mark.parametrize("name", ["honeycomb", "square"])
def test_what_rises_evenly_does_so_up_to_the_corners(name):
    layout = LAYOUTS[name]()
    # float32 of values up to 100
    np.testing.assert_allclose(taken(layout, slope), layout.ideal(slope), atol=1e-5)


def test_what_rises_evenly_does_so_between_moved_pixels():
    """At the border, where all samples lie on one side, a plane is not followed all the way."""
    layout = moved()
    inside = np.s_[:, 3:-3, 3:-3]
    error = np.abs(taken(layout, slope) - layout.ideal(slope))[inside]
    assert np.mean(error < 1e-5) > 0.99


def test_a_sample_in_the_middle_of_a_pixel_is_kept():
    layout = square()
    values = np.random.default_rng(5).random(layout.x.shape)
    planes = interpolate_to_grid(values, values, layout, 3).planes
    kept = np.take_along_axis(planes, layout.color[np.newaxis], axis=0)[0]
    np.testing.assert_allclose(kept, values, atol=1e-6)


@examples(60)
@given(st.integers(1, 12), st.integers(0, 10**6), st.floats(1e-9, 1e9), st.floats(0, 30))
def test_any_samples_give_weights_that_add_up_to_one(count, seed, unit, far):
    """However few, together on a line or at one place, however far: and they stay bounded."""
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, 4, (2, count)) * unit
    at = rng.uniform(-far - 1, far + 1, (2, 5)) * unit
    index, weight = Samples(x, y).weights_at(*at)
    assert index.max() < count
    assert weight.shape == (5, min(count, NEIGHBORS))
    np.testing.assert_allclose(weight.sum(axis=1), 1, atol=1e-6)
    assert np.abs(weight).sum(axis=1).max() <= MAX_WEIGHT_SUM + 1e-6


def chart(x, y, color):
    """Waves of two periods, colored."""
    return 0.5 + 0.3 * np.cos(0.25 * x + color) + 0.2 * np.cos(0.2 * x - 0.3 * y)


@pytest.mark.parametrize("name", ["honeycomb", "moved"])
def test_twice_as_many_pixels_show_the_same_scene_better(name):
    """Each halving of the pixels brings nearly 12 dB, as where errors are of second order."""

    def psnr(fine):
        rows, columns = (28 * fine, 20 * fine)
        layout = honeycomb(rows, columns) if name == "honeycomb" else moved(20 * fine)

        def scene(x, y, color):
            return chart(x / fine, y / fine, color)

        return -10 * np.log10(np.mean((taken(layout, scene) - layout.ideal(scene)) ** 2))

    coarse, fine, finest = (psnr(n) for n in (1, 2, 4))
    assert fine > coarse + 8
    assert finest > fine + 8


def test_saturation_of_any_sample_that_counts():
    layout = square(12)
    codes = np.full(layout.x.shape, 7, np.uint16)
    codes[6, 6] = 99  # a red one
    highest = interpolate_to_grid(codes.astype(float), codes, layout, 3).highest
    assert highest.dtype == codes.dtype
    rows, columns = np.nonzero(highest == 99)
    assert highest[6, 6] == 99
    assert highest[6, 7] == 99
    assert highest[7, 7] == 99
    assert highest[6, 8] == 7, "a red pixel in the middle of a picture's needs no other"
    assert (np.maximum(abs(rows - 6), abs(columns - 6)) <= 3).all()
    assert set(np.unique(highest)) == {7, 99}


def test_workers_make_no_difference():
    layout = moved(80)
    values = np.random.default_rng(0).random(layout.x.shape)
    one, three = (interpolate_to_grid(values, values, layout, 3, workers) for workers in (1, 3))
    assert np.array_equal(one.planes, three.planes)


def test_a_color_without_samples_is_refused():
    layout = square()
    with pytest.raises(ValueError, match="no sample of color 3"):
        interpolate_to_grid(layout.x, layout.x, layout, 4)


def context(layout, **more):
    pattern = (RGB,)
    return Context(pattern, RGB, WHITE, BLACK, layout=layout, saturated_dn=1000, **more)


def raw(layout, reflectance=0.5):
    return layout.sampled(lambda x, y, c: BLACK + reflectance * (WHITE - BLACK)[c])


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("balance", ["illuminant", "gray-world", "bright-block"])
def test_a_gray_scene_becomes_a_gray_picture(name, balance):
    layout = LAYOUTS[name]()
    wanted = steps(black_level="subtract", demosaic="bilinear", white_balance=balance)
    done = process(raw(layout), context(layout), wanted)
    assert done.linear.shape == (len(layout.picture_y), len(layout.picture_x), 3)
    np.testing.assert_allclose(done.linear, 0.5, rtol=2e-6)  # float32
    assert done.encode(8).shape == done.linear.shape
    whole = np.ones((3, *done.shape)) * (BLACK + 0.25 * (WHITE - BLACK))[:, None, None]
    np.testing.assert_allclose(done.ideal(whole), 0.25, rtol=2e-6)


def test_the_place_of_demosaic_among_the_steps_does_not_matter():
    layout = moved()
    values = BLACK + np.random.default_rng(1).random(layout.x.shape) * 200
    orders = (
        ("black_level", "white_balance", "demosaic"),
        ("demosaic", "black_level", "white_balance"),
    )
    how = {"black_level": "subtract", "white_balance": "illuminant", "demosaic": "bilinear"}
    first, second = (
        process(values, context(layout), steps(**{name: how[name] for name in order})).linear
        for order in orders
    )
    assert np.array_equal(first, second)


def test_codes_of_a_logarithmic_converter_are_made_linear_first():
    layout = moved()
    linear = layout.sampled(lambda x, y, c: BLACK + (0.5 + 0.01 * x) * (WHITE - BLACK)[c])
    straight = process(linear, context(layout), FULL)
    bent = Context(
        (RGB,), RGB, np.log(WHITE), float(np.log(BLACK)), linearize=np.exp, layout=layout
    )
    curved = process(np.log(linear), bent, FULL)
    np.testing.assert_allclose(curved.linear, straight.linear, rtol=1e-5)  # float32 of logarithms
    whole = np.ones((3, *curved.shape)) * WHITE[:, None, None]
    np.testing.assert_allclose(curved.ideal(np.log(whole)), 1, rtol=1e-5)


def test_blocks_with_saturated_samples_do_not_decide_white():
    layout = square(32)
    values = raw(layout, 0.4)
    values[:11, :11] = 1000  # a lamp, well inside one block
    balance = steps(black_level="subtract", demosaic="bilinear", white_balance="bright-block")
    linear = process(values, context(layout), balance).linear
    np.testing.assert_allclose(linear[24:, 24:], 0.4, rtol=1e-5)


def test_one_color_makes_a_gray_picture():
    """Steps that the file of positions decides on have nothing to do."""
    layout = moved()
    single = Layout(layout.x, layout.y, np.zeros_like(layout.color), centered(30), centered(30))
    gray = Context((("Y",),), ("Y",), WHITE[:1], BLACK, layout=single)
    done = process(
        np.full(layout.x.shape, 270.0), gray, (*FULL, *steps(color_correction="fit", gamma="srgb"))
    )
    assert done.linear.shape == (30, 30, 1)
    assert done.encode().shape == (30, 30)
    np.testing.assert_allclose(done.linear, 0.5, rtol=1e-6)


def test_without_demosaic_there_is_no_picture():
    layout = moved()
    done = process(raw(layout), context(layout), steps(black_level="subtract"))
    for show in (lambda: done.linear, lambda: done.encode(8)):
        with pytest.raises(BadInput, match="make no picture"):
            show()
    with pytest.raises(BadInput, match="cannot be judged"):
        done.ideal(np.ones((3, 30, 30)))


def test_edges_need_rows_and_columns():
    layout = moved()
    with pytest.raises(BadInput, match="edge-aware needs pixels in rows and columns"):
        process(raw(layout), context(layout), steps(demosaic="edge-aware"))
