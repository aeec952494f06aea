"""Disks that are full or read-only: a message, exit code 3, and nothing lost.

Where the machine allows it, disks of 64 kB are mounted in a name space of the test's own.
Everywhere, files that may not grow take their place: the same writers fail at the same lines.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from driver import Driver
from making import long_except, tree
from test_interrupts import contents, results

MOUNT = (
    "mount -t tmpfs -o size=64k none full && mount -t tmpfs -o size=8m none room"
    ' && cp inside/* room && mount -o remount,ro room && exec "$@"'
)
SMALL = {"array.rows": 8, "array.columns": 9, "accuracy": "draft"}
LARGE = ("--set", "array.rows=200", "--set", "array.columns=300")
LARGEST = 8000
"""Bytes of a file: enough for a small frame and its record, and not for a large frame."""


def written(folder: Path) -> None:
    """A camera, and a study whose frames grow."""
    (folder / "camera.yaml").write_text(yaml.safe_dump(tree(SMALL)))
    study = {
        "kind": "sweep", "name": "s", "camera": "camera.yaml", "metrics": ["mean_electrons"],
        "vary": {"exposure.time": {"start": "1 ms", "stop": "9 ms", "count": 8}}, "seeds": 2,
    }  # fmt: skip
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    columns = {"array.columns": {"values": [8, 9, 600, 10]}}
    growing = study | {"vary": columns, "seeds": 1, "keep": ["raw"]}
    (folder / "growing.yaml").write_text(yaml.safe_dump(growing))


def told(end: dict[str, Any], *words: str) -> None:
    """It ended as it does where this machine cannot do it, in a line."""
    assert end["code"] == 3, end
    assert len(end["said"].splitlines()) == 1, end
    for word in words:
        assert word in end["said"], end["said"]


@pytest.fixture
def folder(tmp_path):
    written(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def disks(tmp_path_factory):
    """A driver that sees `full`, of 64 kB, and `room`, read-only; the folder of both."""
    folder = tmp_path_factory.mktemp("disks")
    for name in ("full", "room", "inside", "free"):
        (folder / name).mkdir()
    for place in (folder, folder / "inside"):
        written(place)
    before = ("unshare", "-rm", "sh", "-c", f"cd '{folder}' && {MOUNT}", "sh")
    reason = refused(before)
    if reason:
        pytest.skip(f"no name space for mounts here: {reason}")
    with Driver(*before) as driver:
        yield driver, folder


class TestFilesThatMayNotGrow:
    def test_a_run_leaves_nothing(self, vcam, folder):
        before = contents(folder)
        told(vcam(folder, "run", "camera.yaml", *LARGE, "-q", "-o", "a/out", largest=LARGEST))
        assert contents(folder) == before
        assert not (folder / "a").exists()

    @pytest.mark.parametrize("largest", long_except([1500], [100, 1500, LARGEST]))
    def test_a_run_leaves_the_former_results(self, vcam, folder, largest):
        """Wherever it fails: at the raw frame, at the table, at the record."""
        assert vcam(folder, "run", "camera.yaml", "-q", "-o", "out")["code"] == 0
        before = contents(folder)
        told(vcam(folder, "run", "camera.yaml", *LARGE, "-q", "-o", "out", largest=largest), "out/")
        assert contents(folder) == before

    def test_a_sweep_keeps_what_fits_and_goes_on(self, vcam, folder):
        line = ("sweep", "growing.yaml", "--workers", "1", "-q", "-o")
        assert vcam(folder, *line, "whole")["code"] == 0
        end = vcam(folder, *line, "out", largest=LARGEST)
        assert end["code"] in (3, 4), end
        assert "Traceback" not in end["said"], end
        found = results(folder / "out")
        expected = results(folder / "whole")
        points = {name: data for name, data in found.items() if name.endswith(".raw.exr")}
        assert len(points) >= 2
        assert points.items() <= expected.items()
        summary = vcam(folder, *line[:-2], "--json", "-o", "out")
        assert json.loads(summary["said"])["computed"] == 4 - len(points), summary
        assert results(folder / "out") == expected

    def test_a_sweep_whose_tables_do_not_fit(self, vcam, folder):
        """Every point is kept: with more room nothing is computed again."""
        line = ("sweep", "study.yaml", "--workers", "1", "-q", "-o")
        told(vcam(folder, *line, "out", largest=700), "points.csv")
        assert not (folder / "out" / "points.csv").exists()
        summary = vcam(folder, *line[:-2], "--json", "-o", "out")
        assert json.loads(summary["said"])["computed"] == 0, summary
        assert vcam(folder, *line, "whole")["code"] == 0
        assert results(folder / "out") == results(folder / "whole")

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
    @pytest.mark.parametrize("command", ["run camera.yaml", "sweep study.yaml"])
    def test_a_folder_that_may_not_be_written(self, vcam, folder, command):
        (folder / "room").mkdir(mode=0o555)
        told(vcam(folder, *command.split(), "-q", "-o", "room/out"), "permission denied", "out")
        assert not list((folder / "room").iterdir())


class TestMounted:
    """One of them is quick: it shows that what fails above is what a full disk fails at."""

    def test_a_run_onto_a_full_disk_leaves_nothing(self, disks):
        driver, folder = disks
        end = driver(folder, "run", "camera.yaml", *LARGE, "-q", "-o", "full/out")
        told(end, "the disk is full", "full/out")
        assert contents(seen(driver, folder / "full")) == {}

    @pytest.mark.long
    def test_a_run_that_fits_and_one_that_does_not(self, disks):
        """The former results stay."""
        driver, folder = disks
        assert driver(folder, "run", "camera.yaml", "-q", "-o", "full/two")["code"] == 0
        before = contents(seen(driver, folder / "full"))
        assert "two/run.json" in before
        told(driver(folder, "run", "camera.yaml", *LARGE, "-q", "-o", "full/two"))
        assert contents(seen(driver, folder / "full")) == before

    @pytest.mark.long
    def test_a_sweep_onto_a_full_disk_keeps_what_it_finished(self, disks):
        """What it kept is whole; where there is more room it goes on with it."""
        driver, folder = disks
        line = ("sweep", "study.yaml", "--workers", "1", "-q", "-o")
        told(driver(folder, *line, "full/sweep"), "the disk is full")
        points = seen(driver, folder / "full" / "sweep" / "points")
        kept = [path for path in points.iterdir() if path.name != ".claims"]
        assert 3 < len(kept) < 16
        assert all(path.suffix == ".json" for path in kept)
        shutil.copytree(points, folder / "free" / "sweep" / "points")
        summary = driver(folder, *line[:-2], "--json", "-o", "free/sweep")
        assert json.loads(summary["said"])["computed"] == 16 - len(kept)
        assert driver(folder, *line, "free/whole")["code"] == 0
        assert results(folder / "free" / "sweep") == results(folder / "free" / "whole")

    @pytest.mark.long
    @pytest.mark.parametrize("command", ["run camera.yaml", "sweep study.yaml"])
    def test_a_read_only_disk_is_read_and_not_written(self, disks, command):
        driver, folder = disks
        line = (*command.split(), "-q", "-o")
        told(driver(folder / "room", *line, "out"), "read-only", "out")
        if command.startswith("run"):
            assert driver(folder / "room", *line, "../free/run")["code"] == 0


def refused(before: tuple[str, ...]) -> str:
    """Why this machine does not mount anything for us; "" where it does."""
    if os.sysconf("SC_PAGE_SIZE") > 4096:
        return "a disk of 64 kB would have a single page"
    if shutil.which("unshare") is None:
        return "there is no unshare"
    done = subprocess.run([*before, "true"], capture_output=True, text=True)
    return done.stderr.strip() or f"exit code {done.returncode}" if done.returncode else ""


def seen(driver: Driver, folder: Path) -> Path:
    """A folder as the driver sees it."""
    return Path(f"/proc/{driver.process.pid}/root") / str(folder).lstrip("/")
