"""`--set` of studies: keys of the study, and paths of a camera with dots in them."""

from pathlib import Path

import pytest

from vcam_cli.capture_schedules import schedule_file
from vcam_cli.config.study_overrides import split_sets, study_path
from vcam_cli.config.yaml_reader import read_text
from vcam_cli.config.yaml_tree import Source
from vcam_cli.errors import BadInput

STUDY = """
vary: {pixel.width: {start: 4 um, stop: 6 um, count: 3}}
repeat: {scene.source.phase: [0 deg]}
cases: {dim.1: {scene.luminance: 1 cd/m2, vary: {adc.bits: {values: [8]}}}, other: {}}
figures: {best: {show: curves, set: {exposure.time: 30 ms}}}
seeds: 2
"""


@pytest.mark.parametrize(
    ("path", "keys"),
    [
        ("seeds", ["seeds"]),
        ("vary.pixel.width.count", ["vary", "pixel.width", "count"]),
        ("vary.pixel.width", ["vary", "pixel.width"]),
        ("vary.adc.bits.values", ["vary", "adc.bits", "values"]),
        ("vary.adc.bits", ["vary", "adc.bits"]),
        ("vary.exposure.time.log_uniform", ["vary", "exposure.time", "log_uniform"]),
        ("repeat.scene.source.phase", ["repeat", "scene.source.phase"]),
        ("repeat.scene.source.angle", ["repeat", "scene.source.angle"]),
        ("cases.dim.1.scene.luminance", ["cases", "dim.1", "scene.luminance"]),
        ("cases.other.scene.luminance", ["cases", "other", "scene.luminance"]),
        ("cases.dim.1.vary.adc.bits.values", ["cases", "dim.1", "vary", "adc.bits", "values"]),
        ("cases.new.vary.adc.bits.count", ["cases", "new", "vary", "adc.bits", "count"]),
        ("figures.best.set.exposure.time", ["figures", "best", "set", "exposure.time"]),
        ("figures.best.show", ["figures", "best", "show"]),
    ],
)
def test_keys_of_a_study(path, keys):
    tree = read_text(STUDY, Source("study.yaml", Path()))
    assert list(study_path(tuple(path.split(".")), tree)) == keys


def test_what_begins_with_no_key_of_the_study_is_its_cameras():
    sets = ["seeds=3", "seed.frame=3", "vary.a.b.values=[1]", "pixel.width=4 um"]
    own, camera = split_sets(sets, {"seeds", "vary"})
    assert own == ("seeds=3", "vary.a.b.values=[1]")
    assert camera == ("seed.frame=3", "pixel.width=4 um")


def test_a_schedule_hands_keys_to_its_camera():
    sets = ["counts=[2]", "array.rows=10", "array.columns=12"]
    read = schedule_file.read("captures-hdr-scene", sets)
    assert read.model.counts == (2,)
    assert (read.camera.array.rows, read.camera.array.columns) == (10, 12)
    with pytest.raises(BadInput, match="array"):
        schedule_file.read("captures", ["array.rows=10"])
