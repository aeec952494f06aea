"""Steps of an installed package: a wheel is built, installed, and named in camera files."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from vcam_cli import load, simulate
from vcam_cli.camera import step_plugins
from vcam_cli.camera.step_plugins import plugin
from vcam_cli.errors import BadInput
from vcam_cli.sweeps.sweep_points import hash_of

PACKAGE = Path(__file__).parent / "step_package"
CAMERA = """
scene: {source: {kind: chart, chart: colorchecker}, luminance: 100 cd/m2}
optics: {f_number: 2.8, focal_length: 4 mm}
pixel:
  width: 4 um
  photodetector: {fill_factor: 0.5, quantum_efficiency: 0.6}
  readout: {conversion_gain: 50 uV/e, full_well: 10 ke, read_noise: 5 e}
array: {rows: 40, columns: 60, pattern: bayer-rggb}
exposure: {time: 20 ms}
quality: [mse]
"""
BEFORE = "{black_level: subtract}, {demosaic: bilinear}, {white_balance: illuminant}"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    place = tmp_path_factory.mktemp("packages")
    line = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation",
            "--no-index", "--target", str(place), str(PACKAGE)]  # fmt: skip
    subprocess.run(line, check=True, capture_output=True)
    return place


@pytest.fixture
def folder(installed, tmp_path, monkeypatch):
    """A folder for camera files, while the package is installed."""
    monkeypatch.syspath_prepend(installed)
    plugin.cache_clear()
    yield tmp_path
    plugin.cache_clear()


def camera(folder, steps):
    file = folder / "camera.yaml"
    file.write_text(f"{CAMERA}processing: [{steps}]\n", encoding="utf-8")
    return load(file)


def test_steps_of_a_package_are_done_where_they_stand(folder):
    plain = simulate(camera(folder, f"{BEFORE}, {{gamma: srgb}}"))
    steps = f"{BEFORE}, {{median: 3x3}}, {{gamma: srgb}}, {{posterize: 4}}"
    mapped = simulate(camera(folder, steps))
    assert set(np.unique(mapped.render)) <= {0, 85, 170, 255}
    # A median commutes with the monotone tone curve: of codes it is the code of the median.
    median = ndimage.median_filter(plain.render, size=(3, 3, 1), mode="mirror")
    np.testing.assert_array_equal(mapped.render, (np.round(median / 85) * 85).astype(np.uint8))
    assert mapped.metrics["mse"] != plain.metrics["mse"]
    np.testing.assert_array_equal(mapped.ideal, plain.ideal)


def test_the_record_names_the_package_and_results_depend_on_its_code(folder, monkeypatch):
    made = camera(folder, f"{BEFORE}, {{median: 3x3}}")
    simulate(made).save(folder / "out")
    record = json.loads((folder / "out/run.json").read_text(encoding="utf-8"))
    assert record["versions"]["step median"] == "vcam-example-steps 1.2"
    assert {"median": "3x3"} in record["camera"]["processing"]
    form = made.model_dump(mode="json")
    before = hash_of(made, form, {})
    monkeypatch.setattr(step_plugins, "_file_hash", lambda kind: "other")
    assert hash_of(made, form, {}) != before


def test_a_step_that_changes_colors_changes_those_of_the_ideal_image(folder):
    plain, same, none = (
        simulate(camera(folder, BEFORE + step)) for step in ("", ", {tint: 1}", ", {tint: 0}")
    )
    np.testing.assert_array_equal(same.linear, plain.linear)
    assert none.linear[..., 2].max() == none.ideal[..., 2].max() == 0
    # What is left of white has luminance 1 again: its blue was 7.22 % of it (ITU-R BT.709).
    np.testing.assert_allclose(none.ideal[..., 1], plain.ideal[..., 1] / 0.9278, rtol=1e-5)


@pytest.mark.parametrize(
    ("steps", "parts"),
    [
        ("{broken: 1}", ("example_steps:Nothing cannot be imported", "vcam-example-steps 1.2")),
        ("{medean: 3x3}", ("median",)),
        ("{median: 3x3}", ("a pixel of a mosaic has one color only", "put demosaic before it")),
        (f"{BEFORE}, {{median: 5x5}}", ("processing.3.median", "3x3")),
        (f"{BEFORE}, {{gamma: 2.2}}, {{median: 3x3}}", ("median after gamma",)),
        (f"{BEFORE}, {{posterize: 4}}, {{gamma: 2.2}}", ("gamma after posterize",)),
    ],
)
def test_what_is_wrong_with_a_step_is_told(folder, steps, parts):
    with pytest.raises(BadInput) as caught:
        camera(folder, steps)
    assert all(part in str(caught.value) for part in parts), caught.value


def test_a_step_that_changes_the_size_of_the_picture_is_refused(folder, monkeypatch):
    made = camera(folder, f"{BEFORE}, {{median: 3x3}}")
    kind = type(made.processing[-1])
    monkeypatch.setattr(kind, "process", lambda self, picture: picture[:, 1:])
    with pytest.raises(BadInput, match=r"processing.3.median.*the step median makes"):
        _ = simulate(made).render


def raising(error):
    def process(self, picture):
        raise error

    return process


def with_nan(self, picture):
    picture[0, 0, 0] = np.nan
    return picture


@pytest.mark.parametrize(
    ("method", "process", "said"),
    [
        ("process", raising(RuntimeError("no luck")), "ends with RuntimeError: no luck"),
        ("process", raising(SystemExit(3)), "ends with SystemExit: 3"),
        ("process", raising(KeyError()), "ends with KeyError"),
        ("process", with_nan, "makes values that are not finite"),
        ("process", lambda self, picture: None, r"makes \(\) of"),
        ("process", lambda self, picture: [[1, 2], [3]], "ends with ValueError"),
        (
            "process",
            lambda self, picture: picture.astype(complex),
            "makes numbers of the type complex128",
        ),
        ("process", lambda self, picture: picture.astype(str), "makes numbers of the type <U"),
        ("process_ideal", lambda self, colors: colors[:1], "makes"),
        ("process_ideal", raising(ZeroDivisionError("x")), "ends with ZeroDivisionError: x"),
    ],
)
def test_whatever_a_step_does_is_told_with_its_name(folder, monkeypatch, method, process, said):
    made = camera(folder, f"{BEFORE}, {{median: 3x3}}")
    monkeypatch.setattr(type(made.processing[-1]), method, process)
    with pytest.raises(BadInput, match=rf"processing.3.median: the step median {said}"):
        _ = simulate(made).metrics["mse"]


@pytest.mark.parametrize(
    ("attribute", "value", "said"),
    [
        ("acts_on", "pixels", "acts_on 'pixels', not one of light, colors, codes"),
        ("acts_on", None, "acts_on None"),
        ("halo", -1, "halo is -1, not a whole number from 0 to 1000"),
        ("halo", 10**9, "halo is 1000000000"),
        ("halo", 2.5, "halo is 2.5"),
        (
            "model_validate",
            classmethod(raising(RuntimeError("no"))),
            "cannot be made: RuntimeError: no",
        ),
        ("model_validate", classmethod(raising(SystemExit())), "cannot be made: SystemExit"),
    ],
)
def test_what_a_step_says_wrongly_of_itself_is_refused(folder, monkeypatch, attribute, value, said):
    kind = plugin("median")
    monkeypatch.setattr(kind, attribute, value)
    plugin.cache_clear()
    with pytest.raises(BadInput) as caught:
        camera(folder, f"{BEFORE}, {{median: 3x3}}")
    assert said in str(caught.value)
    assert "median" in str(caught.value)


def test_they_are_listed_beside_our_own(installed):
    path = os.pathsep.join([str(installed), *sys.path])
    line = [sys.executable, "-m", "vcam_cli.commands.main", "list", "steps"]
    environment = os.environ | {"PYTHONPATH": path}
    done = subprocess.run(line, env=environment, capture_output=True, text=True, check=True)
    listed = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    assert listed["posterize"] == "step of vcam-example-steps 1.2"
    assert {"demosaic", "jpeg"} <= set(listed)
