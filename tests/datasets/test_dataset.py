"""Data sets that are made: labels, the same bytes for all workers and after a kill, shares."""

import csv
import hashlib
import json
import shutil
import signal
import subprocess
import sys
import time
import types

import numpy as np
import pytest
import tifffile
import yaml
from making import tree
from sweeping import ROOT, VCAM, Cluster, environment
from typer.testing import CliRunner

from vcam_cli import load, simulate
from vcam_cli.commands.main import app
from vcam_cli.datasets import dataset_file, drawing, parts
from vcam_cli.datasets.dataset import dataset
from vcam_cli.datasets.parts import Hasher, cut
from vcam_cli.errors import BadInput
from vcam_cli.files.images.png import write_png
from vcam_cli.progress import Silent
from vcam_cli.sweeps.execution import Execution, Share

STUDY = {
    "kind": "dataset",
    "name": "pairs",
    "camera": "camera.yaml",
    "scenes": {"files": "photos/*.png", "frames_each": 3},
    "vary": {
        "exposure.time": {"log_uniform": ["5 ms", "50 ms"]},
        "exposure.gain": {"choice": [1, 4]},
        "optics.f_number": {"uniform": [2.8, 8]},
    },
    "frames": 10,
    "size": {"rows": 20, "columns": 24},
    "shards": 3,
}
CAMERA = {
    "scene.illuminant": "D65",
    "scene.radiance": "0.02 W/(sr m2)",
    "pixel.readout.read_noise": "6 e",
    "pixel.readout.row_noise": "3 e",
    "pixel.fpn.gain_pixel": "1 %",
    "pixel.photodetector.dark_current": "300 e/s",
    "adc.offset": "40 DN",
    "accuracy": "standard",
}


def written(folder, **changes):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "photos").mkdir(exist_ok=True)
    for n in range(2):
        colors = np.random.default_rng(n).integers(0, 256, (10, 14, 3)).repeat(6, 0).repeat(5, 1)
        write_png(folder / "photos" / f"{n}.png", colors.astype(np.uint8))
    (folder / "camera.yaml").write_text(yaml.safe_dump(tree(CAMERA | changes.pop("camera", {}))))
    (folder / "study.yaml").write_text(yaml.safe_dump(STUDY | changes, sort_keys=False))
    return folder / "study.yaml"


def made(study, out, sets=(), **execution):
    return dataset(dataset_file.read(study, sets), out, Execution(**{"workers": 1, **execution}))


