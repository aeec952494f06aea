"""Predictions beside measurements, whose truth the predictor does not see."""

import csv
import json
import math

import numpy as np
import pytest
import yaml
from making import LIGHT, PLANCK, camera
from typer.testing import CliRunner

from vcam_cli import load
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.simulation.simulate import simulate
from vcam_cli.verification import measurement_file
from vcam_cli.verification.prediction import conditions
from vcam_cli.verification.verify import COLUMNS, verify

LINE = {"monochromatic": "550 nm"}
AREA, TIME = 0.5 * 25e-12, 0.02
"""Photodetector of the plain camera [m2], QE 0.5; exposure of the points [s]."""
POINT = {"exposure": "20 ms", "light": LINE, "irradiance": "0.01 W/m2"}


def electrons(irradiance):
    return irradiance * 550e-9 / (PLANCK * LIGHT) * AREA * 0.5 * TIME


def measured(folder, frames, **more):
    form = {"kind": "measurement", "frames": frames, **more}
    file = folder / "bench.yaml"
    file.write_text(yaml.safe_dump(form))
    return measurement_file.read(file)


def rows(folder, frames, made=None, **more):
    return verify(made or camera(folder), measured(folder, frames, **more)).rows


def test_a_signal_is_predicted_in_electrons_volts_and_codes(tmp_path):
    """20 uV/e; 12 bits over 2 V of a well of 100 ke, offset 0."""
    signals = ["10 ke", "0.4 V", "900 DN"]
    found = rows(tmp_path, [POINT | {"signal": s} for s in signals])
    n = electrons(0.01)
    expected = [n, n * 20e-6, n / 100e3 * 4095]
    assert [r.predicted for r in found] == pytest.approx(expected, rel=1e-6)
    assert [r.quantity for r in found] == ["mean [e]", "mean [V]", "mean [DN]"]
    assert found[0].error == pytest.approx(n / 10e3 - 1, rel=1e-6)


def test_photons_on_a_pixel_are_those_of_emva_1288(tmp_path):
    """Half of the pixel's area is photodetector, of a QE of 0.5."""
    point = {"exposure": "20 ms", "light": LINE, "photons": 40_000, "signal": "10 ke"}
    [row] = rows(tmp_path, [point])
    assert row.predicted == pytest.approx(10_000, rel=1e-6)
    wide = point | {"light": {"blackbody": "5000 K"}}
    [row] = rows(tmp_path, [wide])
    assert row.predicted == pytest.approx(10_000, rel=1e-4), "QE is flat: the lamp plays no part"


def test_no_light_leaves_the_dark(tmp_path):
    dark = camera(tmp_path, {"pixel.photodetector": {
        "fill_factor": 0.5, "quantum_efficiency": 0.5, "dark_current": "2000 e/s"}})  # fmt: skip
    [row] = rows(tmp_path, [{"signal": "50 e", "exposure": "20 ms"}], dark)
    assert row.predicted == pytest.approx(40, rel=1e-6)


def test_the_camera_keeps_what_lies_behind_the_light(tmp_path):
    """Whatever scene, lens and exposure the file has: picture, auto exposure, gain."""
    made = load("starter").with_({"exposure": {"auto": {"max": "1 s"}}})
    point = measured(tmp_path, [POINT | {"signal": "1 V", "channel": "G"}]).frames[0]
    there = conditions(made, point)
    assert there.exposure.time == 0.02
    assert not there.optics.is_lens
    assert there.scene.luminance is None
    assert there.pixel == made.pixel
    assert there.array.filters == made.array.filters


def test_a_full_well_is_the_most(tmp_path):
    bright = POINT | {"irradiance": "10 W/m2", "signal": "100 ke"}
    assert rows(tmp_path, [bright])[0].predicted == pytest.approx(100e3)
    assert rows(tmp_path, [bright | {"signal": "4095 DN"}])[0].predicted == pytest.approx(4095)


def test_each_color_is_its_own(tmp_path):
    """Filters that pass a tenth, a fifth and all of the light."""
    filters = {"R": 0.1, "G": 0.2, "B": 1.0}
    array = {"rows": 200, "columns": 300, "pattern": "bayer-rggb", "filters": filters}
    made = camera(tmp_path, {"array": array})
    points = [POINT | {"signal": "1 ke", "channel": c} for c in filters]
    found = [r.predicted for r in rows(tmp_path, points, made)]
    assert found == pytest.approx([electrons(0.01) * f for f in filters.values()], rel=1e-6)


TRUTH = {
    "pixel.technology.quantum_efficiency_scale": 0.77,
    "pixel.technology.capacitance.area": "0.96 fF/um2",
    "pixel.technology.junction.substrate_depth": "2.7 um",
    "pixel.readout.transfer_curve.follower.body_effect": "0.53 sqrt(V)",
}
GLASS = {"none": "A", "blue": ["A", "generic-blue"], "red": ["A", "generic-red"]}


