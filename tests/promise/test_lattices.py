"""The accuracy promise on point grids, which fold onto the pixels: the engine against the truth.

Rms over the array of (mean raw - truth) within the tolerance of full signal, at every preset.
"""

import pytest
from exact_errors import mean_error
from periodic_cameras import CAMERAS, QUICK


@pytest.mark.parametrize("name", QUICK)
def test_point_grids(name, tmp_path):
    found = mean_error(CAMERAS[name], tmp_path)
    assert max(found.over_tolerance.values()) <= 1, found


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in CAMERAS if name not in QUICK])
def test_more_point_grids(name, tmp_path):
    found = mean_error(CAMERAS[name], tmp_path)
    assert max(found.over_tolerance.values()) <= 1, found
