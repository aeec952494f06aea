"""What a shell does to a program: readers that go away, odd addresses, folders in odd places.

Everything ends in a sentence of ours at most: no traceback, no text of a library, no place where
files only wait.
"""

import csv
import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from making import long_except, tree
from processes import VCAM, environment
from sweeping import written
from typer.testing import CliRunner

from vcam_cli import sweep
from vcam_cli.commands import main
from vcam_cli.config.file_names import existing_file
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.atomic import STAGING
from vcam_cli.files.images import rows
from vcam_cli.files.images.exr import ExrWriter
from vcam_cli.files.images.png import write_png
from vcam_cli.sweeps.execution import Execution

pytestmark = pytest.mark.attack("manners in a shell")
SMALL = {"array.rows": 8, "array.columns": 9, "accuracy": "draft"}


# --- readers that go away ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("shell")
    (place / "camera.yaml").write_text(yaml.safe_dump(tree(SMALL)))
    (place / "broken.yaml").write_text("optics: 4\n")
    written(place / "sweep", vary={"pixel.width": {"values": ["5 um", "-1 um"]}})
    return place


COMMANDS = {
    "run camera.yaml": 0,
    "validate camera.yaml broken.yaml": 2,
    "list --json": 0,
    "run broken.yaml": 2,
    "sweep sweep/study.yaml --workers 1": 4,
}  # command -> its exit code, whoever reads what it says


@pytest.mark.parametrize("unbuffered", long_except([""], ["", "1"]))
@pytest.mark.parametrize("gone", long_except(["both"], ["stdout", "stderr", "both"]))
@pytest.mark.parametrize("command", long_except(["run camera.yaml"], COMMANDS))
def test_a_reader_that_goes_away(folder, command, gone, unbuffered):
    """The work is done and the exit code tells of it; nothing is said of the pipe."""
    read, write = os.pipe()
    os.close(read)
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    streams |= dict.fromkeys(streams if gone == "both" else [gone], write)
    env = environment({"PYTHONUNBUFFERED": unbuffered})
    done = subprocess.run([*VCAM, *command.split()], cwd=folder, env=env, text=True, **streams)
    os.close(write)
    assert done.returncode == COMMANDS[command], done
    assert "ipe" not in (done.stderr or ""), done
    if command.startswith("run camera"):
        assert (folder / "out" / "made" / "run.json").is_file()


# --- schedulers ----------------------------------------------------------------------------------

ADDRESSES = [
    "garbage", "", " ", "tcp://", "://", "tcp://:1", "tcp://x:y", "tcp://x:0", "tcp://x:99999",
    "http://x:1", "inproc://x:1", "ucx://x:1", "ws://x:1", "file.json", "a\nb:1", "x:-1", "tcp://[::1",
    "tcp://x:1/", "tcp://x:1?a", "tcp://x:1#a", "tcp://a b:1", "tcp://a@b:1", "\x1b[2J:1",
    "tcp://caf\udce9:1x",
]  # fmt: skip


@pytest.mark.parametrize("address", ADDRESSES, ids=ascii)
def test_what_is_no_address_never_reaches_dask(address):
    with pytest.raises(BadInput) as caught:
        Execution(scheduler=address)
    (said,) = caught.value.problems
    assert str(said).endswith("is no address of a Dask scheduler; write tcp://HOST:8786")
    assert str(said).isprintable()


@pytest.mark.parametrize(
    "address", ["tcp://h:8786", "h:1", "tls://10.0.0.1:65535", "tcp://[::1]:9"]
)
def test_what_is_an_address(address):
    assert Execution(scheduler=address).scheduler == address


IMPATIENT = (
    "from vcam_cli.sweeps import workers; workers.CONNECT_TIMEOUT = 0.5;"
    "from vcam_cli.commands.main import main; main()"
)


