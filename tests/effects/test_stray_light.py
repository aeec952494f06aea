"""Veiling glare: what a color loses everywhere lies evenly over its pixels."""

import math

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.optics.stray_light import StrayLight

EDGE = {
    "scene.source": {"kind": "chart", "chart": "slanted-edge"},
    "scene.radiance": radiance_for(2000),
    "effects": QUIET,
}
BAYER = {
    "scene.source": {"kind": "chart", "chart": "colorchecker"},
    "scene.illuminant": "D65",
    "optics.transmittance": "ir-cut-650",
    "array.pattern": "bayer-grbg",
    "accuracy": {"preset": "standard", "float_width": 64},
}


def mean(folder, *changes: dict) -> np.ndarray:
    merged: dict = dict(EDGE)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged)).mean_electrons


@pytest.mark.parametrize("fraction", [0.001, 0.05, 1.0])
def test_is_the_formula_with_the_mean_over_the_array(fraction, tmp_path):
    clear = mean(tmp_path)
    veiled = mean(tmp_path, {"optics.stray_light": fraction})
    np.testing.assert_allclose(veiled, (1 - fraction) * clear + fraction * clear.mean(), rtol=1e-9)


def test_every_color_has_its_own_veil(tmp_path):
    clear = mean(tmp_path, BAYER)
    veiled = mean(tmp_path, BAYER, {"optics.stray_light": 0.1})
    at = np.indices(clear.shape)
    for color in (at.sum(0) % 2 == 0, (at[0] % 2 == 0) & (at[1] % 2 == 1), at[0] % 2 > at[1] % 2):
        expected = 0.9 * clear[color] + 0.1 * clear[color].mean()
        np.testing.assert_allclose(veiled[color], expected, rtol=1e-9)


def test_comes_after_the_falloff_of_the_lens_and_before_the_dark(tmp_path):
    """The mean is of the light that reaches the sensor: shaded in the corners, without dark."""
    wide = {"optics.off_axis": "cos4", "optics.focal_length": "0.3 mm"}
    dark = {"pixel.photodetector.dark_current": "30 ke/s"}
    clear = mean(tmp_path, wide)
    veiled = mean(tmp_path, wide, dark, {"optics.stray_light": 0.1})
    np.testing.assert_allclose(veiled, 0.9 * clear + 0.1 * clear.mean() + 300, rtol=1e-9)


def test_bound_of_its_change(tmp_path):
    """Half bright, half dark is the most that a picture can lose, and it reaches the bound."""
    made = camera(tmp_path, {"optics.stray_light": 0.1})
    effect = StrayLight.from_camera(made, geometry(made))
    bound = effect.mean_error(SignalLevels(full_signal=200.0, time=1.0))
    half = np.repeat([0.0, 200.0], 50)
    change = 0.1 * (half - half.mean())
    assert math.sqrt(np.mean(change**2)) == pytest.approx(bound, rel=1e-12)


def test_the_plan_says_what_it_changes_with_a_falloff_before_it(tmp_path):
    wide = {"optics.off_axis": "cos4", "optics.focal_length": "0.3 mm", "optics.stray_light": 0.1}
    on = simulate(camera(tmp_path, EDGE | wide))
    full = on.mean_electrons.max()
    said = {d.name: d.contribution for d in on.frame.plan.decisions}
    for name in ("stray_light", "off_axis"):
        off = simulate(camera(tmp_path, EDGE | wide | {"effects": QUIET | {name: "off"}}))
        change = math.sqrt(np.mean((on.mean_electrons - off.mean_electrons) ** 2))
        assert said[name] == pytest.approx(change / full, rel=1e-6)
