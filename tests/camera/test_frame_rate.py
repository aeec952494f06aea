"""Frames a second from the readout's clocks, by architecture."""

import math

import pytest
from making import camera
from typer.testing import CliRunner

from vcam_cli.camera.derived.frame_rate import frame_rate
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.physics.transfer_time import transfer_time

ARRAY = {"array": {"rows": 100, "columns": 200, "pattern": "monochrome"}}


def rate_of(folder, architecture, timing=None, **more):
    changes = {"pixel.architecture": architecture, **ARRAY, **more}
    if timing is not None:
        changes["pixel.readout.timing"] = timing
    return frame_rate(camera(folder, changes))


def test_the_charge_left_behind_by_a_sum_of_diffusing_modes():
    """1-D diffusion out of a gate of uniform charge: sum over odd modes of (8/pi^2)/n^2 exp(..)."""
    length, diffusivity, wanted = 4e-6, 35e-4, 3e-5
    t = float(transfer_time(length, wanted))
    tau = 4 * length**2 / (math.pi**2 * diffusivity)
    left = sum(8 / (math.pi * n) ** 2 * math.exp(-(n**2) * t / tau) for n in range(1, 99, 2))
    assert left == pytest.approx(wanted, rel=1e-9)


def test_a_ccd_of_1024_by_1024_stays_below_25_frames(tmp_path):
    """Chen 2003, section 1.2.1: 0.99997 of the charge, capacitors 4 um apart, three phases."""
    transfer = {"inefficiency": 3e-5, "phases": 3}
    more = {
        "pixel.width": "12 um",
        "pixel.readout.charge_transfer": transfer,
        "array": {"rows": 1024, "columns": 1024, "pattern": "monochrome"},
    }
    found = rate_of(tmp_path, "ccd", **more)
    shift = 3 * float(transfer_time(4e-6, 3e-5))
    assert found.readout_time == pytest.approx(1024 * (1024 + 1) * shift, rel=1e-9)
    assert 10 < found.rate() < 25
    assert found.rate(0.2) == pytest.approx(5), "exposed while it is read"


def test_rows_of_active_pixels_add_up(tmp_path):
    found = rate_of(tmp_path, "aps-3t", {"row_time": "10 us"})
    assert found.readout_time == pytest.approx(100 * 10e-6)
    assert found.rate(1e-3) == pytest.approx(500), "exposed before it is read"
    serial = {"row_time": "10 us", "pixel_time": "50 ns", "outputs": 4}
    found = rate_of(tmp_path, "aps-4t", serial)
    assert found.readout_time == pytest.approx(100 * (10e-6 + 200 * 50e-9 / 4))


def test_digital_pixels_convert_at_once(tmp_path):
    timing = {"conversion_time": "100 us", "pixel_time": "10 ns", "outputs": 2}
    found = rate_of(tmp_path, "dps", timing)
    assert found.readout_time == pytest.approx(100e-6 + 100 * 200 * 10e-9 / 2)
    assert found.overlaps


def test_pixels_that_are_joined_first_are_read_as_one(tmp_path):
    joined = {"array": {**ARRAY["array"], "binning": {"rows": 2, "columns": 4, "kind": "charge"}}}
    found = rate_of(tmp_path, "aps-3t", {"row_time": "8 us", "pixel_time": "1 us"}, **joined)
    assert found.readout_time == pytest.approx(50 * (8e-6 + 50e-6))


def test_the_lines_of_a_rolling_shutter_tell_the_time(tmp_path):
    rolling = {"exposure": {"time": "1 ms", "shutter": {"rolling": {"line_time": "20 us"}}}}
    found = rate_of(tmp_path, "aps-3t", **rolling)
    assert found.rate(1e-3) == pytest.approx(1 / (100 * 20e-6)), "exposed while others are read"


def test_without_clocks_nothing_is_said(tmp_path):
    assert rate_of(tmp_path, "aps-3t") is None
    stages = {"pixel.readout.charge_transfer": {"inefficiency": 1e-5, "phases": 1}}
    assert rate_of(tmp_path, "ccd", **stages) is None


@pytest.mark.parametrize(
    ("architecture", "timing", "key"),
    [("aps-3t", {"outputs": 2}, "row_time"), ("dps", {"row_time": "1 us"}, "pixel_time")],
)
def test_a_clock_that_is_missing_is_asked_for(architecture, timing, key, tmp_path):
    with pytest.raises(BadInput, match=f"{key}: is missing"):
        rate_of(tmp_path, architecture, timing)


def test_the_plan_shows_it():
    sets = ["--set", "pixel.readout.timing={row_time: 10 us}", "-q"]
    done = CliRunner().invoke(app, ["plan", "starter", *sets])
    assert done.exit_code == 0, done.output
    assert "416.7 at most" in done.stdout
