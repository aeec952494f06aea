"""One set of effects in all points of a sweep: no jump of a curve comes from a plan."""

import pytest
from making import radiance_for
from sweeping import written

from vcam_cli import sweep
from vcam_cli.simulation.simulate import prepare, simulate
from vcam_cli.sweeps import point_work, sweep_file, sweep_points
from vcam_cli.sweeps.point_effects import (
    effect_differences,
    with_every_effect,
    with_named_effects,
)

NOISE = "pixel.readout.read_noise"
CAMERA = {
    "scene.source": {"kind": "chart", "chart": "uniform"},
    "scene.radiance": radiance_for(1000),
    "pixel.fpn": {"gain_pixel": "1 %"},
    "optics.stray_light": 0.01,
    NOISE: "2 e",
    "array.rows": 16,
    "array.columns": 24,
    "effects": "auto",
}
LIGHTS = {"exposure.time": {"values": ["0.05 ms", "1 ms", "40 ms"]}}
"""From the dark, where read noise is most of the variance, to where it is none of it."""


def points(tmp_path, changes=None, **study):
    path = written(tmp_path, CAMERA | (changes or {}), **{"vary": LIGHTS, **study})
    return path, sweep_points.grid(sweep_file.read(path)).points


def planned(camera) -> set[str]:
    return {effect.name for effect in prepare(camera, 1)[0].plan.active}


def test_all_points_simulate_what_any_of_them_calls_for(tmp_path, monkeypatch):
    """Where their own plans differ, each has the effects of all."""
    path, found = points(tmp_path)
    own = [planned(point.camera) for point in found]
    assert len(set(map(frozenset, own))) > 1
    simulated = []

    def watched(camera, *args, **others):
        result = simulate(camera, *args, **others)
        simulated.append({effect.name for effect in result.frame.plan.active})
        return result

    monkeypatch.setattr(point_work, "simulate", watched)
    sweep(path, out=tmp_path / "out", workers=1)
    assert len(simulated) == len(found)
    assert all(each == simulated[0] for each in simulated)
    assert simulated[0] >= set.union(*own)


def test_what_a_file_switches_off_stays_off(tmp_path):
    _, found = points(tmp_path, {"effects": {"stray_light": "off"}})
    for point in found:
        every = with_every_effect(point.camera)
        assert "stray_light" not in planned(every)
        assert with_named_effects(point.camera, point.effects).effects == every.effects


def test_points_with_the_same_effects_say_nothing(tmp_path):
    assert effect_differences(points(tmp_path)[1]) == ""


@pytest.mark.parametrize(
    ("study", "said"),
    [
        ({"vary": {NOISE: {"values": ["0 e", "1 e", "9 e"]}}}, "read_noise in 2 of 3"),
        ({"cases": {"with": {}, "without": {"effects.fpn": "off"}}}, "fpn in 3 of 6"),
    ],
)
def test_a_sweep_over_what_is_simulated_says_so(study, said, tmp_path):
    """Once, with the effects and how many of its cameras have them; seeds do not count."""
    path, _ = points(tmp_path, seeds=2, **study)
    told = []
    sweep(path, out=tmp_path / "out", workers=1, tell=told.append)
    assert [line for line in told if said in line] == told
    assert len(told) == 1
