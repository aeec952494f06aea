"""Seconds that are foretold: what they have to grow with, and what they must not grow with."""

import numpy as np
import pytest
from making import GONE, QUIET, camera

from vcam_cli.effects.noise.fpn import DRAW
from vcam_cli.files.images.png import write_png
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


def test_draws_of_a_pattern_that_are_skipped_are_seconds_saved(tmp_path):
    """Offsets of 1e-3 electrons beside gains of 1 %: their draw is left out, and foretold."""
    pattern = {"pixel.fpn": {"offset_pixel": "0.001 e", "gain_pixel": "1 %"}}
    planned = {}
    for effects in ("auto", "all"):
        changes = MOSAIC | pattern | {"effects": effects}
        planned[effects] = prepare(camera(tmp_path, changes), 1)[0]
    fpn = {
        effects: next(d for d in ready.plan.decisions if d.name == "fpn")
        for effects, ready in planned.items()
    }
    pixels = planned["all"].geometry.rows * planned["all"].geometry.columns
    assert "skipped parts: offset_pixel" in fpn["auto"].reason
    assert fpn["auto"].saved == pytest.approx(DRAW * pixels)
    assert fpn["auto"].seconds + fpn["auto"].saved == pytest.approx(fpn["all"].seconds)
    plan = planned["auto"].plan
    slow = cost_model.slowness() / cost_model.threads(1)
    assert plan.seconds_of_all - plan.seconds >= 0.99 * slow * DRAW * pixels


def test_light_that_is_formed_again_saves_again(tmp_path):
    """A camera meters a scene that moves at rest, and skips blurs of even light there, too."""
    write_png(tmp_path / "gray.png", np.full((200, 300), 120, np.uint8))
    source = {"kind": "image", "file": "gray.png", "model": "reflectance", "encoding": "linear"}
    even = {
        "scene.source": source,
        "scene.radiance": GONE,
        "scene.illuminant": "D65",
        "scene.luminance": "100 cd/m2",
        "scene.camera_motion": {"pan": "5 deg/s"},
        "effects": QUIET | {"motion": "on"},
    }
    saved, each = [], []
    for exposure in ({"time": "10 ms"}, {"auto": {"method": "white", "max": "1 s"}}):
        plan = prepare(camera(tmp_path, even | {"exposure": exposure}), 1)[0].plan
        saved.append(plan.seconds_of_all - plan.seconds)
        each.append(next(d.saved for d in plan.decisions if d.name == "diffraction"))
    assert each[1] == pytest.approx(2 * each[0], rel=1e-6)
    assert saved[1] == pytest.approx(2 * saved[0], rel=0.01), "draws are skipped once"
