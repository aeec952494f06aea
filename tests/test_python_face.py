"""The face that Python callers see: `with_`, metrics, `save`, rows, one line for each thing."""

import csv
import json
import pickle

import numpy as np
import pytest
from making import long_except
from typer.testing import CliRunner

import vcam_cli
from vcam_cli import BadInput, load, schedule, simulate, sweep
from vcam_cli.commands.main import app
from vcam_cli.config import shipped
from vcam_cli.files.records import RECORDS
from vcam_cli.files.report import to_json

SMALL = ["array.rows=16", "array.columns=18", "accuracy=draft", "exposure.time=5 ms"]
CHANGES = {"exposure.time": "10 ms", "array.rows": 20, "quality": ["mse"]}
STUDY = """kind: sweep
camera: starter
vary: {exposure.time: {values: [5 ms, 1e9 s, 10 ms]}}
cases: {small: {array.rows: 16, array.columns: 18, accuracy: draft}}
metrics: [snr_db, mean_electrons]
optimize: {metric: snr_db, goal: max}
"""


@pytest.fixture(scope="module")
def result():
    return simulate(load("starter", SMALL))


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A sweep with one point whose camera is refused, so that its cells are empty."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.yaml").write_text(STUDY.replace("1e9 s", "-1 ms"))
    return sweep(folder / "study.yaml", folder / "out", workers=1)


def test_the_face_lists_itself():
    assert dir(vcam_cli) == sorted(vcam_cli.__all__)
    assert {"load", "simulate", "verify", *COMMANDS} <= set(dir(vcam_cli))
    assert all(getattr(vcam_cli, name) is not None for name in dir(vcam_cli))


@pytest.mark.parametrize(
    "name", long_except(shipped.names("cameras")[::4], shipped.names("cameras"))
)
def test_with_is_what_set_is(name):
    """The same camera as from the command line, of every shipped file; the first stays."""
    before = load(name)
    changes = {"name": "other", "exposure.time": "7 ms", "adc.bits": 15, "seed": {"frame": 5}}
    changed = before.with_(changes)
    sets = ["name=other", "exposure.time=7 ms", "adc.bits=15", "seed={frame: 5}"]
    assert changed == load(name, sets)
    assert before == load(name)
    assert changed.files == before.files
    assert before.with_({}) == before
    assert before.with_({"adc.bits": np.int64(15)}).adc.bits == 15


def test_changes_add_up(tmp_path, monkeypatch):
    """Defaults that follow from other keys follow them, after a change and in another process."""
    camera = load("starter", SMALL)
    twice = camera.with_({"exposure.time": "10 ms"}).with_({"optics.f_number": 8})
    assert twice == camera.with_({"optics.f_number": 8, "exposure.time": "10 ms"})
    assert pickle.loads(pickle.dumps(camera)).with_(CHANGES) == camera.with_(CHANGES)
    (tmp_path / "qe.csv").write_text("wavelength_nm,value\n300,0.5\n900,0.4\n")
    monkeypatch.chdir(tmp_path)
    measured = camera.with_({"pixel.photodetector.quantum_efficiency": {"file": "qe.csv"}})
    monkeypatch.chdir("/")
    assert tmp_path / "qe.csv" in measured.with_({"adc.bits": 8}).files


def test_a_model_changed_by_other_means_keeps_that():
    camera = load("starter", SMALL).model_copy(update={"name": "renamed"})
    assert camera.with_({"adc.bits": 9}).name == "renamed"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"exposure.tme": "10 ms"}, "did you mean"),
        ({"exposure.time": 10}, "exposure.time"),
        ({"pixel.width": "-1 um"}, "is negative"),
        ({"a..b": 1}, "is not the path of a key"),
    ],
)
def test_wrong_changes_say_what_and_where(changes, said):
    with pytest.raises(BadInput, match=said) as error:
        load("starter", SMALL).with_(changes)
    assert "with_(" in str(error.value)