def rows(out):
    with open(out / "manifest.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def contents(out):
    """The bytes of shards and manifest."""
    names = [p for p in sorted(out.rglob("*")) if p.suffix in (".npz", ".tif", ".csv")]
    return {str(p.relative_to(out)): hashlib.sha256(p.read_bytes()).hexdigest() for p in names}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A data set that one process has made without a stop."""
    folder = tmp_path_factory.mktemp("whole")
    study = written(folder, write=["raw", "clean", "ideal"])
    assert made(study, folder / "out").computed == 10
    return study, folder / "out"


def test_a_frame_is_what_a_run_of_its_row_gives(whole):
    """A camera file is made of the row by hand, and run."""
    study, out = whole
    for row in rows(out)[::4]:
        camera = load(
            study.parent / "camera.yaml",
            [
                f"scene.source={{kind: image, file: '{study.parent}/photos/{row['scene']}'}}",
                f"scene.source.crop={{row: {row['crop_row']}, column: {row['crop_column']},"
                " rows: 20, columns: 24}",
                "array.rows=20",
                "array.columns=24",
                f"exposure.time={row['exposure.time [ms]']} ms",
                f"exposure.gain={float(row['exposure.gain']):g}",
                f"optics.f_number={row['optics.f_number']}",
                f"seed.frame={row['seed_frame']}",
                "effects=all",
            ],
        )
        run = simulate(camera)
        with np.load(out / f"shard_{int(row['shard']):04d}.npz") as shard:
            arrays = {kind: shard[f"{row['frame']}.{kind}"] for kind in ("raw", "clean", "ideal")}
        assert np.array_equal(arrays["raw"], run.dn)
        assert arrays["raw"].dtype == np.uint16
        assert arrays["ideal"].shape == (20, 24, 1)
        for kind, values in arrays.items():
            assert row[f"sha256_{kind}"] == hashlib.sha256(values.tobytes()).hexdigest()


def test_a_crop_is_that_part_of_the_picture(tmp_path):
    """Beside a file that holds nothing but these samples: the same frame, to the bit."""
    from vcam_cli.files.images.images import read_picture

    study = written(tmp_path)
    window = {"row": 7, "column": 11, "rows": 20, "columns": 24}
    part = read_picture(tmp_path / "photos" / "0.png", "srgb", 1.0, ()).data[7:27, 11:35]
    codes = np.where(part <= 0.0031308, 12.92 * part, 1.055 * part ** (1 / 2.4) - 0.055)
    write_png(tmp_path / "part.png", np.rint(255 * codes).astype(np.uint8))
    camera = load(study.parent / "camera.yaml", ["array.rows=20", "array.columns=24"])
    cropped, alone = (
        camera.with_({"scene.source": {"kind": "image", "file": str(tmp_path / name), **more}})
        for name, more in (("photos/0.png", {"crop": window}), ("part.png", {}))
    )
    assert np.array_equal(simulate(cropped).dn, simulate(alone).dn)
    beyond = window | {"row": 41}
    changes = {
        "scene.source": {"kind": "image", "file": str(tmp_path / "part.png"), "crop": beyond}
    }
    (tmp_path / "beyond.yaml").write_text(yaml.safe_dump(tree(CAMERA | changes)))
    result = CliRunner().invoke(app, ["validate", str(tmp_path / "beyond.yaml")])
    assert result.exit_code == 2
    assert "the crop ends at 61, the picture has 20 rows" in result.output


def test_labels_are_the_moments_of_the_noise(tmp_path):
    """An even chart: variance over pixels is dark_variance + K (clean - black) to five errors."""
    study = written(
        tmp_path,
        camera={"pixel.fpn.gain_pixel": "0 %", "pixel.readout.row_noise": "0 e"},
        scenes={"charts": ["uniform"]},
        vary={"exposure.time": {"choice": ["10 ms", "20 ms"]}, "exposure.gain": {"choice": [1, 2]}},
        size={"rows": 160, "columns": 160},
        frames=4,
        shards=1,
    )
    made(study, tmp_path / "out")
    with np.load(tmp_path / "out" / "shard_0000.npz") as shard:
        for row in rows(tmp_path / "out"):
            raw, clean = (
                shard[f"{row['frame']}.{kind}"].astype(float) for kind in ("raw", "clean")
            )
            told = {key: float(value) for key, value in row.items() if key.endswith("]") and value}
            light = clean.mean() - told["black_level [DN]"]
            variance = told["dark_variance [DN2]"] + told["system_gain [DN/e]"] * light
            assert np.ptp(clean) < 1e-3 * clean.mean()
            assert raw.mean() == pytest.approx(clean.mean(), abs=5 * np.sqrt(variance) / 160)
            assert raw.var() == pytest.approx(variance, rel=5 * np.sqrt(2) / 160)


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """A data set of four parts in two shards."""
    folder = tmp_path_factory.mktemp("many")
    study = written(
        folder, frames=150, shards=2, size={"rows": 10, "columns": 12}, write=["raw", "clean"]
    )
    sizes = [len(job) for job in parts_of(study)]
    assert len(sizes) == 4
    assert sum(sizes) == 150
    assert made(study, folder / "out").computed == 150
    return study, folder / "out"


def parts_of(study):
    """The numbers of the frames of every part."""
    file = dataset_file.read(study)
    return [part.numbers for shard in cut(file, Hasher(file)) for part in shard.parts]


def test_every_frame_is_in_one_part_beside_those_of_its_light(tmp_path):
    """Of shards that cut scenes in two, large frames and charts, with and without end."""
    for changes in (
        {"frames": 100, "shards": 7},
        {"frames": 9, "shards": 1, "size": {"rows": 60, "columns": 70}},
        {"frames": 200, "shards": 1, "scenes": {"charts": ["csf", "uniform"], "frames_each": 90}},
    ):
        found = parts_of(written(tmp_path, **changes))
        assert sorted(number for part in found for number in part) == [*range(changes["frames"])]
        assert max(map(len, found)) <= 64


@pytest.mark.long
def test_workers_kills_and_order_change_no_byte(many, tmp_path):
    """Two workers, killed as soon as a part is there; then again, to the end."""
    study, out = many
    command = [*VCAM, "dataset", str(study), "-o", str(tmp_path / "out"), "--workers", "2", "-q"]
    process = subprocess.Popen(command, env=environment())
    points = tmp_path / "out" / "points"
    deadline = time.monotonic() + 120
    while not list(points.glob("*.json")) and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "out" / "manifest.csv").exists()
    result = made(study, tmp_path / "out", workers=2)
    assert 0 < result.computed < 150
    assert contents(tmp_path / "out") == contents(out)
    assert not list(points.glob("*.npz"))
    assert made(study, tmp_path / "out").computed == 0


def test_a_shard_is_packed_behind_its_last_part(tmp_path, monkeypatch):
    """A progress bar looks at the folder: parts of a whole shard are removed meanwhile."""
    for module in (parts, drawing):
        monkeypatch.setattr(module, "MOST_TOGETHER", 5)
    study = written(
        tmp_path, frames=16, shards=2, size={"rows": 10, "columns": 12}, write=["raw", "clean"]
    )
    assert [len(part) for part in parts_of(study)] == [5, 3, 5, 3]
    out = tmp_path / "before"
    assert made(study, out).computed == 16
    seen = []

    class Watch(Silent):
        def step(self, done, total):
            shards = len(list((tmp_path / "out").glob("*.npz")))
            seen.append((shards, len(list((tmp_path / "out" / "points").glob("*.npz")))))

    dataset(dataset_file.read(study), tmp_path / "out", Execution(workers=1), Watch())
    parts_of_both = max(parts for _, parts in seen)
    assert 0 < parts_of_both <= 4
    assert {shards for shards, _ in seen} <= {0, 1, 2}
    assert len(list((tmp_path / "out").glob("*.npz"))) == 2
    assert not list((tmp_path / "out" / "points").glob("*.npz"))
    assert contents(tmp_path / "out") == contents(out)


@pytest.mark.long
def test_a_cluster_changes_no_byte(many, tmp_path):
    """Two workers of a Dask scheduler, one of which is killed as soon as a part is there."""
    pytest.importorskip("distributed")
    study, out = many
    cluster = Cluster(tmp_path)
    try:
        cluster.add_worker()
        cluster.add_worker()
        command = [*VCAM, "dataset", str(study), "--scheduler", cluster.address, "--json"]
        process = subprocess.Popen(
            [*command, "-o", str(tmp_path / "out")],
            env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        points = tmp_path / "out" / "points"
        deadline = time.monotonic() + 60
        while not list(points.glob("*.json")) and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.002)
        cluster.workers[0].kill()
        told, said = process.communicate(timeout=120)
        assert process.returncode == 0, said
        assert json.loads(told)["computed"] == 150
        assert contents(tmp_path / "out") == contents(out)
        assert not list(points.glob("*.npz"))
    finally:
        cluster.close()


def test_shares_add_up(whole, tmp_path):
    """Each in a folder of its own, as on machines of their own; put together, to the byte."""
    study, out = whole
    for n in (1, 2):
        part = made(study, tmp_path / str(n), share=Share(n, 2))
        assert part.missing == (3, 7)[n - 1]
    shutil.copytree(tmp_path / "2", tmp_path / "1", dirs_exist_ok=True)
    result = made(study, tmp_path / "1")
    assert (result.computed, result.missing) == (0, 0)
    assert contents(tmp_path / "1") == contents(out)
    with pytest.raises(BadInput, match="3 shards cannot be divided among 4"):
        made(study, tmp_path / "1", share=Share(1, 4))


def test_more_frames_or_keys_leave_the_others_as_they_were(whole, tmp_path):
    out = whole[1]
    vary = {"pixel.readout.read_noise": {"uniform": ["1 e", "9 e"]}} | STUDY["vary"]
    made(written(tmp_path, vary=vary, frames=12, shards=1), tmp_path / "out")
    names = [name for name in rows(out)[0] if name.startswith(("exposure.", "optics", "crop"))]
    kept = rows(tmp_path / "out")[:10]
    assert [[r[n] for n in names] for r in kept] == [[r[n] for n in names] for r in rows(out)]


def test_scenes_come_equally_often_and_share_their_light(whole):
    listed = rows(whole[1])
    for n in range(0, 9, 3):
        same = listed[n : n + 3]
        for key in ("scene", "crop_row", "crop_column", "optics.f_number"):
            assert len({row[key] for row in same}) == 1
        assert len({row["exposure.time [ms]"] for row in same}) == 3
    assert {row["scene"] for row in listed[:6]} == {"0.png", "1.png"}
    assert len({row["seed_frame"] for row in listed}) == 10


def test_tiff_has_the_same_numbers(whole, tmp_path):
    out = whole[1]
    other = written(tmp_path, format="tiff", frames=4, shards=2)
    made(other, tmp_path / "out")
    scale = json.loads((tmp_path / "out" / "dataset.json").read_text())["scale"]["clean"]
    assert scale == 16
    with np.load(out / "shard_0000.npz") as shard:
        for number in range(2):
            raw, clean = (
                tifffile.imread(tmp_path / "out" / "shard_0000" / f"{number:06d}_{kind}.tif")
                for kind in ("raw", "clean")
            )
            assert raw.dtype == clean.dtype == np.uint16
            assert np.array_equal(raw, shard[f"{number:06d}.raw"])
            assert np.abs(clean / scale - shard[f"{number:06d}.clean"]).max() <= 0.5 / scale
    assert made(other, tmp_path / "out").computed == 0


def test_a_changed_shard_is_refused_and_former_ones_go(whole, tmp_path):
    folder = tmp_path / "out"
    made(written(tmp_path), folder)
    made(written(tmp_path, shards=2), folder)
    assert sorted(p.name for p in folder.glob("*.npz")) == ["shard_0000.npz", "shard_0001.npz"]
    (folder / "shard_0001.npz").write_bytes(b"mine")
    with pytest.raises(BadInput, match="shard_0001"):
        made(tmp_path / "study.yaml", folder)


def test_a_frame_that_fails_is_a_row_with_its_error(tmp_path):
    """Each of two times is right beside one of the other's, and the first frame has these."""
    vary = {
        "exposure.auto.min": {"choice": ["0 ms", "50 ms"]},
        "exposure.auto.max": {"choice": ["100 ms", "10 ms"]},
    }
    camera = {"exposure": {"auto": {"max": "100 ms"}}}
    study = written(tmp_path, vary=vary, camera=camera, frames=8, shards=2, seed=3)
    result = made(study, tmp_path / "out")
    listed = rows(tmp_path / "out")
    wrong = [row for row in listed if row["error"]]
    assert [row["exposure.auto.min [ms]"] for row in wrong] == ["50.0"] * len(wrong)
    assert [row["exposure.auto.max [ms]"] for row in wrong] == ["10.0"] * len(wrong)
    assert result.failed == len(wrong) > 0
    assert result.exit_code == 4
    with np.load(tmp_path / "out" / "shard_0000.npz") as shard:
        named = {name.partition(".")[0] for name in shard.files}
    assert named == {row["frame"] for row in listed[:4] if not row["error"]}
    again = made(study, tmp_path / "out")
    assert (again.computed, again.failed) == (0, len(wrong))


@pytest.mark.parametrize(
    ("changes", "place", "said"),
    [
        ({"size": {"rows": 200, "columns": 24}}, "scenes.files", "a crop 200 x 24"),
        ({"scenes": {"files": "no/*.png"}}, "scenes.files", "no files in"),
        ({"vary": {"exposure.tim": {"choice": [1]}}}, "exposure.tim", "no such key"),
        ({"vary": {"exposure.time": {"uniform": ["1 ms", "-5 ms"]}}}, "vary", "not below"),
        ({"vary": {"optics.f_number": {"uniform": [-1, 4]}}}, "optics.f_number", ""),
        ({"vary": {"seed.frame": {"integers": [1, 9]}}}, "vary.seed.frame", "the key seed"),
        ({"vary": {"exposure.gain": {}}}, "vary.exposure.gain", "is missing"),
        ({"shards": 11}, "shards", "10 frames do not fill 11 shards"),
        ({"scenes": {"files": "photos/*.png", "charts": ["csf"]}}, "scenes", "cannot both"),
        ({"camera": "nowhere.yaml"}, "camera", ""),
        ({"scenes": {"charts": ["no-chart"]}}, "scene.source.chart", "'no-chart'"),
        ({"scenes": {"charts": [{"kind": "image"}]}}, "charts", "give pictures under files"),
        ({"vary": {"exposure.time": {"choice": [{"a": 1}]}}}, "exposure.time", ""),
        ({"vary": {"exposure.captures": {"choice": [["1 ms", "2 ms"]]}}}, "camera", "samples"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path, changes, place, said):
    study = written(tmp_path, **{k: v for k, v in changes.items() if k != "camera"})
    if "camera" in changes:
        study.write_text(yaml.safe_dump(STUDY | changes))
    result = CliRunner().invoke(app, ["validate", str(study)])
    assert result.exit_code == 2, result.output
    assert place in result.output
    assert said in result.output
    assert "study.yaml:" in result.output


def test_the_command_prints_a_summary(tmp_path):
    study = written(tmp_path, frames=3, shards=1)
    command = ["dataset", str(study), "-o", str(tmp_path / "out"), "--workers", "1", "--json"]
    told = json.loads(CliRunner().invoke(app, [*command, "--seed", "5"]).stdout)
    assert (told["frames"], told["computed"], told["shards"], told["failed"]) == (3, 3, 1, 0)
    first = rows(tmp_path / "out")
    CliRunner().invoke(app, [*command, "--seed", "6"])
    assert rows(tmp_path / "out")[0]["seed_frame"] != first[0]["seed_frame"]
    for name, kind in (("sweep", "vcam dataset"), ("run", "vcam dataset")):
        assert kind in CliRunner().invoke(app, [name, str(study)]).output


def test_depth_is_that_of_the_nearest_layer(tmp_path):
    """A mask that covers the left 8 of 24 columns, 0.5 m before a wall 2 m away."""
    mask = np.zeros((20, 24, 1), np.uint8)
    mask[:, :8] = 255
    near = {"kind": "chart", "chart": "uniform", "reflectance": 0.9}
    layers = [
        {"source": near, "mask": "mask.png", "distance": "0.5 m"},
        {"source": near | {"reflectance": 0.1}, "distance": "2 m"},
    ]
    camera = {"scene.source": {"kind": "layers", "layers": layers}, "scene.distance": "2 m"}
    changes = {"write": ["raw", "depth"], "frames": 1, "shards": 1, "vary": {}}
    study = written(tmp_path, camera=camera, **changes)
    plain = {key: value for key, value in STUDY.items() if key != "scenes"} | changes
    study.write_text(yaml.safe_dump(plain, sort_keys=False))
    write_png(tmp_path / "mask.png", mask[:, :, 0])
    made(study, tmp_path / "out")
    known = np.where(np.arange(24) < 8, 0.5, 2.0) * np.ones((20, 1))
    with np.load(tmp_path / "out" / "shard_0000.npz") as shard:
        assert np.array_equal(shard["000000.depth"], known)
        left, right = (part.mean() for part in np.split(shard["000000.raw"], [8], axis=1))
    assert left > right + 3
    study.write_text(yaml.safe_dump(plain | {"format": "tiff"}, sort_keys=False))
    made(study, tmp_path / "tiff")
    told = tifffile.imread(tmp_path / "tiff" / "shard_0000" / "000000_depth.tif")
    assert np.array_equal(told, 1000 * known)


def test_the_documented_reader_reads(whole, monkeypatch):
    """With what it takes of PyTorch in its place, which vcam does not need."""
    page = (ROOT / "docs" / "howto" / "dataset.md").read_text("utf-8")
    code = page.partition("```python\n")[2].partition("```")[0]
    data = types.SimpleNamespace(Dataset=object)
    torch = types.SimpleNamespace(utils=types.SimpleNamespace(data=data), from_numpy=np.asarray)
    monkeypatch.setitem(sys.modules, "torch", torch)
    names = {}
    exec(code, names)
    pairs = names["Pairs"](whole[1])
    assert len(pairs) == 10
    raw, clean, gain, variance = pairs[7]
    with np.load(whole[1] / "shard_0002.npz") as shard:
        assert np.array_equal(raw, shard["000007.raw"])
        assert np.array_equal(clean, shard["000007.clean"])
    assert gain == float(rows(whole[1])[7]["system_gain [DN/e]"])
    assert variance > 1 / 12
    pairs.shards.popitem()[1].close()


PEAK = """
import resource, sys
from pathlib import Path
from vcam_cli.datasets import dataset_file
from vcam_cli.datasets.dataset import dataset
from vcam_cli.datasets.parts import Hasher, cut
from vcam_cli.sweeps.execution import Execution
dataset(dataset_file.read(sys.argv[1]), Path(sys.argv[2]), Execution(workers=1))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.long
def test_memory_does_not_grow_with_the_number_of_frames(tmp_path):
    """400 frames take at most 20 MB more than 50; the frames themselves are 1.5 GB."""
    peaks = []
    for frames in (50, 400):
        study = written(
            tmp_path / str(frames),
            frames=frames,
            shards=4,
            scenes={"charts": ["uniform"], "frames_each": 50},
            vary={"exposure.time": STUDY["vary"]["exposure.time"]},
            size={"rows": 800, "columns": 800},
        )
        out = tmp_path / str(frames) / "out"
        told = subprocess.run(
            [sys.executable, "-c", PEAK, str(study), str(out)],
            env=environment(),
            capture_output=True,
            text=True,
            check=True,
        )
        peaks.append(int(told.stdout.split()[-1]) / 1024)
        shutil.rmtree(out)
    assert peaks[1] < peaks[0] + 20
