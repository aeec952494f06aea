"""`vcam accuracy`: the files it leaves and what it says."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.batches.fake_device import FakeDevice
from vcam_cli import face
from vcam_cli.accuracy_study import measurements, study
from vcam_cli.commands.main import app
from vcam_cli.devices import choice
from vcam_cli.files.images.png import write_png
from vcam_cli.simulation import simulate as simulation

SMALL = ("--set", "array.rows=12", "--set", "array.columns=16")
UNIFORM = "scene.source={kind: chart, chart: uniform}"


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A study printed as tables, and printed again as JSON."""
    out = tmp_path_factory.mktemp("accuracy") / "out"
    measure, found = face.accuracy, []

    def measured(*given):
        if not found:
            found.append(measure(*given))
        return found[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measurements, "TURNS", 1)
        patch.setattr(face, "accuracy", measured)
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


@pytest.mark.long
def test_it_stands_beside_a_run_in_the_same_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(measurements, "TURNS", 1)
    arguments = ["slanted-edge-f8", *SMALL, "--set", UNIFORM, "-o", str(tmp_path / "out"), "-q"]
    for command in ("run", "accuracy", "run"):
        done = CliRunner().invoke(app, [command, *arguments])
        assert done.exit_code == 0, done.output
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert {"raw.exr", "run.json", "accuracy.csv", "accuracy.json"} <= names


@pytest.mark.long
def test_a_device_is_measured_against_the_processor(tmp_path, monkeypatch):
    """Errors of presets include the device's rounding; single knobs are the processor's."""
    device, opened = FakeDevice(), choice.open_device
    for module in (choice, simulation, study):
        monkeypatch.setattr(
            module, "open_device", lambda name: device if name == "gpu" else opened(name)
        )
    monkeypatch.setattr(measurements, "TURNS", 1)
    light = np.random.default_rng(0).integers(0, 256, (27, 32, 3), np.uint8)
    write_png(tmp_path / "picture.png", light)
    picture = f"scene.source={{kind: image, file: {tmp_path / 'picture.png'}}}"
    arguments = ["accuracy", "starter", *SMALL, "--set", picture, "--workers", "1"]
    found = {}
    for name in ("cpu", "gpu"):
        out = tmp_path / name
        done = CliRunner().invoke(app, [*arguments, "--device", name, "-o", str(out)])
        assert done.exit_code == 0, done.output
        said = "presets, tolerances and times: fake; reference and errors of single knobs: cpu"
        assert (said in done.stdout.splitlines()) == (name == "gpu")
        found[name] = json.loads((out / "accuracy.json").read_text())
    assert [found[name]["device"] for name in ("cpu", "gpu")] == ["cpu", "fake"]
    here, there = (
        {(p["knob"], p["setting"]): p["rms_error"] for p in found[name]["points"]}
        for name in ("cpu", "gpu")
    )
    presets = [key for key in here if key[0] in ("preset", "tolerance", "all", "file")]
    assert all(there[key] == pytest.approx(here[key], abs=1e-5) for key in presets)
    # Where the tolerance is small the difference between both is seen.
    assert any(there[key] != here[key] for key in presets)