@pytest.mark.parametrize("changes", [[1], "exposure.time=10 ms", {1: 2}, None], ids=str)
def test_what_is_no_mapping_of_changes(changes):
    with pytest.raises(TypeError, match="is no mapping of paths to values; write"):
        load("starter", SMALL).with_(changes)


def test_what_is_no_value():
    with pytest.raises(TypeError, match="is no value of a file; write it as YAML has it"):
        load("starter", SMALL).with_({"exposure.time": object()})


def test_metrics_are_a_mapping(result):
    rows = result.metrics.rows
    assert list(result.metrics) == [name for name, _, _ in rows]
    assert dict(result.metrics) == {name: value for name, value, _ in rows}
    assert result.metrics.units["snr_db"] == "dB"
    with pytest.raises(KeyError, match="did you mean psnr_db"):
        result.metrics["psnr"]


def test_saved_is_what_a_run_writes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sets = [part for item in [*SMALL, "quality=[mse, s-cielab]"] for part in ("--set", item)]
    ran = CliRunner().invoke(app, ["run", "starter", "-q", "-o", "by-command", *sets])
    assert ran.exit_code == 0, ran.output
    assert simulate(load("starter", [*SMALL, "quality=[mse, s-cielab]"])).save("by-python")
    files = sorted(path.name for path in (tmp_path / "by-command").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "by-python").iterdir())
    for name in set(files) - set(RECORDS):
        a, b = ((tmp_path / folder / name).read_bytes() for folder in ("by-command", "by-python"))
        assert a == b, name
    records = [
        json.loads((tmp_path / folder / "run.json").read_text())
        for folder in ("by-command", "by-python")
    ]
    assert records[0].keys() == records[1].keys()
    assert records[0]["hashes"] == records[1]["hashes"]


def test_every_repr_fits_a_line(result, swept, tmp_path):
    studied = schedule("captures", tmp_path / "out")
    for each in (result, result.metrics, result.frame.camera, swept, studied):
        assert len(repr(each)) <= 100, repr(each)
        assert "\n" not in repr(each)
        assert repr(each).startswith(f"<{type(each).__name__} ")


def test_rows_are_columns_of_one_type(swept, tmp_path):
    """As data frames want them: the same keys in all rows, None where a cell is empty."""
    studied = schedule("captures", tmp_path / "out")
    for rows in (swept.rows, swept.optimum_rows, studied.rows, studied.summary_rows):
        assert rows
        for name in rows[0]:
            kinds = {type(row[name]) for row in rows} - {type(None)}
            assert len(kinds) <= 1, (name, kinds)
        assert len({tuple(row) for row in rows}) == 1
    assert [row["error"] is None for row in swept.rows] == [True, False, True]
    assert swept.rows[1]["snr_db"] is None
    with open(swept.out / "points.csv", newline="") as file:
        assert list(swept.rows[0]) == next(csv.reader(file))


@pytest.mark.parametrize("given", [5, None, {}, b"captures", ["captures"], 1.5], ids=str)
@pytest.mark.parametrize("function", [sweep, schedule])
def test_what_is_no_study(function, given):
    with pytest.raises(TypeError, match="is no file or name of a study"):
        function(given)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"workers": "2"}, "workers='2' is no whole number"),
        ({"workers": 0}, "workers=0 is less than 1"),
        ({"workers": True}, "workers=True is no whole number"),
        ({"watch": 3}, "watch=3 cannot follow a run"),
        ({"sets": "a=1"}, "is no list of overrides"),
        ({"out": 5}, "is no folder"),
        ({"shard": "1/2"}, "is no share"),
        ({"seed": 1.5}, "is no whole number"),
    ],
    ids=str,
)
def test_wrong_arguments_are_named(wrong, said):
    """Before anything is computed or written."""
    calls = {"sweep": lambda: sweep("pixel-size", **wrong)}
    calls["schedule"] = lambda: schedule("captures", **wrong)
    calls["simulate"] = lambda: simulate(load("starter", SMALL), **wrong)
    takes = {
        "sweep": {"workers", "watch", "sets", "out", "shard"},
        "schedule": {"workers", "watch", "sets", "out", "seed"},
        "simulate": {"workers", "watch"},
    }
    for name, call in calls.items():
        if set(wrong) <= takes[name]:
            with pytest.raises((TypeError, ValueError), match=said):
                call()


