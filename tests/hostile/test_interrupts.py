"""Ctrl-C and SIGKILL at any moment: what exists is whole, what was finished is kept.

The moments are spread over the time that a run takes, measured first; SIGKILL stands for all
that ends a process without its consent. Two runs at once into one folder are here as well.
"""

import csv
import json
import random
import shutil
import signal
from pathlib import Path
from typing import Any

import OpenImageIO as oiio
import pytest
import yaml
from driver import Driver
from making import tree

from vcam_cli.files.images.exr import read_exr

SMALL = {
    "array.rows": 16, "array.columns": 24, "accuracy": "draft", "array.pattern": "bayer-rggb",
    "scene.illuminant": "D65", "quality": ["mse"], "processing": [{"demosaic": "bilinear"}],
}  # fmt: skip
STUDY = {
    "kind": "sweep", "name": "s", "camera": "camera.yaml", "seeds": 2, "metrics": ["mse"],
    "vary": {"exposure.time": {"values": ["5 ms", "6 ms", "7 ms"]}}, "keep": ["raw"],
}  # fmt: skip
RUN = ("run", "camera.yaml", "-q", "-o")
SWEEP = ("sweep", "study.yaml", "--workers", "1", "-q", "-o")
NAMES = {"raw.exr", "ideal.exr", "render.png", "metrics.csv", "run.json"}
SIGNALS = pytest.mark.parametrize(
    "number", [signal.SIGINT, signal.SIGKILL], ids=["SIGINT", "SIGKILL"]
)
MOMENTS = pytest.mark.parametrize("moments", [2, pytest.param(150, marks=pytest.mark.long)])


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(tree(SMALL)))
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(STUDY))
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def results(folder: Path) -> dict[str, bytes]:
    """The files that are the same whenever and wherever they are made."""
    without = {"run.json", "study.json", "timings.csv", "points/.claims"}
    found = {name: data for name, data in contents(folder).items() if name not in without}
    numbers = {name: _numbers(data) for name, data in found.items() if name.endswith(".json")}
    return found | numbers


def _numbers(data: bytes) -> bytes:
    """A point's file without its time."""
    point = json.loads(data)["point"]
    return json.dumps({name: point[name] for name in point if name != "seconds"}).encode()


def moments_over(longest: float, count: int, number: int) -> list[float]:
    """Random moments in seconds, one in every equal part of the time, in random order."""
    chance = random.Random(int(number))
    moments = [longest * (part + chance.random()) / count for part in range(count)]
    chance.shuffle(moments)
    return moments


def sooner(moment: float, tries: int, stops: int) -> float:
    """A moment, halved with each try as long as none has stopped anything.

    The run whose time was measured may have waited for the disk; the others end before then.
    """
    return moment if stops else moment / 2**tries


def whole(folder: Path) -> None:
    """Every file under a final name can be read to its end, every record's files are there."""
    for path in (p for p in folder.rglob("*") if p.is_file() and not hidden(folder, p)):
        if path.suffix == ".exr":
            read_exr(path)
        elif path.suffix == ".png":
            image = oiio.ImageBuf(str(path))
            assert image.read(force=True), path
            assert not image.has_error, path
        elif path.suffix == ".csv":
            rows = list(csv.reader(path.read_text("utf-8").splitlines()))
            assert len({len(row) for row in rows}) == 1, path
        else:
            content = json.loads(path.read_text("utf-8"))
            assert all((path.parent / name).is_file() for name in content.get("files", []))


