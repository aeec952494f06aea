"""Cameras of which no color, or not every color, sees light: a cap on the lens, a blind filter."""

import numpy as np
import pytest
from making import GONE, QUIET, camera, long_except

from vcam_cli.simulation.simulate import simulate

NOTHING = {
    "luminance": {"scene.luminance": "0 cd/m2"},
    "radiance": {"scene.radiance": "0 W/(sr m2)"},
    "illuminance": {"scene.illuminance": "0 lx"},
    "cap": {"scene.source": {"kind": "chart", "chart": "dark"}},
    "black": {"scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0}},
    "transmittance": {"optics.transmittance": 0},
    "table": {"optics.transmittance": {"table": {400: 0, 700: 0}, "outside": "hold"}},
    "silicon": {"pixel.photodetector.quantum_efficiency": 0},
    "filters": {"array.filters": {"R": 0, "G": 0, "B": 0}},
}
SCENES = {
    "edge": {"kind": "chart", "chart": "slanted-edge"},
    "colors": {"kind": "chart", "chart": "colorchecker"},
    "wave": {"kind": "chart", "chart": "sinusoid", "frequency": "20 lp/mm"},
    "points": {"kind": "chart", "chart": "point-grid", "spacing": "50 um"},
    "letters": {"kind": "chart", "chart": "eye-chart"},
}
"""One of every way in which image formation goes."""
BAYER = {
    "array": {"rows": 10, "columns": 12, "pattern": "bayer-rggb"},
    "scene.illuminant": "D65",
    "scene.wavelengths": {"start": "400 nm", "stop": "700 nm"},
    "pixel.photodetector.dark_current": "1000 e/s",
    "optics.stray_light": 0.01,
    "optics.off_axis": "exact",
    "processing": [{"black_level": "subtract"}, {"demosaic": "bilinear"}, {"gamma": 2.2}],
    "quality": ["mse", "psnr", "cielab", "s-cielab"],
}


def taken(tmp_path, changes, scene="edge", effects="auto"):
    """A frame without noise."""
    chosen = QUIET | {"quantization": "on"} if effects == "auto" else effects
    changes = {"scene.source": SCENES[scene], "effects": chosen} | BAYER | changes
    if {"scene.luminance", "scene.illuminance"} & changes.keys():
        changes = {"scene.radiance": GONE} | changes
    return simulate(camera(tmp_path, changes), 1)


@pytest.mark.parametrize("effects", ["auto", "all"])
@pytest.mark.parametrize(
    ("way", "scene"), [*((way, "edge") for way in NOTHING), *(("silicon", s) for s in SCENES)]
)
def test_a_dark_frame(tmp_path, way: str, scene: str, effects: str) -> None:
    """Dark current alone: 1000 e/s in 10 ms, whatever would have kept the light away."""
    result = taken(tmp_path, NOTHING[way], scene, effects)
    np.testing.assert_array_equal(result.frame.rate, 0)
    np.testing.assert_allclose(result.mean_electrons, 10, rtol=1e-6)
    assert np.isfinite(result.linear).all()
    assert not any(np.isnan(value) for value in result.metrics.values())
    assert ("this is a dark frame" in " ".join(result.notes)) == (way not in ("cap", "black"))


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("color", long_except(["G"], "RGB"))
def test_a_blind_color(tmp_path, color: str, scene: str) -> None:
    """The pixels of the other colors see what they saw."""
    filters = {"R": 0.5, "G": 0.5, "B": 0.5}
    before = taken(tmp_path, {"array.filters": filters}, scene)
    after = taken(tmp_path, {"array.filters": filters | {color: 0}}, scene)
    blind = np.array(after.colors)[after.color] == color
    np.testing.assert_array_equal(after.frame.rate[blind], 0)
    # The promise at `reference`: 0.02 % of full signal, in each of the two.
    seen, full = before.frame.rate, before.frame.rate.max()
    np.testing.assert_allclose(after.frame.rate[~blind], seen[~blind], atol=2 * 2e-4 * full)
    assert np.isfinite(after.linear).all()
    assert f"no light reaches the electrons of {color}" in after.notes


def test_what_is_zero_at_a_wavelength_alone_changes_nothing_else(tmp_path) -> None:
    """A node of a table is 0 beside the only line of the light, where it does not count."""
    line = {"scene.illuminant": {"monochromatic": "600 nm"}}
    whole = taken(tmp_path, line | {"optics.transmittance": 1})
    node = {"table": {400: 0, 500: 0, 550: 1, 700: 1}}
    cut = taken(tmp_path, line | {"optics.transmittance": node})
    np.testing.assert_array_equal(cut.frame.rate, whole.frame.rate)
