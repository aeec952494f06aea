"""Programs that call themselves the same and compute other numbers: results are never mixed."""

import csv
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from sweeping import written

from vcam_cli import load, source_code
from vcam_cli.errors import CannotDo
from vcam_cli.simulation.shared import Shared
from vcam_cli.sweeps import computation, point_work

pytestmark = pytest.mark.attack("results of other code")
PACKAGE = Path(source_code.__file__).parent
FOLDERS = sorted({name.rpartition("/")[0] for name, _ in source_code._files(PACKAGE, "")})
OTHER_MSE = "\n\ndef mse(*args, **more):\n    return 777.0\n"


@pytest.fixture(autouse=True)
def _files_as_they_are(monkeypatch):
    """Other tests keep the list of the package's files, which change here."""
    monkeypatch.setattr(source_code, "_files", source_code._files.__wrapped__)


def restart(monkeypatch) -> None:
    """Let the package be loaded now."""
    monkeypatch.setattr(source_code, "STARTED", time.time_ns())


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package, whose state and hash are taken."""
    copy = tmp_path / "vcam_cli"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns(*source_code.NOT_CODE))
    monkeypatch.setattr(source_code, "PACKAGE", copy)
    restart(monkeypatch)
    return copy


def comment(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"#")


def same_size_and_time(path: Path) -> None:
    status, data = path.stat(), path.read_bytes()
    path.write_bytes(bytes([data[0] ^ 1]) + data[1:])
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def replaced_by_a_copy(path: Path) -> None:
    """As by `cp -p`: of another file, with that file's time."""
    other = path.with_name("other.txt")
    other.write_bytes(path.read_bytes() + b"#")
    os.utime(other, (0, 0))
    other.replace(path)


def renamed(path: Path) -> None:
    path.rename(path.with_stem("other"))


def removed(path: Path) -> None:
    path.unlink()


def added(path: Path) -> None:
    path.with_name("more.py").touch()


def moved_over_the_border(path: Path) -> None:
    """From the end of a file to the beginning of the next: all bytes in order stay the same."""
    after = sorted(p for p in path.parent.iterdir() if p.suffix in (".py", ".csv"))[1]
    data = path.read_bytes()
    path.write_bytes(data[:-1])
    after.write_bytes(data[-1:] + after.read_bytes())


CHANGES = (comment, same_size_and_time, renamed, removed, added)


def test_a_file_of_any_folder_is_code(package, monkeypatch):
    """Each that differs makes another hash."""
    hashes = set()
    for folder in FOLDERS:
        restart(monkeypatch)
        source_code._hash.cache_clear()
        hashes.add(source_code.code_hash())
        comment(min(p for p in (package / folder).iterdir() if p.suffix in (".py", ".csv")))
    assert len(hashes) == len(FOLDERS)


@pytest.mark.parametrize("change", CHANGES)
def test_any_file_that_differs_is_other_code(package, monkeypatch, change):
    """On another machine, or at another time; and while the process runs it is noticed."""
    first = source_code.code_hash()
    assert first == source_code.code_hash()
    path = min(p for p in (package / "data").iterdir() if p.suffix in (".py", ".csv"))
    change(path)
    if change is not same_size_and_time:
        with pytest.raises(CannotDo, match="own files have changed since it was started"):
            source_code.code_hash()
    restart(monkeypatch)
    source_code._hash.cache_clear()
    assert source_code.code_hash() != first


LATE = """
import sys, vcam_cli.errors
print("loaded", flush=True)
sys.stdin.read()
print(vcam_cli.source_code.code_hash())
"""


@pytest.mark.parametrize("change", [None, *CHANGES, replaced_by_a_copy])
def test_changes_before_the_hash_is_first_needed(tmp_path, change):
    """A process that was loaded from other files than those on the disk has no hash."""
    copy = tmp_path / "vcam_cli"
    copy.mkdir()
    for name in ("__init__.py", "errors.py", "records.py", "source_code.py"):
        shutil.copy2(PACKAGE / name, copy)
    env = os.environ | {"PYTHONPATH": str(tmp_path)}
    line = [sys.executable, "-c", LATE]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(line, cwd=tmp_path, env=env, text=True, **pipes) as process:
        assert process.stdout.readline() == "loaded\n"
        if change:
            change(copy / "errors.py")
        out, error = process.communicate()
    if change:
        assert "own files have changed since it was started" in error
        assert not out
    else:
        assert len(out.strip()) == 16


