"""The accuracy study: what it measures, and what it recommends."""

import math

import numpy as np
import pytest
import yaml
from making import camera, radiance_for

from vcam_cli import simulate
from vcam_cli.accuracy_study import ablation, measurements, reference, study
from vcam_cli.accuracy_study.knobs import KNOBS
from vcam_cli.accuracy_study.recommendation import coarser_knobs, recommend
from vcam_cli.accuracy_study.setting_errors import COLUMNS, Point
from vcam_cli.effects.order import ORDER
from vcam_cli.files.images.png import write_png
from vcam_cli.floats import rms
from vcam_cli.simulation.simulate import prepare

OWN_ERROR = {knob.name for knob in KNOBS} | {f"effect:{kind.name}" for kind in ORDER}
"""Knobs of which no promise is made."""
DARK = "pixel.photodetector.dark_current"
NOISY = {
    "scene.radiance": radiance_for(2000),
    "scene.source": {"kind": "chart", "chart": "siemens-star"},
    "optics.off_axis": "exact",
    "optics.focal_length": "0.6 mm",
    DARK: "3 ke/s",
    "pixel.readout.read_noise": "9 e",
    "pixel.readout.reset_noise": "12 e",
    "pixel.fpn": {"offset_pixel": "4 e", "offset_column": "2 e", "gain_pixel": "1 %"},
    "array.rows": 12,
    "array.columns": 16,
    "effects": "auto",
    "accuracy": "standard",
}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    made = camera(tmp_path_factory.mktemp("study"), NOISY)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measurements, "TURNS", 1)
        patch.setattr(reference, "MOST_BYTES", 2e8)
        return study.accuracy(made, workers=1)


def of(found, knob: str) -> dict[str, Point]:
    return {p.setting: p for p in found.points if p.knob == knob}


def test_every_preset_knob_and_effect_is_there(measured):
    knobs = {p.knob for p in measured.points}
    assert {"preset", "tolerance", "auto", "all", "file"} <= knobs
    assert {knob.name for knob in KNOBS} == (knobs | set(measured.absent)) & {
        knob.name for knob in KNOBS
    }
    assert set(measured.absent) == {
        "vignetting_points",
        "spectral_rank",
        "field_zones",
        "sub_exposures",
    }
    assert set(of(measured, "tolerance")) == {"1 %", "0.1 %"}
    assert set(of(measured, "preset")) == {"draft", "standard", "reference"}
    assert set(of(measured, "auto")) == set(of(measured, "all")) == set(of(measured, "preset"))
    assert {k.removeprefix("effect:") for k in knobs if k.startswith("effect:")} == {
        kind.name for kind in ORDER if kind.name in {e.name for e in measured.effects}
    }


def test_a_knob_at_its_finest_has_no_error_of_its_own(measured):
    """And each coarser setting more; noise has no mean, so its model none at all."""
    assert of(measured, "float_width")["64"].max_error == 0
    assert 0 < of(measured, "float_width")["32"].rms_error < 1e-5
    assert all(p.max_error == 0 for p in of(measured, "shot_noise").values())
    for knob in ("oversampling", "table_size"):
        errors = [p.rms_error for p in of(measured, knob).values()]
        assert errors[-1] < errors[0] / 3


def test_the_reference_says_how_good_it_is(measured):
    """Its preset's tolerance is 2e-4, a tenth of which is what its spectrum may lose."""
    assert 0 < measured.reference.lost < 2e-5
    assert set(measured.reference.changes) == {p.knob for p in measured.points} & {
        knob.name for knob in KNOBS
    } - {"oversampling"}


def test_renders_are_compared_where_there_are_some(measured):
    assert all(p.mean_s_cielab >= 0 for p in measured.points)
    assert of(measured, "float_width")["64"].mean_s_cielab == 0
    assert of(measured, "effect:shot_noise")["off"].mean_s_cielab > 0.1  # 1/sqrt(2000) of noise


def test_presets_keep_their_tolerance_and_rise_in_accuracy(measured):
    presets = of(measured, "preset")
    for name, tolerance in (("draft", 0.02), ("standard", 0.005), ("reference", 2e-4)):
        assert presets[name].rms_error <= tolerance
    assert presets["reference"].rms_error < presets["standard"].rms_error


