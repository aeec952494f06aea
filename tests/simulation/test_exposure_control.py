"""Automatic exposure that follows: its control law in closed form, against light that changes."""

import itertools

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli.files.folder import OutputFolder
from vcam_cli.progress import Silent
from vcam_cli.simulation.sequence import frames, write_sequence
from vcam_cli.simulation.simulate import simulate

RATE = 40.0
LAMP = {
    "monochromatic": "550 nm",
    "flicker": {"frequency": "10 Hz", "depth": "60 %", "duty": "50 %"},
}
"""A lamp that is bright in two frames of four, dark in the two that follow."""


def exposures(
    folder, count: int, changes: dict, start: str = "0 s", **auto
) -> list[tuple[float, float, float]]:
    """Time, gain and mean signal of every frame."""
    automatic = {"max": "20 ms", "method": "mean", "target": 0.5} | auto
    made = camera(
        folder,
        {
            "scene.illuminant": LAMP,
            "scene.radiance": radiance_for(20000),
            "array.rows": 8,
            "array.columns": 8,
            "effects": QUIET,
            "exposure": {"auto": automatic, "start": start},
        }
        | changes,
    )
    return [
        (result.exposure_time, result.frame.camera.exposure_gain, result.mean_electrons.mean())
        for _, result in frames(made, count, RATE, None, Silent())
    ]


@pytest.mark.parametrize("follow", [1.0, 0.5, 0.2])
def test_every_frame_goes_part_of_the_way_to_what_the_last_one_needed(follow, tmp_path):
    """E(n + 1) = E(n) (target / level of frame n)^follow, exposures well within their limits."""
    short = {"scene.radiance": radiance_for(400000)}
    found = exposures(tmp_path, 9, short, follow=follow)
    well = 100000
    for (time, _, level), (later, gain, _) in itertools.pairwise(found):
        assert later == pytest.approx(time * (0.5 * well / min(level, well)) ** follow, rel=2e-4)
        assert gain == 1
    assert max(t for t, _, _ in found) > 1.5 * min(t for t, _, _ in found)


def test_after_a_step_the_distance_falls_as_a_power(tmp_path):
    """A lamp goes dim behind the first frame: the distance in EV times (1 - follow) a frame."""
    switched = {"frequency": "0.5 Hz", "depth": "60 %", "duty": "50 %"}
    goes_out = {
        "scene.illuminant": LAMP | {"flicker": switched},
        "scene.radiance": radiance_for(80000),
    }
    found = exposures(tmp_path, 8, goes_out, follow=0.3, start="0.98 s")
    distance = np.log2([level / 50000 for _, _, level in found])
    assert distance[0] == pytest.approx(np.log2(1.6), abs=1e-6)  # metered in the lamp's mean light
    assert distance[1] == pytest.approx(0.7 * np.log2(1.6) - 2, abs=1e-4)  # and 1.6 / 0.4 = 4
    np.testing.assert_allclose(distance[2:] / distance[1:-1], 0.7, rtol=1e-3)


def test_gain_follows_where_the_time_has_its_longest(tmp_path):
    dark = {"scene.radiance": radiance_for(4000)}
    found = exposures(tmp_path, 6, dark, max_gain=16, follow=1)
    assert {time for time, _, _ in found} == {0.02}
    gains = [gain for _, gain, _ in found]
    assert max(gains) > 1.5 * min(gains) > 1.5


def test_an_overexposed_frame_tells_no_more_than_that_it_was(tmp_path):
    """All of its light is at saturation, whatever it was: so the next has target times its time."""
    flicker = {"frequency": "10 Hz", "depth": "99 %", "duty": "50 %", "phase": "180 deg"}
    lamp = LAMP | {"flicker": flicker}
    bright = {"scene.illuminant": lamp, "scene.radiance": radiance_for(400000)}
    found = exposures(tmp_path, 6, bright, follow=1)
    full = [n for n, (_, _, level) in enumerate(found[:-1]) if level > 100000]
    assert full
    for n in full:
        assert found[n + 1][0] == pytest.approx(0.5 * found[n][0], rel=1e-9)


def test_a_white_that_stays_leaves_the_exposure_as_it_is(tmp_path):
    found = exposures(tmp_path, 4, {}, method="white")
    assert len({(time, gain) for time, gain, _ in found}) == 1


def test_following_is_said_to_change_nothing_in_a_single_frame(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    small = {"array.rows": 8, "array.columns": 8, "effects": QUIET}
    made = camera(tmp_path, small | {"exposure": {"auto": {"max": "20 ms", "follow": 0.2}}})
    said = [note for note in simulate(made).notes if "exposure.auto.follow" in note]
    assert len(said) == 1
    assert "only in sequences" in said[0]
    with OutputFolder(tmp_path / "out") as folder:
        first, _ = write_sequence(made, 2, RATE, folder, None, Silent())
    assert not [note for note in first.notes if "exposure.auto.follow" in note]
