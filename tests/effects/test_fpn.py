"""Dark currents that differ, and pixels that do not work."""

import math
from functools import partial

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.signal_chain import Site
from vcam_cli.rng import stream

WELL = 100e3
LARGE = {"array.rows": 150, "array.columns": 400}
PIXELS = 150 * 400
DARK = {"scene.source.reflectance": 0, "pixel.photodetector.dark_current": "40 ke/s"}


def frame(folder, *changes: dict):
    merged: dict = dict(LARGE)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged))


def only(*names: str) -> dict:
    return {"effects": QUIET | dict.fromkeys(names, "on")}


# --- dark currents -------------------------------------------------------------------------------


def test_dark_currents_spread_as_stated(tmp_path):
    """20 % of 400 electrons, without any other noise; a normal number's moments."""
    result = frame(tmp_path, DARK, {"pixel.fpn.dark": "20 %"}, only("fpn"))
    spread = result.electrons - result.mean_electrons
    assert spread.mean() == pytest.approx(0, abs=5 * 80 / math.sqrt(PIXELS))
    assert spread.std() == pytest.approx(80, rel=5 / math.sqrt(2 * PIXELS))
    third = np.mean(spread**3) / 80**3
    assert third == pytest.approx(0, abs=5 * math.sqrt(6 / PIXELS))


def test_dark_currents_make_shot_noise_of_their_own(tmp_path):
    """In frames of one sensor the mean differs from pixel to pixel, and the variance with it.

    Of 30 frames: their mean follows the pixel's dark signal with a slope of 1, their variance too;
    5 standard errors, of the slope of variances 5 sqrt(2 / 29 / pixels) mean / spread.
    """
    changes = DARK | {"pixel.fpn.dark": "20 %"}
    dark = frame(tmp_path, changes, only("fpn")).electrons
    frames = np.array(
        [
            frame(tmp_path, changes, only("fpn", "shot_noise"), {"seed.frame": seed}).electrons
            for seed in range(30)
        ]
    )
    slope = np.polyfit(dark.ravel(), frames.mean(0).ravel(), 1)[0]
    assert slope == pytest.approx(1, abs=5 * math.sqrt(400 / 30 / PIXELS) / 80)
    variance = frames.var(0, ddof=1)
    slope = np.polyfit(dark.ravel(), variance.ravel(), 1)[0]
    assert slope == pytest.approx(1, abs=5 * math.sqrt(2.2 / 29 / PIXELS) * 400 / 80)
    assert variance.mean() == pytest.approx(400, rel=5 * math.sqrt(2.2 / 29 / PIXELS))


def test_no_dark_current_is_below_zero(tmp_path):
    """A spread of 100 %: the sixth below zero have none, Phi(-1) of all."""
    found = frame(tmp_path, DARK, {"pixel.fpn.dark": "100 %"}, only("fpn")).electrons
    assert found.min() == 0
    none = 0.158655
    assert np.mean(found == 0) == pytest.approx(none, abs=5 * math.sqrt(none / PIXELS))
    effect = FixedPattern(0, 0, 0, 0, dark=1.0)
    kurtosis = np.mean((found - found.mean()) ** 4) / found.var() ** 2
    error = 5 * math.sqrt((kurtosis - 1) / PIXELS)
    assert found.var() == pytest.approx(effect.variance(400.0, 400.0), rel=error)


def test_dark_currents_do_not_depend_on_light_and_need_dark_current(tmp_path):
    light = {"scene.radiance": radiance_for(5000), **DARK, "scene.source.reflectance": 0.5}
    spread = {"pixel.fpn.dark": "20 %"}
    dark, bright = (frame(tmp_path, c, spread, only("fpn")) for c in (DARK, light))
    pattern = dark.electrons - dark.mean_electrons
    np.testing.assert_allclose(bright.electrons - bright.mean_electrons, pattern, atol=1e-9)
    off = frame(tmp_path, DARK, spread, {"effects": QUIET | {"fpn": "on", "dark_current": "off"}})
    assert not off.electrons.any()


# --- defects -------------------------------------------------------------------------------------

DEFECTS = {"pixel.defects": {"hot": 0.02, "dead": 0.05}}
NOISE = {"pixel.readout.read_noise": "5 e", "pixel.fpn": {"prnu": "1 %", "dsnu": "2 e"}}
GRAY = {"scene.radiance": radiance_for(5000)}


def within(count: int, fraction: float) -> bool:
    """Whether a count of pixels is a fraction of all, to five standard errors."""
    return abs(count - fraction * PIXELS) < 5 * math.sqrt(fraction * (1 - fraction) * PIXELS)


def test_hot_pixels_are_full_and_dead_ones_are_empty(tmp_path):
    found = frame(tmp_path, GRAY, DEFECTS, only("shot_noise", "fpn")).electrons
    hot, dead = found == WELL, found == 0
    assert within(hot.sum(), 0.02)
    assert within(dead.sum(), 0.05)
    rest = found[~hot & ~dead]
    assert rest.mean() == pytest.approx(5000, abs=5 * math.sqrt(5000 / len(rest)))
    assert rest.std() == pytest.approx(math.sqrt(5000), rel=5 / math.sqrt(2 * len(rest)))


def test_a_hot_pixel_is_full_whatever_light_and_noise_are(tmp_path):
    """As a pixel in light far beyond its well: the clip comes last."""
    bright = frame(tmp_path, GRAY, DEFECTS, NOISE)
    dark = frame(tmp_path, {"scene.source.reflectance": 0}, DEFECTS, NOISE)
    hot = bright.electrons == WELL
    assert within(hot.sum(), 0.02)
    assert np.array_equal(hot, dark.electrons == WELL)
    assert np.all(bright.dn[hot] == 4095)
    metrics = dict(bright.metrics)
    assert metrics["saturated_fraction"] == hot.mean()


