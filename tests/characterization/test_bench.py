"""The measuring bench: colors, saturation, small arrays, and what cannot be measured there."""

import math

import pytest
from making import camera, radiance_for

from vcam_cli.characterization import bench as benches
from vcam_cli.characterization import exposures
from vcam_cli.characterization.characterize import characterize
from vcam_cli.errors import BadInput
from vcam_cli.progress import Stages

pytestmark = pytest.mark.long

SHEET = {
    "scene.radiance": radiance_for(30000),
    "pixel.readout": {
        "full_well": "32 ke",
        "voltage_swing": "1 V",
        "read_noise": "13 e",
        "reset_noise": "none",
    },
    "pixel.photodetector.dark_current": "900 e/s",
    "pixel.fpn": {"offset_pixel": "8 e", "gain_pixel": "0.9 %"},
    "adc": {"bits": 12, "offset": "20 DN", "gain": "0.124 DN/e"},
    "effects": "auto",
    "accuracy": "standard",
}
NOISE = math.sqrt(13**2 + 9)
SMALL = 128


@pytest.fixture
def small(monkeypatch):
    """A bench of few pixels and frames: a gain is good to 1 %, its parts to some percents."""
    monkeypatch.setattr(benches, "FIELD", SMALL)
    monkeypatch.setattr(exposures, "STACK", 8)
    monkeypatch.setattr(exposures, "EDGES", 8)
    monkeypatch.setattr(exposures, "REACH", 40)


BAYER = {
    **SHEET,
    "array.pattern": "bayer-rggb",
    "scene.illuminant": "D65",
    "scene.radiance": "1 W/(sr m2)",
}


def test_every_color_is_measured_from_its_own_pixels(small, tmp_path):
    found = characterize(camera(tmp_path, BAYER))
    assert [c.color for c in found.channels] == ["R", "G", "B"]
    assert len(found.channels[1].transfer.series.mean) == len(
        found.channels[0].transfer.series.mean
    )
    for color in "RGB":
        for name in ("system_gain", "quantum_efficiency", "full_well", "read_noise"):
            q = found.get(name, color)
            assert q.measured == pytest.approx(q.expected, rel=0.05), (name, color)
        q = found.get("mtf50", color)
        assert q.measured == pytest.approx(q.expected, rel=0.1)
    efficiencies = [found.get("quantum_efficiency", color).expected for color in "RGB"]
    assert len(set(efficiencies)) == 3


def test_a_color_without_light_is_left_out(small, tmp_path):
    filters = {"R": 0.5, "G": 0.5, "B": 0.0}
    found = characterize(camera(tmp_path, {**BAYER, "array.filters": filters}))
    assert [c.color for c in found.channels] == ["R", "G"]
    assert any(note.startswith("B: not measured") for note in found.notes)


def test_an_adc_that_is_full_before_the_well(small, tmp_path):
    adc = {"bits": 12, "offset": "60 DN", "gain": "0.5 DN/e"}
    found = characterize(camera(tmp_path, {**SHEET, "adc": adc}))
    for name, known in (("system_gain", 0.5), ("full_well", 4035 / 0.5)):
        assert found.get(name).measured == pytest.approx(known, rel=0.04)
        assert found.get(name).expected == pytest.approx(known)
    assert found.bench.pedestal == 0
    assert not found.notes


def test_one_pixel_is_measured_as_a_field_of_its_kind(small, tmp_path):
    one, many = (
        characterize(camera(tmp_path, {**SHEET, "array.rows": n, "array.columns": n}))
        for n in (1, 300)
    )
    assert [q.row for q in one.quantities] == [q.row for q in many.quantities]


def test_numbers_do_not_depend_on_workers_but_on_the_frame_seed(small, tmp_path):
    made = camera(tmp_path, SHEET)
    one, three = (characterize(made, workers=n).quantities for n in (1, 3))
    assert one == three
    other = characterize(camera(tmp_path, {**SHEET, "seed": {"frame": 2}})).quantities
    assert all(a.measured != b.measured for a, b in zip(one[:6], other, strict=False))


def test_unequal_dark_currents_and_lost_charge(small, tmp_path):
    """The dark's own pattern counts; the edge is measured as if all charge came out.

    A standard deviation of 128 x 128 pixels and 8 frames: 5 %; MTF50 at 8 edges: 5 %.
    """
    ccd = {
        "pixel.architecture": "ccd",
        "pixel.readout.charge_transfer": {"inefficiency": 1e-3, "phases": 3},
        "pixel.photodetector.dark_current": "400 ke/s",
        "pixel.fpn": {"offset_pixel": "8 e", "dark": "2 %"},
    }
    found = characterize(camera(tmp_path, {**SHEET, **ccd}))
    assert found.get("dsnu").expected == pytest.approx(math.hypot(8, 0.02 * 4000), rel=1e-6)
    assert found.get("dsnu").measured == pytest.approx(math.hypot(8, 80), rel=0.05)
    sharp = found.get("mtf50")
    assert sharp.measured == pytest.approx(sharp.expected, rel=0.05)


def test_codes_are_moved_up_where_the_dark_would_be_cut_off(small, tmp_path):
    """Half of the noise would be lost below code 0, and with it 0.4 of the dark's variance."""
    adc = {"bits": 12, "gain": "0.124 DN/e", "offset": "0 DN"}
    found = characterize(camera(tmp_path, {**SHEET, "adc": adc}))
    assert found.bench.pedestal > 5 * NOISE * 0.124
    assert "moved up" in found.notes[0]
    assert found.get("read_noise").measured == pytest.approx(13, rel=0.05)


def test_a_lens_given_by_its_field_of_view_stays_the_same(small, tmp_path):
    """The field on the bench is another array, the lens is not."""
    changes = {"optics": {"f_number": 4, "field_of_view": "40 deg", "off_axis": "none"}}
    made = camera(tmp_path, {**SHEET, **changes})
    found = benches.prepare_bench(made, 1, Stages()).ready.geometry
    width = math.hypot(48, 64) * 5e-6
    assert found.image_distance == pytest.approx(width / 2 / math.tan(math.radians(20)), rel=1e-6)


REFUSED = {
    "adc.kind": ({"adc": {"bits": 12, "kind": "logarithmic"}}, "linear cameras"),
    "array.pattern": (
        {"array.pattern": "honeycomb", "output.render": "none"},
        "rows and columns",
    ),
    "array.binning": ({"array.binning": {"rows": 2, "columns": 2}}, "unbinned pixels"),
    "effects.shot_noise": ({"effects": {"shot_noise": "off"}}, "switched off"),
    "adc.bits": ({"adc": {"bits": 3}}, "lost in rounding"),
    "exposure": ({"pixel.photodetector.dark_current": "4000 ke/s"}, "dark current alone"),
    "scene.illuminant": ({"optics.transmittance": 0}, "do not respond"),
}


@pytest.mark.parametrize("path", REFUSED)
def test_what_cannot_be_measured_is_said(path, small, tmp_path):
    changes, words = REFUSED[path]
    with pytest.raises(BadInput, match=words) as caught:
        characterize(camera(tmp_path, {**SHEET, **changes}))
    problem = caught.value.problems[0]
    assert ".".join(map(str, problem.path)) == path
    assert problem.remedy
    assert problem.where
