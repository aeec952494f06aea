"""`--expect`, `expect:` and `--strict`: what is missed is said, and the command exits with 4."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from making import QUIET, camera, tree
from typer.testing import CliRunner

from vcam_cli import simulate, sweep
from vcam_cli.camera.expectations import SNR_NOTE, read_limit
from vcam_cli.camera.quality import UNITS
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput

SMALL = {"array.rows": 8, "array.columns": 12, "accuracy": "draft"}
STUDY = {
    "kind": "sweep",
    "camera": "camera.yaml",
    "vary": {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 3}},
    "metrics": ["mean_electrons", "snr_db"],
    "optimize": {"metric": "mean_electrons", "goal": "max"},
}


FOCUS = {
    "vary": {"optics.defocus": {"start": "-40 um", "stop": "40 um", "count": 5}},
    "cases": {
        "nominal": {
            "scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "50 lp/mm"},
            "quality": ["mse"],
            "effects": {"shot_noise": "off"},
        }
    },
    "metrics": ["mse"],
    "optimize": {"metric": "mse", "goal": "min"},
}
"""A study whose optimum is inside of its range: in focus."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("camera.yaml").write_text(yaml.safe_dump(tree(SMALL)))
    return tmp_path


def write(**study):
    given = {key: value for key, value in (STUDY | study).items() if value is not None}
    Path("study.yaml").write_text(yaml.safe_dump(given, sort_keys=False))


def vcam(*args, code=0):
    # In this process: to start others takes longer than all points.
    alone = ("--workers", "1") if args[0] == "sweep" else ()
    done = CliRunner().invoke(app, [*args, *alone], prog_name="vcam")
    assert done.exit_code == code, done.output
    return done


@pytest.mark.parametrize(
    ("text", "found", "kept"),
    [
        ("exposure_time <= 10 ms", 0.01, True),
        ("exposure_time < 10 ms", 0.01, False),
        ("mean_electrons >= 1 ke", 999.0, False),
        ("mean_electrons>=1000", 1000.0, True),
        ("saturated_fraction <= 0.1 %", 0.0009, True),
        ("snr_db > 3", math.nan, False),
        ("mtf50 > 0.2", math.inf, True),
    ],
)
def test_a_limit(text, found, kept):
    assert read_limit(text, UNITS).holds(found) is kept


@pytest.mark.parametrize(
    "text", ["", "snr", "snr_db = 3", "snr_db >= x", "snr_db >= 3 um", 5, None]
)
def test_what_is_no_limit(text):
    with pytest.raises(ValueError, match=";"):
        read_limit(text, UNITS)


def test_a_run():
    done = vcam("run", "camera.yaml", "-q", "--expect", "mean_electrons >= 1e9", code=4)
    assert "missed: expected mean_electrons >= 1e+09 e, but mean_electrons is " in done.stderr
    assert Path("out/made/metrics.csv").exists(), "it is written all the same"
    done = vcam("run", "camera.yaml", "--expect", "snr_db >= 1")
    assert SNR_NOTE in done.stderr
    done = vcam("run", "camera.yaml", "--json", "--expect", "mean_electrons <= 1", code=4)
    assert len(json.loads(done.stdout)["missed"]) == 1


def test_a_camera_file():
    given = tree({**SMALL, "expect": ["mean_electrons >= 1e9", "exposure_time <= 10 ms"]})
    Path("camera.yaml").write_text(yaml.safe_dump(given))
    done = vcam("run", "camera.yaml", "-q", code=4)
    assert done.stderr.count("missed") == 1
    for wrong in ("mean_elctrons >= 3", "psnr_db >= 3", "mtf50 > 0.1", "hdr_dynamic_range_db > 3"):
        Path("camera.yaml").write_text(yaml.safe_dump(tree({**SMALL, "expect": [wrong]})))
        assert "camera.yaml:" in vcam("run", "camera.yaml", code=2).stderr


def test_what_a_camera_does_not_measure_is_refused_before_it_runs():
    done = vcam("run", "camera.yaml", "--expect", "psnr_db > 3", "--expect", "psnr > 3", code=2)
    assert "add psnr to quality" not in done.stderr, "the mistakes of writing come first"
    assert "did you mean psnr_db?" in done.stderr
    done = vcam("run", "camera.yaml", "--expect", "psnr_db > 3", code=2)
    assert "add psnr to quality" in done.stderr
    assert not Path("out").exists()


