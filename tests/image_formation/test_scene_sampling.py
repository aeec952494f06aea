"""How a scene's spectrum is computed: with how many bits."""

from dataclasses import replace

import numpy as np
import pytest
from optical_paths import PITCH, aperture, of_picture, on_chart, path, rms, sensor, signal

from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.image_formation.estimates import scene_sampling
from vcam_cli.image_formation.estimates.scene_sampling import with_sufficient_precision
from vcam_cli.image_formation.settings import STANDARD
from vcam_cli.scenes.base import Frame
from vcam_cli.scenes.charts.hdr_patches import hdr_patches

SHAPE = 300, 400


def picture(lamp: float = 0.0) -> np.ndarray:
    """Noise around 1/2, and a lamp on a hundredth of each side."""
    light = np.random.default_rng(2).random(SHAPE)
    if lamp:
        light[100:103, 200:204] = lamp
    return light


PICTURES = {
    "noise": picture(),
    "even": np.ones(SHAPE),
    "point": np.eye(1, SHAPE[0] * SHAPE[1], 51_234).reshape(SHAPE),
    "lamp": picture(1e5),
}


def before(tolerance: float = 0.005, ceiling: float = np.inf, shape: tuple[int, int] = SHAPE):
    g = sensor(*shape, (0.8, 0.7))
    knobs = replace(STANDARD, tolerance=tolerance, oversampling=2.0)
    return path(g, Diffraction(4.0, 0.0), aperture(g), knobs=knobs, ceiling=ceiling)


def light_of_both_widths(light, monkeypatch):
    """A picture's light by numbers of 32 and of 64 bits."""
    seen = before(shape=light.shape)
    monkeypatch.setattr(
        "vcam_cli.image_formation.strategies.with_sufficient_precision", lambda path, scene: path
    )
    double = replace(seen, settings=replace(seen.settings, float_width=64))
    single, exact = (
        signal(path, of_picture(light, PITCH, dtype))
        for path, dtype in ((seen, np.float32), (double, np.float64))
    )
    return single.astype(float), exact


def test_transforms_of_prime_lengths_round_most(monkeypatch):
    """They are made of longer ones: the error is more than half of what is stated."""
    light = np.random.default_rng(1).random((601, 797)).astype(np.float32)
    error = rms(*light_of_both_widths(light, monkeypatch)) / rms(light)
    assert scene_sampling.SINGLE / 2 < error < scene_sampling.SINGLE


@pytest.mark.parametrize("name", PICTURES)
def test_rounding_of_32_bits_is_in_proportion_to_the_rms_of_the_light(name, monkeypatch):
    """However bright its brightest sample is."""
    light = PICTURES[name].astype(np.float32)
    assert 0 < rms(*light_of_both_widths(light, monkeypatch)) < scene_sampling.SINGLE * rms(light)


@pytest.mark.parametrize(
    ("lamp", "tolerance", "ceiling", "bits"),
    [
        (0.0, 0.005, np.inf, 32),
        (0.0, 1e-6, np.inf, 64),
        (1e6, 0.005, np.inf, 32),  # the lamp is full signal
        (1e6, 0.005, 2.0, 64),  # it fills every pixel, and the others are judged beside it
        (1e3, 0.005, 2.0, 32),
        (1e3, 1e-5, 2.0, 64),
    ],
)
def test_numbers_have_as_many_bits_as_rounding_asks_for(lamp, tolerance, ceiling, bits):
    seen = replace(before(tolerance, ceiling), full=min(max(lamp, 1.0), ceiling))
    assert with_sufficient_precision(seen, of_picture(picture(lamp), PITCH)).settings == replace(
        seen.settings, float_width=bits
    )


def test_a_lamp_in_a_chart_asks_for_64_bits():
    seen = before(ceiling=2.0)
    frame = Frame(SHAPE[1] * PITCH, SHAPE[0] * PITCH)
    for lamp, bits in ((1e2, 32), (1e6, 64)):
        scene = on_chart(seen, hdr_patches(24, 1000.0, lamp, frame), margin=10)
        assert with_sufficient_precision(seen, scene).settings.float_width == bits
