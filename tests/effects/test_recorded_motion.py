"""A camera's path from a file: against Bessel functions, sums over instants, and other headers."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from making import camera, long_except, tree
from moving_waves import (
    FREQUENCY,
    IMAGE,
    LINE,
    PITCH,
    ROWS,
    STILL,
    TIME,
    WAVE,
    exposure,
    seen,
)
from scipy.special import j0

from vcam_cli import simulate
from vcam_cli.camera.derived.camera_angles import camera_angles
from vcam_cli.errors import BadInput
from vcam_cli.physics.motion_blur import path_transfer
from vcam_cli.simulation import checks

SWING = 4e-4
"""Amplitude of the vibration [rad]: 2 um on the sensor, 0.4 pixels."""


def record(folder: Path, pan, tilt=None, roll=None, end: float = 0.03, rows: int = 6001) -> Path:
    """Angles [rad] as functions of time, in a file."""
    times = np.linspace(0, end, rows)
    columns = {"time_s": times, "pan_rad": pan(times)}
    columns |= {"tilt_rad": tilt(times)} if tilt else {}
    columns |= {"roll_rad": roll(times)} if roll else {}
    file = folder / "imu.csv"
    table = np.array(list(columns.values())).T
    np.savetxt(file, table, "%.12g", ",", header=",".join(columns), comments="")
    return file


def mean(folder: Path, *changes: dict) -> np.ndarray:
    merged = dict(STILL)
    for change in changes:
        merged |= change
    return simulate(camera(folder, merged)).mean_electrons


def recorded(file: Path) -> dict:
    return {"scene.camera_motion": {"file": str(file)}}


def contrast(signal: np.ndarray) -> float:
    """Amplitude over mean of a wave along rows, by its own frequency."""
    f, x = FREQUENCY, (np.arange(signal.shape[1]) - (signal.shape[1] - 1) / 2) * PITCH
    basis = np.stack([x * 0 + 1, np.cos(2 * np.pi * f * x), np.sin(2 * np.pi * f * x)], axis=1)
    level, cosine, sine = np.linalg.lstsq(basis, signal.mean(axis=0), rcond=None)[0]
    return math.hypot(cosine, sine) / level


@pytest.mark.parametrize("swing", [1e-4, 4e-4, 1e-3, 2e-3])
def test_of_whole_periods_of_a_vibration_a_bessel_function_is_left(swing, tmp_path):
    """J0(2 pi f a), a = swing x image distance: within 0.5 % of full contrast."""
    upright = WAVE | {"orientation": "0 deg"}
    still = mean(tmp_path, {"scene.source": upright})
    file = record(tmp_path, lambda t: swing * np.sin(2 * np.pi * 400 * t))
    shaken = mean(tmp_path, {"scene.source": upright}, recorded(file), exposure(None))
    left = contrast(shaken) / contrast(still)
    assert left == pytest.approx(abs(j0(2 * np.pi * FREQUENCY * swing * IMAGE)), abs=0.005)
    if swing < 5e-4:
        assert left == pytest.approx(abs(j0(2 * np.pi * FREQUENCY * swing * IMAGE)), rel=0.005)


def shake(t):
    """Pan, tilt and roll at once, from 5 ms on as the file has them [rad]."""
    return (
        SWING * np.sin(2 * np.pi * 170 * t),
        0.5 * SWING * np.cos(2 * np.pi * 90 * t),
        10 * SWING * np.sin(2 * np.pi * 60 * t + 1),
    )


@pytest.mark.parametrize("direction", long_except(["up"], [None, "down", "up", "right"]))
@pytest.mark.parametrize("axes", long_except(["pan tilt roll"], ["pan tilt", "pan tilt roll"]))
def test_every_line_sees_its_own_part_of_the_path(axes, direction, tmp_path):
    """Wobble: a sum over 60 instants of every line, within the error of the record's own steps."""
    rolls = "roll" in axes
    used = [lambda t, i=i: shake(t)[i] if i < 2 or rolls else 0 * np.asarray(t) for i in range(3)]
    file = record(tmp_path, *used)
    reference = 0.012
    changes = {"exposure.start": "5 ms", "exposure.reference": f"{reference} s"}
    made = exposure(direction, **{k.partition(".")[2]: v for k, v in changes.items()})
    still = mean(tmp_path, {"scene.source": WAVE})
    moved = mean(tmp_path, {"scene.source": WAVE}, recorded(file), made)
    count = {"right": 64}.get(direction, ROWS)
    middle = 0.005 + TIME / 2 + (LINE * (count - 1) / 2 if direction else 0)

    def since(t, axis):
        return used[axis](t + middle) - used[axis](reference)

    def position(z, t):
        shift = (-since(t, 0) + 1j * since(t, 1)) * IMAGE
        return (z - shift) * np.exp(1j * since(t, 2))

    truth = seen(still, position, lambda t: -since(t, 2), direction)
    error = np.sqrt(np.mean((moved - truth) ** 2)) / truth.max()
    assert error < 2e-4
    assert np.sqrt(np.mean((moved - still) ** 2)) > 50 * error * truth.max()


