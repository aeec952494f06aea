"""Pictures that emit light: their three primaries come back as those of the display."""

import numpy as np
import pytest
from PIL import Image

from tests.making import GONE, tree
from vcam_cli.camera.camera import Camera
from vcam_cli.processing.color_correction import fit_primaries
from vcam_cli.simulation.simulate import simulate


@pytest.mark.parametrize("pattern", ["bayer-rggb", "rgbw", "stacked"])
@pytest.mark.parametrize("model", ["laser", "rgb-display"])
def test_a_picture_that_emits_comes_back_in_its_own_colors(tmp_path, model, pattern):
    colors = np.array([[128, 64, 128], [255, 255, 255], [255, 0, 0], [20, 200, 90]], np.uint8)
    file = tmp_path / "four.png"
    Image.fromarray(np.repeat(np.repeat(colors.reshape(2, 2, 3), 24, 0), 24, 1)).save(file)
    rgb = {"R": "generic-red", "G": "generic-green", "B": "generic-blue"}
    changes = {
        "scene.source": {"kind": "image", "file": str(file), "model": model},
        "scene.illuminant": GONE,
        "scene.radiance": GONE,
        "scene.luminance": "100 cd/m2",
        "array": {"rows": 48, "columns": 48, "pattern": pattern},
        "processing": GONE,
        "effects": {"shot_noise": "off", "diffraction": "off"},
        "exposure.time": "700 ms",
        "adc.bits": 16,
        "accuracy": "standard",
    }
    if pattern == "rgbw":
        changes["array.filters"] = rgb | {"W": 0.9}
    camera = Camera.model_validate(tree(changes))
    assert camera.processing[-2].value == "primaries"
    render = simulate(camera).render[6::12, 6::12].reshape(-1, 3)
    shown = render[[0, 2, 8, 10]].astype(int)
    # Rounding of the ADC and of the render
    assert np.abs(shown - colors).max() <= 1, shown


def test_primaries_are_told_apart_by_any_three_colors():
    signals = np.array([[9.0, 2.0, 0.5], [1.0, 7.0, 2.0], [0.2, 1.0, 5.0], [8.0, 9.0, 6.0]])
    for used in (signals[:3], signals):
        white = used.sum(axis=1)
        fit = fit_primaries(used, balanced=False)
        assert fit.note == ""
        np.testing.assert_allclose(fit.matrix @ used, white.max() * np.eye(3), atol=1e-12)
        fit = fit_primaries(used, balanced=True)
        gains = white.max() / white
        np.testing.assert_allclose(
            fit.matrix @ (gains[:, np.newaxis] * used), white.max() * np.eye(3), atol=1e-12
        )
    alike = fit_primaries(np.array([signals[0]] * 3), balanced=True)
    assert "too few colors" in alike.note
    blind = fit_primaries(np.diag([1.0, 1.0, 0.0]), balanced=True)
    assert "not every color" in blind.note


def test_only_a_picture_that_emits_has_primaries():
    changes = {"processing": [{"color_correction": "primaries"}], "array.pattern": "stacked"}
    with pytest.raises(ValueError, match="has primaries"):
        Camera.model_validate(tree(changes))
