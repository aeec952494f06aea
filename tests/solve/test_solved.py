"""A camera, solved: the same as solving the file that says the same, whatever way it came about."""

import pytest
from making import camera

from vcam_cli.camera.derived.electrical import circuit
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.solve import solved as module
from vcam_cli.solve.solved import Solved, solve

NOISY = {
    "pixel.readout.read_noise": {"table": {1: "5 e", 16: "1.5 e"}},
    "adc": {"bits": 12, "offset": "auto", "noise": "2 DN"},
}
MOVING = {"kind": "chart", "chart": "slanted-edge", "motion": {"x": "0.1 m/s"}}


def facts(found: Solved) -> tuple:
    """What frames depend on of a solved camera."""
    effects = tuple(found.effects.found.items())
    return found.geometry, found.electrical, effects, found.settings, found.base_iso


@pytest.mark.parametrize("gain", [1, 4, 16])
def test_another_gain_is_that_of_a_file_with_it(gain, tmp_path):
    """Read noise follows the gain, an automatic offset the noise, the step of the ADC both."""
    found = solve(camera(tmp_path, NOISY)).at_gain(gain)
    written = solve(camera(tmp_path, NOISY | {"exposure": {"time": "10 ms", "gain": gain}}))
    assert found.gain == gain
    assert facts(found) == facts(written)


def test_an_iso_speed_is_a_gain(tmp_path):
    """gain = iso / base_iso, and the base ISO speed is that of gain 1."""
    plain = solve(camera(tmp_path, NOISY))
    iso = 4 * plain.base_iso
    found = solve(camera(tmp_path, NOISY | {"exposure": {"time": "10 ms", "iso": iso}}))
    assert found.base_iso == plain.base_iso
    assert found.gain == pytest.approx(4, rel=1e-12)
    assert found.electrical.offset == plain.at_gain(4.0).electrical.offset


def test_a_camera_meters_what_stands_still(tmp_path):
    moving = solve(camera(tmp_path, {"scene.source": MOVING, "effects": {"motion": "on"}}))
    still = solve(camera(tmp_path, {"scene.source": {"kind": "chart", "chart": "slanted-edge"}}))
    found = moving.standing_still()
    assert moving.effects.found["motion"] is not None
    assert found.effects.found == still.effects.found
    assert not found.scene.moves


def test_a_chosen_time_is_that_of_a_file_with_it_and_the_file_is_kept(tmp_path):
    auto = solve(camera(tmp_path, NOISY | {"exposure": {"auto": {"max": "1 s", "max_gain": 8}}}))
    found = auto.timed(0.02, 2.5, ())
    written = solve(camera(tmp_path, NOISY | {"exposure": {"time": "20 ms", "gain": 2.5}}))
    assert facts(found) == facts(written)
    assert found.exposure.time == 0.02
    back = found.with_exposure(auto.exposure)
    assert back.exposure is auto.exposure
    assert back.gain == back.camera.exposure_gain == 2.5


def test_a_lens_that_is_moved_is_that_of_a_file_that_says_so(tmp_path):
    found = solve(camera(tmp_path, {"optics.focus": "auto"})).focused_at(5e-6)
    written = solve(camera(tmp_path, {"optics.defocus": "5 um"}))
    assert facts(found) == facts(written)
    assert found.optics.focus == "fixed"


def test_every_effect_is_built_once_and_the_circuit_solved_for_each_gain_once(
    tmp_path, monkeypatch
):
    """A second gain, beside that of the file, is only that of the base ISO speed."""
    made, solvings = camera(tmp_path, NOISY), []
    monkeypatch.setattr(module, "electrical", lambda c: solvings.append(c) or electrical(c))
    solve(made)
    assert len(solvings) == 1
    solvings.clear()
    solve(camera(tmp_path, NOISY | {"exposure": {"time": "10 ms", "gain": 4}}))
    assert sorted(c.exposure_gain for c in solvings) == [1, 4]


def test_the_circuit_is_that_of_the_gain(tmp_path):
    found = solve(camera(tmp_path, NOISY)).at_gain(8.0)
    assert found.electrical.exposure_gain == circuit(found.camera).exposure_gain == 8
