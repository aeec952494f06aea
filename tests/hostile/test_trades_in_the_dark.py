"""Accuracy, bench, sweep and schedule: no warning of NumPy leaks, and the caller's `np.seterr`
changes nothing; a camera that sees no light is one like any other.

Warnings are errors in all tests; here every kind of them is asked for, underflow included.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from making import long_except

from vcam_cli import load, schedule, sweep
from vcam_cli.accuracy_study import measurements, reference
from vcam_cli.accuracy_study.study import accuracy
from vcam_cli.characterization import bench, exposures
from vcam_cli.characterization.characterize import characterize
from vcam_cli.errors import BadInput

pytestmark = pytest.mark.attack("dark cameras and float errors")
DARK = {
    "luminance": {"scene": {"luminance": "0 cd/m2"}},
    "cap": {"scene": {"source": {"kind": "chart", "chart": "dark"}}},
    "silicon": {"pixel": {"photodetector": {"quantum_efficiency": 0}}},
    "transmittance": {"optics": {"transmittance": 0}},
}
SEES = {"light": {}, **DARK}
TREATMENTS = ("warn", "raise", "ignore")
BASES = ["starter", "hdr-captures", "csf-0.35um"]


def camera_file(folder: Path, base: str, changes: dict, rows: int = 12) -> Path:
    path = folder / "camera.yaml"
    text = {"extends": base, "array": {"rows": rows, "columns": rows + 4}, "accuracy": "draft"}
    path.write_text(yaml.safe_dump(text | changes), encoding="utf-8")
    return path


def study_file(folder: Path, name: str, **keys) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump({"name": name, **keys}, sort_keys=False), encoding="utf-8")
    return path


def sweep_file(folder: Path, **changes) -> Path:
    keys = {
        "kind": "sweep", "camera": "camera.yaml", "seeds": 2,
        "vary": {"pixel.readout.read_noise": {"values": ["1 e", "5 e", "20 e"]}},
        "metrics": ["picture_snr_db", "mse", "saturated_fraction"],
        "optimize": {"metric": "mse", "goal": "min"},
    }  # fmt: skip
    return study_file(folder, "swept", **(keys | changes))


def schedule_file(folder: Path, **changes) -> Path:
    keys = {"kind": "schedule", "pdf": {"camera": "camera.yaml", "bins": 64}, "counts": [2, 3]}
    return study_file(folder, "scheduled", **(keys | changes))


def under_every_treatment(compute) -> list:
    """What is computed under every setting of the caller, which stays what it is."""
    found = []
    for treatment in TREATMENTS:
        with np.errstate(all=treatment):
            before = np.geterr()
            found.append(compute(treatment))
            assert np.geterr() == before
    return found


def agree(found: list) -> None:
    assert all(json.dumps(each) == json.dumps(found[0]) for each in found)


def timeless(rows) -> list[dict]:
    return [{k: v for k, v in row.items() if "seconds" not in k} for row in rows]


@pytest.mark.parametrize("base", long_except(["hdr-captures"], BASES))
@pytest.mark.parametrize("sees", long_except(["silicon"], SEES))
def test_sweeps(base, sees, tmp_path):
    camera_file(tmp_path, base, SEES[sees])
    study = sweep_file(tmp_path)

    def compute(treatment):
        result = sweep(study, tmp_path / treatment, workers=1)
        assert result.failed == 0
        return timeless(result.rows)

    agree(found := under_every_treatment(compute))
    if sees != "light":
        assert {row["picture_snr_db"] for row in found[0]} == {-np.inf}
    assert not any(np.isnan(row["mse"]) for row in found[0])


@pytest.mark.parametrize("base", long_except(["starter"], BASES))
def test_schedules(base, tmp_path):
    camera_file(tmp_path, base, {})
    study = schedule_file(tmp_path)

    def compute(treatment):
        return timeless(schedule(study, tmp_path / treatment).rows)

    agree(under_every_treatment(compute))


@pytest.mark.parametrize("sees", DARK)
def test_a_schedule_for_no_light_is_refused_with_its_place(sees, tmp_path):
    """There is no best time to look at nothing."""
    camera_file(tmp_path, "starter", SEES[sees])
    with pytest.raises(BadInput, match=r"scheduled.yaml:.*pdf.camera: no pixel .* sees any light"):
        schedule(schedule_file(tmp_path), tmp_path / "out")
    assert not (tmp_path / "out" / "schedule.csv").exists()


@pytest.mark.parametrize(
    ("sees", "treatment"),
    [
        ("luminance", "raise"),
        pytest.param("cap", "warn", marks=pytest.mark.long),
        pytest.param("light", "ignore", marks=pytest.mark.long),
    ],
)
def test_benches(sees, treatment, tmp_path, monkeypatch):
    """The bench has a lamp of its own: what the scene is makes no difference.

    But of rounding: light ten times as bright is another number in 32 bits, by which some draws of
    noise are other electrons. That is far below the noise of MTF50, around 1e-3.
    """
    for module, name, value in (
        (bench, "FIELD", 64),
        (exposures, "STACK", 4),
        (exposures, "EDGES", 4),
        (exposures, "REACH", 20),
    ):
        monkeypatch.setattr(module, name, value)
    time = {"exposure": {"time": "20 ms"}}
    lit, made = (
        load(camera_file(tmp_path, "starter", changes | time)) for changes in ({}, SEES[sees])
    )
    expected = characterize(lit).quantities
    with np.errstate(all=treatment):
        before = np.geterr()
        found = characterize(made).quantities
        assert np.geterr() == before
    assert [q.name for q in found] == [q.name for q in expected]
    for one, other in zip(found, expected, strict=True):
        assert one.measured == pytest.approx(other.measured, rel=1e-4, nan_ok=True)


@pytest.mark.parametrize("sees", ["silicon", "transmittance"])
def test_a_bench_with_nothing_to_measure_says_so(sees, tmp_path):
    made = load(camera_file(tmp_path, "starter", SEES[sees]))
    with pytest.raises(
        BadInput, match=r"the pixels do not respond to this light; .* transmittance"
    ):
        characterize(made)


@pytest.mark.parametrize(
    "sees",
    long_except(["silicon"], SEES),
)
def test_accuracy(sees, tmp_path, monkeypatch):
    """A dark camera has an error, too: none, but for that of its dark current left out."""
    made = load(camera_file(tmp_path, "starter", SEES[sees]))
    monkeypatch.setattr(measurements, "TURNS", 1)  # of the clock, whose seconds nobody reads here
    monkeypatch.setattr(reference, "MOST_BYTES", 2e8)
    with np.errstate(all="raise"):
        found = accuracy(made, workers=1)
    errors = {(p.knob, p.setting): p.rms_error for p in found.points}
    assert all(np.isfinite(error) for error in errors.values())
    if sees != "light":
        large = {knob for (knob, _), error in errors.items() if error > 1e-6}
        assert large == {"effect:dark_current"}