def test_all_and_auto_spend_the_tolerance_of_their_preset(measured):
    """With every effect on, the settings have half of it; what the plan leaves out has the rest."""
    for name, tolerance in (("draft", 0.02), ("standard", 0.005), ("reference", 2e-4)):
        auto, everything = of(measured, "auto")[name], of(measured, "all")[name]
        assert auto.tolerance == everything.tolerance == tolerance
        assert auto.rms_error == of(measured, "preset")[name].rms_error
        assert auto.tolerance_spent == pytest.approx(auto.rms_error / tolerance)
        assert auto.tolerance_spent <= 1
        assert everything.tolerance_spent <= 0.5
        assert everything.left_out == ()
    assert of(measured, "auto")["draft"].left_out
    assert of(measured, "file")["as it is"].tolerance == 0.005
    assert all((p.tolerance is None) == (p.knob in OWN_ERROR) for p in measured.points)


def test_numbers_of_a_point_belong_together(measured):
    full = measured.reference.full_signal
    for p in measured.points:
        assert p.rms_electrons == pytest.approx(p.rms_error * full, rel=1e-12)
        assert p.max_error >= p.rms_error
        assert p.seconds > 0
        assert p.seconds_spread >= 0
        assert len(p.row) == len(COLUMNS)


def test_dark_current_left_out_is_its_electrons(measured):
    """3 ke/s for 10 ms are 30 electrons in every pixel."""
    left_out = of(measured, "effect:dark_current")["off"]
    assert left_out.rms_electrons == pytest.approx(30, rel=1e-6)
    assert left_out.max_error == pytest.approx(left_out.rms_error, rel=1e-6)


def test_noise_left_out_changes_no_mean(measured):
    for name in ("shot_noise", "fpn", "reset_noise", "read_noise", "quantization"):
        assert of(measured, f"effect:{name}")["off"].max_error == 0


def test_expected_stands_beside_measured(measured):
    """From 10 % too little to ten times too much; of variances, to the 2 % they are sampled to."""
    for e in measured.effects:
        assert e.predicted is not None
        assert e.ratio is None or 0.9 <= e.ratio <= 10
        if e.unit.endswith("variance"):
            assert e.predicted == pytest.approx(e.measured, rel=0.02)


def test_report_is_plain(measured):
    report = measured.report()
    assert {"points", "effects", "reference", "recommendation", "tolerance"} <= set(report)
    assert all(math.isfinite(p["rms_error"]) for p in report["points"])


def test_an_effect_the_user_switched_off_is_off_everywhere(tmp_path):
    made = camera(tmp_path, NOISY | {"effects": {"off_axis": "off", "read_noise": "on"}})
    for every in ("auto", "all"):
        found = ablation.with_effects(made, every)
        states = {d.name: d.state for d in prepare(found)[0].plan.decisions}
        assert states["off_axis"] == "off"
    assert states["read_noise"] == "on"
    assert "off_axis" not in ablation.wanted_effects(made)


def test_variance_shares_are_what_frames_have(tmp_path):
    """On a uniform field, whose percentiles are all the same signal."""
    quiet = {"pixel.readout.read_noise": "30 e", "scene.radiance": radiance_for(900)}
    made = camera(tmp_path, quiet | {"array.rows": 256, "array.columns": 256, "effects": "all"})
    ready = prepare(made)[0]
    shares = ablation.variance_shares(ready, 900.0, 1)
    assert shares["read_noise"] == pytest.approx(0.5, rel=0.03)
    frame = simulate(made)
    noise = np.var(frame.electrons - frame.mean_electrons)
    assert noise == pytest.approx(900 + 900, rel=0.03)  # five standard errors of 65536 pixels
    assert shares["shot_noise"] == pytest.approx(0.5, rel=0.03)


def test_hot_pixels_are_full_in_variance_shares(tmp_path):
    """What they add is the variance of some full pixels, not of charge that no pixel holds."""
    pattern = {"defects": {"hot": 0.01}, "fpn": {"gain_pixel": "1 %", "shading": {"gain": "5 %"}}}
    changes = {f"pixel.{name}": value for name, value in pattern.items()}
    made = camera(tmp_path, changes | {"scene.radiance": radiance_for(20000), "effects": "all"})
    ready = prepare(made)[0]
    shares = ablation.variance_shares(ready, 20000.0, 1)
    well = made.pixel.readout.full_well
    hot, slow, own = 0.01 * 0.99 * (well - 20000) ** 2, (0.05 * 20000) ** 2, (0.01 * 20000) ** 2
    assert well > 40000
    assert shares["fpn_shading"] == pytest.approx(slow / (hot + slow + own), rel=0.05)


