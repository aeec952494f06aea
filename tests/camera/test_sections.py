"""Cameras made of another one and some sections of a file: as the whole file says."""

import numpy as np
import pytest
import yaml
from making import tree

from vcam_cli.camera import load
from vcam_cli.camera.sections import with_sections
from vcam_cli.config.yaml_tree import Node
from vcam_cli.files.images.png import write_png
from vcam_cli.simulation.checks import CHECKS

BASE = {
    "scene.illuminant": "D65",
    "scene.radiance": "0.02 W/(sr m2)",
    "pixel.readout.read_noise": "6 e",
    "adc.offset": "40 DN",
    "seed.frame": 3,
}
CHANGES = [
    {"exposure.time": "3 ms"},
    {"exposure.gain": 4, "seed.frame": 9},
    {"pixel.readout.read_noise": "1 e", "adc.offset": "7 DN"},
    {"pixel.fpn.gain_pixel": "1 %", "array.pattern": "bayer-rggb"},
    {"array.rows": 12, "optics.f_number": 8},
    {"scene.source": {"kind": "image", "file": "two.png"}},
    {"scene.source": {"kind": "image", "file": "two.png", "crop": {"row": 1, "column": 2,
                                                                   "rows": 3, "columns": 4}}},
    {"scene.wavelengths": {"start": "450 nm", "stop": "650 nm"}, "exposure.time": "4 ms"},
]  # fmt: skip


@pytest.fixture
def file(tmp_path):
    for name in ("one", "two"):
        write_png(tmp_path / f"{name}.png", np.full((8, 9, 3), 90, np.uint8))
    source = {"scene.source": {"kind": "image", "file": "one.png"}}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(tree(BASE | source)))
    return load.read(tmp_path / "camera.yaml", tmp_path)


def changed(file, changes):
    sets = [f"{path}={yaml.safe_dump(value, default_flow_style=True)}" for path, value in
            changes.items()]  # fmt: skip
    return file.overlay(
        load.overlay([text.removesuffix("...\n") for text in sets], file.file.parent)
    )


def test_it_is_the_camera_of_the_whole_file(file):
    """Each from each: values, what was given, files, places."""
    documents = [changed(file, changes) for changes in CHANGES]
    cameras = [document.validate(CHECKS) for document in documents]
    for known, before in zip(cameras, CHANGES, strict=True):
        for whole, document, changes in zip(cameras, documents, CHANGES, strict=True):
            sections = {path.partition(".")[0] for path in (*before, *changes)}
            found = with_sections(known, document, sections, CHECKS)
            assert found == whole
            assert found.model_fields_set == whole.model_fields_set
            assert found.model_dump(mode="json") == whole.model_dump(mode="json")
            assert found.files == whole.files
            assert found.source_tree.tree.plain() == whole.source_tree.tree.plain()
            assert found.locate(("exposure",)) == whole.locate(("exposure",))


@pytest.mark.parametrize(
    "changes",
    [
        {"exposure.time": "-3 ms"},
        {"scene.source.file": "three.png"},
        {"scene.source.crop": {"row": 7, "column": 2, "rows": 3, "columns": 4}},
        {"pixel.readout.gains": [1, 8], "array.binning": {"rows": 2, "columns": 2}},
        {"scene.wavelengths.outside": "zero"},
    ],
)
def test_what_is_wrong_or_reaches_further_is_left_to_the_whole_file(file, changes):
    known = file.validate(CHECKS)
    sections = {path.partition(".")[0] for path in changes}
    assert with_sections(known, changed(file, changes), sections, CHECKS) is None


def test_a_section_that_is_not_in_the_file_is_left_to_the_whole_file(file):
    known = file.validate(CHECKS)
    document = changed(file, {"display.dpi": 90})
    assert isinstance(document.tree, Node)
    assert with_sections(known, document, {"display"}, CHECKS) is None
