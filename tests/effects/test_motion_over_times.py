"""What moves under exposures whose times are several, or chosen by the camera."""

import math

import numpy as np
import pytest
from making import camera, radiance_for
from moving_waves import SCALE, STILL, WAVE, exposure, seen

from vcam_cli import simulate
from vcam_cli.simulation.simulate import prepare

TIMES = (1e-3, 4e-3, 10e-3)
UNROUNDED = {"effects": STILL["effects"] | {"quantization": "off"}}
SPIN = math.radians(300)


def result(folder, *changes: dict):
    merged = dict(STILL)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged))


def captures(direction: str | None) -> dict:
    made = exposure(direction)["exposure"]
    del made["time"]
    return {"exposure": made | {"captures": [f"{time * 1e3:g} ms" for time in TIMES]}}


@pytest.mark.parametrize("direction", [None, "down"])
@pytest.mark.parametrize("motion", [{"x": "0.4 m/s", "y": "0.1 m/s"}, {"rotate": "300 deg/s"}])
def test_every_sample_has_what_moved_by_up_to_its_time(motion, direction, tmp_path):
    """Electrons at t_k: the integral from 0 to t_k over a scene that moves, by instants."""
    still = result(tmp_path, {"scene.source": WAVE}).mean_electrons
    found = result(
        tmp_path, {"scene.source": WAVE | {"motion": motion}}, captures(direction), UNROUNDED
    )
    spin = SPIN if "rotate" in motion else 0.0
    speed = 0.0 if spin else (0.4 + 0.1j) * SCALE

    def position(z, t):
        return (z - speed * t) * np.exp(-1j * spin * t)

    for time, electrons in zip(TIMES, found.samples_electrons, strict=True):
        mean = seen(still, position, lambda t: spin * t, direction, time, start=-TIMES[-1] / 2)
        expected = mean * time / TIMES[-1]
        error = np.sqrt(np.mean((electrons - expected) ** 2)) / expected.max()
        assert error < 2e-4


def test_motion_limits_what_samples_tell(tmp_path):
    """The photocurrent of several samples is that of a still scene with blur: as thesis, ch. 3."""
    quick = {"scene.source": WAVE | {"motion": {"x": "1.5 m/s"}}}
    bright = {"scene.radiance": radiance_for(300000)}  # the well is full after a third
    still = result(tmp_path, {"scene.source": WAVE}, captures(None), bright)
    moving = result(tmp_path, quick, captures(None), bright)
    blur = np.sqrt(np.mean((moving.photocurrent - still.photocurrent) ** 2))
    assert blur > 0.05 * still.photocurrent.max()


def test_an_automatic_exposure_meters_the_scene_where_its_file_says(tmp_path):
    """Its time is that of the still scene; the light is that of the moving one for that time."""
    auto = {"exposure": {"auto": {"max": "50 ms", "method": "percentile", "percentile": 90}}}
    moving = {"scene.source": WAVE | {"motion": {"x": "0.7 m/s"}}}
    metered = result(tmp_path, {"scene.source": WAVE}, auto)
    found = result(tmp_path, moving, auto)
    assert found.exposure_time == metered.exposure_time
    fixed = {"exposure": {"time": f"{found.exposure_time!r} s"}}
    assert (
        found.mean_electrons.tobytes() == result(tmp_path, moving, fixed).mean_electrons.tobytes()
    )
    assert any("meters the scene without motion" in note for note in found.notes)
    assert found.frame.camera.exposure.auto is not None
    longer = {"exposure": {"auto": {"max": "2 ms"}}}
    assert result(tmp_path, moving, longer).frame.exposure_limit == "longest time"


def test_scheduled_times_are_those_of_the_still_scene(tmp_path):
    schedule = {"exposure": {"captures": {"schedule": "optimal", "count": 3, "max": "20 ms"}}}
    moving = {"scene.source": WAVE | {"motion": {"x": "0.3 m/s"}}}
    noisy = {"effects": "all"}
    still = result(tmp_path, {"scene.source": WAVE}, schedule, noisy)
    found, notes = prepare(camera(tmp_path, STILL | moving | schedule | noisy))
    assert found.times == still.times
    assert len(found.step_rates) == len(found.times)
    assert any(note.startswith("best times") for note in notes)