def point(knob: str, setting: str, error: float, seconds: float, variance: float = 0.0) -> Point:
    return Point(knob, setting, error, error, error, seconds, 0.0, variance_lost=variance)


OWN = point("file", "as it is", 0.001, 1.0)


@pytest.mark.parametrize(
    ("points", "line"),
    [
        ([OWN, point("preset", "draft", 0.004, 0.5)], "accuracy: draft"),
        ([OWN, point("preset", "draft", 0.006, 0.5)], "accuracy: standard"),
        ([OWN, point("preset", "draft", 0.001, 0.5, variance=0.02)], "accuracy: standard"),
        ([OWN, point("preset", "draft", 0.001, 0.95)], "accuracy: standard"),
        (
            [
                OWN,
                point("preset", "draft", 0.004, 0.8),
                point("combined", "oversampling: 2, wavelength_step: 40 nm", 0.003, 0.4),
            ],
            "accuracy: {preset: standard, oversampling: 2, wavelength_step: 40 nm}",
        ),
        (  # alone its knob would do, but nothing is said of all of it
            [OWN, point("oversampling", "2", 0.003, 0.4)],
            "accuracy: standard",
        ),
        (
            [OWN, point("tolerance", "1 %", 0.004, 0.5)],
            "accuracy: 1 %",
        ),
        (
            [point("file", "as it is", 0.009, 1.0), point("preset", "reference", 1e-4, 9.0)],
            "accuracy: reference",
        ),
    ],
)
def test_recommended_is_the_fastest_that_keeps_the_tolerance(points, line, tmp_path):
    made = camera(tmp_path, {"accuracy": "standard"})
    found = recommend(made, tuple(points))
    assert found.line == line
    assert line in found.sentence
    pasted = camera(tmp_path, {"accuracy": _read(line)})
    assert pasted.accuracy.tolerance in (0.02, 0.01, 0.005, 0.0002)


def judged(
    knob: str, setting: str, error: float, own: float, seconds: float = 1.0, **more
) -> Point:
    """A row with a tolerance of its own."""
    return Point(knob, setting, error, error, error, seconds, 0.0, tolerance=own, **more)


FILE = judged("file", "as it is", 0.009, 0.005)
"""A file at `standard` whose plan misses it."""


@pytest.mark.parametrize(
    ("points", "line"),
    [
        # `reference` is good enough for the file, but not for what it promises itself.
        ([FILE, judged("preset", "reference", 0.003, 0.0002)], ""),
        ([FILE, judged("preset", "reference", 0.0001, 0.0002)], "accuracy: reference"),
        # Its plan skips more noise than it may.
        ([FILE, judged("preset", "reference", 1e-4, 2e-4, variance_lost=0.002)], ""),
        # The reference may be wrong by more than what is left of the tolerance.
        ([FILE, judged("preset", "reference", 1.5e-4, 2e-4, unsure=1e-4)], ""),
        # Where every plan misses, all effects are a way out: the fastest that meets both.
        (
            [
                FILE,
                judged("preset", "reference", 0.003, 0.0002),
                judged("all", "draft", 0.004, 0.02, seconds=2.0),
                judged("all", "standard", 1e-4, 0.005, seconds=3.0),
            ],
            "accuracy: draft\neffects: all",
        ),
        # A plan that meets both goes first, also where all effects are faster.
        (
            [
                FILE,
                judged("tolerance", "0.1 %", 1e-4, 0.001, seconds=9.0),
                judged("all", "standard", 1e-4, 0.005),
            ],
            "accuracy: 0.1 %",
        ),
    ],
)
def test_no_setting_is_recommended_that_misses_its_own_tolerance(points, line, tmp_path):
    found = recommend(camera(tmp_path, {"accuracy": "standard"}), tuple(points))
    assert found.line == line
    if line:
        assert " with ".join(f"`{part}`" for part in line.splitlines()) in found.sentence
        assert "within the tolerance of 0.5 %" in found.sentence
    else:
        assert found.sentence.startswith("none: no tested setting meets the 0.5 %")