def test_a_sweep():
    write()
    done = vcam("sweep", "study.yaml", "-q", "--expect", "mean_electrons >= 1e9", code=4)
    assert "at 3 of 3 points; the worst: case = nominal, pixel.width [um] = 4.0" in done.stderr
    done = vcam("sweep", "study.yaml", "-q", "--expect", "optimum <= 5000 nm", code=4)
    assert "missed: expected optimum <= 5 um, but optimum is not known (case nom" in done.stderr
    vcam("sweep", "study.yaml", "-q", "--expect", "snr_db > 0")
    done = vcam("sweep", "study.yaml", "-q", "--expect", "exposure_time > 0", code=2)
    assert "exposure_time" in done.stderr
    found = sweep("study.yaml", workers=1, expect=["mean_electrons <= 1"])
    assert len(found.missed) == 1
    # One of several shares is no reason to miss anything.
    vcam(
        "sweep", "study.yaml", "-q", "-o", "o", "--shard", "1/3", "--expect", "mean_electrons > 1e9"
    )


def test_strict():
    write(**FOCUS, expect={"best": {"quantity": "optimum", "between": ["4 um", "50 um"]}})
    vcam("sweep", "study.yaml", "-q")
    done = vcam("sweep", "study.yaml", "-q", "--strict", code=4)
    assert re.search(r"missed: best: -?[0-3](\.\d+)?, expected 4 to 50 um", done.stderr)
    vcam("sweep", "study.yaml", "-q", "--expect", "optimum <= 4 um", "--expect", "optimum > -4 um")
    write(**FOCUS, expect={"best": {"quantity": "optimum", "between": ["-4 um", "4 um"]}})
    vcam("sweep", "study.yaml", "-q", "--strict")


def test_snr_in_an_expectation_is_told_from_the_light():
    write(expect={"snr": {"quantity": "snr_db", "at": "4 um", "between": [0, 1000]}})
    assert SNR_NOTE in vcam("sweep", "study.yaml", "--strict").stderr


def test_a_single_point():
    write(
        vary=None, optimize=None, expect={"much": {"quantity": "mean_electrons", "between": [1, 9]}}
    )
    vcam("sweep", "study.yaml")
    assert len(Path("out/study/points.csv").read_text().splitlines()) == 2
    done = vcam("sweep", "study.yaml", "-q", "--strict", code=4)
    assert "missed: much" in done.stderr
    write(vary=None)
    assert "the study varies nothing" in vcam("sweep", "study.yaml", code=2).stderr


def test_set_of_keys_of_a_study():
    write()
    sets = ["vary.pixel.width.count=2", "vary.adc.bits.values=[8, 10]", "seeds=3", "array.rows=9"]
    found = sweep("study.yaml", sets=[*sets, "vary.pixel.width.stop=9 um"], workers=1)
    assert len(found.points) == 12
    assert {row["pixel.width [um]"] for row in found.points} == {4.0, 9.0}
    found = sweep(
        "study.yaml", sets=["vary.pixel.width.values=[7 um]", "cases.a.adc.bits=8"], workers=1
    )
    assert [(row["case"], row["pixel.width [um]"]) for row in found.points] == [("a", 7.0)]
    with pytest.raises(BadInput, match="did you mean count"):
        sweep("study.yaml", sets=["vary.pixel.width.cuont=2"])


def test_gray_is_photon_noise_of_18_percent(tmp_path):
    """A white of 10,000 electrons: gray has 1,800, and nothing but their own noise."""
    from making import radiance_for

    effects = {**QUIET, "shot_noise": "on"}
    adc = {"bits": 16, "offset": "0 DN", "gain": "0.5 DN/e"}
    found = simulate(
        camera(tmp_path, {"scene.radiance": radiance_for(10000), "effects": effects, "adc": adc})
    )
    # Rounding adds a twelfth of a code, 4 / 12 e2.
    expected = 20 * math.log10(1800 / math.sqrt(1800 + 4 / 12))
    assert found.metrics["gray_snr_db"] == pytest.approx(expected, abs=0.01)
    assert found.metrics["picture_snr_db"] > found.metrics["gray_snr_db"]


def test_mtf50_of_bare_pixels(tmp_path):
    """No lens blur, square photodetectors that fill their pixels: sinc(f) = 1/2 at 0.6034."""
    edge = {"kind": "chart", "chart": "slanted-edge", "angle": "5 deg"}
    off = {**QUIET, "diffraction": "off", "shot_noise": "off"}
    found = simulate(
        camera(
            tmp_path,
            {
                "scene.source": edge,
                "pixel.photodetector.fill_factor": 1,
                "array.rows": 128,
                "array.columns": 128,
                "adc.bits": 16,
                "effects": off,
            },
        )
    )
    x = np.linspace(0.4, 0.8, 40001)
    expected = float(x[np.abs(np.sinc(x) - 0.5).argmin()])
    assert found.metrics["mtf50"] == pytest.approx(expected, rel=0.02)
    assert found.metrics.units["mtf50"] == "cycles/pixel"
