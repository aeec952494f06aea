"""Stacks of frames beside those that a camera file predicts: right files agree, others differ."""

import csv
import json
import math

import numpy as np
import planted
import pytest
import yaml
from scipy.stats import t as student
from typer.testing import CliRunner

from vcam_cli.commands.main import app
from vcam_cli.verification import measured_points
from vcam_cli.verification.pooled import SURE, pool
from vcam_cli.verification.stack_prediction import FALSE_ALARMS, STACKS, Judged, bound
from vcam_cli.verification.stack_quantities import quantities

FEW = "dark, short", "half"
QUICK = {
    "no row noise": "dark, short",
    "PRNU 15 % low": "half",
    "read noise 5 % low": "dark, short",
}
"""Wrong files that are judged beside the one with a wrong gain, whose verdicts are read; and the
frames in which that is seen."""


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    folder = tmp_path_factory.mktemp("planted")
    camera = planted.true_camera(folder)
    return camera, folder, planted.bench(camera, folder, 3, FEW, 4)


@pytest.fixture(scope="module")
def right(taken):
    """What is judged of the right file."""
    camera, _, file = taken
    return planted.judged(camera, {}, file)


def form_of(file, *names):
    """What the file of the measurement holds, of the frames of some names."""
    form = yaml.safe_load(file.read_text())
    return form | {"frames": [frames for frames in form["frames"] if frames["name"] in names]}


def named(frames, highest=4095):
    return {quantity.name: quantity.value for quantity in quantities(frames, highest)}


def test_spectra_and_variances_are_those_of_known_noise():
    """White noise of rows is spread evenly; its bands add up to the variance of row means.

    Five standard errors of 199 rows, 8 frames: 5 (2 / (199 * 7))^1/2 = 19 %; pixels 5 % of that.
    """
    rng = np.random.default_rng(1)
    frames = 1000 + 3 * rng.standard_normal((8, 200, 160)) + 2 * rng.standard_normal((8, 200, 1))
    found = named(frames)
    rows = [v for name, v in found.items() if name.startswith("temporal variance of rows")]
    parts = np.array([0.25, 0.25, 0.5])
    known = (4 + 9 / 160) * 7 / 8 * parts
    assert np.array(rows) == pytest.approx(known, rel=0.19 / math.sqrt(0.25))
    assert sum(rows) == pytest.approx(known.sum(), rel=0.19)
    assert found["temporal variance of pixels [DN2]"] == pytest.approx(9, rel=0.02)
    assert found["temporal noise beyond 3 sigma [1]"] == pytest.approx(0.0027, rel=0.15)
    half = found["width of 50% of the temporal noise [DN]"]
    assert half == pytest.approx(2 * 0.6745 * 3 * math.sqrt(7 / 8), rel=0.02)


def test_a_wave_is_in_the_band_of_its_frequency():
    """Amplitude 5, 20 cycles over 160 rows: 12.5 DN^2 at 0.125 cycles a pixel."""
    wave = 5 * np.cos(2 * math.pi * 20 * np.arange(160) / 160)
    found = named(np.broadcast_to(1000 + wave[:, None], (1, 160, 64)))
    bands = [v for name, v in found.items() if name.startswith("spatial variance of rows")]
    assert bands == pytest.approx([12.5, 0, 0], abs=1e-9)
    assert not [name for name in found if "temporal" in name]


def test_outliers_and_ends_are_shares_and_change_no_variance():
    rng = np.random.default_rng(2)
    frames = np.rint(2000 + 4 * rng.standard_normal((6, 100, 100)))
    before = named(frames)
    frames[:, 10, 20:30], frames[:, 50, 40:45] = 4095, 0
    found = named(frames)
    assert found["codes at the highest [1]"] == pytest.approx(1e-3)
    assert found["codes of 0 [1]"] == pytest.approx(5e-4)
    assert found["outliers of the pattern [1]"] == pytest.approx(1.5e-3)
    for name in ("temporal variance of pixels [DN2]", "spatial variance of pixels [DN2]"):
        assert found[name] == pytest.approx(before[name], rel=0.005)


def test_the_bound_holds_the_false_alarms_of_all_quantities():
    assert student.sf(bound(100), STACKS - 1) == pytest.approx(FALSE_ALARMS / 200)
    assert bound(200) > bound(100) > bound(1)


def judged(deviation, rng, spread=0.02):
    others = tuple(rng.standard_normal(STACKS))
    return Judged(
        "", "temporal variance of pixels [DN2]", 1.0, 1.0, deviation, others, spread, True
    )


