"""`vcam schedule`: what it says, how it ends; the shipped studies; studies in other commands."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vcam_cli.capture_schedules import study as module
from vcam_cli.commands.main import app
from vcam_cli.config import shipped
from vcam_cli.errors import CannotDo
from vcam_cli.files import plots

SHIPPED = [
    name
    for name, file in shipped.files("studies").items()
    if "\nkind: schedule\n" in file.read_text("utf-8")
]
STUDY = """\
kind: schedule
pdf: {uniform: {min: 0, max: 1}}
counts: [2, 10]
methods: [optimal, uniform]
targets: [1.7, 3]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("study.yaml").write_text(STUDY, "utf-8")
    return tmp_path


def vcam(*args, code=0):
    done = CliRunner().invoke(app, list(args), prog_name="vcam")
    assert done.exit_code == code, done.output
    return done


def test_a_person_reads_gains_certificates_and_times():
    text = vcam("schedule", "study.yaml").stdout
    head, *lines = text.splitlines()
    assert head.split("  ")[0] == "method"
    assert "upper bound" in head
    assert "gap" in head
    optimal = next(line.split() for line in lines if line.startswith("optimal") and " 10 " in line)
    assert optimal[1:4] == ["10", "1.7222", "2"]
    assert float(optimal[4]) <= 1e-6
    uniform = next(line for line in lines if line.startswith("uniform") and " 10 " in line)
    assert " - " in uniform
    assert "-0." in uniform
    assert " dB" in uniform
    assert any(line.strip().startswith("2: 1.0000  2.0000") for line in lines)
    assert "a gain of 1.7 takes 10 captures, which gain 1.7222" in text
    assert "a gain of 3 is out of reach: no number of captures gains more than 2" in text
    assert text.endswith("study: out/study/\n")
    assert vcam("schedule", "study.yaml", "-q").output == ""


def test_json_is_all_there_is_on_stdout():
    told = json.loads(vcam("schedule", "study.yaml", "--json", "-o", "x").stdout)
    assert told["name"] == "study"
    assert told["out"] == "x"
    assert [row["gap"] is None for row in told["summary"]] == [False, False, True, True]
    assert [row["capture"] for row in told["schedule"][:3]] == [1, 2, 1]
    assert told["targets"][0]["count"] == 10
    assert told["targets"][1]["possible"] is False


def test_times_of_a_sensor_are_in_ms():
    sensor = 'sensor={well_capacity: "20000 e"}'
    text = vcam("schedule", "study.yaml", "--set", sensor, "--set", "pdf.uniform.max=4e6").stdout
    assert "optimal capture times, in ms:\n   2: 5  10\n" in text


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["captrues"], "did you mean 'captures'?"),
        (["study.yaml", "--set", "counts=[0]"], "--set counts=[0]: counts.0: 0 is out of range"),
        (["study.yaml", "--set", "methods=[best]"], "methods.0: 'best' is not allowed here"),
        (["exposure-and-noise"], "give it to vcam sweep"),
        (["camera.yaml"], "this is a camera file, not a study; give it to vcam run"),
        (["study.yaml", "--seed", "-1"], "--seed"),
        (["list.yaml"], "list.yaml:1:1: a mapping is needed here"),
        (["study.yaml", "-o", "full"], "full is not empty and holds no study.json of vcam"),
    ],
)
def test_bad_input_ends_with_2_and_writes_nothing(args, said):
    Path("camera.yaml").write_text("extends: starter.yaml\n")
    Path("list.yaml").write_text("- 1\n")
    Path("full").mkdir()
    Path("full/mine").write_text("x")
    before = sorted(Path().rglob("*"))
    assert said in vcam("schedule", *args, code=2).stderr
    assert sorted(Path().rglob("*")) == before


def test_what_a_failed_study_finds_stays(monkeypatch):
    vcam("schedule", "study.yaml", "-q")
    before = {p.name: p.read_bytes() for p in Path("out/study").iterdir()}

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "find_schedules", interrupted)
    assert "interrupted" in vcam("schedule", "study.yaml", code=130).stderr
    assert {p.name: p.read_bytes() for p in Path("out/study").iterdir()} == before


@pytest.mark.draws
def test_a_full_disk_ends_with_3(monkeypatch):
    def full(_, path):
        raise CannotDo(f"cannot write {path}: the disk is full", "free some space")

    monkeypatch.setattr(plots, "save", full)
    assert "the disk is full" in vcam("schedule", "study.yaml", code=3).stderr
    assert not Path("out").exists()


def test_each_kind_of_study_has_its_command():
    assert "give it to vcam schedule" in vcam("sweep", "study.yaml", code=2).stderr
    assert "or run the study with vcam schedule" in vcam("run", "study.yaml", code=2).stderr


def test_validate_reads_tables_and_runs_nothing():
    assert vcam("validate", "study.yaml").stdout == "study.yaml: ok (study)\n"
    Path("h.csv").write_text("low,high,count\n0,1,-1\n")
    override = ["--set", "pdf={histogram: {file: h.csv}}"]
    told = vcam("validate", "study.yaml", *override, code=2).stderr
    assert "h.csv:2: '0,1,-1': a count is negative" in told
    assert not Path("out").exists()


@pytest.mark.parametrize("name", SHIPPED)
class TestShipped:
    def test_validates_and_is_named_after_its_file(self, name):
        assert vcam("validate", name).stdout == f"{name}: ok ({name})\n"

    def test_is_listed(self, name):
        assert f"\n{name} " in "\n" + vcam("list", "studies").stdout
        assert "kind: schedule" in vcam("list", "studies", name).stdout


@pytest.mark.long
def test_each_without_frames_runs():
    for name in SHIPPED:
        text = shipped.find("studies", name).read_text("utf-8")
        if "\nframes:" in text:  # these have tests of their own
            continue
        few = ["--set", "counts=[2, 4]"]
        if "pdf: {camera:" in text:
            few += ["--accuracy", "draft", "--set", "segments=[1, 3]", "--set", "pdf.bins=64"]
        told = json.loads(vcam("schedule", name, "--json", *few).stdout)
        assert all(row["gain"] <= row["upper_bound"] for row in told["summary"])
        assert Path("out", name, "schedule.csv").exists()


def test_there_are_several():
    assert "captures" in SHIPPED
    assert len(SHIPPED) >= 4