def hidden(folder: Path, path: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def ended(done: dict[str, Any], number: int, vcam: Driver, out: Path) -> bool:
    """Whether it was stopped; an interrupt is told in a line at most, and leaves nothing."""
    if number == signal.SIGINT:
        assert done["code"] in (0, 130), done
        lines = done["said"].splitlines()
        assert len(lines) <= 1, done
        assert all(line.startswith("interrupted; ") for line in lines), done
        found = [str(p) for p in out.rglob(".*") if p.name != ".claims"]
        assert not found + vcam.left, done
    else:
        assert done["code"] in (0, -number), done
    return done["code"] != 0


@MOMENTS
@SIGNALS
def test_a_run_that_replaces_another(number, moments, vcam, folder):
    """The former results or the new ones, never some of each; and the next run succeeds."""
    expected, seconds = {}, []
    for seed in ("1", "2"):
        done = vcam(folder, *RUN, seed, "--seed", seed)
        assert done["code"] == 0, done
        expected[seed] = results(folder / seed)
        seconds.append(done["seconds"])
    assert expected["1"] != expected["2"]
    assert set(contents(folder / "1")) == NAMES
    out, stops = folder / "out", 0
    assert vcam(folder, *RUN, "out", "--seed", "1")["code"] == 0
    now = "1"
    for tries, moment in enumerate(moments_over(min(seconds), moments, number)):
        other = "2" if now == "1" else "1"
        after = sooner(moment, tries, stops)
        done = vcam(folder, *RUN, "out", "--seed", other, signal=number, after=after)
        stops += ended(done, number, vcam, out)
        whole(out)
        if number == signal.SIGKILL and not (out / "run.json").exists():
            assert vcam(folder, *RUN, "out", "--seed", other)["code"] == 0
        record = json.loads((out / "run.json").read_text())
        now = str(record["camera"]["seed"]["frame"])
        there = {name: (out / name).read_bytes() for name in record["files"]}
        assert there == expected[now]
        if number == signal.SIGINT:
            assert set(contents(out)) == NAMES
    assert stops, "nothing was interrupted"
    for seed in ("2", "1"):
        assert vcam(folder, *RUN, "out", "--seed", seed)["code"] == 0
        assert set(contents(out)) == NAMES
        assert results(out) == expected[seed]


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(signal.SIGINT, id="SIGINT"),
        # That it leaves nothing half written, runs above that replace another show.
        pytest.param(signal.SIGKILL, id="SIGKILL", marks=pytest.mark.long),
    ],
)
def test_a_first_run(number, vcam, folder):
    """There was nothing before: after an interrupt not even the folder is there."""
    longest = vcam(folder, *RUN, "expected")["seconds"]
    out, stops = folder / "deep" / "out", 0
    for tries, moment in enumerate(moments_over(longest, 3, number)):
        after = sooner(moment, tries, stops)
        done = vcam(folder, *RUN, "deep/out", signal=number, after=after)
        stops += ended(done, number, vcam, out)
        whole(out)
        if number == signal.SIGINT:  # it may come when all is written already
            assert not out.parent.exists() or set(contents(out)) == NAMES
        shutil.rmtree(out.parent, ignore_errors=True)
    assert stops, "nothing was interrupted"


@MOMENTS
@SIGNALS
def test_a_sweep_goes_on_where_it_was(number, moments, vcam, folder):
    done = vcam(folder, *SWEEP, "whole")
    assert done["code"] == 0, done
    longest, expected = done["seconds"], results(folder / "whole")
    assert sum(name.endswith(".json") for name in expected) >= 6
    out, stops = folder / "out", 0
    for tries, moment in enumerate(moments_over(longest, moments, number)):
        before = kept(out)
        # The rest of a sweep takes less time than all of it.
        after = sooner(moment, tries, stops) * (0.8 if len(before) < 12 else 0.5)
        done = vcam(folder, *SWEEP, "out", signal=number, after=after)
        stops += ended(done, number, vcam, out)
        whole(out)
        assert results_but(out, ".part").items() <= expected.items(), "what exists is right"
        assert before.items() <= kept(out).items(), "what was finished is kept"
        if done["code"] == 0:
            assert results_but(out, ".part") == expected
            shutil.rmtree(out)
    assert stops, "nothing was interrupted"
    finished = sum(name.endswith(".json") for name in kept(out))
    summary = vcam(folder, *SWEEP[:-2], "--json", "-o", "out")
    assert summary["code"] == 0, summary
    assert json.loads(summary["said"])["computed"] == 6 - finished
    assert results_but(out, ".part") == expected


def results_but(folder: Path, ending: str) -> dict[str, bytes]:
    return {name: data for name, data in results(folder).items() if not name.endswith(ending)}


def kept(out: Path) -> dict[str, bytes]:
    """The finished points and their frames; what is being written has another name."""
    record = out.parent / "whole" / "study.json"
    points = json.loads(record.read_text("utf-8"))["points"]
    names = {f"points/{point}.{end}" for point in points for end in ("json", "raw.exr")}
    return {name: data for name, data in results_but(out, ".part").items() if name in names}


def test_two_runs_at_once_leave_what_one_of_them_gives(vcam, folder):
    """One comes after the other, or is told that the folder is in use."""
    expected = []
    for seed in ("1", "2"):
        assert vcam(folder, *RUN, seed, "--seed", seed)["code"] == 0
        expected.append(results(folder / seed))
    for _ in range(2):
        ends = vcam.at_once(folder, *((*RUN, "out", "--seed", seed) for seed in ("1", "2")))
        assert sorted(end["code"] for end in ends) in ([0, 0], [0, 3]), ends
        assert all(end["code"] == 0 or "folder in use" in end["said"] for end in ends)
        assert set(contents(folder / "out")) == NAMES
        assert results(folder / "out") in expected
