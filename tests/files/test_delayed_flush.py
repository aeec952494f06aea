"""Files flushed together: all of them, within a second, errors told."""

import errno
import os
import subprocess
import sys
import time

import pytest

from vcam_cli.errors import CannotDo
from vcam_cli.files import atomic, delayed_flush
from vcam_cli.files.delayed_flush import DelayedFlush
from vcam_cli.files.points_store import SweepFolder


@pytest.fixture
def flushed(monkeypatch):
    """The names of what is flushed, in order."""
    names, true = [], atomic.flush
    monkeypatch.setattr(atomic, "flush", lambda path: names.append(path.name) or true(path))
    return names


def test_files_are_flushed_together_and_once(tmp_path, flushed):
    later = DelayedFlush(tmp_path)
    for name in "abc":
        atomic.write_bytes(tmp_path / name, b"x", is_flushed=False)
        later.add(tmp_path / name)
    assert flushed == []
    later.flush()
    assert flushed == ["a", "b", "c", tmp_path.name]
    later.flush()
    assert len(flushed) == 4


def test_nobody_has_to_ask(tmp_path, flushed, monkeypatch):
    monkeypatch.setattr(delayed_flush, "SECONDS", 0.01)
    later = DelayedFlush(tmp_path)
    atomic.write_bytes(tmp_path / "a", b"x", is_flushed=False)
    later.add(tmp_path / "a")
    until = time.monotonic() + 30
    while len(flushed) < 2 and time.monotonic() < until:
        time.sleep(0.01)
    assert flushed == ["a", tmp_path.name]


def test_a_file_that_is_gone_keeps_none_from_the_disk(tmp_path, flushed):
    later = DelayedFlush(tmp_path)
    (tmp_path / "b").write_bytes(b"x")
    for name in "ab":
        later.add(tmp_path / name)
    later.flush()
    assert flushed == ["a", "b", tmp_path.name]


def test_what_fails_is_told(tmp_path, monkeypatch):
    def fail(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(atomic, "flush", fail)
    later = DelayedFlush(tmp_path)
    later.add(tmp_path / "a")
    with pytest.raises(CannotDo, match="disk is full"):
        later.flush()
    later.flush()  # once


def test_a_point_survives_a_kill_at_once(tmp_path):
    """Before anything is flushed, and without any cleaning up."""
    code = (
        "import os, sys\n"
        "from vcam_cli.files.points_store import SweepFolder\n"
        "with SweepFolder(sys.argv[1]) as folder:\n"
        "    folder.write('ab' * 16, {'a': 1}, {'npz': b'frame'})\n"
        "    os.kill(os.getpid(), 9)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path], check=False)
    assert done.returncode == -9
    with SweepFolder(tmp_path) as folder:
        assert folder.read("ab" * 16, ("npz",)) == {"a": 1}
        for name, part in (("npz", b""), ("json", b"{}")):  # as a power cut may leave them
            folder.file("ab" * 16, name).write_bytes(part)
            assert folder.read("ab" * 16, ("npz",)) is None


def test_the_folder_is_left_with_all_points_on_the_disk(tmp_path, flushed):
    with SweepFolder(tmp_path) as folder:
        for number in range(3):
            folder.write(f"{number:032x}", {"a": number})
        assert flushed == []
    assert len(flushed) == 4
