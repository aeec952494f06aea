"""The shipped street: drawn by its script, and seen as closed forms have it."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from vcam_cli import load, simulate
from vcam_cli.files.images.images import read_picture

ROOT = Path(__file__).parents[2]
QUIET = {name: "off" for name in ("shot_noise", "read_noise", "fpn", "quantization")}


@pytest.mark.long
def test_the_shipped_files_are_what_their_script_draws():
    spec = importlib.util.spec_from_file_location("make_street", ROOT / "scripts/make_street.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for name, drawn in script.pictures().items():
        shipped = read_picture(str(script.SCENES / name), "linear", 1.0, ()).data
        np.testing.assert_array_equal(np.rint(shipped.squeeze() * 255), drawn)


def test_its_bands_are_those_of_its_lamp():
    """(max - min) / (max + min) = 60 % x sinc(100 Hz x 4 ms), within 0.5 %; dark 2.4 times."""
    camera = load("street").with_({"effects": QUIET})
    steady = simulate(camera.with_({"scene.illuminant": "FL3"})).mean_electrons
    bands = (simulate(camera).mean_electrons / steady).mean(axis=1)
    contrast = (bands.max() - bands.min()) / (bands.max() + bands.min())
    assert contrast == pytest.approx(0.6 * np.sinc(0.4), rel=0.005)
    assert np.diff(bands > 1).sum() == 5  # 24 ms at 100 Hz


def test_the_car_passes_before_the_street():
    """At 13 m, 50 km/h are 13.9 m/s x 2 mm / 13 m (1 + m): in 100 ms 53 pixels to the right."""
    camera = load("street", ["scene=passing-car"]).with_(
        {"effects": QUIET, "exposure.shutter": "global", "accuracy": "draft"}
    )
    still = str(ROOT / "configs/scenes/street-empty.png")
    behind = {"source": {"kind": "image", "file": still}, "distance": "15 m"}
    empty = camera.with_({"scene.source": {"kind": "layers", "layers": [behind]}})
    background, centers = simulate(empty).mean_electrons, []
    for start in ("0 ms", "100 ms"):
        light = simulate(camera.with_({"exposure.start": start})).mean_electrons
        changed = np.abs(light - background).max(axis=0)
        centers.append(np.flatnonzero(changed > 0.2 * changed.max())[[0, -1]].mean())
    path = 50 / 3.6 * 0.1 * 2e-3 / (13 - 2e-3) / 4e-6
    assert centers[1] - centers[0] == pytest.approx(path, abs=1.0)
