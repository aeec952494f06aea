"""Shading of the fixed pattern: exact strength over the array, nothing above its frequency."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for
from scipy.fft import dctn

from vcam_cli import simulate

ROWS, COLUMNS = 150, 96


def pattern(folder, workers: int = 1, **given) -> np.ndarray:
    """What it adds to an even frame of 500 electrons."""
    changes = {
        "scene.radiance": radiance_for(500),
        "array": {"rows": ROWS, "columns": COLUMNS, "pattern": "monochrome"},
        "pixel.fpn.shading": given,
        "effects": QUIET | {"fpn_shading": "on"},
    }
    result = simulate(camera(folder, changes), workers)
    return (result.electrons - result.mean_electrons) / result.mean_electrons.mean() * 500


@pytest.mark.parametrize(
    ("given", "rms"),
    [
        ({"offset": "4 e"}, 4.0),
        ({"gain": "1 %"}, 5.0),
        ({"offset": "4 e", "gain": "0.6 %"}, 5.0),
        ({"offset": "4 e", "cycles": 12}, 4.0),
    ],
)
def test_strength_over_the_array(given, rms, tmp_path):
    """Exact but for rounding, and for the light of one electron in 1e9 that is not even."""
    found = pattern(tmp_path, **given)
    assert found.mean() == pytest.approx(0, abs=1e-8)
    assert found.std() == pytest.approx(rms, rel=1e-8)


@pytest.mark.parametrize("cycles", [1, 3])
def test_spectrum_ends_at_the_stated_frequency(cycles, tmp_path):
    """Discrete cosine transform by SciPy: k half cycles a side, within an ellipse."""
    power = dctn(pattern(tmp_path, offset="4 e", cycles=cycles), norm="ortho") ** 2
    radius = np.hypot(*np.meshgrid(np.arange(ROWS), np.arange(COLUMNS), indexing="ij"))
    inside = power[(radius <= 2 * cycles) & (radius > 0)]
    assert inside.sum() == pytest.approx(power.sum(), rel=1e-9)
    assert np.count_nonzero(inside > 1e-6 * power.sum()) > inside.size / 2


def test_goes_with_the_sensor_and_not_with_the_workers(tmp_path):
    one = pattern(tmp_path, offset="4 e")
    assert one.tobytes() == pattern(tmp_path, 2, offset="4 e").tobytes()
