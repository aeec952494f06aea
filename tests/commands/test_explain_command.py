"""`vcam explain`: everything that files and tables name can be explained."""

import json

import pytest
from typer.testing import CliRunner

from vcam_cli.camera import hints
from vcam_cli.camera.scene.scene_files import ImageFile
from vcam_cli.camera.scene.sources import CHARTS, PICTURE_MODELS
from vcam_cli.commands import explain
from vcam_cli.commands.main import app
from vcam_cli.effects.order import ORDER


def vcam(*words, code=0):
    done = CliRunner().invoke(app, ["explain", *words])
    assert done.exit_code == code, done.output
    return done


def test_every_name_has_an_explanation():
    for name in explain.names():
        found = list(explain.explanations(name))
        assert found, name
        assert all(len(entry["about"]) > 5 for entry in found), name


@pytest.mark.parametrize("key", hints.index(), ids=lambda key: key.dotted)
def test_a_key_is_told_with_unit_default_and_example(key):
    entry = next(e for e in explain.explanations(key.dotted) if e.get("in") == "camera file")
    assert entry["title"].startswith(key.dotted)
    assert key.unit in entry["title"]
    assert key.example in entry["example"]
    assert entry["default"]


@pytest.mark.parametrize("effect", ORDER, ids=lambda effect: effect.name)
def test_an_effect_is_told_with_its_source_and_switch(effect):
    said = vcam(effect.name).stdout.replace("\n    ", " ")
    assert effect.reference in said
    assert f"effects: {{{effect.name}: off}}" in said


def test_a_key_leads_to_no_effect_that_only_speaks_of_its_section():
    """`pixel` and `scene` are words of sentences, and no keys that an effect needs."""
    for name in ("pixel.temperature", "scene.luminance", "pixel.width"):
        assert "effect:" not in vcam(name).stdout


def test_a_key_leads_to_its_effect():
    assert "vcam explain read_noise" in vcam("pixel.readout.read_noise").stdout
    assert "vcam explain fpn" in vcam("prnu").stdout
    assert "vcam explain" not in vcam("array.rows").stdout


def test_words_of_the_trade_lead_to_keys():
    assert vcam("qe").stdout.startswith("pixel.photodetector.quantum_efficiency")
    assert "exposure.iso" in vcam("ISO").stdout
    assert "lp/mm" in vcam("csf").stdout
    for chart in CHARTS:
        assert "(chart)" in vcam(chart).stdout


def test_what_is_unknown_is_refused_with_the_nearest_name():
    assert "did you mean" in vcam("read_nois", code=2).stderr
    assert "vcam list" in vcam("zzzzzz", code=2).stderr


def test_json():
    found = json.loads(vcam("gain", "--json").stdout)
    assert {entry["title"].split()[0] for entry in found["explanations"]} >= {
        "exposure.gain",
        "adc.gain",
    }


def test_the_models_of_a_picture_are_listed():
    """The table and the type of the key are the same."""
    assert set(PICTURE_MODELS) == set(ImageFile.model_fields["model"].annotation.__args__)
    shown = CliRunner().invoke(app, ["list", "models"]).stdout
    assert all(f"\n{name} " in f"\n{shown}" for name in PICTURE_MODELS)


def test_what_is_not_simulated_is_told():
    assert vcam("blooming").stdout.startswith("blooming (not simulated)\n  Charge beyond the full")


def test_a_metric_by_its_name_without_unit():
    assert vcam("snr").stdout.startswith("snr_db (metric)")
    assert vcam("dynamic range").stdout.startswith("dynamic_range_db (metric)")