def test_small_deviations_of_one_kind_add_up():
    """Seven of 2 standard deviations are 14 of 7^1/2; the least error by hand, to the others' 20 %.

    None of them is beyond a bound of 4; all of them are.
    """
    rng = np.random.default_rng(8)
    [found] = pool({"lit frames": [judged(2.0, rng) for _ in range(7)]})
    assert found.judged.deviation == pytest.approx(14 / math.sqrt(7), rel=0.2)
    assert found.least_error(4.0) == pytest.approx((4 + SURE) * 0.02 / math.sqrt(7), rel=0.2)
    assert pool({"lit frames": [judged(2.0, rng)]}) == []


def test_frames_of_one_sensor_have_their_pattern_in_common():
    """The same deviations in all frames: they are one, however many frames there are."""
    rng = np.random.default_rng(9)
    one = judged(2.0, rng)
    [found] = pool({"lit frames": [one] * 7})
    assert found.judged.deviation == pytest.approx(2.0, rel=0.3)


def test_it_is_said_what_would_have_been_found(right):
    least = right.least_errors
    assert any(name.startswith("temporal variance of pixels") for name in least)
    assert all(0.002 < value < 0.5 for value in least.values())


def test_a_right_file_agrees(right):
    assert [row for row in right.judged if row.differs] == []
    assert {row.frame for row in right.judged} == {*FEW, "all frames"}
    assert right.summary()["differing"] == 0


@pytest.mark.parametrize(("what", "where"), QUICK.items())
def test_a_wrong_file_differs(taken, what, where):
    camera, folder, file = taken
    one = folder / "one.yaml"
    one.write_text(yaml.safe_dump(form_of(file, where)))
    assert planted.judged(camera, planted.WRONG[what], one).summary()["differing"] > 0


@pytest.mark.parametrize(
    ("judged", "tolerance", "code"),
    [pytest.param(FEW, "2 %", 4, marks=pytest.mark.draws), (FEW[1:], "4 %", 0)],
)
def test_the_command_ends_with_4_where_a_tolerance_is_missed(
    judged, tolerance, code, taken, tmp_path
):
    """Of a wrong gain, by two frames each: 3 % is more than 2 %, and less than 4 %; of lit frames
    alone, too."""
    _, folder, file = taken
    form = form_of(file, *judged) | {"tolerance": tolerance}
    for frames in form["frames"]:
        frames["files"] = frames["files"].replace("*", "[01]")
    file = folder / f"{code}.yaml"
    file.write_text(yaml.safe_dump(form))
    out = tmp_path / "out"
    command = ["verify", str(folder / "true.yaml"), str(file), "-o", str(out)]
    result = CliRunner().invoke(app, [*command, "--set", "adc.gain=0.309 DN/e"])
    assert result.exit_code == code, result.output
    assert "quantities of frames differ significantly" in result.output
    pooled = "smallest errors that 90 % of tests detect" in result.output
    assert pooled == (judged is FEW)
    with open(out / "verify.csv", newline="", encoding="utf-8") as listed:
        rows = list(csv.DictReader(listed))
    verdicts = {row["verdict"] for row in rows}
    assert verdicts == ({"agrees", "differs"} | ({"missed"} if code else set()))
    told = json.loads((out / "verify.json").read_text())
    assert told["judged"] == len(rows)
    assert (out / "errors.png").stat().st_size > 0


def test_large_frames_are_judged_in_their_middle(taken, monkeypatch):
    camera, folder, every = taken
    file = folder / "half.yaml"
    file.write_text(yaml.safe_dump(form_of(every, "half")))
    monkeypatch.setattr(measured_points, "WINDOW", 40)
    found = planted.judged(camera, {}, file)
    assert "noise is judged in the middle 40 x 40 pixels" in found.notes
    assert found.summary()["differing"] == 0


@pytest.mark.long
def test_twenty_right_files_agree_and_all_wrong_ones_differ(tmp_path):
    """Each right one beside frames of a sensor of its own; 1 % of right ones would differ."""
    camera = planted.true_camera(tmp_path)
    alarms = 0
    for sensor in range(20):
        found = planted.judged(camera, {}, planted.bench(camera, tmp_path, sensor))
        alarms += found.summary()["differing"] > 0
    assert alarms <= 2  # of a share of 1 % two are as rare as 2 in 100, three as 1 in 1000
    missed = [
        what
        for what, changes in planted.WRONG.items()
        if not planted.judged(camera, changes, tmp_path / "bench.yaml").summary()["differing"]
    ]
    assert missed == []
