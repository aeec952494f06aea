"""The whole camera in one run, figure 1.1 of Chen 2003: each part does what it is there for."""

import numpy as np
import pytest

from vcam_cli import load, simulate

PARTS = {
    "color": {"color_correction": "fit"},
    "denoise": {"denoise": {"strength": 1}},
    "sharpen": {"sharpen": {"radius": "1 px", "amount": 1}},
    "compression": {"jpeg": {"quality": 50}},
}
WHOLE = {
    "scene.wavelengths.step": "50 nm",
    "optics.defocus": "60 um",
    "optics.focus": "auto",
    "exposure": {"auto": {"max": "6 ms", "max_gain": 8, "target": 0.9}},
    "array": {"rows": 64, "columns": 96, "pattern": "bayer-rggb", "filters": "generic-rgb"},
    "quality": [],
    "accuracy": "draft",
}


def steps(*without):
    chain = [
        {"black_level": "subtract"},
        {"demosaic": "bilinear"},
        {"white_balance": "illuminant"},
        PARTS["color"],
        PARTS["denoise"],
        PARTS["sharpen"],
        {"gamma": "srgb"},
        PARTS["compression"],
    ]
    return [step for step in chain if step not in [PARTS[part] for part in without]]


def taken(*without, **changes):
    camera = load("starter").with_(WHOLE | {"processing": steps(*without)} | changes)
    return simulate(camera, workers=1)


@pytest.fixture(scope="module")
def whole():
    return taken()


@pytest.fixture(scope="module")
def less(whole):
    """What the same camera takes without a part, its lens where the autofocus left it."""
    focus = {"optics.focus": "fixed", "optics.defocus": f"{whole.frame.camera.optics.defocus} m"}
    return lambda *parts: taken(*parts, **focus)


def roughness(picture):
    """Mean square of differences between neighbors over the squared mean."""
    return float(np.mean(np.square(np.diff(picture, axis=1))) / picture.mean() ** 2)


def test_the_lens_is_focused(whole):
    blurred = taken(**{"optics.focus": "fixed"})
    green = (slice(0, None, 2), slice(1, None, 2))
    assert roughness(whole.mean_electrons[green]) > roughness(blurred.mean_electrons[green])
    assert abs(whole.frame.camera.optics.defocus) < 20e-6


def test_time_and_gain_bring_white_to_the_converter_s_end(whole):
    """The longest time is too short at gain 1: the gain makes up for it."""
    assert whole.exposure_time == pytest.approx(6e-3)
    assert 1 < whole.frame.electrical.analog_gain <= 8
    assert np.array_equal(whole.dn, np.rint(whole.dn))
    top = 2**whole.frame.camera.adc.bits - 1
    assert 0.7 * top < whole.dn.max() <= top


def test_colors_are_corrected(less):
    """The chart's red is nearer to what its maker publishes: 175, 54, 60 in sRGB."""
    published = ((np.array([175, 54]) / 255 + 0.055) / 1.055) ** 2.4

    def off(*parts):
        rows, columns = 40, 40  # in the third patch of the third row
        red, green, _ = (
            less(*parts).linear[rows - 4 : rows + 4, columns - 4 : columns + 4].mean(axis=(0, 1))
        )
        return abs(np.log(red / green) - np.log(published[0] / published[1]))

    assert off() < off("color") / 2


def test_enhancement_smooths_and_sharpens(whole, less):
    now = roughness(whole.linear.mean(axis=2))
    assert roughness(less("sharpen").linear.mean(axis=2)) < now
    assert now < roughness(less("denoise").linear.mean(axis=2))


def test_compression_loses_a_little(whole, less):
    codes, plain = whole.render.astype(int), less("compression").render.astype(int)
    lost = np.sqrt(np.mean((codes - plain) ** 2))
    assert 0 < lost < 30
