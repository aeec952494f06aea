"""scripts/read_chromatic_set.py and the page of scripts/make_validation.py, on sets made here."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
import read_chromatic_set as chromatic  # noqa: E402
import read_emva_set as emva  # noqa: E402

SIDE = 24
"""Pixels of a patch."""
REFLECTANCE = np.geomspace(0.1, 0.9, 24).round(4)
SCALE = {400: 0.001, 450: 0.9, 500: 0.7, 550: 1.0, 600: 0.8, 650: 0.3, 700: 0.05}
"""Codes a ms of a reflectance of 1, where the light is 1."""


def light(y, x):
    return np.exp(0.3 * x - 0.2 * y + 0.1 * x * y)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A chart of 24 gray patches behind filters, in uneven light, rounded to 8 bits."""
    root = tmp_path_factory.mktemp("set")
    data = root / "demo_data"
    for name in ("spectral_data", "colorChecker_labels", "captured_images/dark_frames",
                 "captured_images/images_filtered_light/color_checker"):  # fmt: skip
        (data / name).mkdir(parents=True)
    wave = np.arange(350, 781)
    header = ["Wavelength", *chromatic.FILTERS.values(), chromatic.FIRST, *map(str, range(23))]
    filters = [
        0.02 + np.exp(-(((wave - peak) / 5) ** 2)) for peak in (400, 440, 500, 550, 600, 650, 700)
    ]
    columns = [wave, *filters, *(np.full(len(wave), r) for r in REFLECTANCE)]
    with open(data / "spectral_data/spectra_averaged.csv", "w", newline="") as file:
        csv.writer(file).writerows([header, *np.array(columns).T.round(6).tolist()])
    number = np.kron(np.arange(1, 25).reshape(4, 6), np.ones((SIDE, SIDE)))
    label = np.where(np.kron(np.ones((4, 6)), np.pad(np.ones((18, 18)), 3)), number, 0)
    Image.fromarray(label.astype(np.uint8)).save(
        data / "colorChecker_labels/d2_colorChecker30cm_550nm_labels.png"
    )
    rows, across = number.shape
    y, x = np.indices(number.shape)
    falls = light((y - rows / 2) / (across / 2), (x - across / 2) / (across / 2))
    for time in chromatic.TIMES:
        dark = np.full(number.shape, 1, np.uint8)
        Image.fromarray(dark).save(data / f"captured_images/dark_frames/d2_dark_{time}ms_1.tif")
        for name, scale in SCALE.items():
            codes = 1 + scale * time * REFLECTANCE[number.astype(int) - 1] * falls
            strong = {450: (0, 1), 500: (0, 1), 600: (1, 0), 650: (1, 0), 700: (1, 0)}.get(name)
            if strong:  # the greens see a filter less well than blue or red does
                weak = np.ones((2, 2), bool)
                weak[strong] = False
                codes = np.where(np.tile(weak, (rows // 2, across // 2)), codes / 3, codes)
            file = f"d2_colorChecker30cm_{name}nm_{time}ms_1.tif"
            Image.fromarray(np.clip(np.rint(codes), 0, 255).astype(np.uint8)).save(
                data / "captured_images/images_filtered_light/color_checker" / file
            )
    return root


def test_half_of_the_patches_predict_the_others(folder):
    """But for rounding, which is half a code at most, and the light's change over a patch."""
    signals = chromatic.predict(folder)
    held = [signal for signal in signals if not signal.fitted]
    assert len({signal.patch for signal in held}) == 12
    assert {signal.filter for signal in held} == set(SCALE) - {400}  # too dark
    for signal in held:
        assert chromatic.LEAST <= signal.measured <= chromatic.MOST
        assert signal.predicted == pytest.approx(signal.measured, abs=0.5, rel=0.01)
    assert max(abs(signal.even / signal.measured - 1) for signal in held) > 0.1


def test_a_level_whose_photons_are_wrong_is_left_out():
    levels = [emva.Level(n * 1e-6, 100.0 * n) for n in range(1, 9)]
    levels += [emva.Level(0.0, 1.0), emva.Level(3.5e-6, 350.0), emva.Level(1e-6, None)]
    for level in levels:
        level.__dict__["mean"] = 3.0 + 0.1 * (level.photons or 0.0)
    levels[-2].__dict__["mean"] = 300.0
    dark, lit, said = emva.usable(levels)
    assert dark == levels[-1:]
    assert lit == levels[:8]
    assert len(said) == 2
    assert "350 photons: its mean of 300.0 DN" in said[1]
