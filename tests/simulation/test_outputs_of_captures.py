"""What a run with several samples leaves: every sample, their photocurrent, the record."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from making import tree
from typer.testing import CliRunner

from vcam_cli.accuracy_study.ablation import with_exposure_time
from vcam_cli.camera.load import load
from vcam_cli.characterization.bench import prepare_bench
from vcam_cli.commands.main import app
from vcam_cli.files.images.exr import read_exr
from vcam_cli.progress import Stages
from vcam_cli.simulation.simulate import prepare, simulate

CHANGES = {
    "name": "several",
    "array.rows": 70,
    "array.columns": 30,
    "exposure": {"captures": ["1 ms", "10 ms", "100 ms"], "estimator": "weighted"},
    "pixel.readout.read_noise": "10 e",
    "pixel.photodetector.dark_current": "1 ke/s",
    "output.raw": ["dn", "electrons"],
}
SINGLE = ("--set", "exposure.time=5 ms")


def vcam(*words: str, code: int = 0):
    done = CliRunner().invoke(app, [*words], prog_name="vcam")
    assert done.exit_code == code, done.output + str(done.exception)
    return done


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write({})
    return tmp_path


def write(more: dict) -> None:
    Path("several.yaml").write_text(yaml.safe_dump(tree(CHANGES | more)), "utf-8")


def listed() -> list[str]:
    return sorted(str(p.relative_to("out")) for p in Path("out").rglob("*") if p.is_file())


SAMPLES = [f"captures/raw_{n:03d}.exr" for n in (1, 2, 3)]


def test_files_hold_what_the_result_does():
    vcam("run", "several.yaml", "-q", "-o", "out")
    result = simulate(load("several.yaml"))
    others = ["hdr.exr", "metrics.csv", "raw.exr", "render.png", "run.json"]
    assert listed() == sorted(SAMPLES + others)
    for number, name in enumerate(SAMPLES):
        channels, said = read_exr(Path("out") / name)
        assert np.array_equal(channels["dn"], result.samples_dn[number])
        assert np.array_equal(
            channels["electrons"], result.samples_electrons[number].astype(np.float32)
        )
        assert said["vcam:exposureTime"] == pytest.approx(result.times[number], rel=1e-7)
    last, said = read_exr("out/raw.exr")
    assert np.array_equal(last["dn"], result.dn)
    assert np.array_equal(last["dn"], channels["dn"])
    light, said = read_exr("out/hdr.exr")
    assert list(light) == ["photocurrent"]
    assert np.array_equal(light["photocurrent"], result.photocurrent)
    assert said["vcam:captureTimes"] == "0.001,0.01,0.1"
    assert (said["vcam:estimator"], said["vcam:unit"]) == ("weighted", "e/s")
    assert said["vcam:saturatedFrom"] == pytest.approx(100e3 / 1e-3 - 1e3, rel=1e-6)


def test_the_record_names_samples_and_times():
    vcam("run", "several.yaml", "-q", "-o", "out")
    run = json.loads(Path("out/run.json").read_text("utf-8"))
    assert [c["file"] for c in run["captures"]] == SAMPLES
    assert [c["time"] for c in run["captures"]] == [1e-3, 1e-2, 1e-1]
    shares = [c["saturated_fraction"] for c in run["captures"]]
    assert shares == sorted(shares)
    assert run["metrics"]["saturated_fraction"] == shares[-1]
    assert run["camera"]["exposure"]["captures"] == ["1 ms", "10 ms", "100 ms"]
    assert run["metrics"]["hdr_saturated_fraction"] == 0
    assert "reconstruction" in run["stages"]


def test_a_later_run_removes_them():
    vcam("run", "several.yaml", "-q", "-o", "out")
    vcam("run", "several.yaml", "-q", "-o", "out", *SINGLE)
    assert listed() == ["metrics.csv", "raw.exr", "render.png", "run.json"]
    assert not Path("out/captures").exists()
    run = json.loads(Path("out/run.json").read_text("utf-8"))
    assert "captures" not in run
    assert "hdr_dynamic_range_db" not in run["metrics"]


def test_stacked_pixels_have_a_channel_for_each_color():
    lit = {"illuminant": "D65", "luminance": "100 cd/m2", "distance": "1 m"}
    source = {"source": {"kind": "chart", "chart": "uniform"}}
    write({"array.pattern": "stacked", "scene": source | lit})
    vcam("run", "several.yaml", "-q", "-o", "out")
    light, _ = read_exr("out/hdr.exr")
    assert set(light) == {"photocurrent.R", "photocurrent.G", "photocurrent.B"}
    first, _ = read_exr(f"out/{SAMPLES[0]}")
    assert first["dn.R"].shape == light["photocurrent.B"].shape == (70, 30)


def test_what_is_printed():
    done = vcam("run", "several.yaml", "-o", "out")
    assert "hdr_dynamic_range_db" in done.stdout
    assert f"photocurrent {Path('out/hdr.exr')}" in done.stdout
    planned = vcam("plan", "several.yaml").stdout
    assert "exposure  0.1 s, 3 samples from 0.001 s on" in planned


def test_measured_on_the_bench_it_is_one_exposure_of_the_last_time():
    """Where means and variances of one frame are asked for: accuracy, characterize."""
    camera = load("several.yaml")
    fixed = with_exposure_time(camera, 0.1)
    assert (fixed.exposure.time, fixed.exposure.samples) == (0.1, ())
    one, several = prepare(fixed, 1)[0], prepare(camera, 1)[0]
    assert one.exposure_time == several.exposure_time == 0.1
    assert np.array_equal(one.rate, several.rate)
    assert several.plan.memory_bytes > one.plan.memory_bytes
    assert several.plan.seconds > one.plan.seconds
    on = prepare_bench(load("several.yaml", ["scene.radiance=0.001 W/(sr m2)"]), 1, Stages())
    assert math.isclose(on.time, 0.1)
    assert on.flat_frame(100.0, 0).shape == (512, 512)
