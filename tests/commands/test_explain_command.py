"""`vcam explain`: everything that files and tables name can be explained."""

import json

import pytest
from every import every
from typer.testing import CliRunner

from vcam_cli import load, simulate
from vcam_cli.camera import hints
from vcam_cli.camera.scene.scene_files import ImageFile
from vcam_cli.camera.scene.sources import CHARTS, PICTURE_MODELS
from vcam_cli.commands import explain, glossary
from vcam_cli.commands.main import COMMANDS, app
from vcam_cli.effects.order import ORDER
from vcam_cli.sweeps.quantities import METRICS, QUANTITIES


def vcam(*words, code=0):
    done = CliRunner().invoke(app, ["explain", *words])
    assert done.exit_code == code, done.output
    return done


def test_every_name_has_an_explanation():
    """Whole paths of keys aside, of which the next test asks more."""
    for name in set(explain.names()) - {key.dotted for key in hints.index()}:
        found = list(explain.explanations(name))
        assert found, name
        assert all(len(entry["about"]) > 5 for entry in found), name


def test_a_key_is_told_with_unit_default_and_example():
    def check(key):
        entry = next(e for e in explain.explanations(key.dotted) if e.get("in") == "camera file")
        assert entry["title"].startswith(key.dotted)
        assert key.unit in entry["title"]
        assert key.example in entry["example"]
        assert entry["default"]

    every([(key,) for key in hints.index()], check)


def test_a_section_lists_its_keys():
    entry = next(e for e in explain.explanations("pixel.fpn") if e.get("in") == "camera file")
    assert entry["keys"].startswith("offset_pixel, dsnu, ")
    assert "keys" not in next(explain.explanations("pixel.temperature"))


def test_an_effect_is_told_with_its_source_and_switch():
    def check(effect):
        said = vcam(effect.name).stdout.replace("\n    ", " ")
        assert effect.reference in said
        assert f"effects: {{{effect.name}: off}}" in said

    every(ORDER, check)


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
    assert vcam("flash").stdout.startswith(
        "flash (not simulated)\n  Scene.illuminant has one level throughout the exposure"
    )


def test_a_metric_by_its_name_without_unit():
    assert vcam("snr").stdout.startswith("snr_db (metric)")
    assert vcam("dynamic range").stdout.startswith("dynamic_range_db (metric)")


CHART_CAMERA = """
scene: {SOURCE, luminance: 100 cd/m2}
optics: {f_number: 2.8, focal_length: 4.5 mm}
pixel:
  width: 4 um
  photodetector: {fill_factor: 0.5, quantum_efficiency: 0.5}
  readout: {conversion_gain: 40 uV/e, full_well: 25 ke}
array: {rows: 48, columns: 64}
exposure: {time: 60 ms}
"""


@pytest.mark.parametrize("chart", CHARTS)
def test_the_example_of_a_chart_is_taken(chart, tmp_path):
    [entry] = (e for e in explain.explanations(chart) if e["title"].endswith("(chart)"))
    path = tmp_path / "a.yaml"
    path.write_text(CHART_CAMERA.replace("SOURCE", entry["example"]), encoding="utf-8")
    assert load(path).scene.source.chart == chart


def test_every_value_that_is_told_is_taken_by_its_key():
    """A pattern, an architecture, a method: each is found, with the key that it is a value of."""
    for word in ("quad-bayer", "aps-4t", "edge-aware", "gray-world", "rectilinear"):
        found = [e["title"] for e in explain.explanations(word)]
        if word != "rectilinear":
            assert any(title.startswith(f"{word} (value of ") for title in found), word


def test_everything_that_a_run_or_a_table_names_is_explained(tmp_path):
    """Metrics of a run that asks for all of them, columns, quantities of studies, commands."""
    result = simulate(load("starter", ["quality=[mse, psnr, cielab, s-cielab]"]))
    words = [*result.metrics, *QUANTITIES, *COMMANDS, *METRICS]
    words += [name for table in glossary.written().values() for name in table]
    for word in words:
        assert list(explain.explanations(word)), word
    for column in (name for table in glossary.written().values() for name in table):
        assert column in glossary.COLUMNS | glossary.QUANTITIES, column


def test_columns_with_their_units_are_explained():
    assert vcam("time [s]").stdout.startswith("time (column)")
    assert "pixel.width" in vcam("pixel.width [um]").stdout


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("lux", "files write lx"),
        ("e-", "files write e"),
        ("electrons", "files write e"),
        ("2.5 e-/ADU", "2.5 e-/ADU is 0.4 DN/e"),
        ("DN/e", "Unit of an ADC gain"),
        ("PTC", "photon transfer curve"),
        ("photon transfer", "also called: ptc"),
        ("responsivity", "V/(lx s)"),
        ("NIR", "scene.wavelengths"),
        ("video", "--frames N --fps F"),
        ("mtf50", "ISO 12233"),
        ("gray_snr_db", "18 %"),
        ("metrics", "metrics.csv"),
        ("columns", "table"),
        ("sweep", "Run a sweep study"),
    ],
)
def test_words_of_tables_data_sheets_and_units_are_explained(word, said):
    assert said in " ".join(vcam(word).stdout.split())