COMMANDS = {"accuracy", "characterize", "compare", "dataset", "fit", "plan", "schedule", "sweep"}


def test_each_command_that_computes_is_a_function():
    for name in (*COMMANDS, "verify", "simulate"):
        found = getattr(vcam_cli, name)
        assert found.__name__ == name, f"{name} is {found}"


def json_of(*arguments):
    done = CliRunner().invoke(app, [*arguments, "--json", "-q"], prog_name="vcam")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def test_plan_is_what_the_command_prints():
    sets = [part for word in SMALL for part in ("--set", word)]
    found = vcam_cli.plan(load("starter", SMALL))
    printed = json_of("plan", "starter", *sets)
    assert json.loads(to_json(found.geometry)) == printed["geometry"]
    named = [{k: e[k] for k in ("name", "state", "reason")} for e in found.effects]
    assert named == [{k: e[k] for k in ("name", "state", "reason")} for e in printed["effects"]]
    assert repr(found).startswith("<PlannedRun starter: ")
    assert "\n" not in repr(found)


def test_compare_is_what_the_command_prints(result, tmp_path):
    one = result.save(tmp_path / "one") / "render.png"
    other = simulate(load("starter", [*SMALL, "seed.frame=9"])).save(tmp_path / "two")
    found = vcam_cli.compare(one, other / "render.png", tmp_path / "ab", ppd=30)
    printed = json_of("compare", str(one), str(other / "render.png"), "--ppd", "30")
    assert found.report() == {k: v for k, v in printed.items() if k != "out"}
    assert {p.name for p in (tmp_path / "ab").iterdir()} >= {"compare.csv", "s_cielab.png"}
    with pytest.raises(BadInput, match="cannot both be given"):
        vcam_cli.compare(one, one, ppd=3, dpi=3)
    with pytest.raises(BadInput, match="for the space xyz only"):
        vcam_cli.compare(one, one, white=(1, 1, 1))


def test_dataset_writes_what_the_command_writes(tmp_path):
    (tmp_path / "pairs.yaml").write_text(
        "kind: dataset\ncamera: starter\nvary: {exposure.time: {choice: [5 ms, 9 ms]}}\nframes: 9\n"
        "size: {rows: 8, columns: 8}\nwrite: [raw]\nshards: 2\n"
    )
    sets = ["frames=4", "vary.exposure.time.choice=[5 ms]", "accuracy=draft"]
    found = vcam_cli.dataset(tmp_path / "pairs.yaml", tmp_path / "out", sets, workers=1)
    assert (found.frames, found.computed, found.shards) == (4, 4, 2)
    with open(tmp_path / "out/manifest.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4


def test_verify_reads_a_measurement_and_writes_where_it_is_told(tmp_path):
    found = vcam_cli.verify(
        "test-pixel-0.18um", "test-pixel-simulated", tmp_path / "out", formats=["svg"]
    )
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {"verify.csv", "errors.svg"}
    assert found.rows
    assert not found.missed


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("plan", (5,)),
        ("accuracy", (None,)),
        ("characterize", (b"x",)),
        ("fit", (3.0,)),
        ("verify", ("starter", None)),
        ("dataset", ([],)),
        ("compare", (1, "x.png")),
        ("plan", ("starter", "two")),
    ],
)
def test_arguments_of_another_type_are_refused(name, arguments):
    with pytest.raises(TypeError, match="write "):
        getattr(vcam_cli, name)(*arguments)


def test_frames_can_only_be_kept_somewhere():
    with pytest.raises(ValueError, match="needs a folder"):
        vcam_cli.characterize("starter", keep_frames=True)
