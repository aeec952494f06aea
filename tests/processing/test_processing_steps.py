"""The whole of processing: scale, order, ideal image, workers, black frames, bad orders."""

from dataclasses import dataclass

import numpy as np
import pytest
from demosaiced import bilinear

from vcam_cli.errors import BadInput
from vcam_cli.processing import Context, check, process, tone

RGB = ("R", "G", "B")
RGGB = (("R", "G"), ("G", "B"))
BLACK = 20.0
CONTEXT = Context(RGGB, RGB, np.array([520.0, 1020.0, 270.0]), BLACK)
GRAY = Context((("Y",),), ("Y",), np.array([420.0]), BLACK)


@dataclass(frozen=True)
class Step:
    name: str
    value: str | float


def steps(**given):
    return tuple(Step(name, value) for name, value in given.items())


FULL = steps(black_level="subtract", demosaic="bilinear", white_balance="gray-world", gamma="srgb")


def mosaic_of(planes):
    """The raw frame a Bayer array takes of full-color planes (3, rows, columns)."""
    raw = np.empty(planes.shape[1:], planes.dtype)
    for i in range(2):
        for j in range(2):
            raw[i::2, j::2] = planes[RGB.index(RGGB[i][j]), i::2, j::2]
    return raw


def flat(reflectance, shape=(10, 12), context=CONTEXT):
    """Full-color DN of a uniform scene."""
    level = BLACK + reflectance * (context.white_dn - BLACK)
    return np.ones((1, *shape)) * level[:, None, None]


def test_white_is_one_and_gray_is_its_reflectance():
    for reflectance in (1.0, 0.18):
        done = process(mosaic_of(flat(reflectance)), CONTEXT, FULL)
        assert done.linear.shape == (10, 12, 3)
        assert done.linear.dtype == np.float32
        # a few float32 roundings
        np.testing.assert_allclose(done.linear, reflectance, rtol=5e-7)
        code = tone.codes(np.array(reflectance), "srgb", 8)
        np.testing.assert_array_equal(done.encode(8), np.full((10, 12, 3), code))


def test_the_exposure_is_known_so_a_dim_picture_stays_dim_and_a_bright_one_exceeds_one():
    raw = mosaic_of(flat(0.01))
    assert process(raw, CONTEXT, FULL).linear.max() == pytest.approx(0.01, rel=1e-5)
    bright = process(mosaic_of(flat(1.7)), CONTEXT, FULL)
    assert bright.linear.max() == pytest.approx(1.7, rel=1e-6)
    assert bright.encode(8).min() == 255


BT709 = np.array([0.2126, 0.7152, 0.0722])


def test_without_white_balance_the_luminance_of_white_is_one():
    plain = steps(black_level="subtract", demosaic="bilinear")
    done = process(mosaic_of(flat(1.0)), CONTEXT, plain)
    white = np.array([0.5, 1.0, 0.25])
    np.testing.assert_allclose(done.linear[3, 4], white / (white @ BT709), rtol=5e-7)


def test_without_black_level_black_counts_in_white_and_picture_alike():
    for none in (steps(demosaic="bilinear"), steps(black_level="none", demosaic="bilinear")):
        done = process(mosaic_of(flat(1.0)), CONTEXT, none)
        np.testing.assert_allclose(
            done.linear[3, 4], CONTEXT.white_dn / (CONTEXT.white_dn @ BT709), rtol=5e-7
        )


def test_a_black_level_given_as_a_number():
    done = process(mosaic_of(flat(1.0)), CONTEXT, steps(black_level=120.0, demosaic="bilinear"))
    white = np.array([400, 900, 150])
    np.testing.assert_allclose(done.linear[3, 4], white / (white @ BT709), rtol=5e-7)


@pytest.mark.parametrize("demosaic_first", [True, False])
def test_gray_world_makes_the_means_equal_where_it_stands(demosaic_first):
    raw = np.random.default_rng(1).integers(20, 1023, (150, 131)).astype(np.uint16)
    order = (
        steps(black_level="subtract", demosaic="bilinear", white_balance="gray-world")
        if demosaic_first
        else steps(black_level="subtract", white_balance="gray-world")
    )
    linear = process(raw, CONTEXT, order).linear.astype(float)
    if demosaic_first:
        means = linear.mean(axis=(0, 1))
    else:
        cells = [linear[i::2, j::2] for i in range(2) for j in range(2)]
        means = [
            cells[0].mean(),
            np.concatenate([c.ravel() for c in cells[1:3]]).mean(),
            cells[3].mean(),
        ]
    # every value carries a few float32 roundings, which average out
    np.testing.assert_allclose(means, means[0], rtol=1e-6)


def test_balancing_the_mosaic_or_the_picture_agrees_for_a_flat_scene():
    raw = mosaic_of(flat(0.4))
    before = steps(black_level="subtract", white_balance="gray-world", demosaic="bilinear")
    np.testing.assert_allclose(
        process(raw, CONTEXT, before).linear, process(raw, CONTEXT, FULL).linear, rtol=5e-7
    )


