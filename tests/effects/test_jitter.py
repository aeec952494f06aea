"""Pointing jitter: the transfer function of normally distributed displacements."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.image_motion import check_motion
from vcam_cli.effects.temporal.jitter import Jitter
from vcam_cli.errors import BadInput

WAVE = {
    "scene.source": {"kind": "chart", "chart": "sinusoid", "frequency": "50 lp/mm", "contrast": 1},
    "scene.radiance": radiance_for(2000),
    "effects": QUIET,
    "accuracy": {"preset": "standard", "float_width": 64},
}
"""50 lp/mm are 0.25 cycles per pixel of 5 um."""


def mean(folder, **changes: object) -> np.ndarray:
    return simulate(camera(folder, WAVE | changes)).mean_electrons


def test_contrast_of_a_wave(tmp_path):
    """exp(-2 pi^2 0.5^2 0.25^2) = 0.7346: Holst's closed form."""
    clear, soft = mean(tmp_path), mean(tmp_path, **{"scene.camera_motion": {"jitter": "0.5 px"}})
    transfer = np.exp(-2 * np.pi**2 * 0.5**2 * 0.25**2)
    assert transfer == pytest.approx(0.7346, abs=1e-4)
    np.testing.assert_allclose(soft - 1000, transfer * (clear - 1000), atol=1e-6)


def test_is_the_mean_over_many_displacements():
    """Drawn at random: the standard error of a mean of 100,000 cosines is below 0.003."""
    shifts = np.random.default_rng(2).normal(0, 2e-6, 100_000)
    frequency = np.array([0.0, 3e4, 9e4])
    drawn = np.cos(2 * np.pi * np.outer(frequency, shifts)).mean(axis=1)
    np.testing.assert_allclose(Jitter(2e-6, 5e-6).otf(frequency, 550e-9), drawn, atol=0.015)


def test_two_jitters_add_in_squares():
    frequency = np.linspace(0, 2e5, 9)
    three, four, five = (Jitter(s * 1e-6, 5e-6).otf(frequency, 550e-9) for s in (3, 4, 5))
    np.testing.assert_allclose(three * four, five, rtol=1e-12)


def test_is_left_out_where_it_changes_nothing(tmp_path):
    for jitter, state in (("0.001 px", "off"), ("1 px", "on")):
        changes = {"scene.camera_motion": {"jitter": jitter}, "effects": "auto"}
        made = simulate(camera(tmp_path, WAVE | changes | {"accuracy": "standard"}))
        assert {d.name: d.state for d in made.frame.plan.decisions}["jitter"] == state


def test_none_without_a_lens(tmp_path):
    made = camera(tmp_path, WAVE)
    assert Jitter.from_camera(made, geometry(made)) is None
    bare = {
        "optics": "none",
        "scene.radiance": "0.1 W/(sr m2)",
        "scene.source": {"kind": "chart", "chart": "uniform"},
        "scene.camera_motion": {"jitter": "1 px"},
    }
    with pytest.raises(BadInput, match="bare sensor"):
        check_motion(camera(tmp_path, bare))


def test_almost_all_of_the_light_stays_within_its_reach():
    """All but 3e-4 of it: exp(-r^2 / 2 sigma^2) of a normal distribution lies beyond r."""
    jitter = Jitter(2e-6, 5e-6)
    assert 1e-4 < np.exp(-((jitter.reach / 2e-6) ** 2) / 2) < 1e-3
