"""Data sets in batches on a device: the labels and light of single frames, and resumed alike."""

import csv
import json

import numpy as np
import pytest

from tests.batches.fake_device import FakeDevice
from vcam_cli import dataset
from vcam_cli.datasets import dataset as work
from vcam_cli.datasets import frame_work
from vcam_cli.devices import choice
from vcam_cli.files.images.png import write_png
from vcam_cli.simulation import simulate as simulation

SET = """
kind: dataset
name: pairs
camera: starter
scenes: {files: "*.png", frames_each: 2}
vary:
  exposure.time: {log_uniform: [1 ms, 30 ms]}
  exposure.gain: {choice: [1, 4]}
frames: 12
size: {rows: 32, columns: 48}
write: [raw, clean]
shards: 2
"""


@pytest.fixture
def fake(monkeypatch):
    device, opened = FakeDevice(), choice.open_device
    for module in (choice, simulation, work, frame_work):
        monkeypatch.setattr(
            module, "open_device", lambda name: device if name == "gpu" else opened(name)
        )
    return device


@pytest.fixture
def study(tmp_path):
    rng = np.random.default_rng(0)
    for number in range(2):
        coarse = rng.random((9, 12, 3)).repeat(8, axis=0).repeat(8, axis=1)
        write_png(tmp_path / f"p{number}.png", (255 * coarse).astype(np.uint8))
    path = tmp_path / "set.yaml"
    path.write_text(SET)
    return path


def rows(folder):
    with (folder / "manifest.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_batch_is_begun_before_codes_of_the_one_before_are_waited_for(fake, study, tmp_path):
    """Copies overlap with computing: of two batches the second is begun while the first waits."""
    text = study.read_text().replace("shards: 2", "shards: 1")
    text = text.replace("  exposure.gain: {choice: [1, 4]}\n", "")
    study.write_text(text)
    found = dataset(study, tmp_path / "gpu", device="gpu", workers=1)
    assert (found.failed, found.computed) == (0, 12)
    # Two copies a batch, of one gain: the first batch is a single frame, the second the rest.
    assert fake.log == [*["begun"] * 4, *["waited"] * 4]


def test_labels_and_light_are_those_of_single_frames(fake, study, tmp_path):
    here = dataset(study, tmp_path / "cpu", workers=1)
    there = dataset(study, tmp_path / "gpu", device="gpu", workers=1)
    assert (here.failed, there.failed, there.computed) == (0, 0, 12)
    for one, other in zip(rows(tmp_path / "cpu"), rows(tmp_path / "gpu"), strict=True):
        for name, value in one.items():
            if name.startswith("sha256"):
                assert other[name] != value
            elif name in ("mean [DN]", "saturated_fraction"):
                assert float(other[name]) == pytest.approx(float(value), rel=0.02, abs=0.02)
            else:
                assert other[name] == value
    for number in range(2):
        archives = [np.load(tmp_path / d / f"shard_{number:04d}.npz") for d in ("cpu", "gpu")]
        for name in archives[0].files:
            a, b = (archive[name] for archive in archives)
            assert a.dtype == b.dtype
            if name.endswith("clean"):
                assert np.abs(a - b).max() < 0.01 * np.ptp(a)
    record = json.loads((tmp_path / "gpu" / "dataset.json").read_text())
    assert record["device"] == "fake"


def test_a_data_set_resumes(fake, study, tmp_path):
    first = dataset(study, tmp_path / "one", device="gpu", shard=(1, 2), workers=1)
    assert (first.computed, first.missing) == (6, 6)
    rest = dataset(study, tmp_path / "one", device="gpu", workers=1)
    assert (rest.computed, rest.missing) == (6, 0)
    dataset(study, tmp_path / "two", device="gpu", workers=1)
    for name in ("shard_0000.npz", "shard_0001.npz", "manifest.csv"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_charts_take_their_light_one_by_one(fake, study, tmp_path):
    charts = "scenes: {charts: [{kind: chart, chart: step-wedge}], frames_each: 2}"
    text = SET.replace('scenes: {files: "*.png", frames_each: 2}', charts).replace("12", "4")
    study.write_text(text)
    said = []
    found = dataset(study, tmp_path / "out", device="gpu", workers=1, tell=said.append)
    assert (found.computed, found.failed) == (4, 0)
    assert said == ["frames take their light from the processor, one by one"]


def test_what_a_device_cannot_do_is_a_row(fake, study, tmp_path):
    study.write_text(SET.replace("camera: starter", "camera: street"))
    found = dataset(study, tmp_path / "out", device="gpu", workers=1)
    assert found.exit_code == 4
    points = [path.read_text() for path in (tmp_path / "out" / "points").rglob("*.json")]
    assert points
    assert all("the light depends on the exposure time" in point for point in points)


def test_little_memory_makes_smaller_batches(fake, study, tmp_path, monkeypatch):
    whole = dataset(study, tmp_path / "whole", device="gpu", workers=1)
    monkeypatch.setattr(FakeDevice, "free_memory", lambda self: 500_000)
    small = dataset(study, tmp_path / "small", device="gpu", workers=1)
    assert whole.failed == small.failed == 0
    name = "shard_0000.npz"
    assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "small" / name).read_bytes()