def test_linear_is_the_composition_of_its_steps_across_block_borders():
    """200 rows are four blocks; the whole frame at once, in float64, is the reference."""
    raw = np.random.default_rng(2).integers(0, 1023, (201, 57)).astype(np.uint16)
    planes = bilinear(raw - BLACK, RGGB, RGB).astype(float)
    means = planes.mean(axis=(1, 2))
    gains = means.max() / means
    scale = 1 / (((CONTEXT.white_dn - BLACK) * gains) @ BT709)
    expected = np.moveaxis(planes * (gains * scale)[:, None, None], 0, 2)
    done = process(raw, CONTEXT, FULL)
    # values of about 1 to 4 in float32
    np.testing.assert_allclose(done.linear, expected, atol=2e-6, rtol=0)


@pytest.mark.parametrize("shape", [(2, 2), (3, 5), (63, 8), (64, 8), (65, 9), (128, 4), (321, 40)])
def test_the_same_bytes_for_any_number_of_workers(shape):
    raw = np.random.default_rng(3).integers(0, 1023, shape).astype(np.float32)
    one, four = (process(raw, CONTEXT, FULL, workers=workers) for workers in (1, 4))
    assert one.linear.tobytes() == four.linear.tobytes()
    for bits in (8, 16):
        assert one.encode(bits).tobytes() == four.encode(bits).tobytes()
    planes = np.stack([raw] * 3)
    assert one.ideal(planes).tobytes() == four.ideal(planes).tobytes()


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("curve", ["srgb", 2.2])
def test_encode_is_the_tone_curve_of_linear(bits, curve):
    raw = np.random.default_rng(4).integers(0, 1023, (70, 40)).astype(np.uint16)
    done = process(raw, CONTEXT, (*FULL[:3], Step("gamma", curve)))
    np.testing.assert_array_equal(done.encode(bits), tone.codes(done.linear, curve, bits))


def test_without_gamma_codes_are_linear():
    done = process(mosaic_of(flat(0.5)), CONTEXT, FULL[:3])
    np.testing.assert_array_equal(done.encode(8), 128)


def test_the_frame_is_not_changed():
    raw = np.random.default_rng(5).integers(0, 1023, (70, 40)).astype(np.float32)
    raw.setflags(write=False)
    done = process(raw, CONTEXT, FULL)
    done.linear, done.encode(8)
    planes = np.stack([raw] * 3)
    planes.setflags(write=False)
    done.ideal(planes)


def test_any_dtype_of_raw_gives_the_same():
    raw = np.random.default_rng(6).integers(0, 1023, (10, 8))
    results = {
        process(raw.astype(dtype), CONTEXT, FULL).encode().tobytes()
        for dtype in (np.uint16, np.int64, np.float32, np.float64)
    }
    assert len(results) == 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_ideal_image_of_a_flat_scene_is_the_picture(dtype):
    planes = flat(0.3, (80, 12)).astype(dtype)
    done = process(mosaic_of(planes), CONTEXT, FULL)
    ideal = done.ideal(planes)
    assert ideal.dtype == np.float32
    assert ideal.shape == (80, 12, 3)
    # the same roundings in float32, fewer in float64
    np.testing.assert_allclose(ideal, done.linear, rtol=5e-7)


def test_the_ideal_image_takes_the_gains_of_the_picture():
    """A red picture: gray world is wrong about it, and the ideal image is wrong alike."""
    red = flat(0.3)
    red[0] = BLACK + 0.6 * (CONTEXT.white_dn[0] - BLACK)
    done = process(mosaic_of(red), CONTEXT, FULL)
    ideal = done.ideal(flat(0.5))
    np.testing.assert_allclose(ideal[..., 0] / ideal[..., 1], 0.5, rtol=1e-6)
    np.testing.assert_allclose(done.ideal(red)[..., 0], done.linear[..., 0], rtol=5e-7)


def test_the_ideal_image_refuses_planes_of_another_camera():
    done = process(mosaic_of(flat(0.3)), CONTEXT, FULL)
    with pytest.raises(ValueError, match="one plane for each"):
        done.ideal(np.ones((2, 4, 4)))


def test_monochrome_is_gray():
    raw = flat(0.25, context=GRAY)[0]
    done = process(raw, GRAY, steps(black_level="subtract", gamma="srgb"))
    assert done.linear.shape == (10, 12, 1)
    np.testing.assert_allclose(done.linear, 0.25, rtol=5e-7)
    assert done.encode(8).shape == (10, 12)
    assert done.encode(8)[0, 0] == 137
    np.testing.assert_array_equal(done.ideal(raw[np.newaxis]), done.linear)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (65, 1)])
