"""What neither raw nor metrics need is not computed."""

import json

import numpy as np
import pytest
from making import camera, radiance_for
from sweeping import written

from vcam_cli import simulate, sweep
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.errors import BadInput
from vcam_cli.simulation import pipeline
from vcam_cli.simulation import simulate as engine
from vcam_cli.simulation.output import outputs
from vcam_cli.solve import idle_keys

COLOR = {
    "array.pattern": "bayer-rggb",
    "array.rows": 24,
    "array.columns": 32,
    "processing": [
        {"black_level": "subtract"},
        {"demosaic": "bilinear"},
        {"white_balance": "illuminant"},
        {"color_correction": "fit"},
    ],
}
RAW = {"output": {"raw": ["dn"], "render": "none"}, "quality": []}
HONEYCOMB = {**COLOR, "array.pattern": "honeycomb"}


@pytest.fixture
def prepared(monkeypatch):
    """The pictures whose steps were prepared."""
    found = []

    def process(dn, *args, **others):
        found.append(dn)
        return original(dn, *args, **others)

    original = pipeline.process
    monkeypatch.setattr(pipeline, "process", process)
    return found


@pytest.mark.parametrize("pixels", [COLOR, HONEYCOMB])
def test_a_raw_frame_prepares_no_picture(pixels, prepared, tmp_path):
    """Neither gains, nor a color correction, nor samples brought to a grid."""
    result = simulate(camera(tmp_path, pixels | RAW), 1)
    assert result.metrics
    outputs.write_raw(result, tmp_path / "raw.exr")
    assert isinstance(result.notes, tuple)
    assert not prepared
    assert "balance" not in result.stages.seconds


@pytest.mark.parametrize("asked", [{"output": {"render": 8}}, {"quality": ["mse"]}])
def test_a_picture_that_is_asked_for_is_prepared_with_the_frame(asked, prepared, tmp_path):
    """So that what is wrong with its steps is said before anything is written."""
    simulate(camera(tmp_path, COLOR | RAW | asked), 1)
    assert len(prepared) == 1


def test_steps_that_cannot_work_are_said_at_once(tmp_path):
    small = {**COLOR, "array.rows": 1, "array.columns": 1}
    with pytest.raises(BadInput, match="cannot be demosaiced"):
        simulate(camera(tmp_path, small), 1)


def test_who_asks_for_a_picture_later_gets_it(tmp_path):
    late = simulate(camera(tmp_path, COLOR | RAW), 1).render
    assert np.array_equal(late, simulate(camera(tmp_path, COLOR), 1).render)


def test_a_sweep_prepares_pictures_where_it_judges_or_keeps_them(prepared, tmp_path):
    for number, (study, pictures) in enumerate(
        [({}, 0), ({"keep": ["raw"]}, 0), ({"keep": ["render"]}, 3), ({"metrics": ["mse"]}, 3)]
    ):
        place = tmp_path / str(number)
        sweep(written(place, COLOR, **study), out=place / "out", workers=1)
        assert len(prepared) == pictures
        prepared.clear()


def test_noise_that_is_left_out_is_not_drawn(tmp_path, monkeypatch):
    """A bright wall calls for no read noise; simulated, it would be drawn here."""
    wall = COLOR | RAW | {"scene.source": {"kind": "chart", "chart": "uniform"}}
    quiet = wall | {"scene.radiance": radiance_for(5000), "pixel.readout.read_noise": "0.3 e"}
    quiet["accuracy"] = "standard"

    def drawn(*args):
        raise AssertionError("drawn")

    monkeypatch.setattr(ReadNoise, "apply", drawn)
    simulate(camera(tmp_path, quiet | {"effects": "auto"}), 1)
    with pytest.raises(AssertionError, match="drawn"):
        simulate(camera(tmp_path, quiet | {"effects": "all"}), 1)


def test_notes_are_looked_for_when_they_are_read(tmp_path, monkeypatch):
    """To find the keys that cannot act, the camera is solved again and again."""
    looked = []
    original = idle_keys.notes
    monkeypatch.setattr(idle_keys, "notes", lambda one: looked.append(one) or original(one))
    idle = {"pixel.readout.gain": 2, "exposure.time": "5 ms"}
    made = camera(tmp_path, COLOR | RAW | idle)
    result, (ready, notes) = simulate(made, 1), engine.prepare(made, 1)
    assert result.metrics
    assert not looked
    assert ready.plan.decisions
    expected = "pixel.readout.gain changes nothing here"
    for found in (result.notes, result.notes, notes, list(notes)):
        assert [n for n in found if n.startswith(expected)]
    assert len(looked) == 2, "once for the frame, once for what is ready to take it"
    assert notes[:] == (*notes,) == result.notes


def test_run_json_has_the_notes(tmp_path):
    made = camera(tmp_path, COLOR | RAW | {"pixel.readout.gain": 2})
    simulate(made, 1).save(tmp_path / "out")
    [note] = json.loads((tmp_path / "out" / "run.json").read_text())["notes"]
    assert note.startswith("pixel.readout.gain changes nothing here")
