"""docs/wavefronts.md: where a point of light goes for positive odd Zernike terms."""

import numpy as np
import pytest
from making import QUIET, camera

POINT = {
    "scene.source": {
        "kind": "chart", "chart": "point-grid", "spacing": "64 um", "diameter": "1 um",
    },
    "scene.distance": "infinity",
    "optics": {"f_number": 8, "focal_length": "20 mm", "off_axis": "none"},
    "pixel.width": "1 um",
    "array.rows": 63,
    "array.columns": 63,
    "effects": QUIET,
}  # fmt: skip


def image(folder, terms):
    from vcam_cli import simulate

    return simulate(camera(folder, POINT | {"optics.zernike": terms})).mean_electrons


def brightest(found):
    """The brightest pixel, right of and below the middle [um]."""
    y, x = np.unravel_index(np.argmax(found), found.shape)
    return int(x) - 31, int(y) - 31


@pytest.mark.parametrize(("term", "place"), [(2, (13, 0)), (3, (0, 13))])
def test_tilt_moves_the_picture_by_the_slope_of_the_wavefront(term, place, tmp_path):
    """4 N c = 4 x 8 x 0.4 um = 12.8 um, right or down."""
    assert brightest(image(tmp_path, {term: "0.4 um"})) == place


@pytest.mark.parametrize(("term", "axis"), [(8, 0), (7, 1)])
def test_the_head_of_a_positive_coma_lies_left_or_above(term, axis, tmp_path):
    """The slope in the pupil's middle is -2 sqrt(8) c: they land left of (above) it."""
    head = brightest(image(tmp_path, {term: "0.25 um"}))
    assert head[axis] < -1
    assert head[1 - axis] == 0
    mirrored = brightest(image(tmp_path, {term: "-0.25 um"}))
    assert mirrored[axis] == -head[axis]
