"""Hot pixels that leak, bad columns and rows; and the ISO speed that limits a gain."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.errors import BadInput

NO_NOISE = {name: state for name, state in QUIET.items() if name != "fpn"}
WALL = {
    "scene.radiance": radiance_for(1000),
    "effects": NO_NOISE,
    "array.rows": 200,
    "array.columns": 300,
    "pixel.readout.full_well": "1e9 e",
    "accuracy": {"preset": "standard", "float_width": 64},
}
LEAKING = {
    "pixel.defects": {"hot": 0.05, "hot_current": 40},
    "pixel.photodetector.dark_current": {
        "value": "2 ke/s",
        "temperature": "300 K",
        "doubling": "8 K",
    },
}


def electrons(folder, *changes: dict) -> np.ndarray:
    merged = dict(WALL)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged)).electrons


def test_hot_pixels_leak_exponentially_and_grow_with_time_and_temperature(tmp_path):
    """20 e of dark signal in 10 ms; 3,000 hot pixels, whose mean has a standard error of 2 %."""
    found = electrons(tmp_path, LEAKING)
    leak = found - found.min()
    hot = leak > 1e-6
    assert hot.mean() == pytest.approx(0.05, abs=5 * np.sqrt(0.05 / found.size))
    assert leak[hot].mean() == pytest.approx(40 * 20, rel=5 / np.sqrt(hot.sum()))
    assert leak[hot].std() == pytest.approx(leak[hot].mean(), rel=0.1)
    twice = electrons(tmp_path, LEAKING, {"pixel.temperature": "308 K"})
    np.testing.assert_allclose(twice - twice.min(), 2 * leak, atol=1e-6)
    longer = electrons(tmp_path, LEAKING, {"exposure.time": "30 ms"})
    np.testing.assert_allclose(longer - longer.min(), 3 * leak, atol=1e-5)


def test_stated_variance_is_that_of_the_mixture(tmp_path):
    effect = FixedPattern.from_camera(made := camera(tmp_path, {**WALL, **LEAKING}), geometry(made))
    found = electrons(tmp_path, LEAKING)
    # Of 3,000 exponential numbers the mean square has a standard error of 4 %.
    assert effect.variance(1020.0, 20.0) == pytest.approx(float(found.var()), rel=0.2)


@pytest.mark.parametrize(("key", "axis"), [("columns", 0), ("rows", 1)])
def test_bad_lines_collect_nothing(key, axis, tmp_path):
    found = electrons(tmp_path, {"pixel.defects": {key: 0.1}})
    lost = (found == 0).all(axis=axis)
    assert ((found == 0).any(axis=axis) == lost).all()
    assert lost.mean() == pytest.approx(0.1, abs=5 * np.sqrt(0.09 / lost.size))
    np.testing.assert_allclose(np.compress(~lost, found, axis=1 - axis), 1000, rtol=1e-6)


def test_variance_of_bad_lines_is_that_of_dead_pixels():
    lines = FixedPattern(0, 0, 0, 0, bad_columns=0.1, bad_rows=0.2)
    assert lines.variance(100.0) == pytest.approx(0.28 * 0.72 * 100**2)
    assert lines.working_variance() == 0


def test_same_lines_in_both_float_types(tmp_path):
    bad = {"pixel.defects": {"columns": 0.1, "rows": 0.1}}
    coarse = {"accuracy": {"preset": "standard", "float_width": 32}}
    np.testing.assert_array_equal(
        electrons(tmp_path, bad) == 0, electrons(tmp_path, bad, coarse) == 0
    )


DIM = {
    "scene.illuminant": "D65",
    "scene.radiance": radiance_for(30),
    "exposure": {"auto": {"max": "10 ms", "max_iso": 400}},
}


def test_the_iso_speed_limits_the_gain(tmp_path):
    frame = simulate(camera(tmp_path, DIM)).frame
    assert frame.solved.gain == pytest.approx(400 / frame.base_iso)
    assert frame.exposure_limit == "largest gain"


def test_limits_that_contradict(tmp_path):
    both = {"exposure": {"auto": {"max": "10 ms", "max_iso": 400, "max_gain": 2}}}
    with pytest.raises(BadInput, match="max_iso"):
        camera(tmp_path, DIM | both)
    low = {"exposure": {"auto": {"max": "10 ms", "max_iso": 0.01}}}
    with pytest.raises(BadInput, match="is below ISO"):
        simulate(camera(tmp_path, DIM | low))
    with pytest.raises(BadInput, match="no dark current"):
        simulate(camera(tmp_path, {**WALL, "pixel.defects": LEAKING["pixel.defects"]}))
    idle = simulate(camera(tmp_path, {**WALL, "pixel.defects": {"hot_current": 5}}))
    assert any("no hot pixels" in note for note in idle.remarks)