def test_monochrome_may_be_one_pixel_wide(shape):
    raw = flat(0.25, shape, GRAY)[0]
    linear = process(raw, GRAY, steps(black_level="subtract")).linear
    np.testing.assert_allclose(linear, np.full((*shape, 1), 0.25), rtol=5e-7)


def test_a_mosaic_without_demosaic_is_shown_gray_and_cannot_be_judged():
    raw = mosaic_of(flat(1.0))
    done = process(raw, CONTEXT, steps(black_level="subtract", white_balance="gray-world"))
    assert done.linear.shape == (10, 12, 1)
    assert done.encode().shape == (10, 12)
    np.testing.assert_allclose(done.linear, 1.0, rtol=5e-7)
    with pytest.raises(BadInput) as caught:
        done.ideal(flat(1.0))
    assert [p.path for p in caught.value.problems] == [("quality",)]


def test_no_steps_at_all_show_the_raw_frame():
    raw = mosaic_of(flat(1.0))
    expected = raw / (CONTEXT.white_dn @ BT709)
    np.testing.assert_allclose(process(raw, CONTEXT, ()).linear[..., 0], expected, rtol=5e-7)


@pytest.mark.parametrize("level", [0.0, BLACK, BLACK + 0.05])
def test_a_black_frame_is_black_and_finite(level):
    done = process(np.full((8, 8), level), CONTEXT, FULL)
    assert np.all(np.isfinite(done.linear))
    assert done.encode().max() <= 1
    white = (CONTEXT.white_dn - BLACK) @ BT709
    np.testing.assert_allclose(done.linear, (level - BLACK) / white, atol=1e-8)


def test_a_scene_without_light_is_black():
    dark = Context(RGGB, RGB, np.full(3, BLACK), BLACK)
    noise = np.random.default_rng(7).normal(BLACK, 2, (8, 8))
    done = process(noise, dark, FULL)
    assert np.all(done.linear == 0)
    assert done.encode().max() == 0


def problems(*args, **kwargs):
    with pytest.raises(BadInput) as caught:
        check(*args, **kwargs)
    return caught.value.problems


@pytest.mark.parametrize(
    ("given", "index"),
    [
        (steps(gamma=2.2, demosaic="bilinear"), 1),
        (steps(gamma=2.2) + steps(gamma="srgb"), 1),
        (steps(white_balance="gray-world", black_level="subtract"), 1),
        (steps(demosaic="bilinear") * 2, 1),
        (steps(demosaic="magic"), 0),
        (steps(demosaic=3.0), 0),
        (steps(gamma=0.0), 0),
        (steps(gamma=-2.2), 0),
        (steps(gamma=float("nan")), 0),
        (steps(black_level=float("inf")), 0),
        (steps(black_level="substract"), 0),
        (steps(demosiac="bilinear"), 0),
    ],
)
def test_steps_that_cannot_work_are_refused(given, index):
    found = problems(given, RGGB, RGB)
    assert {p.path for p in found} == {("processing", index, given[index].name)}
    assert all(p.message and p.remedy for p in found)
    with pytest.raises(BadInput):
        process(np.zeros((4, 4)), CONTEXT, given)


def test_the_nearest_right_name_is_given():
    assert "`demosaic`" in problems(steps(demosiac="bilinear"), RGGB, RGB)[0].remedy
    assert "`subtract`" in problems(steps(black_level="substract"), RGGB, RGB)[0].remedy


def test_all_problems_are_told_at_once():
    found = problems(
        steps(gamma=-1, white_balance="gray-world", demosaic="bilinear"), (("Y",),), ("Y",)
    )
    assert len(found) == 5  # the number, two steps after gamma, two that need several colors


def test_color_steps_need_colors():
    for step in (steps(demosaic="bilinear"), steps(white_balance="gray-world")):
        assert len(problems(step, (("Y",),), ("Y",))) == 1
    check(steps(white_balance="none"), (("Y",),), ("Y",))


def test_quality_needs_demosaic_or_one_color():
    assert problems(FULL[:1], RGGB, RGB, ("mse",))[0].path == ("quality",)
    check(FULL[:1], RGGB, RGB)
    check(FULL, RGGB, RGB, ("mse", "psnr"))
    check(FULL[:1], (("Y",),), ("Y",), ("mse",))


@pytest.mark.parametrize("shape", [(1, 8), (8, 1)])
def test_an_array_too_narrow_to_demosaic_is_refused(shape):
    with pytest.raises(BadInput) as caught:
        process(np.zeros(shape), CONTEXT, FULL)
    assert caught.value.problems[0].path == ("processing", 1, "demosaic")


def test_a_black_level_above_white_is_refused():
    with pytest.raises(BadInput) as caught:
        process(np.zeros((4, 4)), CONTEXT, steps(black_level=2000.0, demosaic="bilinear"))
    assert caught.value.problems[0].path == ("processing", 0, "black_level")
