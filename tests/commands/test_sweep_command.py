"""`vcam sweep`: what it says, how it ends; the shipped study; studies in the other commands."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from making import tree
from typer.testing import CliRunner

from vcam_cli.commands import options, progress
from vcam_cli.commands.main import app
from vcam_cli.files import atomic
from vcam_cli.sweeps import sweep as module

STUDY = {
    "kind": "sweep",
    "camera": "camera.yaml",
    "vary": {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 3}},
    "metrics": ["mean_electrons"],
    "optimize": {"metric": "mean_electrons", "goal": "max"},
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(changes=None, **study):
    small = {"array.rows": 8, "array.columns": 12, "accuracy": "draft"}
    Path("camera.yaml").write_text(yaml.safe_dump(tree({**small, **(changes or {})})))
    given = {key: value for key, value in (STUDY | study).items() if value is not None}
    Path("study.yaml").write_text(yaml.safe_dump(given, sort_keys=False))


def vcam(*args, code=0):
    done = CliRunner().invoke(app, list(args), prog_name="vcam")
    assert done.exit_code == code, done.output
    return done


def points():
    with open("out/study/points.csv", newline="") as file:
        return list(csv.DictReader(file))


def one(*args, code=0):
    return vcam("sweep", "study.yaml", "--workers", "1", *args, code=code)


def test_a_person_reads_the_optimum_and_where_it_all_is():
    write()
    text = one().stdout
    lines = [line.split() for line in text.splitlines()]
    assert lines[0] == ["pixel.width", "[um]", "mean_electrons"]
    assert [line[0] for line in lines[1:4]] == ["4", "5", "6"]
    shown = [f"{float(row['mean_electrons']):.6g}" for row in points()]
    assert [line[1] for line in lines[1:4]] == shown
    assert lines[5][:6] == ["case", "parameter", "unit", "best", "low", "high"]
    assert lines[6][:6] == ["nominal", "pixel.width", "um", "none", "mean_electrons", shown[2]]
    assert "best at 6, the high end of its range" in text
    assert "3 of 3 points, 3 computed in" in text
    assert text.endswith("study: out/study/\n")
    assert "3 of 3 points, 0 computed in" in one().stdout
    assert one("-q").output == ""


def test_results_are_means_over_seeds_and_repeats():
    """Of what is varied alone is there a row; words stand left, numbers right."""
    phases = {"scene.source.phase": ["0 deg", "90 deg"]}
    chart = {"kind": "chart", "chart": "csf", "max_frequency": "20 lp/mm"}
    write(
        {"scene.source": chart},
        vary={"pixel.architecture": {"values": ["aps-3t", "aps-4t"]}},
        seeds=2,
        repeat=phases,
        optimize=None,
    )
    head, *rows, said = one().stdout.partition("\n\n")[0].splitlines()
    assert head.split() == ["pixel.architecture", "mean_electrons"]
    assert said == "means over seeds and repeats"
    assert [row.split()[0] for row in rows] == ["aps-3t", "aps-4t"]
    for row in rows:
        name, shown = row.split()
        every = [float(p["mean_electrons"]) for p in points() if p["pixel.architecture"] == name]
        assert len(every) == 4
        assert shown == f"{sum(every) / 4:.6g}"


def test_a_long_table_is_cut_where_no_optimum_stands_for_it():
    widths = {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 26}}
    write(vary=widths, optimize=None)
    assert "and 2 rows more: points.csv" in one().stdout
    write(vary=widths)
    assert one().stdout.startswith("case")


def test_a_point_that_failed_leaves_its_cell_empty():
    write(vary={"optics.f_number": {"values": [4, -1]}}, optimize=None)
    assert [line.split() for line in one(code=4).stdout.splitlines()[1:3]][1] == ["-1"]


def test_a_narrow_terminal_gets_plain_columns(monkeypatch, capsys):
    """No number is cut, and brackets are no markup."""
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    head, row = ["case", ">exposure.time [ms]"], ["nominal", "10"]
    monkeypatch.setattr(options, "line_width", lambda most: 20)
    options.print_table(head, [row])
    assert capsys.readouterr().out == "case     exposure.time [ms]\nnominal                  10\n"
    monkeypatch.setattr(options, "line_width", lambda most: 80)
    options.print_table(head, [row])
    assert "exposure.time [ms]" in capsys.readouterr().out


def test_json_is_all_there_is_on_stdout():
    write()
    told = json.loads(one("--json").stdout)
    assert (told["points"], told["computed"], told["failed"], told["missing"]) == (3, 3, 0, 0)
    assert told["optimum"][0]["parameter"] == "pixel.width"
    assert told["optimum"][0]["edge"] == "high"
    assert json.loads(one("--json", "--shard", "1/3", "-o", "part").stdout)["missing"] == 2


def test_failing_points_end_with_4():
    write(vary={"optics.f_number": {"values": [4, -1]}})
    done = one(code=4)
    assert "study.yaml:7:7: " in done.stderr
    assert "optics.f_number: -1 is negative" in done.stderr
    assert "1 failed: see the column error of points.csv" in done.stdout


def test_a_study_without_a_valid_point_ends_with_2():
    write(vary={"optics.f_number": {"values": [-2, -1]}})
    assert "-2 is negative" in one(code=2).stderr
    write(cases={"a": {"pixel.widht": "4 um"}})
    assert "did you mean width?" in one(code=2).stderr
    assert not Path("out").exists()


def test_many_messages_are_cut_short():
    write(vary={"optics.f_number": {"values": [4, *range(-20, 0)]}})
    said = one(code=4).stderr.splitlines()
    assert len(said) == 13
    assert said[-1] == "and 8 more"


@pytest.mark.parametrize("shard", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2"])
def test_shares_that_are_none(shard):
    write()
    assert "is not a share such as 2/8" in one("--shard", shard, code=2).stderr


def test_the_seed_is_the_first_of_the_frames():
    write(seeds=2)
    one("--seed", "7")
    rows = Path("out/study/points.csv").read_text().splitlines()[1:]
    assert [row.split(",")[2] for row in rows] == ["7", "8"] * 3


def test_a_full_disk_ends_with_3(monkeypatch):
    write()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "replace", full)
    assert "the disk is full" in one(code=3).stderr


@pytest.mark.long  # tests/hostile/test_interrupts.py interrupts sweeps
@pytest.mark.parametrize("workers", ["1", "2"])
def test_ctrl_c_says_that_points_are_kept(workers):
    """All points would take more than a minute: no wait for the disk outlasts them."""
    write(
        {"array.rows": 300, "array.columns": 300, "scene.source.chart": "dead-leaves"},
        vary={"pixel.width": {"start": "4 um", "stop": "6 um", "count": 300}},
    )
    command = [sys.executable, "-m", "vcam_cli.commands.main", "sweep", "study.yaml"]
    root = str(Path(module.__file__).parents[2])
    # Where a shell started the tests in the background, they ignore SIGINT, and so would the sweep.
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(
        [*command, "--workers", workers],
        env=os.environ | {"PYTHONPATH": root},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    signal.signal(signal.SIGINT, former)
    until = time.monotonic() + 60
    while len(list(Path("out/study/points").glob("*.json"))) < 1 and time.monotonic() < until:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    last = err.splitlines()[-1]  # on a busy machine, stages are told before it
    assert last == "interrupted; finished points are kept, and the same command continues"
    assert not list(Path("out/study/points").glob("*.part"))


def test_a_log_has_a_line_a_minute(capsys, monkeypatch):
    assert progress.LOG_INTERVAL == 60
    monkeypatch.setattr(progress, "LOG_INTERVAL", 0.01)
    monkeypatch.setattr(progress, "LOG_STEP", 0.01)
    monkeypatch.setattr(progress, "LOG_AFTER", 0.0)
    with progress.Progress(quiet=True, log="sweep") as log:
        log.begin("sweep")
        log.step(3, 12)
        time.sleep(0.05)
    assert capsys.readouterr().err == ""
    with progress.Progress(log="sweep") as log:
        log.begin("sweep")
        time.sleep(0.1)
        assert capsys.readouterr().err == "sweep: computing points\n"  # nothing more is known yet
        log.step(3, 12)
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert lines
    assert all(line.startswith("sweep: 3 of 12, about ") for line in lines)


@pytest.mark.draws
def test_plots_are_pictures_and_the_same_bytes():
    write(cases={"a": {}, "b": {"scene.radiance": "0.2 W/(sr m2)"}}, seeds=2)
    one()
    first = Path("out/study/mean_electrons.png").read_bytes()
    assert first.startswith(b"\x89PNG")
    assert len(first) > 5000
    one("-o", "other")
    assert Path("other/mean_electrons.png").read_bytes() == first


class TestStudiesElsewhere:
    def test_validate(self):
        write()
        assert vcam("validate", "study.yaml", "camera.yaml").stdout == (
            "study.yaml: ok (study)\ncamera.yaml: ok (made)\n"
        )
        assert vcam("validate", "exposure-and-noise").stdout.endswith("ok (exposure-and-noise)\n")

    def test_validate_tells_every_point_that_is_refused(self):
        write(vary={"optics.f_number": {"values": [4, -1, -2]}})
        said = vcam("validate", "study.yaml", code=2).stderr.splitlines()
        assert [line.partition(": ")[0] for line in said] == ["study.yaml:7:7", "study.yaml:8:7"]

    def test_list(self):
        assert "exposure-and-noise" in vcam("list", "studies").stdout
        assert "kind: sweep" in vcam("list", "studies", "exposure-and-noise").stdout

    def test_a_study_given_to_run(self):
        write()
        said = vcam("run", "study.yaml", code=2).stderr
        assert "this is a study (kind: sweep); give a camera file, or run the study" in said

    def test_init_writes_a_study_that_is_valid_beside_its_camera(self):
        vcam("init", "new")
        assert sorted(p.name for p in Path("new").iterdir()) == [
            *("camera.yaml", "schemas", "study.yaml")
        ]
        assert vcam("validate", "new/study.yaml").exit_code == 0
        assert "camera: camera.yaml" in Path("new/study.yaml").read_text()


@pytest.mark.long
def test_the_shipped_study():
    """Noisier pixels want to be exposed longer; saturation ends it for both at about the same."""
    sizes = ["--set", "array.rows=60", "--set", "array.columns=90", "--accuracy", "draft"]
    small = [*sizes, "--set", "scene.source={kind: chart, chart: step-wedge}"]
    told = json.loads(vcam("sweep", "exposure-and-noise", *small, "--json", "-q").stdout)
    quiet, noisy = told["optimum"]
    assert told["points"] == 72
    assert told["failed"] == 0
    for found in (quiet, noisy):
        assert found["edge"] == ""
        assert 15 < found["low"] <= found["optimum"] <= found["high"] < 40
    assert quiet["value"] < noisy["value"]
