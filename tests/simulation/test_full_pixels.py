"""Scenes that fill every pixel: nothing that acts on the light is called for."""

import numpy as np
import pytest
from making import camera, long_except, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.camera import Camera
from vcam_cli.simulation.simulate import prepare

CHARTS = {
    "uniform": {"reflectance": 0.1},
    "sinusoid": {"contrast": 0.8, "frequency": "30 lp/mm"},
    "step-wedge": {},
    "slanted-edge": {"contrast": 0.9},
    "colorchecker": {},
    "dead-leaves": {"seed": 3},
    "dead-leaves with a card": {"colorchecker": 0.5},
}
WELL = 100e3
LIT = {
    "scene.illuminant": "D65", "array.pattern": "bayer-rggb", "effects": "auto",
    "accuracy": "standard", "array.rows": 8, "array.columns": 10, "optics.off_axis": "exact",
    "pixel.photodetector.quantum_efficiency": "front-illuminated-qe",
    "optics.transmittance": "ir-cut-650", "optics.focal_length": "0.2 mm",
}  # fmt: skip
LIGHT = {"diffraction", "pixel_aperture", "off_axis"}
"""Effects on the light."""


def before(chart: str, tmp_path, changes: dict) -> Camera:
    source = {"kind": "chart", "chart": chart.split()[0], **CHARTS[chart]}
    return camera(tmp_path, {**LIT, "scene.source": source, **changes})


def left_out(made: Camera) -> set[str]:
    return {d.name for d in prepare(made, 1)[0].plan.decisions if d.state == "off"}


@pytest.mark.parametrize("chart", long_except(CHARTS.keys() - {"dead-leaves with a card"}, CHARTS))
def test_no_place_is_darker_than_a_chart_says(chart, tmp_path):
    """In any color, relative to the perfect white in it."""
    ready = prepare(before(chart, tmp_path, {}), 1)[0]
    g, rng = ready.geometry, np.random.default_rng(5)
    x, y = (np.sort(rng.uniform(-s, s, 60)) for s in (g.sensor_width, g.sensor_height))
    light = ready.scene.values_at(x, y, ready.transfer.level.T)
    darkest = getattr(ready.scene, "chart", ready.scene).darkest
    least = (light.min(axis=(1, 2)) / ready.white_rate).min()
    assert 0 < darkest <= least * (1 + 1e-6)


LEAVES = {"dead-leaves", "dead-leaves with a card"}
"""Of which frames with everything on take seconds, and which are no darker than they say, above."""


@pytest.mark.parametrize("chart", long_except(CHARTS.keys() - LEAVES, CHARTS))
def test_nothing_acts_on_light_that_fills_every_pixel(chart, tmp_path):
    """The codes are those of a camera with everything on, noise included."""
    made = before(chart, tmp_path, {"scene.radiance": "1e6 W/(sr m2)"})
    assert left_out(made) >= LIGHT
    everything = made.with_({"effects": "all"})
    assert np.array_equal(simulate(made, 1).dn, simulate(everything, 1).dn)


@pytest.mark.parametrize(
    ("wells", "changes"),
    [
        (1.2, {}),
        (0.5, {}),
        (50.0, {"exposure": {"auto": {"max": "10 ms"}}}),
        (50.0, {"exposure": {"captures": ["0.01 ms", "10 ms"]}}),
        (50.0, {"effects": {"saturation": "off"}}),
        (2.5, {"pixel.fpn": {"gain_pixel": "20 %"}}),
    ],
)
def test_all_counts_where_some_pixel_may_not_be_full(wells, changes, tmp_path):
    """A pixel that noise, a shorter time or no well keeps from being full shows what light it had.

    The falloff is 20 % in the corners.
    """
    plain = {"array.pattern": "monochrome", "scene.illuminant": {"monochromatic": "550 nm"}}
    plain |= {"pixel.photodetector.quantum_efficiency": 0.5, "optics.transmittance": 1}
    source = {"kind": "chart", "chart": "uniform", "reflectance": 1.0}
    lit = {"scene.radiance": radiance_for(wells * WELL), "scene.source": source}
    made = camera(tmp_path, {**LIT, **plain, **lit, **changes})
    assert "off_axis" not in left_out(made)
    full = camera(tmp_path, {**LIT, **plain, **lit, "scene.radiance": radiance_for(4 * WELL)})
    assert "off_axis" in left_out(full)
