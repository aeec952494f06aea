"""The accuracy promise against exact truths: point grids, which fold onto the pixels, and charts.

Rms over the array of (mean raw - truth) within the tolerance of full signal, at every preset.
"""

import chart_cameras
import periodic_cameras
import pytest
from exact_errors import mean_error

SLOW = {"colorchecker-5", "hdr-patches-3-7", "hdr-patches-4-51", "siemens-star-7"}
"""Others of their charts are quick."""
CAMERAS = periodic_cameras.CAMERAS | chart_cameras.CAMERAS
QUICK = {*periodic_cameras.QUICK, *chart_cameras.QUICK} - SLOW


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in CAMERAS]
)
def test_the_mean_is_within_the_tolerance(name, tmp_path):
    found = mean_error(CAMERAS[name], tmp_path)
    assert max(found.over_tolerance.values()) <= 1, found
