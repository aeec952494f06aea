"""Mistakes in words: what was given, what is allowed, the nearest right name, a YAML path."""

import pytest
from camera_trees import changed, mistakes
from pydantic import BaseModel, ValidationError

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.sensor.pixel import FixedPattern, Pixel
from vcam_cli.config import validation_messages
from vcam_cli.errors import Problem


def test_problems_have_yaml_paths():
    changes = {"pixel.photodetector.quantum_efficiency": {"pixel": {"table": {400: "x"}}}}
    with pytest.raises(ValidationError) as caught:
        Camera.model_validate(changed(changes))
    (problem,) = validation_messages.problems(caught.value)
    assert isinstance(problem, Problem)
    assert problem.path == ("pixel", "photodetector", "quantum_efficiency", "pixel", "table", 400)


def test_an_unknown_key_gets_the_nearest_right_one_and_all_that_are_allowed():
    (mistake,) = mistakes({"adc.bitts": 10})
    assert mistake.startswith("adc.bitts: ")
    assert "bits, kind, offset, full_scale, gain, noise, reference" in mistake
    assert mistake.endswith("did you mean bits?")


def test_a_key_like_no_other_gets_no_guess():
    (mistake,) = mistakes({"adc.zzz": 10})
    assert "did you mean" not in mistake


def test_a_missing_key_gets_an_example():
    (mistake,) = mistakes({"scene.source": {"kind": "image"}})
    expected = "scene.source.file: is missing; add it, for example file: photo.png"
    assert mistake == expected


def test_a_word_gets_the_nearest_right_one_and_all_that_are_allowed():
    (mistake,) = mistakes({"pixel.architecture": "aps3t"})
    assert "'aps3t'" in mistake
    assert "aps-3t, aps-4t, pps, dps, ccd" in mistake
    assert mistake.endswith("did you mean aps-3t?")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "is empty; write a mapping of"),
        ("6.5 um", "'6.5 um' is not a mapping; write a mapping of"),
        ([1, 2], "a list of 2 is not a mapping"),
    ],
)
def test_a_section_that_is_none(value, words):
    (mistake,) = mistakes({"pixel": value})
    assert mistake.startswith("pixel: ")
    assert words in mistake


def test_keys_that_are_no_words():
    (mistake,) = mistakes({"adc": {3: 4}})
    assert mistake.startswith("adc.3: ")


def test_no_pydantic_in_any_message():
    changes = {
        "name": 3,
        "scene": {"source": 5, "luminance": [], "extent": {"w": 1}, "illuminant": {"x": 1}},
        "optics": {"f_number": {}, "off_axis": 1, "psf": {}, "zernike": 4, "diffraction": None},
        "pixel": {"width": {}, "stack": {"oxide": 1}, "microlens": {}, "fpn": [], "readout": "x"},
        "array": {"rows": "x", "columns": [], "pattern": 3, "filters": 4, "binning": {"rows": 1.5}},
        "exposure": {"time": {}, "auto": 3, "captures": "x"},
        "processing": [3, {}, {"gamma": None}, {"demosaic": None}],
        "quality": [3, None],
        "effects": {"fpn": None},
        "accuracy": [],
        "seed": 3,
        "output": {"raw": [{}], "render": {}},
    }
    found = mistakes(changes)
    assert len(found) > 35
    for mistake in found:
        for word in ("pydantic", "input", "Input", "validator", "type=", "model_", "union", "None"):
            assert word not in mistake, mistake


def test_other_models_are_understood_too():
    class Plain(BaseModel):
        width: int

    with pytest.raises(ValidationError) as caught:
        Plain.model_validate({"width": "x"})
    (problem,) = validation_messages.problems(caught.value)
    assert problem.path == ("width",)
    assert problem.message


def test_long_values_are_cut():
    (mistake,) = mistakes({"pixel.architecture": "x" * 10_000})
    assert len(mistake) < 300


def test_second_names_are_names():
    assert {"dsnu", "prnu", "offset_pixel"} <= set(validation_messages.key_fields(FixedPattern))
    assert validation_messages.key_fields(Pixel)["width"].examples == ["6.5 um"]
