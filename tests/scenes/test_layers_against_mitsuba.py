"""Layers before a thin lens against Mitsuba 3: tests/data/layers_mitsuba.npz, by rays at random.

`scripts/render_layers_in_mitsuba.py` rendered it. Its three pictures are focused on one layer each.
Their noise is known: the standard error of every pixel over 32 independent renderings, 0.05 to
0.07 % of full signal. What the pictures differ by beyond that is an error of ours, and it has to be
within the one that the simulation predicts of itself, at most the tolerance.
"""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from layered_reference import Flat, Scene, changes
from making import QUIET, camera, radiance_for

from vcam_cli import simulate

ROOT = Path(__file__).parents[2]
RENDERED = np.load(ROOT / "tests/data/layers_mitsuba.npz")


def scene(focus: float) -> Scene:
    keys = "distance", "light", "opacity", "width", "position"
    layers = []
    for distance, light, opacity, width, place in zip(*(RENDERED[k] for k in keys), strict=True):
        x, y = place
        layers.append(Flat(float(distance), light, opacity, float(width), (float(x), float(y))))
    return Scene(tuple(layers), focus)


def picture(focus: float, side: int, accuracy: str, folder: Path) -> tuple[np.ndarray, float]:
    """The simulated picture over white, and the error it predicts of the layers' order."""
    given = changes(scene(focus), folder) | {
        "array.rows": side,
        "array.columns": side,
        "scene.radiance": radiance_for(40000),
        "effects": QUIET | {"diffraction": "off"},
        "accuracy": accuracy,
    }
    frame = simulate(camera(folder, given)).frame
    white = frame.white_rate[0] * frame.exposure_time
    return frame.mean_electrons / white, frame.spectrum.depth.error


def check(found: np.ndarray, mean: np.ndarray, error: np.ndarray, allowed: float) -> None:
    """Chi-square per pixel below 1, of the noise and of an error of ours, relative to white."""
    expected = math.hypot(np.sqrt(np.mean(np.square(error))), allowed)
    # 4096 pixels: five standard errors of their mean square, taken as normal.
    most = 1 + 5 * math.sqrt(2 / found.size)
    assert np.mean(np.square(found - mean)) <= most * expected**2
    # Nothing is displaced by a hundredth of a pixel.
    for axis in (0, 1):
        slope = np.gradient(mean, axis=axis)
        moved = np.sum((found - mean) * slope) / np.sum(np.square(slope))
        assert abs(moved) <= 0.01


@pytest.mark.parametrize(
    ("number", "accuracy", "most"),
    [
        (0, "standard", 0.005),
        *(pytest.param(n, "0.2 %", 0.002, marks=pytest.mark.long) for n in range(3)),
    ],
)
def test_three_layers_are_what_mitsuba_renders(number, accuracy, most, tmp_path):
    focus, mean = float(RENDERED["focus"][number]), RENDERED["mean"][number]
    found, predicted = picture(focus, len(mean), accuracy, tmp_path)
    assert predicted <= most
    check(found, mean, RENDERED["standard_error"][number], predicted * mean.max())


@pytest.mark.long
def test_the_file_is_what_the_script_renders():
    """Two renderings of other random numbers, where Mitsuba is installed."""
    pytest.importorskip("mitsuba")
    render = runpy.run_path(str(ROOT / "scripts/render_layers_in_mitsuba.py"))["render"]
    for number, focus in enumerate(RENDERED["focus"]):
        mean, _ = render(float(focus), seeds=range(1000, 1002))
        # The file's standard error is of 32 renderings, that of these two 4 times as large.
        noise = np.sqrt(np.mean(np.square(RENDERED["standard_error"][number])) * (1 + 16))
        assert np.sqrt(np.mean(np.square(mean - RENDERED["mean"][number]))) <= 1.2 * noise
