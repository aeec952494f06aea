"""One camera before many scenes: `vcam plan --scenes`."""

import csv

import pytest
from typer.testing import CliRunner

from vcam_cli import load
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.simulation import scene_plans
from vcam_cli.simulation.simulate import prepare

SMALL = ("array.rows=64", "array.columns=80")


def test_all_is_six_charts_in_three_lights():
    found = scene_plans.scene_settings(["all"])
    assert len(found) == 18
    assert found["uniform, 100 cd/m2"] == (
        "scene.source={kind: chart, chart: uniform}",
        "scene.luminance=100 cd/m2",
    )


def test_scenes_call_for_different_effects():
    plans = list(scene_plans.plan_scenes("starter", SMALL, ["all"], 1))
    sets = {tuple(d.state for d in each.decisions) for each in plans}
    assert len(sets) >= 5
    states = {each.scene: {d.name: d.state for d in each.decisions} for each in plans}
    assert states["uniform, 20000 cd/m2"]["read_noise"] == "off"
    assert states["uniform, 0.5 cd/m2"]["read_noise"] == "on"
    assert states["uniform, 0.5 cd/m2"]["diffraction"] == "off"
    assert states["dead-leaves, 100 cd/m2"]["diffraction"] == "on"
    assert states["hdr-patches, 20000 cd/m2"]["saturation"] == "on"


def test_the_command_writes_a_table_and_a_picture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sets = [word for each in SMALL for word in ("--set", each)]
    scenes = ["--scenes", "slanted-edge", "--scenes", "colorchecker"]
    done = CliRunner().invoke(
        app, ["plan", "starter", *sets, *scenes, "-o", "plans", "--format", "svg"]
    )
    assert done.exit_code == 0, done.output
    assert "slanted-edge" in done.stdout
    with (tmp_path / "plans" / "scenes.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == scene_plans.COLUMNS
    assert {row["scene"] for row in rows} == {"slanted-edge", "colorchecker"}
    assert {row["state"] for row in rows} <= {"on", "off"}
    assert all(float(row["seconds"]) >= 0 for row in rows)
    assert (tmp_path / "plans" / "scenes.png").stat().st_size > 10_000
    assert "<svg" in (tmp_path / "plans" / "scenes.svg").read_text("utf-8")


def test_a_scene_that_is_not_there_is_told(tmp_path):
    with pytest.raises(BadInput):
        list(scene_plans.plan_scenes("starter", SMALL, ["no-such-scene"], 1))


def planned(chart, *sets):
    source = f"scene.source={{kind: chart, chart: {chart}}}"
    return prepare(load("starter", [*SMALL, source, *sets]), 1)[0]


def test_blurs_left_out_save_transforms_where_there_would_be_some():
    """Before a wall there are none, with every effect on either; a lens that is fine enough for its
    pixels saves those of an edge."""
    wall = planned("uniform")
    edge = planned("slanted-edge", "array.rows=400", "array.columns=500", "pixel.width=60 um")
    for ready in (wall, edge):
        states = {d.name: d.state for d in ready.plan.decisions}
        assert states["diffraction"] == "off"
        assert not ready.spectrum.terms
    assert wall.plan.seconds <= wall.plan.seconds_of_all < 1.1 * wall.plan.seconds
    assert edge.plan.seconds_of_all - edge.plan.seconds > 1e-3  # [s]
