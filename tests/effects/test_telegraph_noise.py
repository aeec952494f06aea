"""Random telegraph noise: levels of a pixel, moments over pixels, whiteness over frames."""

import math

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.noise.telegraph_noise import TelegraphNoise

NOISE = {"fraction": "20 %", "amplitude": "30 e", "occupancy": "25 %"}


def frames(folder, count: int, **changes) -> np.ndarray:
    """Frames of one sensor without their mean (count, rows, columns) [electrons]."""
    given = {
        "scene.radiance": radiance_for(500),
        "pixel.readout.telegraph_noise": NOISE,
        "effects": QUIET | {"telegraph_noise": "on"},
        "array": {"rows": 100, "columns": 120, "pattern": "monochrome"},
    }
    taken = [camera(folder, given | changes | {"seed.frame": n}) for n in range(count)]
    return np.array([r.electrons - r.mean_electrons for r in map(simulate, taken)])


@pytest.mark.parametrize(("architecture", "levels"), [("aps-3t", 2), ("aps-4t", 3)])
def test_a_pixel_has_few_levels_that_stay(architecture, levels, tmp_path):
    """With a trap: two levels a step apart, or three with correlated double sampling."""
    found = frames(tmp_path, 30, **{"pixel.architecture": architecture}).round(6)
    counts = np.array([len(np.unique(found[:, r, c])) for r in range(20) for c in range(120)])
    assert counts.max() == levels
    share, n = np.mean(counts > 1), counts.size
    # of 30 frames, all in one state: 0.75^30, and with two readouts each 0.625^30
    assert share == pytest.approx(0.2, abs=5 * math.sqrt(0.2 * 0.8 / n) + 0.2 * 0.75**30)
    if levels == 3:
        lively = found[:, counts.reshape(20, 120).argmax() // 120, :]
        three = [np.unique(column) for column in lively.T if len(np.unique(column)) == 3]
        for low, middle, high in three:
            assert middle == 0
            assert low == -high


def test_steps_are_exponential(tmp_path):
    """Highest less lowest of 30 frames is the step: mean 30, mean square 2 x 30^2."""
    found = frames(tmp_path, 30)
    steps = np.ptp(found, axis=0).ravel()
    steps = steps[steps > 1e-6]
    assert steps.mean() == pytest.approx(30, rel=5 / math.sqrt(steps.size))
    spread = math.sqrt(20 / steps.size)  # of the square of an exponential number, over its mean: 5
    assert np.mean(steps**2) == pytest.approx(1800, rel=5 * spread)


def test_frames_are_white(tmp_path):
    """Neighbors in time and in place are uncorrelated; the same traps vary in all frames."""
    found = frames(tmp_path, 12)
    power = np.mean(found**2)
    for a, b in ((found[1:], found[:-1]), (found[:, 1:], found[:, :-1])):
        scale = np.sqrt(np.mean(a**2 * b**2) / a.size)
        assert np.mean(a * b) == pytest.approx(0, abs=5 * scale)
    busy = found[0] != 0
    assert np.mean(found[1:] ** 2, axis=0)[~busy].max() == 0 < power


def test_variance_stated():
    """Of two levels p (1 - p) A^2, of three twice that; A^2 is twice the squared mean of A."""
    assert TelegraphNoise(0.1, 20.0, 0.5).variance(0.0) == pytest.approx(0.1 * 800 / 4)
    assert TelegraphNoise(0.1, 20.0, 0.5, True).variance(0.0) == pytest.approx(0.1 * 800 / 2)


@pytest.mark.parametrize("states", [{"occupancy": "0 %"}, {"occupancy": "100 %"}])
def test_traps_that_never_change_are_none(states, tmp_path):
    made = camera(tmp_path, {"pixel.readout.telegraph_noise": NOISE | states})
    assert TelegraphNoise.from_camera(made, None) is None
