"""`vcam characterize`: the files it leaves, what it says, and how it ends."""

import csv
import json

import pytest
from typer.testing import CliRunner

from vcam_cli.characterization import bench, exposures
from vcam_cli.characterization.output import SHOWN
from vcam_cli.commands.main import app

FILES = {
    "characterize.csv",
    "characterize.json",
    "photon_transfer.png",
    "snr.png",
    "linearity.png",
    "mtf.png",
}


@pytest.fixture(autouse=True, scope="module")
def small():
    """A bench of few pixels and frames."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, "FIELD", 64)
        patch.setattr(exposures, "STACK", 4)
        patch.setattr(exposures, "EDGES", 4)
        patch.setattr(exposures, "REACH", 20)
        yield


def call(*arguments):
    return CliRunner().invoke(app, ["characterize", *arguments])


@pytest.fixture(scope="module")
def ran(small, tmp_path_factory):
    out = tmp_path_factory.mktemp("characterize") / "out"
    done = call("starter", "-o", str(out))
    assert done.exit_code == 0, done.output
    return out, done


@pytest.mark.draws
def test_files(ran):
    out, _ = ran
    assert {path.name for path in out.iterdir()} == FILES
    for name in FILES:
        if name.endswith(".png"):
            assert (out / name).read_bytes().startswith(b"\x89PNG")
    rows = list(csv.reader((out / "characterize.csv").read_text().splitlines()))
    assert rows[0] == ["quantity", "channel", "measured", "expected", "unit", "definition"]
    assert {row[1] for row in rows[1:]} == {"R", "G", "B"}
    assert all(float(row[2]) == float(row[2]) and float(row[3]) >= 0 for row in rows[1:])
    assert all(row[5] for row in rows[1:])
    assert set(SHOWN) <= {row[0] for row in rows}


def test_the_record(ran):
    out, _ = ran
    record = json.loads((out / "characterize.json").read_text())
    assert record["program"] == "vcam"
    assert set(record["files"]) == FILES - {"characterize.json"}
    assert record["camera"]["array"]["rows"] == 240  # the user's camera, not the bench's
    assert set(record["channels"]) == {"R", "G", "B"}
    red = record["channels"]["R"]
    assert len(red["photons"]) == len(red["mean"]) == len(red["variance"]) >= 50
    assert len(red["frequency"]) == len(red["mtf"]) == len(red["mtf_expected"])


def test_a_person_reads_a_table(ran):
    _, done = ran
    for word in (*SHOWN, "expected", "e/s", "lp/mm", "mtf.png"):
        assert word in done.stdout
    assert "moved up" in done.stderr
    assert "moved up" not in done.stdout
    *table, files = done.stdout.splitlines()  # the last line has a path, as long as it is
    assert max(map(len, table)) <= 100
    assert files.endswith("mtf.png")


def test_json_and_quiet(ran, tmp_path):
    told = call("starter", "-o", str(tmp_path / "a"), "--json", "-q")
    assert told.stderr == ""
    record = json.loads(told.stdout)
    assert record["out"] == str(tmp_path / "a")
    assert record["quantities"]
    again = (tmp_path / "a" / "characterize.csv").read_bytes()
    assert again == (ran[0] / "characterize.csv").read_bytes()


@pytest.mark.long
def test_set_and_seed_reach_the_bench(tmp_path):
    sets = ("--set", "pixel.readout.read_noise=40 e", "--set", "array.pattern=monochrome")
    sets += ("--set", "processing=[]", "--json", "-q")
    first, second = (
        json.loads(call("starter", "-o", str(tmp_path / seed), *sets, "--seed", seed).stdout)
        for seed in "12"
    )
    noise = [
        next(q for q in told["quantities"] if q["quantity"] == "read_noise")
        for told in (first, second)
    ]
    assert [n["expected"] for n in noise] == [40, 40]
    assert noise[0]["measured"] != noise[1]["measured"]
    assert noise[0]["measured"] == pytest.approx(40, rel=0.1)


@pytest.mark.long
def test_it_stands_beside_a_run_in_the_same_folder(tmp_path):
    out = tmp_path / "out"
    size = ("--set", "array.rows=16", "--set", "array.columns=16")
    for command in ("run", "characterize", "run"):
        done = CliRunner().invoke(app, [command, "starter", *size, "-o", str(out), "-q"])
        assert done.exit_code == 0, done.output
    assert {"raw.exr", "run.json"} | FILES <= {path.name for path in out.iterdir()}


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        ("adc.kind=logarithmic", "adc.kind: EMVA 1288 measures linear cameras"),
        ("effects={shot_noise: off}", "effects.shot_noise: photon transfer needs shot noise"),
        ("adc.bits=2", "adc.bits: the noise of light"),
        ("adc.bits=two", "adc.bits"),
    ],
)
def test_bad_input_is_told_and_leaves_nothing(sets, words, tmp_path):
    done = call("starter", "-o", str(tmp_path / "out"), "--set", sets)
    assert done.exit_code == 2
    assert words in done.stderr
    assert "Traceback" not in done.output
    assert not (tmp_path / "out").exists()


def test_a_foreign_folder_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    done = call("starter", "-o", str(tmp_path))
    assert done.exit_code == 2
    assert "holds no characterize.json" in done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"mine.txt"}