def test_a_dead_pixel_keeps_offset_and_readout_noise(tmp_path):
    result = frame(tmp_path, GRAY, {"pixel.defects": {"dead": 1}}, NOISE)
    noise = result.electrons
    assert noise.mean() == pytest.approx(0, abs=5 * math.sqrt(29 / PIXELS))
    assert noise.var() == pytest.approx(29, rel=5 * math.sqrt(2 / PIXELS))


@pytest.mark.parametrize(("kind", "electrons"), [("hot", WELL), ("dead", 0)])
def test_the_plan_keeps_defects_that_all_pixels_have(kind, electrons, tmp_path):
    """They do not differ then, and there is no noise by which to judge them."""
    result = frame(tmp_path, GRAY, {"pixel.defects": {kind: 1}, "effects": "auto"})
    assert np.all(result.electrons == electrons)


def test_defects_stay_with_the_sensor(tmp_path):
    def where(**changes):
        return frame(tmp_path, GRAY, DEFECTS, changes).electrons == WELL

    first = where()
    assert np.array_equal(first, where(**{"seed.frame": 5}))
    both = np.mean(first & where(**{"seed.sensor": 5}))
    assert both == pytest.approx(0.02**2, abs=5 * math.sqrt(0.02**2 / PIXELS))


def test_the_same_pixels_in_both_float_types_and_more_of_them_are_more(tmp_path):
    def defective(**more):
        found = frame(tmp_path, GRAY, only("fpn"), more).electrons
        return found == np.float32(WELL), found == 0

    defects = {"pixel.defects": {"hot": 0.02, "dead": 0.05}}
    single = {"accuracy": {"preset": "standard", "float_width": 32}}
    double = {"accuracy": {"preset": "standard", "float_width": 64}}
    few = defective(**defects, **double)
    assert all(
        np.array_equal(a, b) for a, b in zip(few, defective(**defects, **single), strict=True)
    )
    many = defective(**{"pixel.defects": {"hot": 0.1, "dead": 0.2}}, **double)
    assert all(not np.any(a & ~b) for a, b in zip(few, many, strict=True))


def test_defects_are_not_in_rows_columns_or_blocks(tmp_path):
    """Counts of every row, column and block are those of independent pixels."""
    found = frame(tmp_path, GRAY, {"pixel.defects": {"hot": 0.3}}, only("fpn")).electrons == WELL
    for axis, n in ((0, 150), (1, 400)):
        counts = found.sum(axis)
        assert counts.var() == pytest.approx(0.21 * n, rel=5 * math.sqrt(2 / len(counts)))
    assert not np.array_equal(found[:64], found[64:128])


def site(n: int, dark: float) -> Site:
    here = partial(stream, 3)
    return Site(1, n, here, here, np.float64, dark)


@pytest.mark.parametrize("mean", [0.0, 50.0, 1000.0])
@pytest.mark.parametrize(
    ("hot", "dead"), [(0.01, 0.0), (0.0, 0.3), (0.1, 0.2), (0.5, 0.5), (1.0, 0.0)]
)
def test_variance_of_defects_is_the_measured_one(hot, dead, mean):
    """Clipped at the well, as it is read; standard errors from the sample's own fourth moment."""
    n, well = 200_000, 2000.0
    effect = FixedPattern(3.0, 0.0, 0.01, 0.0, 0.1, hot, dead, well)
    where = site(n, 0.5 * mean)
    found = effect.apply(effect.before_shot(np.full((1, n), mean), where), where)
    found = np.minimum(found, well)
    stated = effect.variance(mean, 0.5 * mean)
    fourth = np.mean((found - found.mean()) ** 4)
    error = 5 * math.sqrt(max(fourth - found.var() ** 2, 0) / n)
    assert found.var() == pytest.approx(stated, abs=error + 1e-9)


def test_defects_alone_are_a_fixed_pattern(tmp_path):
    made = camera(tmp_path, {"pixel.defects": {"hot": 1e-4}})
    effect = FixedPattern.from_camera(made, geometry(made))
    assert (effect.hot, effect.dead, effect.full_well) == (1e-4, 0, pytest.approx(WELL))
    assert "0.01 % hot" in effect.describe()


def test_pictures_survive_defects(tmp_path):
    """Balance, matrix, tone and metrics of a Bayer camera with many of them are finite."""
    scene = {
        "scene.illuminant": "D65",
        "scene.source": {"kind": "chart", "chart": "colorchecker"},
        "optics.transmittance": "ir-cut-650",
        "array.pattern": "bayer-rggb",
        "pixel.defects": {"hot": 0.2, "dead": 0.3},
        "pixel.readout.read_noise": "5 e",
        "quality": ["mse", "psnr", "cielab", "s-cielab"],
        "accuracy": "standard",
        "array.rows": 40,
        "array.columns": 60,
    }
    for balance in ("gray-world", "bright-block", "illuminant"):
        steps = [
            *({"black_level": "subtract"}, {"demosaic": "edge-aware"}),
            *({"white_balance": balance}, {"color_correction": "fit"}, {"gamma": "srgb"}),
        ]
        result = frame(tmp_path, scene, {"processing": steps})
        assert np.isfinite(result.linear).all()
        assert np.isfinite(result.electrons).all()
        assert all(math.isfinite(value) for value in result.metrics.values())
