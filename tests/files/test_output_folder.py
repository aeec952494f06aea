"""The output folder: together or not at all, locked, nothing foreign touched."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files import folder as folder_module
from vcam_cli.files import records
from vcam_cli.files.atomic import STAGING, write_text
from vcam_cli.files.folder import LOCK, OutputFolder


def run(path, files, **options):
    with OutputFolder(path, **options) as folder:
        for name, text in files.items():
            write_text(folder.new(name), text)
        folder.finish({"seconds": 1.0})


def tree(path):
    return sorted(str(p.relative_to(path)) for p in Path(path).rglob("*"))


def test_run_leaves_its_files_and_a_record_that_names_them(tmp_path):
    out = tmp_path / "deep" / "out"
    run(out, {"raw.exr": "raw", "captures/raw_001.exr": "one"})
    assert tree(out) == ["captures", "captures/raw_001.exr", "raw.exr", "run.json"]
    record = json.loads((out / "run.json").read_text())
    hashes = {name: hashlib.sha256(text).hexdigest() for name, text in
              {"raw.exr": b"raw", "captures/raw_001.exr": b"one"}.items()}  # fmt: skip
    assert record == {
        "files": ["captures/raw_001.exr", "raw.exr"], "program": "vcam", "seconds": 1.0,
        "written": {name: {"bytes": 3, "sha256": digest} for name, digest in hashes.items()},
    }  # fmt: skip


def test_next_run_removes_what_the_former_named_and_nothing_else(tmp_path):
    run(tmp_path / "out", {"raw.exr": "1", "captures/raw_001.exr": "1"})
    (tmp_path / "out" / "mine.txt").write_text("mine")
    run(tmp_path / "out", {"raw.exr": "2", "render.png": "2"})
    assert tree(tmp_path / "out") == ["mine.txt", "raw.exr", "render.png", "run.json"]
    assert (tmp_path / "out" / "raw.exr").read_text() == "2"


@pytest.mark.parametrize("before", [{}, {"raw.exr": "1", "sub/a": "1"}])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_failing_run_changes_nothing(tmp_path, before, error):
    out = tmp_path / "a" / "out"
    if before:
        run(out, before)
    present = tree(tmp_path)
    with pytest.raises(error), OutputFolder(out) as folder:
        write_text(folder.new("raw.exr"), "2")
        write_text(folder.new("new/x"), "2")
        raise error
    assert tree(tmp_path) == present
    assert not before or (out / "raw.exr").read_text() == "1"


def test_run_without_finish_leaves_nothing(tmp_path):
    with OutputFolder(tmp_path / "out") as folder:
        write_text(folder.new("raw.exr"), "2")
    assert tree(tmp_path) == []


def test_foreign_folder_is_refused_and_untouched(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(BadInput, match="not empty"):
        run(tmp_path, {"raw.exr": "1"})
    assert tree(tmp_path) == ["thesis.txt"]


@pytest.mark.parametrize(
    "record", ["{}", "[", "[]", '{"program": "other"}', '{"program": "vcam"}', "[" * 100_000,
               '{"program": "vcam", "files": [1]}']
)  # fmt: skip
def test_record_of_another_program_owns_nothing(tmp_path, record):
    (tmp_path / "run.json").write_text(record)
    with pytest.raises(BadInput):
        run(tmp_path, {"raw.exr": "1"})
    assert tree(tmp_path) == ["run.json"]


def test_file_as_output_is_bad_input(tmp_path):
    (tmp_path / "out").write_text("a file")
    for path in (
        tmp_path / "out",
        tmp_path / "out" / "below",
        tmp_path / ("x" * 300),
        tmp_path / "a\0b",
    ):
        with pytest.raises(BadInput):
            run(path, {"raw.exr": "1"})
    assert tree(tmp_path) == ["out"]


def test_dangling_link_as_output_is_bad_input(tmp_path):
    (tmp_path / "out").symlink_to(tmp_path / "nowhere")
    with pytest.raises(BadInput):
        run(tmp_path / "out", {"raw.exr": "1"})


def test_file_of_the_user_is_not_overwritten(tmp_path):
    run(tmp_path / "out", {"raw.exr": "1"})
    (tmp_path / "out" / "render.png").write_text("mine")
    with pytest.raises(BadInput, match=r"render\.png"):
        run(tmp_path / "out", {"raw.exr": "2", "render.png": "2"})
    assert (tmp_path / "out" / "raw.exr").read_text() == "1"
    assert (tmp_path / "out" / "render.png").read_text() == "mine"


def test_input_of_the_run_is_not_replaced(tmp_path):
    run(tmp_path / "out", {"render.png": "1"})
    scene = tmp_path / "out" / "render.png"
    with pytest.raises(BadInput, match="input"):
        run(tmp_path / "out", {"raw.exr": "2"}, inputs=[scene])
    assert tree(tmp_path / "out") == ["render.png", "run.json"]


def test_folder_that_has_come_into_the_way_is_refused_and_removes_nothing(tmp_path):
    out = tmp_path / "out"
    run(out, {"raw.exr": "1", "render.png": "1"})
    (out / "raw.exr").unlink()
    (out / "raw.exr").mkdir()
    present = tree(out)
    with pytest.raises(BadInput, match=r"raw\.exr is there already"):
        run(out, {"render.png": "2", "raw.exr": "2"})
    assert tree(out) == present
    assert (out / "render.png").read_text() == "1"


@pytest.mark.parametrize("late", ["in the way", "not written"])
def test_finish_removes_nothing_unless_all_can_be_moved_in(tmp_path, late):
    out = tmp_path / "out"
    run(out, {"raw.exr": "1", "old.csv": "1"})
    with pytest.raises((BadInput, CannotDo)), OutputFolder(out) as folder:
        place = folder.new("raw.exr")
        if late == "in the way":
            place.write_text("2")
            (out / "raw.exr").unlink()
            (out / "raw.exr").mkdir()
        folder.finish({})
    assert (out / "old.csv").read_text() == "1"
    assert json.loads((out / "run.json").read_text())["files"] == ["old.csv", "raw.exr"]


def test_name_that_is_no_text_is_refused_before_anything_is_made(tmp_path):
    with pytest.raises(BadInput, match="not UTF-8") as caught:
        run(tmp_path / "made" / "b\udcffad", {"raw.exr": "1"})
    assert caught.value.problems[0].remedy
    assert tree(tmp_path) == []


@pytest.mark.parametrize("name", ["../x", "/x", "", "run.json", LOCK, f"{STAGING}/x"])
def test_new_refuses_names_that_are_no_result(tmp_path, name):
    with OutputFolder(tmp_path / "out") as folder, pytest.raises(ValueError, match="no name"):
        folder.new(name)


def test_second_run_in_the_same_folder_cannot_start(tmp_path):
    with OutputFolder(tmp_path / "out") as first:
        with pytest.raises(CannotDo, match="folder in use"), OutputFolder(tmp_path / "out"):
            pass
        write_text(first.new("raw.exr"), "1")
        first.finish({})
    assert tree(tmp_path / "out") == ["raw.exr", "run.json"]


HOLDER = """
    import sys, time
    from vcam_cli.files.atomic import write_text
    from vcam_cli.files.folder import OutputFolder
    with OutputFolder(sys.argv[1]) as folder:
        write_text(folder.new("raw.exr"), "unfinished")
        print("holding", flush=True)
        time.sleep(60)