def test_settings_that_miss_their_own_tolerance_are_named_once_each(tmp_path):
    points = (
        FILE,
        judged("preset", "standard", 0.009, 0.005),  # the same as the file's
        judged("preset", "draft", 0.009, 0.02),
        judged("preset", "reference", 0.00834, 0.0002),
        judged("tolerance", "0.1 %", 0.0005, 0.001, variance_lost=0.01),
        judged("all", "reference", 0.0003, 0.0002, unsure=0.0002),  # that may be the reference's
        judged("wavelength_step", "80 nm", 0.9, None),
    )
    found = recommend(camera(tmp_path, {"accuracy": "standard"}), points)
    of_standard, of_reference, of_variance = found.missed
    assert of_standard.startswith("`accuracy: standard` misses its own tolerance")
    assert "0.83 % of full signal, 41.7 times the tolerance of 0.02 %" in of_reference
    assert "1 % of a variance, 5 times the tolerance of 0.2 %" in of_variance


def test_a_line_with_all_effects_keeps_those_off_that_the_file_switches_off(tmp_path):
    made = camera(tmp_path, NOISY | {"effects": {"off_axis": "off"}})
    found = recommend(made, (FILE, judged("all", "standard", 1e-4, 0.005)))
    pasted = camera(tmp_path, NOISY | yaml.load(found.line, yaml.BaseLoader))
    assert pasted.effects["off_axis"] == "off"
    assert pasted.effects["read_noise"] == "on"


@pytest.mark.long
def test_the_recommendation_before_one_white_column_meets_its_tolerances(tmp_path):
    """A survey of some places may miss such a line, and all presets with it."""
    picture = np.zeros((64, 96), np.uint8)
    picture[:, 47] = 255
    write_png(tmp_path / "column.png", picture)
    lone = {
        "scene.radiance": radiance_for(2000),
        "scene.source": {"kind": "image", "file": "column.png"},
        "array.rows": 16,
        "array.columns": 24,
        "effects": "auto",
        "accuracy": "standard",
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measurements, "TURNS", 1)
        found = study.accuracy(camera(tmp_path, lone), workers=1)
    presets = [p for p in found.points if p.knob in ("preset", "all")]
    assert len(presets) == 6
    for p in presets:
        setting = f"`accuracy: {p.setting}`{' with `effects: all`' if p.knob == 'all' else ''}"
        missed = any(text.startswith(f"{setting} misses") for text in found.recommendation.missed)
        assert missed == (p.tolerance_spent > 1), setting
    line = yaml.load(found.recommendation.line, yaml.BaseLoader)  # on and off are words
    if isinstance(line["accuracy"], dict):
        line["accuracy"] = yaml.safe_load(found.recommendation.line)["accuracy"]
    pasted = camera(tmp_path, lone | line)
    exact = {"effects": "all", "accuracy": {"tolerance": 1e-6, "float_width": 64}}
    truth = ablation.mean_raw(prepare(camera(tmp_path, lone | exact), 1)[0])
    error = rms(ablation.mean_raw(prepare(pasted, 1)[0]) - truth) / truth.max()
    assert error <= min(0.005, pasted.accuracy.tolerance)


def test_knobs_are_made_coarser_where_they_save_time_and_lose_little(tmp_path):
    made = camera(tmp_path, {"accuracy": "standard"})
    points = (
        OWN,
        point("oversampling", "1", 0.004, 0.2),  # more than half of 0.5 %
        point("oversampling", "2", 0.002, 0.5),
        point("table_size", "64", 1e-4, 0.97),  # saves too little
        point("wavelength_step", "80 nm", 0.001, 0.5),  # more than a tenth
        point("wavelength_step", "20 nm", 1e-4, 0.8),
        point("shot_noise", "gaussian", 0.0, 0.1),  # not the same noise
    )
    assert coarser_knobs(made, points) == {"wavelength_step": "20 nm", "oversampling": 2}


def test_a_saving_within_the_spread_is_none(tmp_path):
    made = camera(tmp_path, {"accuracy": "standard"})
    shaky = Point("preset", "draft", 0.001, 0.001, 1.0, 0.8, 0.6)
    assert recommend(made, (OWN, shaky)).line == "accuracy: standard"


def _read(line: str):
    return yaml.safe_load(line)["accuracy"]