def test_a_steady_path_is_a_sinc():
    """Straight and even, in one piece or in many: sinc(f . path) about its middle."""
    fx, fy = np.linspace(-2e5, 2e5, 7), np.linspace(0, 1.5e5, 5)
    path = np.array([23e-6, -11e-6])
    for pieces in (2, 40):
        along = np.linspace(-0.5, 0.5, pieces)
        found = path_transfer(fx, fy, along, along * path[0], along * path[1])
        expected = np.sinc(fx[None, :] * path[0] + fy[:, None] * path[1])
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_path_that_rests_keeps_what_it_sees_there():
    """A third of the time at each of three places: the mean of three phases."""
    times = [0, 1, 1 + 1e-9, 2, 2 + 1e-9, 3]
    x = np.array([-1, -1, 0.5, 0.5, 2, 2]) * 1e-6
    fx = np.linspace(0, 4e5, 9)
    found = path_transfer(fx, np.zeros(1), times, x, 0 * x)[0]
    expected = np.exp(-2j * np.pi * np.outer(fx, [-1e-6, 0.5e-6, 2e-6])).mean(axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-6)


HEADERS = {
    "time_s,pan_deg,tilt_deg": (1, 180 / math.pi),
    "t_ms,yaw [deg],pitch [deg]": (1e3, 180 / math.pi),
    "Timestamp (us),Pan (mrad),Tilt (mrad)": (1e6, 1e3),
    "time [ns],gyro_y [rad/s],gyro_x [rad/s]": (1e9, None),
    "#timestamp [ns],w_RS_S_y [rad s^-1],w_RS_S_x [rad s^-1]": (1e9, None),
    "time_s,gyro_y_dps,GyroX_deg_s": (1, "deg"),
}


@pytest.mark.parametrize("header", HEADERS)
def test_headers_as_instruments_write_them(header, tmp_path):
    """Angles, or rates about the camera's axes: the same path, whatever the units."""
    clock, size = HEADERS[header]
    times = np.linspace(0, 0.5, 2001)
    pan, tilt = 0.01 * np.sin(9 * times), 0.004 * (1 - np.cos(7 * times))
    if isinstance(size, float | int):
        columns = pan * size, tilt * size
    else:
        scale = math.degrees(1) if size else 1.0
        columns = 0.09 * np.cos(9 * times) * scale, 0.028 * np.sin(7 * times) * scale
    file = tmp_path / "imu.csv"
    rows = np.array([(times + 12.5) * clock, *columns]).T
    np.savetxt(file, rows, "%.12g", ",", header=header, comments="")
    found = camera_angles(str(file))
    at = np.array([0.0, 0.2501, 0.4])
    expected = [0.01 * np.sin(9 * at), 0.004 * (1 - np.cos(7 * at)), 0 * at]
    # The trapezoidal rule and straight pieces between the rows err by 1e-6 of the path.
    np.testing.assert_allclose(found.angles_at(at), expected, atol=2e-8)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("time_s,pan\n0,1\n1,2\n", "'pan' has no unit"),
        ("pan_deg,tilt_deg\n0,1\n1,2\n", "the header is"),
        ("time_s,acc_x\n0,1\n1,2\n", "the header is"),
        ("time_s,pan_deg,yaw_deg\n0,1,1\n1,2,1\n", "the header is"),
        ("time_s,pan_deg\n0,1\n0,2\n", ":3: the times do not rise"),
        ("time_s,pan_deg\n0,1\n", "less than two rows"),
        ("time_s,pan_deg\n0,1\n1,nan\n", "imu.csv:3"),
        ("0,1\n1,2\n", "no line names its columns"),
        ("time_s,pan_deg\n0,1\n0.004,2\n", "move exposure.start, or record longer"),
    ],
)
def test_files_that_are_refused(text, said, tmp_path):
    file = tmp_path / "imu.csv"
    file.write_text(text, encoding="utf-8")
    made = tmp_path / "wrong.yaml"
    made.write_text(yaml.safe_dump(tree(recorded(file)), sort_keys=False), encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        checks.load(str(made))
    assert said in str(caught.value)
    assert "scene.camera_motion.file" in str(caught.value)


def test_a_file_stands_in_place_of_speeds(tmp_path):
    file = record(tmp_path, np.sin)
    both = {"scene.camera_motion": {"file": str(file), "pan": "1 deg/s"}}
    made = tmp_path / "wrong.yaml"
    made.write_text(yaml.safe_dump(tree(both), sort_keys=False), encoding="utf-8")
    with pytest.raises(BadInput, match="in addition to a file of angles"):
        checks.load(str(made))


def test_what_was_read_of_a_file_is_said(tmp_path):
    file = tmp_path / "imu.csv"
    file.write_text("time_s,pan_deg,acc_x\n0,0,9\n1,0.3,9\n", encoding="utf-8")
    source = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}}
    few = {"array.rows": 8, "array.columns": 8}
    notes = simulate(camera(tmp_path, STILL | source | few | recorded(file))).notes
    [note] = [note for note in notes if note.startswith("imu.csv")]
    assert note.endswith("moves by time_s, pan_deg; acc_x are ignored")
