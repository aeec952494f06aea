"""radiance.exr: the scene as simulated, which is a scene again that makes the same frame."""

import numpy as np
import pytest
import yaml

from vcam_cli import load, simulate
from vcam_cli.errors import BadInput
from vcam_cli.files.images.images import open_image
from vcam_cli.files.spectral.exr import open_spectral
from vcam_cli.simulation import checks

SMALL = {
    "array.rows": 24,
    "array.columns": 32,
    "output.radiance": True,
    "effects": "all",
    "accuracy": "reference",
    "quality": [],
}
MONOCHROME = {**SMALL, "array.pattern": "monochrome", "processing": [{"black_level": "subtract"}]}


def written(camera, folder):
    """The frame, the file, and the camera that looks at the file."""
    result = simulate(camera, workers=1)
    result.save(folder / "out")
    file = folder / "out/radiance.exr"
    with open_image(file) as source:
        said = yaml.safe_load("{" + source.spec().get_string_attribute("vcam:scene") + "}")
    again = camera.model_dump(mode="json")
    for key in ("luminance", "radiance", "illuminance", "irradiance", "illuminant"):
        again["scene"].pop(key, None)
    again["scene"] |= {"source": {"kind": "hyperspectral", "file": str(file)}, **said}
    again["output"]["radiance"] = False
    (folder / "again.yaml").write_text(yaml.safe_dump(again), "utf-8")
    return result, file, load(folder / "again.yaml")


def test_a_picture_read_back_makes_the_same_frame(tmp_path):
    """Automatic exposure and color included: the file keeps its perfect white."""
    camera = load("hdr-scene").with_(SMALL)
    result, _, again = written(camera, tmp_path)
    second = simulate(again, workers=1)
    assert second.exposure_time == pytest.approx(result.exposure_time, rel=1e-4)
    np.testing.assert_allclose(
        second.mean_electrons, result.mean_electrons, atol=1e-4 * result.mean_electrons.max()
    )


def test_the_radiance_of_a_gray_is_light_times_reflectance(tmp_path):
    """Eq 2.34, and a uniform chart in a picture that has no margin at infinity."""
    gray = {"scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0.25},
            "scene.illuminant": "equal-energy", "scene.distance": "infinity"}  # fmt: skip
    result, file, again = written(load("starter").with_({**MONOCHROME, **gray}), tmp_path)
    data = open_spectral(file)
    values = np.asarray(data.read(), float)
    white = data.white / 1e9
    assert values.shape[:2] == (24 * 4, 32 * 4)
    np.testing.assert_allclose(values, 0.25 * white[0], rtol=1e-6)
    np.testing.assert_allclose(
        simulate(again, workers=1).mean_electrons, result.mean_electrons, rtol=1e-4
    )


def test_cells_of_a_chart_keep_its_light(tmp_path):
    """Edges within a cell are smeared; what the array collects is the chart's to 1e-3."""
    edge = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}, "accuracy": "draft"}
    result, _, again = written(load("starter").with_({**MONOCHROME, **edge}), tmp_path)
    second = simulate(again, workers=1)
    assert second.mean_electrons.mean() == pytest.approx(result.mean_electrons.mean(), rel=1e-3)
    assert np.abs(second.mean_electrons - result.mean_electrons).max() < (
        0.05 * result.mean_electrons.max()
    )


def test_scenes_of_several_distances_are_refused():
    with pytest.raises(BadInput, match="several distances"):
        checks.load("table-top", ["output.radiance=true"])


def test_a_wrong_white_in_a_file_is_refused(tmp_path):
    from vcam_cli.files.file_checks import UnusableFile
    from vcam_cli.files.spectral.exr import RADIANCE, WHITE, write_spectral

    for text in ("1,x", "1", "nan,1", "-1,1", "0,0"):
        file = tmp_path / "wrong.exr"
        plane = np.ones((2, 3))
        write_spectral(file, [5e-7, 6e-7], [plane, plane], (2, 3), RADIANCE[1], {WHITE: text})
        with pytest.raises(UnusableFile, match=WHITE):
            open_spectral(file)
