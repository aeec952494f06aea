"""Notes that spare hours: each where it is due, and not where it is not."""

import numpy as np
import pytest
from making import GONE, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived import photodiode
from vcam_cli.simulation.simulate import prepare

COLOR = {
    "array.pattern": "bayer-rggb",
    "array.filters": {"R": {"table": {380: 0, 599: 0, 600: 1, 1000: 1}}, "G": 0.5, "B": 0.3},
    "scene.illuminant": "equal-energy",
    "scene.radiance": "0.1 W/(sr m2)",
    "scene.wavelengths": {"start": "400 nm", "stop": "900 nm"},
    "processing": [{"demosaic": "bilinear"}, {"white_balance": "illuminant"}],
    "accuracy": "draft",
}


def notes(folder, changes):
    return list(prepare(camera(folder, changes), 1)[1])


def told(folder, changes, begin):
    return [note for note in notes(folder, changes) if note.startswith(begin)]


def test_infrared_light_that_nothing_cuts_off_is_told(tmp_path):
    """Photons of equal energy from 700 to 900 nm over those from 600: (81 - 49) / (81 - 36)."""
    [note] = told(tmp_path, COLOR, "nothing cuts off infrared")
    assert f"{100 * (81 - 49) / (81 - 36):.2g} % of the signal of R" in note
    assert "ir-cut-650" in note
    cut = {"table": {400: 1, 650: 1, 660: 0, 900: 0}}
    for change in ({"optics.transmittance": cut}, {"scene.wavelengths.stop": "700 nm"}):
        assert told(tmp_path, COLOR | change, "nothing cuts off infrared") == []
    gray = {"array.pattern": "monochrome", "array.filters": GONE, "processing": []}
    assert told(tmp_path, {k: v for k, v in (COLOR | gray).items() if v is not GONE}, "noth") == []


def test_a_render_that_an_overexposure_darkens_is_told(tmp_path):
    bright = {"scene.radiance": radiance_for(400e3), "processing": [{"gamma": "srgb"}]}
    [note] = told(tmp_path, bright, "the scene's white is 4 times the saturation level")
    assert "25 % of white" in note
    assert "tone: {white: sensor}" in note
    result = simulate(camera(tmp_path, bright))
    assert np.median(result.linear) == pytest.approx(0.25, rel=1e-3)
    for change in (
        {"processing": [{"tone": {"white": "sensor"}}, {"gamma": "srgb"}]},
        {"scene.radiance": radiance_for(90e3)},
        {"output.render": "none"},
    ):
        assert told(tmp_path, bright | change, "the scene's white") == []


def test_a_well_that_the_adc_ends_is_told(tmp_path):
    """4095 codes at 0.1 DN/e are 40,950 e of 100,000."""
    short = {"adc": {"bits": 12, "offset": "0 DN", "gain": "0.1 DN/e"}}
    [note] = told(tmp_path, short, "the ADC is full at")
    assert "4.095e+04 e, 40.9 % of the full well" in note
    [meant] = [word for word in note.split() if word.startswith("0.04095")]
    assert meant
    fitting = {"adc": {"bits": 12, "offset": "0 DN", "gain": "0.04095 DN/e"}}
    assert told(tmp_path, fitting, "the ADC is full at") == []
    assert told(tmp_path, short | {"exposure.gain": 2}, "the ADC is full at") == []


@pytest.mark.parametrize(
    ("kind", "density", "is_told"),
    [("pinned", 136.7, True), ("pinned", 0.5, False), ("ndiff-psub", 13.2, True),
     ("ndiff-psub", 5.0, False)],
)  # fmt: skip
def test_junctions_that_contradict_practice_are_told(kind, density, is_told, tmp_path, monkeypatch):
    monkeypatch.setattr(photodiode, "junction_parts", lambda *_: (density * 1e-5, 0.0, 0.0))
    monkeypatch.setattr(photodiode, "process", lambda _: None)
    made = camera(tmp_path)
    own = made.pixel.photodetector.model_copy(
        update={"kind": kind, "dark_current_density": "junction", "dark_current": None}
    )
    changed = made.model_copy(
        update={"pixel": made.pixel.model_copy(update={"photodetector": own})}
    )
    found = photodiode.remarks(changed)
    assert bool(found) == is_told
    if is_told:
        assert f"{density:.4g} nA/cm2" in found[0]
