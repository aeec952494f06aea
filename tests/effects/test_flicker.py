"""Flicker: what each line sees of a lamp that goes up and down, against sums over many instants."""

import itertools

import numpy as np
import pytest
import yaml
from making import QUIET, camera, long_except, radiance_for, tree

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.temporal.flicker import Flicker
from vcam_cli.errors import BadInput
from vcam_cli.physics import flicker
from vcam_cli.simulation import checks

LINE = 100e-6
ROWS, COLUMNS = 48, 64


def changes(time: float = 8e-3, direction: str = "down", **lamp) -> dict:
    flickering = {"frequency": "120 Hz", "depth": "30 %"} | lamp
    shutter = {"rolling": {"line_time": "100 us", "direction": direction}}
    return {
        "scene.illuminant": {"monochromatic": "550 nm", "flicker": flickering},
        "scene.radiance": radiance_for(40000, time),
        "exposure": {"time": f"{time} s", "shutter": shutter},
        "effects": QUIET,
    }


def lines(mean: np.ndarray, direction: str) -> np.ndarray:
    """The signal of every line, in the order in which they are exposed."""
    along = mean[:, 5] if direction in ("down", "up") else mean[7]
    return along[::-1] if direction in ("up", "left") else along


def brute_force(wave, time: float, count: int, instants: int = 40000) -> np.ndarray:
    """Mean of a wave of time over the exposure of every line, by the midpoint rule."""
    at = (np.arange(instants) + 0.5) / instants * time
    return np.array([wave(line * LINE + at).mean() for line in range(count)])


@pytest.mark.parametrize(
    ("time", "direction"),
    long_except(
        [(0.5e-3, "down"), (4e-3, "up"), (8e-3, "right"), (20e-3, "left")],
        itertools.product([0.5e-3, 4e-3, 8e-3, 20e-3], ["down", "up", "right", "left"]),
        several=True,
    ),
)
def test_every_line_sees_the_light_of_its_own_time(direction, time, tmp_path):
    mean = simulate(camera(tmp_path, changes(time, direction, phase="40 deg"))).mean_electrons
    steady = simulate(camera(tmp_path, changes(time) | {"scene.illuminant": GREEN})).mean_electrons

    def wave(t):
        return 1 + 0.3 * np.cos(2 * np.pi * 120 * t + np.radians(40))

    found = lines(mean / steady, direction)
    # 32 bits are not asked for at reference; the midpoint rule errs by 1e-9
    np.testing.assert_allclose(found, brute_force(wave, time, len(found)), rtol=1e-6)


GREEN = {"monochromatic": "550 nm"}


def test_banding_contrast_falls_with_the_integration_time_as_a_sinc(tmp_path):
    """Over lines of a whole period: (max - min) / (max + min) = depth |sinc(f T)|, within 0.5 %."""
    for time in (1e-3, 3e-3, 5e-3, 13e-3):
        long = {"array.rows": 1000, "array.columns": 4}
        mean = simulate(camera(tmp_path, changes(time) | long)).mean_electrons[:, 0]
        contrast = (mean.max() - mean.min()) / (mean.max() + mean.min())
        assert contrast == pytest.approx(0.3 * abs(np.sinc(120 * time)), rel=0.005)


def test_whole_periods_see_steady_light(tmp_path):
    mean = simulate(camera(tmp_path, changes(2 / 120))).mean_electrons
    assert np.ptp(mean) / mean.mean() < 1e-6  # rounding of the time in the file


def test_a_global_shutter_has_no_bands(tmp_path):
    made = changes(4e-3) | {"exposure": {"time": "4 ms"}}
    mean = simulate(camera(tmp_path, made)).mean_electrons
    steady = simulate(camera(tmp_path, made | {"scene.illuminant": GREEN})).mean_electrons
    light = brute_force(lambda t: 1 + 0.3 * np.cos(2 * np.pi * 120 * t), 4e-3, 1)[0]
    np.testing.assert_allclose(mean, light * steady, rtol=1e-6)


@pytest.mark.parametrize(
    ("time", "duty", "depth"),
    long_except(
        [(0.7e-3, 0.5, 1.0), (8.4e-3, 0.2, 0.6), (0.7e-3, 0.9, 0.3), (8.4e-3, 1.0, 0.5)],
        [
            (time, duty, depth)
            for time in (0.7e-3, 8.4e-3)
            for duty, depth in ((0.5, 1.0), (0.2, 0.6), (0.9, 0.3), (1.0, 0.5))
        ],
        several=True,
    ),
)
def test_a_switched_lamp_against_a_sum_over_instants(duty, depth, time):
    phase = 1.1

    def wave(t):
        bright = (120 * t + phase / (2 * np.pi)) % 1 < duty
        low, high = 1 - depth, 1 + depth
        return np.where(bright, high, low) / (duty * high + (1 - duty) * low)

    starts = LINE * np.arange(200)
    found = flicker.pulse_mean(starts, time, 120, depth, duty, phase)
    # two edges that the midpoint rule has wrong by half an instant each
    np.testing.assert_allclose(found, brute_force(wave, time, 200), atol=3e-4)


