"""Black levels by color: in the codes, taken off by the processing, predicted and fitted."""

import numpy as np
import pytest
import yaml
from making import GONE, camera

from vcam_cli import load, simulate
from vcam_cli.errors import BadInput
from vcam_cli.verification import measurement_file
from vcam_cli.verification.verify import verify

LEVELS = {"R": "66 DN", "G": "64 DN", "B": "61 DN"}
MEAN = 191 / 3
DARK = {
    "scene.irradiance": "0 W/m2",
    "scene.radiance": GONE,
    "optics": "none",
    "array": {"rows": 40, "columns": 48, "pattern": "bayer-grbg"},
    "adc": {"bits": 12, "offset": LEVELS},
    "pixel.readout.read_noise": "5 e",
    "output": {"render": 8},
}
PLACES = {"G": [(0, 0), (1, 1)], "R": [(0, 1)], "B": [(1, 0)]}


def of_color(dn, color):
    return np.concatenate([dn[r::2, c::2].ravel() for r, c in PLACES[color]]).astype(float)


def test_codes_have_the_level_of_their_color(tmp_path):
    """To five standard errors of noise and rounding."""
    made = camera(tmp_path, DARK)
    frame = simulate(made).frame
    dark = frame.black_dn - MEAN
    for color, level in (("R", 66), ("G", 64), ("B", 61)):
        codes = of_color(frame.dn, color)
        assert codes.mean() == pytest.approx(level + dark, abs=5 * 0.6 / np.sqrt(codes.size))


def test_they_differ_from_one_level_by_that_alone(tmp_path):
    """In light, the same seeds, the same mean level: the codes differ by the steps, no picture."""
    lit = DARK | {"scene.irradiance": "0.02 W/m2", "adc": {"bits": 12, "offset": "64 DN"}}
    steps = [{"black_level": "subtract"}, {"demosaic": "bilinear"}, {"gamma": 2.2}]
    lit |= {"processing": steps}
    one = camera(tmp_path, lit)
    several = one.with_({"adc.offset": {"R": "69 DN", "G": "64 DN", "B": "59 DN"}})
    plain, stepped = (simulate(each) for each in (one, several))
    apart = stepped.dn.astype(int) - plain.dn
    for color, step in (("R", 5), ("G", 0), ("B", -5)):
        assert set(of_color(apart, color)) == {step}
    np.testing.assert_allclose(stepped.render, plain.render, atol=1)


def test_prediction_has_the_level_of_the_color(tmp_path):
    made = camera(tmp_path, DARK)
    for n in range(2):
        np.save(tmp_path / f"dark_{n}.npy", simulate(made.with_({"seed.frame": n + 1})).dn)
    form = {
        "kind": "measurement",
        "frames": [{"files": "dark_*.npy", "exposure": "10 ms", "light": "none"}],
        "levels": {"bits": 12},
        "pixel": {"width": "5 um"},
        "pattern": "bayer-grbg",
    }
    (tmp_path / "bench.yaml").write_text(yaml.safe_dump(form))
    found = verify(made, measurement_file.read(tmp_path / "bench.yaml"))
    means = {row.channel: row for row in found.rows if row.quantity == "mean [DN]"}
    assert means["R"].predicted - means["B"].predicted == pytest.approx(5, abs=0.01)
    assert not any(row.differs for row in found.judged)


def test_the_file_reads_back_as_it_was_written(tmp_path):
    made = camera(tmp_path, DARK)
    written = made.model_dump(mode="json")["adc"]["offset"]
    assert {color: level.split()[0] for color, level in written.items()} == {
        "R": "66", "G": "64", "B": "61",
    }  # fmt: skip
    (tmp_path / "again.yaml").write_text(yaml.safe_dump(made.model_dump(mode="json")))
    assert load(tmp_path / "again.yaml").adc.offset == made.adc.offset


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"adc.offset": {"W": "66 DN"}}, "give one for each color"),
        ({"adc.offset": {"R": 66, "G": "64 DN", "B": "61 DN"}}, "adc.offset"),
        ({"adc.offset": {"R": "auto", "G": "64 DN", "B": "61 DN"}}, "auto is for all colors"),
        ({"adc.offset": {"R": "5000 DN", "G": "64 DN", "B": "61 DN"}}, "leaves no number"),
        ({"adc.offset": {}}, "a mapping of colors is empty"),
        ({"array.pattern": "monochrome"}, "mosaics of 2 x 2"),
        ({"output.dng": True}, "raw.dng has one black level"),
        ({"array.binning": {"rows": 2, "columns": 2}}, "binned pixels"),
    ],
)
def test_what_is_not_simulated_is_refused(tmp_path, changes, words):
    made = camera(tmp_path, DARK)
    with pytest.raises(BadInput, match=words):
        simulate(made.with_(changes))
