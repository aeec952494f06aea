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
    "accuracy": {"tolerance": 1e-4},
    "scene.wavelengths": {"start": "400 nm", "stop": "700 nm", "step": "20 nm"},
    "quality": [],
}
MONOCHROME = {**SMALL, "array.pattern": "monochrome", "processing": [{"black_level": "subtract"}]}


def written(camera, folder):
    """The frame, the file, and the camera that looks at the file."""
    result = simulate(camera, workers=1)
    folder.mkdir(exist_ok=True)
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


CHARTS = {
    "csf": {"max_frequency": "33 lp/mm"},
    "slanted-edge": {},
    "siemens-star": {},
    "colorchecker": {},
    "step-wedge": {},
    "eye-chart": {},
    "dead-leaves": {},
    "sinusoid": {"frequency": "30 lp/mm", "contrast": 1},
    "point-grid": {"spacing": "60 um", "diameter": "5 um"},
    "hdr-patches": {},
    "uniform": {},
    "dark": {},
}
"""Every chart, with the keys that it needs."""
CAMERAS = {
    "a sharp lens": {},
    "no blur": {"optics.diffraction": False},
    "oblong pixels": {"pixel.height": "9 um"},
    "at infinity": {"scene.distance": "infinity"},
    "a frame": {"scene.extent": {"width": "20 mm"}},
    "twice the samples": {"accuracy": {"tolerance": 1e-4, "oversampling": 8}},
    "standard accuracy": {"accuracy": "standard", "scene.source.chart": "step-wedge"},
    "a lens that distorts": {"optics.distortion": {"k1": -0.2}},
}
"""Cameras that sample charts differently."""
WITHIN = {"a lens that distorts": 5e-4}
"""Differences of full signal that may be larger: warps of a chart and of a picture of it err by
shares of the tolerance by themselves."""


@pytest.mark.long
def test_charts_read_back_make_the_same_frame(tmp_path):
    """Every chart before the starter, and one chart before every camera."""
    runs = [(chart, "a sharp lens") for chart in CHARTS]
    runs += [("colorchecker", name) for name in list(CAMERAS)[1:]]
    found = {}
    for number, (chart, name) in enumerate(runs):
        source = {"kind": "chart", "chart": chart} | CHARTS[chart]
        bands = {"start": "400 nm", "stop": "700 nm", "step": "20 nm"}
        keys = {**MONOCHROME, "accuracy": {"tolerance": 1e-4},
                "scene.source": source, "scene.wavelengths": bands} | CAMERAS[name]  # fmt: skip
        result, _, again = written(load("starter").with_(keys), tmp_path / str(number))
        second = simulate(again, workers=1)
        rate = second.mean_electrons * (result.exposure_time / second.exposure_time)
        error = np.abs(rate - result.mean_electrons).max()
        found[chart, name] = error / max(result.mean_electrons.max(), 1e-30)
    assert not {at: e for at, e in found.items() if not e < WITHIN.get(at[1], 1e-4)}


def test_samples_of_a_chart_hold_its_light(tmp_path):
    """Written or not: the frames differ by what samples blur, a quarter with twice as many.

    The chart is mirrored beyond the array at this accuracy, so that pixels at the border do not
    count.
    """
    chart = {"scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "33 lp/mm"}}
    keys = {**MONOCHROME, **chart, "array.rows": 48, "exposure": {"time": "5 ms"}}
    precise = {"tolerance": 2e-4}
    closed = simulate(
        load("starter").with_(keys | {"accuracy": precise, "output.radiance": False}), 1
    )
    errors = []
    for per_pixel in (4, 8):
        finer = {"accuracy": precise | {"oversampling": per_pixel}}
        sampled = simulate(load("starter").with_(keys | finer), 1)
        assert any(f"in {per_pixel} samples per pixel" in note for note in sampled.notes)
        change = np.abs(sampled.mean_electrons - closed.mean_electrons)[12:-12, 8:-8]
        errors.append(change.max() / closed.mean_electrons.max())
    assert errors[0] < 1e-3
    assert errors[1] < 0.5 * errors[0]


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
