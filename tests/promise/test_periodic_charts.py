"""The accuracy promise on charts of sharp or ever finer content: the engine against exact truths.

Rms over the array of (mean raw - truth) within the tolerance of full signal, at every preset.
"""

import pytest
from chart_cameras import CAMERAS, QUICK
from exact_errors import mean_error


@pytest.mark.parametrize("name", QUICK)
def test_charts(name, tmp_path):
    found = mean_error(CAMERAS[name], tmp_path)
    assert max(found.over_tolerance.values()) <= 1, found


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in CAMERAS if name not in QUICK])
def test_more_charts(name, tmp_path):
    found = mean_error(CAMERAS[name], tmp_path)
    assert max(found.over_tolerance.values()) <= 1, found
