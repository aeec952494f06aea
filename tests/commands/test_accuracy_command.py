"""`vcam accuracy`: the files it leaves and what it says."""

import csv
import json

import pytest
from typer.testing import CliRunner

from vcam_cli.accuracy_study import measurements
from vcam_cli.commands.main import app

SMALL = ("--set", "array.rows=12", "--set", "array.columns=16")
UNIFORM = "scene.source={kind: chart, chart: uniform}"


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    out = tmp_path_factory.mktemp("accuracy") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measurements, "TURNS", 1)
        arguments = ["accuracy", "slanted-edge-f8", *SMALL, "-o", str(out)]
        text = CliRunner().invoke(app, [*arguments, "--set", UNIFORM, "--workers", "1"])
        assert text.exit_code == 0, text.output
        again = CliRunner().invoke(app, [*arguments, "--set", UNIFORM, "--json"])
        assert again.exit_code == 0, again.output
    return out, text.stdout, json.loads(again.stdout)


def test_files(ran):
    out, _, _ = ran
    assert sorted(p.name for p in out.iterdir()) == [
        "accuracy.csv",
        "accuracy.json",
        "accuracy.png",
    ]
    lines = (out / "accuracy.csv").read_text().splitlines()
    assert lines[0] == (
        "knob,setting,rms_error,max_error,rms_electrons,seconds,seconds_spread,mean_s_cielab,"
        "tolerance_spent"
    )
    rows = list(csv.reader(lines[1:]))
    assert all(float(cell) >= 0 for row in rows for cell in row[2:] if cell != "")
    assert {"preset", "auto", "all", "effect:diffraction"} <= {row[0] for row in rows}
    record = json.loads((out / "accuracy.json").read_text())
    assert record["program"] == "vcam"
    assert record["camera"]
    assert record["effects"]


def test_a_person_reads_tables_and_a_recommendation(ran):
    _, text, _ = ran
    for word in (
        "preset",
        "standard",
        "shot_noise",
        "expected",
        "measured",
        "recommended: ",
        "does not apply",
        "of T",
    ):
        assert word in text


def test_json_has_the_measurement(ran):
    _, _, told = ran
    assert {"out", "points", "effects", "recommendation", "reference"} <= set(told)
    assert {"predicted", "measured", "ratio", "unit"} <= set(told["effects"][0])


def test_it_stands_beside_a_run_in_the_same_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(measurements, "TURNS", 1)
    arguments = ["slanted-edge-f8", *SMALL, "--set", UNIFORM, "-o", str(tmp_path / "out"), "-q"]
    for command in ("run", "accuracy", "run"):
        done = CliRunner().invoke(app, [command, *arguments])
        assert done.exit_code == 0, done.output
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert {"raw.exr", "run.json", "accuracy.csv", "accuracy.json"} <= names
