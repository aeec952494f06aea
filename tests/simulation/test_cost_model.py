"""Seconds that are foretold: what they have to grow with, and what they must not grow with."""

import pytest
from making import camera

from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.mosaic import mosaic
from vcam_cli.simulation import cost_model

JUDGED = {"quality": ["s-cielab"], "processing": [{"gamma": 2.2}], "output.render": 8}


def foretold(folder, **display) -> float:
    made = camera(folder, JUDGED | {"display": {"filters": "continuous", **display}})
    return cost_model.output_seconds(made, geometry(made), mosaic(made))


def test_looking_at_a_pixel_in_many_places_is_foretold(tmp_path) -> None:
    """64 pixels in 512 inches are looked at in 33 x 33 places each, as are those in 5000."""
    fine = foretold(tmp_path, dpi=72)
    coarse = foretold(tmp_path, width="512 in")
    assert coarse > 100 * fine
    assert foretold(tmp_path, width="5000 in") == pytest.approx(coarse)