def test_bytes_that_move_from_file_to_file(package, monkeypatch):
    first = source_code.code_hash()
    moved_over_the_border(package / "errors.py")
    restart(monkeypatch)
    assert source_code.code_hash() != first


def test_the_same_files_elsewhere_are_the_same_code(package, monkeypatch):
    """Another time and another place, and what Python and users leave beside them."""
    (package / "__pycache__").mkdir()
    (package / "__pycache__" / "errors.pyc").touch()
    (package / "configs").mkdir()
    (package / "configs" / "a.csv").touch()
    for path in package.rglob("*.py"):
        os.utime(path, (0, 0))
    restart(monkeypatch)
    copied = source_code.code_hash()
    monkeypatch.undo()
    assert copied == source_code.code_hash()


def program(folder: Path, change: str = "") -> dict[str, str]:
    """The environment of a copy of the program, whose mean squared error is another one."""
    shutil.copytree(PACKAGE, folder / "vcam_cli")  # with what is compiled already
    for shipped in ("configs", "schemas"):
        if not (folder / "vcam_cli" / shipped).exists():
            (folder / shipped).symlink_to(PACKAGE.parent / shipped)
    if change:
        path = folder / "vcam_cli" / "quality" / "mse.py"
        path.write_text(path.read_text("utf-8") + change, "utf-8")
    return os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}


def sweep(study: Path, env: dict[str, str], *more: str) -> tuple[dict, str]:
    line = [sys.executable, "-m", "vcam_cli.commands.main", "sweep", str(study), "--workers", "1"]
    done = subprocess.run(
        [*line, "--json", "-o", "out", *more],
        cwd=study.parent, env=env, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return json.loads(done.stdout), done.stderr


def column(folder: Path) -> list[float]:
    with open(folder / "points.csv", newline="") as file:
        return [float(row["mse"]) for row in csv.DictReader(file)]


@pytest.mark.long
def test_shares_of_one_folder_by_two_programs(tmp_path):
    """The same version, another mse: no table has both, and each run says so."""
    study = written(tmp_path, {"quality": ["mse"]}, metrics=["mse"])
    ours, other = program(tmp_path / "ours"), program(tmp_path / "other", OTHER_MSE)
    first, said = sweep(study, ours, "--shard", "1/2")
    assert "other code" not in said
    second, said = sweep(study, other, "--shard", "2/2")
    assert "points of other code are left out, and computed again (code " in said
    found = column(tmp_path / "out")
    assert set(found) == {777.0}
    assert second["missing"] == 3 - len(found) > 0
    again, said = sweep(study, other)
    assert "other code" not in said
    assert again["computed"] == second["missing"]
    assert column(tmp_path / "out") == [777.0] * 3
    back, said = sweep(study, ours)
    assert "other code" in said
    assert back["computed"] == 3 - first["computed"]
    assert 777.0 not in column(tmp_path / "out")
    for path in (tmp_path / "out" / "points").glob("*.json"):
        point = json.loads(path.read_text())["point"]
        record = json.loads((tmp_path / "out" / "study.json").read_text())
        is_ours = point["code"] == record["versions"]["code"]
        assert is_ours == (point["metrics"]["mse"] != 777.0)


@pytest.mark.parametrize("name", ["code", "vcam", "numpy", "scipy", "OpenImageIO"])
@pytest.mark.parametrize("when", ["before", "meanwhile"])
def test_a_worker_with_other_code_computes_nothing(tmp_path, monkeypatch, name, when):
    """In a process of its own, or on a cluster: alike `compute_points`, wherever it runs."""
    versions = point_work.versions()
    job = computation.Job("ab", load("starter"), (), (), {name: versions[name]})
    later = iter([versions if when == "meanwhile" else {}, {}])
    monkeypatch.setattr(point_work, "versions", lambda: next(later))
    monkeypatch.setattr(point_work, "simulate", lambda *_, **__: None)
    [outcome] = point_work.compute_points([job], 1, Shared())
    assert outcome.error.startswith(f"the worker has {name} None, the sweep {versions[name]}; ")
    assert not outcome.metrics
    assert not outcome.final


def test_a_run_says_which_code_made_it(tmp_path):
    env = program(tmp_path / "ours", "\n")
    study = written(tmp_path)
    line = [sys.executable, "-m", "vcam_cli.commands.main", "run", "camera.yaml", "-q", "-o", "out"]
    subprocess.run(line, cwd=study.parent, env=env, check=True)
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert len(record["versions"]["code"]) == 16
    assert record["versions"]["code"] != source_code.code_hash()