def bench(changes, seed):
    """Signals of a hidden sensor: frames with noise of another seed, means of their volts."""
    sensor = load("test-pixel-0.18um").with_(changes)
    points = []
    for number, (name, light) in enumerate(GLASS.items()):
        at = {"scene.illuminant": light, "seed": {"sensor": seed, "frame": seed + number}}
        volts = float(simulate(sensor.with_(at)).volts.mean(dtype=float))
        points.append({"name": name, "signal": f"{volts!r} V", "exposure": "30 ms", "light": light,
                       "irradiance": "0.05 W/m2"})  # fmt: skip
    return points


def test_the_same_sensor_is_predicted_to_its_noise(tmp_path):
    """256 pixels of some 20 ke: shot, reset and read noise make 0.05 % of a mean; five of these."""
    found = verify(load("test-pixel-0.18um"), measured(tmp_path, bench({}, 91)))
    assert np.abs(found.errors).max() < 5 * 0.0006


def test_a_hidden_truth_shows_in_the_errors(tmp_path):
    """Numbers that are 2.7 to 6 % off: the errors are neither noise nor more than their sum."""
    found = verify(load("test-pixel-0.18um"), measured(tmp_path, bench(TRUTH, 92)))
    largest = np.abs(found.errors).max()
    assert 0.005 < largest < 0.16
    seen = verify(load("test-pixel-0.18um").with_(TRUTH), measured(tmp_path, bench(TRUTH, 93)))
    assert np.abs(seen.errors).max() < 5 * 0.0006, "who knows the truth predicts it"


def test_tolerances_are_the_points_or_the_measurements(tmp_path):
    n = electrons(0.01)
    points = [
        POINT | {"signal": f"{n * 0.95!r} e"},
        POINT | {"signal": f"{n * 0.95!r} e", "tolerance": "6 %"},
    ]
    found = verify(camera(tmp_path), measured(tmp_path, points, tolerance="5 %"))
    assert [r.missed for r in found.rows] == [True, False]
    assert found.summary()["missed"] == 1
    assert not any(r.missed for r in rows(tmp_path, points[:1]))


def test_a_signal_of_nothing_has_no_relative_error(tmp_path):
    [zero, off] = rows(
        tmp_path,
        [{"signal": "0 e", "exposure": "20 ms"}, POINT | {"signal": "0 e"}],
    )
    assert zero.error == 0
    assert math.isinf(off.error)


FILES = {"verify.csv", "verify.json", "errors.png", "report.html"}


def call(*arguments):
    return CliRunner().invoke(app, ["verify", *arguments])


def test_the_shipped_measurement_holds_its_tolerance(tmp_path):
    out = tmp_path / "out"
    options = ["-o", str(out), "--json", "--report"]
    done = call("test-pixel-0.18um", "test-pixel-simulated", *options)
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    with (out / "verify.csv").open() as file:
        table = list(csv.DictReader(file))
    assert list(table[0]) == list(COLUMNS)
    assert len(table) == said["count"] == 15
    assert max(abs(float(row["error_percent"])) for row in table) <= 8
    assert {p.name for p in out.iterdir()} >= FILES


def test_a_missed_tolerance_is_exit_code_4(tmp_path):
    strict = ["-o", str(tmp_path / "out"), "--set", "pixel.technology.quantum_efficiency_scale=0.6"]
    done = call("test-pixel-0.18um", "test-pixel-simulated", *strict)
    assert done.exit_code == 4, done.output
    assert "miss their tolerance" in done.stderr
    assert "missed" in done.stdout
    assert (tmp_path / "out" / "verify.csv").is_file(), "the results are there"


@pytest.mark.parametrize(
    ("point", "path", "words"),
    [
        ({"signal": "3 lx"}, "signal", "0.42 V"),
        ({"photons": 5}, "photons", "both"),
        ({"irradiance": "from-file"}, "irradiance", "file"),
        ({"light": "none"}, "irradiance", "no light"),
        ({"channel": "G"}, "channel", "no color"),
        ({"light": {"monochromatic": "550"}}, "light", "550"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(point, path, words, tmp_path):
    with pytest.raises(BadInput) as caught:
        rows(tmp_path, [POINT | {"signal": "1 V"} | point])
    problems = list(caught.value.problems)
    assert any(p.path[:3] == ("frames", 0, path) for p in problems), problems
    assert words in str(caught.value)
    assert "bench.yaml:" in problems[0].where


def test_a_camera_is_no_measurement(tmp_path):
    with pytest.raises(BadInput, match="no measurement"):
        measurement_file.read(load("starter").origin)


def test_validate_knows_measurements(tmp_path):
    assert CliRunner().invoke(app, ["validate", "test-pixel-simulated"]).exit_code == 0
    (tmp_path / "m.yaml").write_text("kind: measurement\nframes: []\n")
    done = CliRunner().invoke(app, ["validate", str(tmp_path / "m.yaml")])
    assert done.exit_code == 2
    assert "empty" in done.stderr