@pytest.mark.long  # test_sweep_on_dask.py asks the first of them without a process of its own
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "tls://127.0.0.1:1", "127.0.0.1:{}"])
def test_a_scheduler_that_is_none(tmp_path, address):
    """Nobody there, no certificates, or somebody who says nothing: one line, exit code 3."""
    pytest.importorskip("distributed")
    written(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        place = address.format(silent.getsockname()[1])
        done = subprocess.run(
            [sys.executable, "-c", IMPATIENT, "sweep", "study.yaml", "-q", "--scheduler", place],
            cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=120,
        )  # fmt: skip
    assert done.returncode == 3, done
    assert len(done.stderr.splitlines()) == 1, done
    assert place in done.stderr


# --- links and folders in odd places -------------------------------------------------------------


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def pipe(path: Path) -> None:
    os.mkfifo(path.with_name("there"))
    path.symlink_to("there")


def folder_behind(path: Path) -> None:
    path.with_name("there").mkdir()
    path.symlink_to("there")


def listener(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        here = Path.cwd()
        os.chdir(path.parent)  # names of sockets are short
        server.bind("there")
        os.chdir(here)
    path.symlink_to("there")


LINKS = {"a device": device, "a pipe": pipe, "a folder": folder_behind, "a socket": listener}


@pytest.mark.parametrize("kind", LINKS)
@pytest.mark.parametrize("hops", [1, 3])
def test_a_link_is_called_what_it_leads_to(tmp_path, kind, hops):
    LINKS[kind](tmp_path / "0")
    for hop in range(1, hops):
        (tmp_path / str(hop)).symlink_to(str(hop - 1))
    with pytest.raises(BadInput, match=f"'x' is a link to {kind}; point it to a file"):
        existing_file(tmp_path / str(hops - 1), "x")


def error_column(out: Path) -> list[str]:
    with open(out / "points.csv", newline="") as file:
        return [row["error"] for row in csv.DictReader(file)]


@pytest.mark.parametrize("name", long_except(["raw.exr"], ["json", "raw.exr", "render.png"]))
@pytest.mark.parametrize("filled", long_except([True], [False, True]))
@pytest.mark.parametrize("share", long_except([None], [None, (1, 1)]))
def test_a_folder_in_place_of_a_points_file_costs_that_point(tmp_path, name, filled, share):
    study, out = written(tmp_path, keep=["raw", "render"]), tmp_path / "out"
    first = sweep(study, out, workers=1)
    path = out / "points" / f"{first.ids[1]}.{name}"
    path.unlink()
    path.mkdir()
    if filled:
        (path / "mine").write_text("mine")
    again = sweep(study, out, workers=1, shard=share)
    assert (again.exit_code, again.failed, again.computed) == (4, 1, 1)
    assert error_column(out) == ["", f"points/{path.name} is a folder; move it away", ""]
    assert not filled or (path / "mine").read_text() == "mine"
    path.rename(tmp_path / "moved")
    assert sweep(study, out, workers=1).exit_code == 0
    assert error_column(out) == [""] * 3


# --- capture schedules ---------------------------------------------------------------------------


@pytest.mark.parametrize("count", long_except([2, 11], [1, 2, 10, 11]))
@pytest.mark.parametrize(
    ("gap", "frame", "most"),
    [(7, 2, 10), (8, 0, 10), (8, 8, 10), (0, 8, 10), (70, 0, 2), (74, 0, 1), (7.9, 8, 10)],
)
def test_captures_that_do_not_fit_their_least_distance(tmp_path, gap, frame, most, count):
    """Between 8 ms, when 500 e are there of 62.5 ke/s, and 80 ms."""
    from vcam_cli import schedule

    sensor = {"well_capacity": "500 e", "read_noise": "10 e", "max_time": "80 ms"}
    study = {
        "kind": "schedule", "counts": [count],
        "pdf": {"uniform": {"min": "1 e/s", "max": "62500 e/s"}},
        "sensor": sensor, "methods": ["optimal", "uniform"],
        "constraints": {"min_gap": f"{gap} ms", "frame_time": f"{frame} ms"},
    }  # fmt: skip
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    if count > most:
        key = "min_gap" if gap >= frame else "frame_time"
        with pytest.raises(BadInput, match=rf"constraints\.{key}: {count} captures, .* {most} at"):
            schedule(tmp_path / "study.yaml", tmp_path / "out")
        assert not (tmp_path / "out").exists()
    else:
        found = schedule(tmp_path / "study.yaml", tmp_path / "out")
        for one in found.found:
            told = f"{one.method} keeps {one.distinct_captures} of its {one.count} captures"
            repeats = one.distinct_captures < one.count
            assert any(note.startswith(told) for note in found.notes) == repeats


# --- text of libraries ---------------------------------------------------------------------------

NOT_OURS = re.compile(
    rf"{re.escape(STAGING)}|exception|\.cpp|0x[0-9a-f]{{6}}|\.part\b|OpenEXR|libpng"
)


def broken_files(folder: Path) -> dict[str, bytes]:
    """Whole picture files, to cut and to damage."""
    import numpy as np

    plane = np.linspace(0, 1, 32 * 48, dtype=np.float32).reshape(32, 48)
    with ExrWriter(folder / "a.exr", plane.shape, ["R", "G", "B"]) as exr:
        exr.write_rows(0, dict.fromkeys("RGB", plane))
    write_png(folder / "a.png", np.dstack([(plane * 255).astype(np.uint8)] * 3))
    return {name: (folder / name).read_bytes() for name in ("a.exr", "a.png")}


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
@pytest.mark.parametrize("part", [0.01, 0.1, 0.3, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("way", ["cut", "zeros", "ones"])
def test_a_damaged_picture_is_refused_in_our_words(tmp_path, monkeypatch, name, part, way):
    monkeypatch.chdir(tmp_path)
    data = broken_files(tmp_path)[name]
    place = int(len(data) * part)
    rest = {"cut": b"", "zeros": bytes(64) + data[place + 64 :], "ones": b"\xff" * 64}[way]
    (tmp_path / name).write_bytes(data[:place] + rest)
    image = {"kind": "image", "file": f"./{name}", "model": "reflectance"}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(tree(SMALL | {"scene.source": image})))
    result = CliRunner().invoke(main.app, ["run", "camera.yaml", "-q"], prog_name="vcam")
    assert result.exit_code in (0, 2, 3), result.exception
    assert not NOT_OURS.search(result.stderr), result.stderr


REASONS = {
    f"OpenEXR exception: /a/{STAGING}/x.exr ({os.strerror(27)}) at 0x123456789": "larger than",
    f'Cannot write "/a/.x.1-2.part": {os.strerror(122)}.': "quota",
    "": "could not be written completely",
    "libpng error: 0xdeadbeef in foo.cpp": "could not be written completely",
}


@pytest.mark.parametrize("reason", REASONS)
def test_a_picture_that_cannot_be_written_is_told_in_our_words(tmp_path, monkeypatch, reason):
    monkeypatch.setattr(rows, "_FULL", 0)
    writer = ExrWriter(tmp_path / STAGING / "raw.exr", (1, 1), ["Y"])
    said = str(writer._failure(reason))
    assert isinstance(writer._failure(reason), CannotDo)
    assert said.startswith(f"cannot write {tmp_path / 'raw.exr'}: ")
    assert REASONS[reason] in said
    assert not NOT_OURS.search(said)


@pytest.mark.parametrize("largest", long_except([2000], [500, 2000]))
@pytest.mark.parametrize("command", ["run", "sweep"])
def test_a_file_that_may_not_grow_is_told_in_our_words(vcam, tmp_path, command, largest):
    written(tmp_path, {"array.rows": 64, "array.columns": 96}, keep=["raw", "render"])
    file = "camera.yaml" if command == "run" else "study.yaml"
    line = (command, file, "-q", "-o", "out", "--workers", "1")
    end = vcam(tmp_path, *line, largest=largest)
    assert end["code"] in (3, 4), end
    column = error_column(tmp_path / "out") if (tmp_path / "out" / "points.csv").exists() else []
    assert not NOT_OURS.search(end["said"] + json.dumps(column)), (end, column)
