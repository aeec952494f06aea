"""Sweeps whose rows would not have the values that they show, or that write over each other."""

import itertools
import json
import subprocess
import sys
import textwrap

import pytest
from making import long_except
from sweeping import ROOT, environment, written
from typer.testing import CliRunner

from vcam_cli import sweep
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.sweeps import sweep_file, sweep_points

pytestmark = pytest.mark.attack("mislabeled rows of a sweep")
SETS = {
    "exposure": [{"time": "1 ms"}, {"time": "2 ms"}],
    "exposure.time": ["3 ms", "4 ms"],
    "pixel": [{"width": "5 um"}],
    "pixel.readout": [{"read_noise": "1 e"}],
    "pixel.readout.read_noise": ["2 e"],
    "optics.f_number": [2, 4],
}
PAIRS = [(a, b) for a, b in itertools.permutations(SETS, 2) if b.startswith(f"{a}.")]
PAIRS += [(b, a) for a, b in PAIRS]
OVERLAPS = [(place, a, b) for place in ("grid", "case") for a, b in PAIRS]
PAIRS += [(a, a) for a in SETS]
OVERLAPS += [(place, a, b) for place in ("repeat", "case and repeat") for a, b in PAIRS]


def values(path: str) -> dict:
    return {path: {"values": SETS[path]}}


def study(place: str, first: str, second: str) -> dict:
    """Two keys at places of a study where both would act."""
    match place:
        case "grid":
            return {"vary": values(first) | values(second)}
        case "repeat":
            return {"vary": values(first), "repeat": {second: SETS[second]}}
        case "case":
            return {"vary": values(first), "cases": {"a": {}, "b": {"vary": values(second)}}}
        case "case and repeat":
            own = {"a": {"vary": values(first)}}
            vary = {"adc.bits": {"values": [10]}}
            return {"vary": vary, "cases": own, "repeat": {second: SETS[second]}}
    return {}


@pytest.mark.parametrize(("place", "first", "second"), OVERLAPS, ids=" ".join)
def test_keys_that_overlap(tmp_path, place, first, second):
    with pytest.raises(BadInput) as caught:
        sweep_file.read(written(tmp_path, **study(place, first, second)))
    said = [str(p) for p in caught.value.problems]
    assert len(said) == 1
    assert "study.yaml:" in said[0]
    assert first in said[0]
    assert second in said[0]
    assert said[0].endswith("; keep one of the two")


@pytest.mark.parametrize("place", ["vary", "repeat", "case"])
@pytest.mark.parametrize(("path", "value"), [("seed", {"frame": 3}), ("seed.frame", 3)])
def test_a_seed_that_is_varied_and_counted(tmp_path, place, path, value):
    own = {"values": [value]}
    keys = {
        "vary": {"vary": {path: own}},
        "repeat": {"repeat": {path: [value]}},
        "case": {"cases": {"a": {"vary": {path: own}}}},
    }[place]
    sweep_file.read(written(tmp_path, **keys))
    with pytest.raises(BadInput, match="seeds counts on from this key"):
        sweep_file.read(written(tmp_path, **keys, seeds=2))


@pytest.mark.parametrize("other", ["exposure.times", "exposur", "pixel.readout2", "optics"])
def test_keys_that_only_look_alike(tmp_path, other):
    keys = {"exposure.time": {"values": ["1 ms"]}, "pixel.readout": {"values": [{}]}}
    keys |= {other: {"values": [1]}}
    sweep_file.read(written(tmp_path, vary=keys))


HOLDER = """
    import sys
    from vcam_cli.files.points_store import SweepFolder
    with SweepFolder(sys.argv[1]) as folder:
        folder.begin({"name": "s"}, sys.argv[2])
        print("at work", flush=True)
        sys.stdin.read()
"""


class Holder:
    """A process at work on a study in a folder."""

    def __init__(self, folder, study: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(HOLDER), str(folder), study],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment(), cwd=ROOT,
        )  # fmt: skip
        assert self.process.stdout.readline() == "at work\n"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.communicate("")


STUDIES = ["0" * 64, "f" * 64, "7" * 64, "7" * 14 + "8" * 50, "7" * 14 + "6" * 50]


@pytest.mark.parametrize("first", long_except(STUDIES[1:2], STUDIES))
def test_two_studies_in_one_folder_at_once(tmp_path, first):
    """The second is refused unless it is the same; when the first has ended there is room."""
    with Holder(tmp_path, first), Holder(tmp_path, first):
        for study in STUDIES:
            with SweepFolder(tmp_path) as folder:
                if study == first:
                    folder.begin({"name": "s"}, study)
                    continue
                with pytest.raises(CannotDo, match="folder in use: another study"):
                    folder.begin({"name": "s"}, study)
    for study in STUDIES:
        with SweepFolder(tmp_path) as folder:
            folder.begin({"name": "s"}, study)


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({}, True),
        pytest.param({"name": "other"}, False, marks=pytest.mark.long),
        pytest.param({"metrics": ["snr_db"]}, False, marks=pytest.mark.long),
        pytest.param({"seeds": 2}, False, marks=pytest.mark.long),
        pytest.param({"vary": {"adc.bits": {"values": [8]}}}, False, marks=pytest.mark.long),
    ],
)
def test_whole_sweeps_at_once(tmp_path, changes, same):
    """A sweep of a study that another process has in hand, or of another one."""
    first = written(tmp_path / "a")
    second = written(tmp_path / "b", **changes)
    known = sweep_points.grid(sweep_file.read(first)).hash
    with Holder(tmp_path / "out", known):
        line = ["sweep", str(second), "--workers", "1", "--json", "-o", str(tmp_path / "out")]
        done = CliRunner().invoke(app, line, prog_name="vcam")
    assert done.exit_code == (0 if same else 3), done.output
    if same:
        assert json.loads(done.stdout)["computed"] == 3
    else:
        assert done.stderr.startswith("folder in use: another study")


WRITING = [
    ("run", "starter"), ("accuracy", "starter"), ("characterize", "starter"),
    ("plan", "starter", "--scenes", "csf"), ("schedule", "captures"),
    ("compare", "gray.png", "gray.png"),
]  # fmt: skip


@pytest.mark.parametrize(
    "command", long_except(WRITING[:2], WRITING), ids=[command[0] for command in WRITING]
)
def test_every_other_command_in_the_folder_of_a_sweep_at_work(command, tmp_path, monkeypatch):
    """It is refused before it computes, and the folder stays what it is."""
    oiio = pytest.importorskip("OpenImageIO")
    oiio.ImageBuf(oiio.ImageSpec(4, 4, 1, "uint8")).write(str(tmp_path / "gray.png"))
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "out"
    with Holder(out, STUDIES[0]):
        before = sorted(path.name for path in out.rglob("*"))
        done = CliRunner().invoke(app, [*command, "-q", "-o", "out"], prog_name="vcam")
        assert done.exit_code == 3, done.output
        assert done.stderr.startswith("folder in use: a sweep is writing out; wait for it")
        assert sorted(path.name for path in out.rglob("*")) == before


def test_a_sweep_in_the_folder_of_a_run_at_work(tmp_path):
    study = written(tmp_path / "a")
    with OutputFolder(tmp_path / "out"):
        line = [sys.executable, "-m", "vcam_cli.commands.main", "sweep", str(study), "-q"]
        done = subprocess.run(
            [*line, "-o", "out"], cwd=tmp_path, env=environment(), capture_output=True, text=True
        )
    assert done.returncode == 3, done
    assert done.stderr.startswith("folder in use: another run is writing out; wait for it")
    assert sweep(study, tmp_path / "out", workers=1).exit_code == 0
