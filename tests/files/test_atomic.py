"""Whole files: the name appears with the last byte, a failure leaves the former file."""

import errno
import json
import os
import signal
import subprocess
import sys
import textwrap

import pytest

from vcam_cli.errors import CannotDo
from vcam_cli.files import atomic
from vcam_cli.files.atomic import displayed_path, write_text, write_whole


def test_the_name_appears_only_when_the_body_is_done(tmp_path):
    path = tmp_path / "a.txt"
    with write_whole(path) as temporary:
        assert temporary.parent == tmp_path
        temporary.write_text("whole")
        assert not path.exists()
    assert path.read_text() == "whole"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, CannotDo])
def test_failing_body_keeps_the_former_file_and_leaves_nothing(tmp_path, error):
    write_text(tmp_path / "a.txt", "former")
    with pytest.raises(error), write_whole(tmp_path / "a.txt") as temporary:
        temporary.write_text("half")
        raise error("stop")
    assert os.listdir(tmp_path) == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "former"


@pytest.mark.parametrize(
    ("number", "words"),
    [(errno.ENOSPC, "disk is full"), (errno.EACCES, "permission"), (errno.EROFS, "read-only")],
)
def test_failure_of_the_disk_says_why_and_what_helps(tmp_path, monkeypatch, number, words):
    def refuse(*args):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(atomic.os, "fsync", refuse)
    with pytest.raises(CannotDo, match=words) as caught:
        write_text(tmp_path / "a.txt", "x")
    assert "a.txt" in caught.value.message
    assert caught.value.remedy
    assert os.listdir(tmp_path) == []


def test_missing_folder_is_cannot_do(tmp_path):
    with pytest.raises(CannotDo, match="No such file"):
        write_text(tmp_path / "missing" / "a.txt", "x")


def test_no_remedy_names_an_option_that_some_commands_lack():
    for number in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EACCES, errno.EROFS, errno.EIO):
        assert "--" not in str(atomic.cannot_write("a", OSError(number, os.strerror(number))))


def test_bytes_of_a_name_that_are_no_text_are_escaped(tmp_path):
    write_text(tmp_path / "a.json", '"b\udcffad"')
    assert json.loads((tmp_path / "a.json").read_bytes()) == "b\udcffad"


def test_long_names_fit(tmp_path):
    name = "x" * 250 + ".csv"
    write_text(tmp_path / name, "x")
    assert os.listdir(tmp_path) == [name]


def test_staging_folder_is_not_shown():
    assert displayed_path(f"out/{atomic.STAGING}/raw.exr") == os.path.join("out", "raw.exr")


def test_kill_while_writing_leaves_no_file_under_the_name(tmp_path):
    script = """
        import sys, time
        from vcam_cli.files.atomic import write_whole
        with write_whole(sys.argv[1]) as temporary:
            temporary.write_text("half")
            print("writing", flush=True)
            time.sleep(60)
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(tmp_path / "a.txt")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout.readline() == "writing\n"
        writer.send_signal(signal.SIGKILL)
    assert not (tmp_path / "a.txt").exists()
