"""Seconds that are foretold: what they have to grow with, and what they must not grow with."""

import pytest
from making import GONE, camera

from vcam_cli.simulation import cost_model
from vcam_cli.simulation.simulate import prepare
from vcam_cli.solve.solved import solve

MOSAIC = {
    "scene.illuminant": "D65",
    "scene.radiance": GONE,
    "scene.luminance": "100 cd/m2",
    "array.pattern": "quad-bayer",
    "pixel.readout.read_noise": "5 e",
}
JUDGED = {"quality": ["s-cielab"], "processing": [{"gamma": 2.2}], "output.render": 8}


def foretold(folder, **display) -> float:
    made = camera(folder, JUDGED | {"display": {"filters": "continuous", **display}})
    return cost_model.output_seconds(solve(made))


def test_looking_at_a_pixel_in_many_places_is_foretold(tmp_path) -> None:
    """64 pixels in 512 inches are looked at in 33 x 33 places each, as are those in 5000."""
    fine = foretold(tmp_path, dpi=72)
    coarse = foretold(tmp_path, width="512 in")
    assert coarse > 100 * fine
    assert foretold(tmp_path, width="5000 in") == pytest.approx(coarse)


@pytest.mark.parametrize(("kind", "joined"), [("charge", 4), ("digital", 1)])
def test_charge_of_joined_pixels_is_drawn_and_coded_once(kind, joined, tmp_path) -> None:
    """Light falls on every pixel; what acts on charge acts on what is joined before it is read."""
    seconds = []
    for binning in ("none", {"rows": 2, "columns": 2, "kind": kind}):
        ready, _ = prepare(camera(tmp_path, MOSAIC | {"array.binning": binning}))
        plan = ready.plan.report()["effects"]
        seconds.append({e["name"]: e["seconds"] for e in plan if e["state"] == "on"})
    each, together = seconds
    for name in ("shot_noise", "read_noise", "quantization"):
        assert together[name] == pytest.approx(each[name] / joined)
