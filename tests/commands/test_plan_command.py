"""`vcam plan`: what it says, and that it says the same as the run does."""

import json
import re

import pytest
from typer.testing import CliRunner

from vcam_cli.commands.main import app
from vcam_cli.config import shipped
from vcam_cli.effects.order import ORDER

SMALL = ["--set", "array.rows=48", "--set", "array.columns=64"]


def plan(*arguments):
    done = CliRunner().invoke(app, ["plan", "still-life", *SMALL, *arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


def test_json_has_the_keys_of_the_contract():
    report = json.loads(plan("--json"))
    assert {"effects", "settings", "seconds", "memory_bytes", "geometry"} <= set(report)
    keys = {"name", "state", "by", "reason", "contribution", "unit", "seconds"}
    keys |= {"allowed", "saved", "free"}
    assert all(set(effect) == keys for effect in report["effects"])
    assert [effect["name"] for effect in report["effects"]] == [kind.name for kind in ORDER]
    assert report["seconds"] > 0
    assert report["memory_bytes"] > 0


def test_a_graphics_processor_saves_noise_and_readout_and_takes_its_start():
    """Twelve times the pixels: further frames cost less there, a first one more."""
    large = ["--set", "array.rows=600", "--set", "array.columns=800", "--json"]
    here, there = json.loads(plan(*large)), json.loads(plan(*large, "--device", "gpu"))
    assert set(there) - set(here) == {"device_seconds", "device_start", "device"}
    cost = there["device"]
    stages = sum(cost[name] for name in ("light", "charge", "copies", "processor"))
    assert cost["card"] == "NVIDIA H100"
    assert "painting of charts" in cost["stays"]
    assert there["device_seconds"] == pytest.approx(there["device_start"] + stages)
    further = there["device_seconds"] - there["device_start"]
    assert 0 < further < there["seconds"] < there["device_seconds"]
    said = (
        r"with --device gpu [\d.e-]+ s, then [\d.e-]+ s a frame\. By measured constants of an"
        r" NVIDIA H100: start 2\.5 s, light .* By this processor [\d.e-]+ s: painting of charts"
    )
    assert re.search(said, " ".join(plan("--device", "gpu").split()))


@pytest.mark.long
def test_the_run_does_what_the_plan_says(tmp_path):
    told = json.loads(plan("--json"))
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["run", "still-life", *SMALL, "-o", str(out), "-q"])
    assert done.exit_code == 0, done.output
    ran = json.loads((out / "run.json").read_text())["plan"]
    states = [(e["name"], e["state"], e["by"], e["contribution"]) for e in told["effects"]]
    assert states == [(e["name"], e["state"], e["by"], e["contribution"]) for e in ran["effects"]]
    assert told["settings"] == ran["settings"]


@pytest.mark.long
def test_a_person_reads_every_effect_with_its_reason():
    text = plan("--set", "effects={read_noise: off}", "--details")
    for kind in ORDER:
        assert kind.name in text
    assert "switched off in effects" in text
    assert "% of full signal" in text
    assert "10 nm" in text


def story(camera, *arguments):
    done = CliRunner().invoke(app, ["plan", camera, *arguments])
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert len(lines) <= 40
    assert all(len(line) <= 80 for line in lines)
    return done.stdout


def test_the_story_names_every_effect_once_under_what_became_of_it():
    text = story("still-life", *SMALL, "--set", "effects={read_noise: off}")
    on, _, rest = text.partition("skipped: the change is within the tolerance")
    gone, _, rest = rest.partition("skipped: off in the file")
    off, _, absent = rest.partition("not in this camera")
    assert "shot_noise" in on
    assert "saturation" in gone
    assert "read_noise" in off
    assert "microlens" in absent
    words = re.findall(r"[a-z_]+", text)
    assert all(words.count(kind.name) == 1 for kind in ORDER if "_" in kind.name)
    told = json.loads(plan("--set", "effects={read_noise: off}", "--json"))
    shot = next(e for e in told["effects"] if e["name"] == "shot_noise")
    assert f"{100 * shot['contribution']:.3g} % of noise" in on
    assert "vcam plan still-life --details" in text


@pytest.mark.long
@pytest.mark.parametrize("camera", shipped.names("cameras"))
def test_the_story_of_a_shipped_camera_fits_a_screen(camera):
    story(camera)


@pytest.mark.long
def test_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plan()
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_switched_on_is_refused_with_its_place():
    arguments = ["plan", "still-life", "--set", "effects={charge_transfer: on}"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2
    assert "effects.charge_transfer" in done.stderr
