"""The shipped street: drawn by its script, and seen as closed forms have it."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from vcam_cli import load, simulate
from vcam_cli.files.images.images import read_picture

ROOT = Path(__file__).parents[2]
QUIET = {name: "off" for name in ("shot_noise", "read_noise", "fpn", "quantization")}


def test_the_shipped_file_is_what_its_script_draws():
    spec = importlib.util.spec_from_file_location("make_street", ROOT / "scripts/make_street.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    shipped = read_picture(str(script.FILE), "linear", 1.0, ()).data
    np.testing.assert_array_equal(np.rint(shipped * 255), script.street())


def test_its_bands_are_those_of_its_lamp():
    """(max - min) / (max + min) = 60 % x sinc(100 Hz x 4 ms), within 0.5 %; dark 2.4 times."""
    camera = load("street").with_({"effects": QUIET})
    steady = simulate(camera.with_({"scene.illuminant": "FL3"})).mean_electrons
    bands = (simulate(camera).mean_electrons / steady).mean(axis=1)
    contrast = (bands.max() - bands.min()) / (bands.max() + bands.min())
    assert contrast == pytest.approx(0.6 * np.sinc(0.4), rel=0.005)
    assert np.diff(bands > 1).sum() == 5  # 24 ms at 100 Hz
