"""A finished sweep of which nothing has changed is read; any change is noticed."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from spectral_files import tiff
from sweeping import environment, written

from vcam_cli import sweep
from vcam_cli.errors import BadInput
from vcam_cli.files.records import record_check
from vcam_cli.sweeps import sweep_points, sweep_result

STUDY = {
    "optimize": {"metric": "mean_electrons", "goal": "max"},
    "repeat": {"adc.bits": [10, 12]},
    "seeds": 2,
    "expect": {
        "best": {"quantity": "optimum", "between": ["2 um", "9 um"], "calibrated": "nothing"},
        "never": {"quantity": "optimum", "between": ["1 um", "2 um"], "why": "it is not so"},
    },
}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A folder with a finished sweep, a copy of all of it, and the result."""
    folder, kept = tmp_path_factory.mktemp("swept"), tmp_path_factory.mktemp("kept") / "copy"
    result = sweep(written(folder, **STUDY), folder / "out", workers=1)
    shutil.copytree(folder, kept)
    return folder, kept, result


@pytest.fixture
def finished(swept):
    """The finished sweep, which a test may change: it is put back in its place for the next one."""
    folder, kept, result = swept
    yield folder / "study.yaml", folder / "out", result
    shutil.rmtree(folder)
    shutil.copytree(kept, folder)


@pytest.fixture
def resolved(monkeypatch):
    """How often the cameras of a study are resolved."""
    times = []
    grid = sweep_points.grid

    def counted(*args, **options):
        times.append(args)
        return grid(*args, **options)

    monkeypatch.setattr(sweep_points, "grid", counted)
    return times


