"""Folders from elsewhere and files that a person has changed: nothing of them is removed.

Whatever a record, a journal or a name claims, only files of the size and the hash that vcam wrote
down are removed or replaced. Each attack compares the whole folder before and after.
"""

import hashlib
import json
import os
from pathlib import Path

import pytest
import yaml
from making import long_except, tree
from typer.testing import CliRunner

from vcam_cli.commands import main
from vcam_cli.config import shipped
from vcam_cli.errors import BadInput
from vcam_cli.files.atomic import STAGING, write_text
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.in_use import POINTS
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.files.records import LOCK, RECORDS

pytestmark = pytest.mark.attack("deleting without proof")
MINE = b"mine"


def contents(folder: Path) -> dict[str, bytes | str]:
    """All files by name, and where links lead."""
    return {
        str(p.relative_to(folder)): os.readlink(p) if p.is_symlink() else p.read_bytes()
        for p in folder.rglob("*")
        if p.is_symlink() or p.is_file()
    }


def proof(data: bytes) -> dict:
    return {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def claim(name: str, **written) -> dict:
    return {"program": "vcam", "files": [name], **written}


def run(path: Path, record: str, name: str) -> None:
    """As the commands write: a run, or a sweep."""
    if record == "study.json":
        with SweepFolder(path) as folder:
            folder.begin({"name": "s"})
            folder.finish({name: lambda place: write_text(place, "new")}, {"name": "s"})
    else:
        with OutputFolder(path, record) as folder:
            write_text(folder.new(name), "new")
            folder.finish({})


WRONG = {
    "no proof": {},
    "a list": {"written": ["a"]},
    "no object": {"written": {"a": 4}},
    "nested": {"written": {"a": [[proof(MINE)]]}},
    "size alone": {"written": {"a": {"bytes": 4}}},
    "hash alone": {"written": {"a": {"sha256": proof(MINE)["sha256"]}}},
    "other size": {"written": {"a": proof(MINE) | {"bytes": 5}}},
    "other hash": {"written": {"a": proof(b"thin")}},
    "of another file": {"written": {"b": proof(MINE)}},
    "pending, other hash": {"pending": {"a": proof(b"thin")}},
}  # what a record says of the file `a`


@pytest.mark.parametrize("written", WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("place", [*RECORDS, LOCK])
@pytest.mark.parametrize("new", ["a", "b"])
def test_a_record_that_names_a_file_proves_nothing(tmp_path, place, new, written):
    """In a record or in the journal, whether the file would be replaced or only removed."""
    (tmp_path / "a").write_bytes(MINE)
    (tmp_path / place).write_text(json.dumps(claim("a", **written)))
    before = contents(tmp_path)
    with pytest.raises(BadInput, match=r"a is there already|a and 1 more|lock"):
        run(tmp_path, "run.json" if place == LOCK else place, new)
    found = contents(tmp_path)
    found.pop(f"{POINTS}/.claims", None)
    assert found == before


def outside(folder: Path) -> str:
    (folder.parent / "outside").write_bytes(MINE)
    return "../outside"


def absolute(folder: Path) -> str:
    outside(folder)
    return str(folder.parent / "outside")


def behind_a_link(folder: Path) -> str:
    (folder.parent / "far").mkdir()
    (folder.parent / "far" / "a").write_bytes(MINE)
    (folder / "link").symlink_to(folder.parent / "far")
    return "link/a"


def a_link(folder: Path) -> str:
    outside(folder)
    (folder / "a").symlink_to(folder.parent / "outside")
    return "a"


def a_folder(folder: Path) -> str:
    (folder / "a").mkdir()
    (folder / "a" / "b").write_bytes(MINE)
    return "a"


def staged(folder: Path) -> str:
    (folder / STAGING).mkdir()
    (folder / STAGING / "a").write_bytes(MINE)
    return f"{STAGING}/a"


def through_itself(folder: Path) -> str:
    outside(folder)
    return "x/../../outside"


PLACES = (outside, absolute, behind_a_link, a_link, a_folder, staged, through_itself)


@pytest.mark.parametrize(
    "place", [*PLACES, *(lambda _, n=n: n for n in ("", ".", "a\0b", "y" * 999))]
)
@pytest.mark.parametrize("record", [*RECORDS, LOCK])
def test_a_right_hash_of_what_is_no_file_inside_proves_nothing(tmp_path, record, place):
    folder = tmp_path / "out"
    folder.mkdir()
    name = place(folder)
    text = json.dumps(claim(name, written={name: proof(MINE)}, pending={name: proof(MINE)}))
    (folder / record).write_text(text)
    before = contents(tmp_path)
    with pytest.raises(BadInput):
        run(folder, "run.json" if record == LOCK else record, "b")
    found = contents(tmp_path)
    found.pop(f"out/{POINTS}/.claims", None)
    assert found == before


FOREIGN = {
    "staging": (f"{STAGING}/a", None),
    "staging of a record": (f"{STAGING}/a", "run.json"),
    "staging of a journal": (f"{STAGING}/a", LOCK),
    "a lock": (LOCK, None),
    "a lock of a record": (LOCK, "run.json"),
    "a file as staging": (STAGING, None),
    "a file as staging of a record": (STAGING, "run.json"),
}  # a foreign file, and what shows that the folder is vcam's


@pytest.mark.parametrize(("name", "shown"), FOREIGN.values(), ids=FOREIGN)
def test_names_that_vcam_uses_prove_nothing(tmp_path, name, shown):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(MINE)
    if shown:
        text = json.dumps({"program": "vcam", "files": [], "staging": 1})
        (tmp_path / shown).write_text(text)
    before = contents(tmp_path)
    with pytest.raises(BadInput, match=Path(name).parts[0]):
        run(tmp_path, "run.json", "b")
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    "name", [".a.part", ".thesis.part", f".{'0' * 32}.json.part", ".x.1-00000000.part"]
)
def test_an_old_temporary_file_of_another_program(tmp_path, name):
    run(tmp_path, "study.json", "a")
    old = tmp_path / POINTS / name
    old.write_bytes(MINE)
    os.utime(old, (0, 0))
    run(tmp_path, "study.json", "a")
    assert old.read_bytes() == MINE


def vcam(*args: str | Path):
    return CliRunner().invoke(main.app, [str(a) for a in args], prog_name="vcam")


SCHEMAS = {p.name: json.loads(p.read_text("utf-8")) for p in sorted(shipped.schemas().iterdir())}


@pytest.mark.parametrize("name", long_except([min(SCHEMAS), max(SCHEMAS)], SCHEMAS))
@pytest.mark.parametrize("way", ["a file", "a link", "an empty file", "a folder"])
def test_a_schema_replaces_nothing(tmp_path, monkeypatch, name, way):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("vcam_cli.commands.schemas.schemas", lambda: SCHEMAS)
    (tmp_path / "mine").write_bytes(MINE)
    match way:
        case "a link":
            (tmp_path / name).symlink_to("mine")
        case "a folder":
            (tmp_path / name).mkdir()
        case _:
            (tmp_path / name).write_bytes(MINE if way == "a file" else b"")
    before = contents(tmp_path)
    result = vcam("schema")
    assert result.exit_code == 2
    assert name in result.stderr
    assert contents(tmp_path) == before


CHANGED = {"run": ("raw.exr", "render.png", "metrics.csv"), "sweep": ("points.csv", "snr_db.png")}


@pytest.mark.parametrize(
    ("command", "name"), [(c, name) for c, names in CHANGED.items() for name in names]
)
def test_a_result_that_a_person_has_changed_is_kept(tmp_path, monkeypatch, command, name):
    """As whole commands: told before anything is computed, and gone on with when moved away."""
    monkeypatch.chdir(tmp_path)
    small = {"array.rows": 8, "array.columns": 9, "accuracy": "draft"}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(tree(small)))
    study = {
        "kind": "sweep", "name": "s", "camera": "camera.yaml", "metrics": ["snr_db"],
        "vary": {"exposure.time": {"values": ["1 ms"]}},
    }  # fmt: skip
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    line = (command, "camera.yaml" if command == "run" else "study.yaml", "-q", "-o", "out")
    assert vcam(*line).exit_code == 0
    (tmp_path / "out" / name).write_bytes(MINE)
    before = contents(tmp_path)
    result = vcam(*line, *(("--workers", "1") if command == "sweep" else ()))
    assert result.exit_code == 2, result.output
    assert f"out/{name} is there already and was not written by vcam, or ch" in result.stderr
    assert contents(tmp_path) == before
    (tmp_path / "out" / name).rename(tmp_path / "mine")
    assert vcam(*line).exit_code == 0