"""


def test_killed_run_frees_the_folder_for_the_next(tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-c", textwrap.dedent(HOLDER), str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        try:
            assert holder.stdout.readline() == "holding\n"
            with pytest.raises(CannotDo, match="folder in use"):
                run(out, {"raw.exr": "2"})
        finally:
            holder.send_signal(signal.SIGKILL)
    assert not (out / "raw.exr").exists()  # nothing half done under a final name
    run(out, {"raw.exr": "2"})
    assert tree(out) == ["raw.exr", "run.json"]


class Killed(BaseException):
    """Stands for SIGKILL: nothing of `_leave` runs."""


@pytest.mark.parametrize("step", range(7))
def test_kill_at_any_step_of_finish_leaves_a_folder_the_next_run_can_use(
    tmp_path, monkeypatch, step
):
    out = tmp_path / "out"
    run(out, {"raw.exr": "1", "old.csv": "1"})
    (out / "mine.txt").write_text("mine")
    left = step

    def counted(function):
        def call(*args, **options):
            nonlocal left
            left -= 1
            if left < 0:
                raise Killed
            return function(*args, **options)

        return call

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", counted(os.replace))
        patch.setattr(Path, "unlink", counted(Path.unlink))
        patch.setattr(OutputFolder, "_leave", lambda self: os.close(self._lock))
        with pytest.raises(Killed), OutputFolder(out) as folder:
            for name in ("raw.exr", "render.png"):
                folder.new(name).write_text("2")
            folder.finish({})
    if (out / "run.json").exists():  # a folder with a record is complete
        record = json.loads((out / "run.json").read_text())
        assert all((out / name).exists() for name in record["files"])
    run(out, {"raw.exr": "3"})
    assert tree(out) == ["mine.txt", "raw.exr", "run.json"]
    assert (out / "raw.exr").read_text() == "3"


@pytest.mark.parametrize("number", ["ENOSPC", "EACCES", "EROFS"])
def test_folder_that_cannot_be_written_is_cannot_do(tmp_path, monkeypatch, number):
    code = getattr(folder_module.errno, number)

    def refuse(*args, **options):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(folder_module.os, "open", refuse)
    with pytest.raises(CannotDo, match=r"out.*;") as caught, OutputFolder(tmp_path / "out"):
        pass
    assert caught.value.exit_code == 3
    monkeypatch.undo()
    assert tree(tmp_path) == []


def test_file_system_without_locks_is_used_all_the_same(tmp_path, monkeypatch):
    def refuse(*args):
        raise OSError(folder_module.errno.ENOLCK, "no locks")

    monkeypatch.setattr(folder_module.fcntl, "flock", refuse)
    run(tmp_path / "out", {"raw.exr": "1"})
    assert tree(tmp_path / "out") == ["raw.exr", "run.json"]


def test_a_file_that_was_written_is_read_again_when_it_changes(tmp_path):
    """Its hash is remembered by size, times and number: a planted one of the same size is found."""
    path, temporary = tmp_path / "shard.npz", tmp_path / "temporary"
    temporary.write_bytes(b"a" * 100)
    before, made = temporary.lstat(), records.file_fingerprint(temporary)
    temporary.rename(path)
    records.remember(path, before, made)

    def holds():
        return records.Proofs(tmp_path, {"files": [path.name], "written": {path.name: made}}).holds(
            path.name
        )

    assert holds()
    time.sleep(0.02)  # clocks of file systems tick every few milliseconds
    path.write_bytes(b"b" * 100)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert not holds()