def contents(folder):
    return {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def plain(result):
    return replace(result, computed=0, seconds=0.0)


def test_no_engine_is_loaded_for_it(finished):
    # Two thirds of what the command would take: every part of a second counts in a CI matrix.
    study, out, _ = finished
    script = (
        "import sys; from vcam_cli import sweep;"
        f"sweep({str(study)!r}, {str(out)!r});"
        "print([m for m in sys.modules if m.startswith(('scipy', 'vcam_cli.simulation.frame'))])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment(), capture_output=True, text=True
    )
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_it_is_the_same_and_no_camera_is_resolved(finished, resolved):
    study, out, first = finished
    before = contents(out)
    again = sweep(study, out, workers=1)
    assert again.computed == 0
    assert not resolved
    assert repr(plain(again)) == repr(plain(first))  # nan is not itself, but reads the same
    assert [type(v) for row in again.points for v in row.values()] == [
        type(v) for row in first.points for v in row.values()
    ]
    assert contents(out) == before


def test_what_is_refused_is_told_again(tmp_path, resolved):
    study = written(tmp_path, vary={"pixel.width": {"values": ["5 um", "-1 um"]}})
    told = []
    first = sweep(study, tmp_path / "out", workers=1, tell=told.append)
    assert told
    assert resolved
    once, resolved[:] = list(told), []
    again = sweep(study, tmp_path / "out", workers=1, tell=told.append)
    assert told == once * 2
    assert not resolved
    assert (again.exit_code, again.points) == (first.exit_code, first.points)
    assert again.failed


def damage(path):
    path.write_bytes(path.read_bytes()[:-3])


def edit_camera(folder):
    path = folder / "camera.yaml"
    path.write_text(path.read_text("utf-8") + "\n# another comment\n", "utf-8")


def edit_study(folder):
    path = folder / "study.yaml"
    path.write_text(path.read_text("utf-8").replace("seeds: 2", "seeds: 1"), "utf-8")


@pytest.mark.parametrize(
    "change",
    [
        edit_camera,
        edit_study,
        lambda folder: (folder / "out" / "points.csv").unlink(),
        lambda folder: (folder / "out" / "mean_electrons.png").unlink(),
        lambda folder: damage(next((folder / "out" / "points").glob("*.json"))),
        lambda folder: next((folder / "out" / "points").glob("*.json")).unlink(),
    ],
)
def test_every_change_is_noticed_and_mended(finished, resolved, change):
    study, out, _ = finished
    before = {p.name: p.read_bytes() for p in out.glob("*.csv")}
    change(study.parent)
    sweep(study, out, workers=1)
    assert len(resolved) == 1
    if change is not edit_study:
        before.pop("timings.csv")
        assert before.items() <= {p.name: p.read_bytes() for p in out.glob("*.csv")}.items()
    sweep(study, out, workers=1)
    assert len(resolved) == 1


@pytest.mark.parametrize("name", ["optimum.csv", "mean_electrons.png"])
def test_a_changed_table_is_noticed_and_kept(finished, name):
    """A person may have changed it: it is made again once it is moved away."""
    study, out, _ = finished
    whole = (out / name).read_bytes()
    damage(out / name)
    changed = (out / name).read_bytes()
    with pytest.raises(BadInput, match=f"{name} is there already and was not"):
        sweep(study, out, workers=1)
    assert (out / name).read_bytes() == changed
    (out / name).unlink()
    assert sweep(study, out, workers=1).computed == 0
    assert (out / name).read_bytes() == whole


def test_a_kept_frame_that_was_cut_is_made_again(tmp_path, resolved):
    study = written(tmp_path, keep=["raw"])
    sweep(study, tmp_path / "out", workers=1)
    frame = next((tmp_path / "out" / "points").glob("*.raw.exr"))
    whole = frame.read_bytes()
    damage(frame)
    again = sweep(study, tmp_path / "out", workers=1)
    assert again.computed == 1
    assert frame.read_bytes() == whole
    assert len(resolved) == 2


PART = "f_number: {}\nfocal_length: 4.5 mm\n"


def a_part_appears(folder):
    yield "f8-landscape", {"optics": {"values": ["f2.8-normal", "f8-landscape"]}}
    (folder / "f8-landscape.yaml").write_text(PART.format(4), "utf-8")


def a_part_is_another(folder):
    for number in (8, 4):
        (folder / f"f{number}.yaml").write_text(PART.format(number), "utf-8")
    (folder / "mine.yaml").symlink_to("f8.yaml")
    yield "mine", {"optics": {"values": ["f2.8-normal", "mine"]}}
    (folder / "mine.yaml").unlink()
    (folder / "mine.yaml").symlink_to("f4.yaml")


def a_part_is_mended(folder):
    (folder / "mine.yaml").write_text("f_number: [\n", "utf-8")
    yield "mine", {"optics": {"values": ["f2.8-normal", "mine"]}}
    (folder / "mine.yaml").write_text(PART.format(4), "utf-8")


def a_part_is_there_at_last(folder):
    yield "{use: mine}", {"optics": {"values": ["f2.8-normal", {"use": "mine"}]}}
    (folder / "mine.yaml").write_text(PART.format(4), "utf-8")


def a_table_is_there_at_last(folder):
    table = {"file": "mine.csv"}
    yield "{file: mine.csv}", {"optics.transmittance": {"values": [0.5, table]}}
    (folder / "mine.csv").write_text("wavelength_nm,value\n300,0.5\n900,0.25\n", "utf-8")


def a_table_is_mended(folder):
    (folder / "mine.csv").write_text("wavelength_nm,value\n900,0.5\n300,0.25\n", "utf-8")
    table = {"file": "mine.csv"}
    yield "{file: mine.csv}", {"optics.transmittance": {"values": [0.5, table]}}
    (folder / "mine.csv").write_text("wavelength_nm,value\n300,0.5\n900,0.25\n", "utf-8")


@pytest.mark.parametrize(
    "change",
    [
        a_part_appears,
        a_part_is_another,
        a_part_is_mended,
        a_part_is_there_at_last,
        a_table_is_there_at_last,
        a_table_is_mended,
    ],
)
def test_what_a_value_names_is_looked_up_anew(tmp_path, resolved, change):
    way = change(tmp_path)
    value, vary = next(way)
    study = written(tmp_path, vary=vary, metrics=["mean_electrons"])

    def electrons():
        rows = sweep(study, tmp_path / "out", workers=1).points
        return next(row["mean_electrons"] for row in rows if value in row.values())

    before = electrons()
    assert electrons() == before
    assert len(resolved) == 1
    next(way, None)
    after = electrons()
    assert after != before
    assert after != ""
    assert len(resolved) == 2
    assert electrons() == after
    assert len(resolved) == 2


def test_parts_that_overrides_name_are_looked_up_anew(tmp_path, resolved, monkeypatch):
    study = written(tmp_path, metrics=["mean_electrons"])
    monkeypatch.chdir(tmp_path)
    first = sweep(study, "out", ["optics=f8-landscape"], workers=1)
    a_part = tmp_path / "f8-landscape.yaml"
    a_part.write_text(PART.format(4), "utf-8")
    again = sweep(study, "out", ["optics=f8-landscape"], workers=1)
    assert len(resolved) == 2
    assert again.points != first.points


def test_a_table_that_appears_beside_a_picture(tmp_path, resolved):
    table = "wavelength_nm,reflectance\n" + "".join(f"{nm},{{0}}\n" for nm in (300, 550, 900))
    tiff(tmp_path / "a.tif", np.ones((8, 12, 3), np.float32), description=table.format(0.1))
    source = {"kind": "hyperspectral", "file": "a.tif"}
    vary = {"adc.bits": {"values": [10, 12]}}
    study = written(tmp_path, {"scene.source": source}, vary=vary, metrics=["mean_electrons"])
    first = sweep(study, tmp_path / "out", workers=1)
    (tmp_path / "a.csv").write_text(table.format(0.2), "utf-8")
    again = sweep(study, tmp_path / "out", workers=1)
    assert len(resolved) == 2
    assert again.points != first.points


def test_other_overrides_are_another_sweep(finished, resolved):
    study, out, first = finished
    other = sweep(study, out, ["pixel.readout.full_well=3000 e"], workers=1)
    assert len(resolved) == 1
    assert other.computed == first.computed


def test_keys_of_several_kinds(tmp_path, resolved):
    over_field = [{"field": 0, 8: "0 um"}, {"field": 1, 8: "0.05 um"}]
    study = written(tmp_path, cases={"plain": {}, "coma": {"optics.zernike": over_field}})
    sweep(study, tmp_path / "out", workers=1)
    sweep(study, tmp_path / "out", workers=1)
    assert len(resolved) == 1


def test_a_version_that_computes_otherwise_is_asked_again(finished, resolved, monkeypatch):
    study, out, _ = finished
    versions = sweep_result.provenance.versions()
    monkeypatch.setattr(sweep_result.provenance, "versions", lambda: versions | {"vcam": "0"})
    sweep(study, out, workers=1)
    assert len(resolved) == 1


def test_the_record_of_a_sweep_that_only_began_is_no_seal(finished, resolved):
    study, out, _ = finished
    written = json.loads((out / "study.json").read_text("utf-8"))["written"]
    record = {"program": "vcam", "files": [], "written": written}
    (out / "study.json").write_text(json.dumps(record), "utf-8")
    sweep(study, out, workers=1)
    assert len(resolved) == 1


def test_an_edited_record_is_no_seal(finished, resolved):
    study, out, first = finished
    record = json.loads((out / "study.json").read_text("utf-8"))
    (out / "study.json").write_text(json.dumps(record | {"expected": []}), "utf-8")
    assert len(sweep(study, out, workers=1).expectations) == len(first.expectations) == 2
    assert len(resolved) == 1


@pytest.mark.long
def test_a_record_of_other_types_is_no_seal(finished, resolved):
    study, out, _ = finished
    record = json.loads((out / "study.json").read_text("utf-8"))
    for key in ("hashes", "points", "optimum", "expected"):
        other = record | {key: [1]}
        other["check"] = record_check(other)
        (out / "study.json").write_text(json.dumps(other), "utf-8")
        sweep(study, out, workers=1)
    assert len(resolved) == 4