@pytest.mark.parametrize("duty", [None, 0.1, 0.5, 0.8])
def test_the_bound_is_kept_and_reached(duty):
    starts = np.linspace(0, 1 / 120, 5000)
    for time in (0.1e-3, 2e-3, 7e-3, 30e-3):
        bound = flicker.most_change(time, 120, 0.4, duty)
        if duty is None:
            light = flicker.sinusoid_mean(starts, time, 120, 0.4)
        else:
            light = flicker.pulse_mean(starts, time, 120, 0.4, duty)
        most = np.abs(light - 1).max()
        assert most <= bound * (1 + 1e-9)
        if duty is None or time == 0.1e-3:
            assert most == pytest.approx(bound, rel=1e-4)


def test_samples_of_one_integration_see_their_own_times(tmp_path):
    times = [1e-3, 4e-3, 9e-3]
    found = changes() | {"exposure": {"captures": ["1 ms", "4 ms", "9 ms"]}}
    found["exposure"]["shutter"] = {"rolling": {"line_time": "100 us"}}
    off = {"effects": QUIET | {"quantization": "off"}}
    flickering = simulate(camera(tmp_path, found | off)).samples_electrons
    steady = simulate(camera(tmp_path, found | off | {"scene.illuminant": GREEN})).samples_electrons
    for number, time in enumerate(times):
        light = brute_force(lambda t: 1 + 0.3 * np.cos(2 * np.pi * 120 * t), time, ROWS)
        ratio = flickering[number, :, 3] / steady[number, :, 3]
        np.testing.assert_allclose(ratio, light, rtol=1e-5)


def test_the_plan_leaves_out_what_no_exposure_shows(tmp_path):
    """Of whole periods it is left out, of others it runs; the light is within the promise."""
    auto = {"effects": "auto", "accuracy": "standard"}
    states = []
    for time in (10 / 120, 8e-3):
        result = simulate(camera(tmp_path, changes(time) | auto))
        [said] = [d for d in result.frame.plan.decisions if d.name == "flicker"]
        states.append(said.state)
    assert states == ["off", "on"]
    steady = simulate(camera(tmp_path, changes(8e-3) | {"scene.illuminant": GREEN}))
    change = result.mean_electrons - steady.mean_electrons
    rms = np.sqrt(np.mean(change**2)) / result.mean_electrons.max()
    assert said.contribution == pytest.approx(rms, rel=0.01)


def test_its_bound_as_an_effect(tmp_path):
    made = camera(tmp_path, changes(8e-3))
    effect = Flicker.from_camera(made, geometry(made))
    bound = effect.mean_error(SignalLevels(full_signal=200.0, time=8e-3))
    assert bound == pytest.approx(200 * 0.3 * abs(np.sinc(120 * 8e-3)), rel=1e-12)


def test_it_is_no_lamp_of_the_measuring_bench(tmp_path):
    lamp = camera(tmp_path, changes()).scene.illuminant
    assert lamp.flicker is not None
    assert lamp.steady.flicker is None
    assert lamp.steady.line == lamp.line


def test_flicker_alone_is_that_of_daylight_and_a_name_may_be_given(tmp_path):
    lamp = {"flicker": {"frequency": "100 Hz", "depth": "5 %"}}
    assert camera(tmp_path, {"scene.illuminant": lamp}).scene.illuminant.steady.lamp == "D65"
    named = camera(tmp_path, {"scene.illuminant": {"lamp": "FL2"} | lamp}).scene.illuminant
    assert named.steady.lamp == "FL2"
    assert named.to_yaml()["flicker"] == lamp["flicker"] | {"phase": "0 deg"}


@pytest.mark.parametrize(
    ("wrong", "path", "word"),
    [
        ({"scene.illuminant": {"lamp": "D66", "flicker": {}}}, "scene.illuminant.lamp", "D65"),
        (
            {"scene.illuminant": {"flicker": {"frequency": "100", "depth": "3 %"}}},
            "scene.illuminant.flicker.frequency",
            "100 Hz",
        ),
        ({"exposure.shutter": "curtain"}, "exposure.shutter", "global"),
        (
            {
                "exposure.shutter": {"rolling": {"line_time": "1 us"}},
                "array.binning": {"rows": 2, "columns": 2, "kind": "charge"},
            },
            "exposure.shutter",
            "not built yet",
        ),
    ],
)
def test_mistakes_are_told_with_their_place(wrong, path, word, tmp_path):
    with pytest.raises(BadInput) as caught:
        file = tmp_path / "wrong.yaml"
        file.write_text(yaml.safe_dump(tree(wrong), sort_keys=False), encoding="utf-8")
        checks.load(str(file))
    text = str(caught.value)
    assert path in text
    assert word in text
