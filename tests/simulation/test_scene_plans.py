"""One camera before many scenes: `vcam plan --scenes`."""

import csv
import json
import os
import time
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from vcam_cli import load
from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.simulation import scene_plans, scene_times
from vcam_cli.simulation.output.scene_plans_plot import plot_scene_plans
from vcam_cli.simulation.plan import Decision, Plan
from vcam_cli.simulation.scene_plans import ScenePlan
from vcam_cli.simulation.scene_times import SceneTimes
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


@pytest.mark.draws
def test_the_command_writes_a_table_and_a_picture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sets = [word for each in SMALL for word in ("--set", each)]
    scenes = ["--scenes", "slanted-edge", "--scenes", "colorchecker"]
    done = CliRunner().invoke(
        app, ["plan", "starter", *sets, *scenes, "-o", "plans", "--format", "svg"]
    )
    assert done.exit_code == 0, done.output
    assert "slanted-edge" in done.stdout
    for words in ("Blank: skipped", "free: could be skipped", "estimated for one core"):
        assert words in " ".join(done.stdout.split())
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
    sharp = "pixel.width=60 um", "accuracy=draft"
    edge = planned("slanted-edge", "array.rows=400", "array.columns=500", *sharp)
    for ready in (wall, edge):
        states = {d.name: d.state for d in ready.plan.decisions}
        assert states["diffraction"] == "off"
        assert not ready.spectrum.terms
    assert wall.plan.seconds <= wall.plan.seconds_of_all < 1.1 * wall.plan.seconds
    assert edge.plan.seconds_of_all - edge.plan.seconds > 1e-3  # [s]


def line(name="read_noise", **changes):
    """A decision as a plan makes it."""
    plain = Decision(name, "on", "plan", "", 0.03, 0.01, "of temporal variance", 1e-3)
    return replace(plain, **changes)


def drawn(folder, *decisions, times=None):
    """Bytes of the picture of one scene with these decisions."""
    plan = Plan(decisions, (), None, 0.2, 0, 0.3)
    plot_scene_plans(folder / "scenes.png", "made", [ScenePlan("wall", plan, times)], "")
    return (folder / "scenes.png").read_bytes()


def test_cells_say_what_became_of_an_effect():
    off = {"state": "off", "seconds": 0.0}
    cases = {
        "on": line(),
        "free": line(free=True),
        "1.2": line(**off, saved=1.234e-3),
        "": line(**off, saved=1e-6),
        "off": line(**off, by="user", saved=1.0),
    }
    assert {text: scene_plans.mark(d) for text, d in cases.items()} == {t: t for t in cases}


@pytest.mark.draws
def test_the_picture_colors_what_a_plan_may_skip(tmp_path):
    """The share of quantization, which is never skipped, changes nothing in it."""
    for name, is_colored in (("read_noise", True), ("quantization", False)):
        one, more = (drawn(tmp_path, line(name, contribution=share)) for share in (0.02, 5.0))
        assert (one != more) == is_colored, name


@pytest.mark.draws
@pytest.mark.long
def test_the_picture_shows_skipped_effects_by_the_time_that_they_save(tmp_path):
    skipped = [line(state="off", saved=s, contribution=c) for s, c in ((0, 1e-3), (0, 1e-5))]
    nothing = drawn(tmp_path, skipped[0])
    assert drawn(tmp_path, skipped[1]) == nothing, "white, whatever its share"
    assert drawn(tmp_path, replace(skipped[0], saved=2e-3)) != nothing
    assert drawn(tmp_path, replace(skipped[0], saved=1e-6)) == nothing
    assert drawn(tmp_path, line()) != nothing
    assert drawn(tmp_path, skipped[0], times=SceneTimes((0.2,), (0.3,))) != nothing, "measured"


def test_runs_alternate_and_their_medians_count(monkeypatch):
    camera = load("starter", [*SMALL, "effects={read_noise: off, off_axis: on}"])
    decisions = prepare(camera, 1)[0].plan.decisions
    took = iter([9, 9, 1, 2, 20, 10, 3, 90])  # two to warm up, then three turns of two
    clock, order, processors = [0.0], [], set()

    def frame(made, workers):
        order.append("auto" if made is camera else "all")
        processors.add(len(os.sched_getaffinity(0)))
        clock[0] += next(took)
        states = {name for name, wish in made.effects.items() if wish == "off"}
        assert states == {"read_noise"}
        assert made is camera or made.effects["diffraction"] == "on"

    monkeypatch.setattr(scene_times, "compute_frame", frame)
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    before = os.sched_getaffinity(0)
    found = scene_times.measure(camera, decisions, 1, turns=3)
    assert order[2:] == ["auto", "all", "all", "auto", "auto", "all"]
    assert set(order[:2]) == {"auto", "all"}
    assert (found.auto, found.every) == ((1, 10, 3), (2, 20, 90))
    assert (found.seconds_auto, found.seconds_all) == (3, 20)
    assert processors == {1}
    assert os.sched_getaffinity(0) == before


def test_measured_seconds_are_written_and_said(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sets = [word for each in ("array.rows=16", "array.columns=20") for word in ("--set", each)]
    asked = ["--scenes", "colorchecker", "--measure", "--turns", "2", "--workers", "1"]
    done = CliRunner().invoke(app, ["plan", "starter", *sets, *asked, "-o", "plans"])
    assert done.exit_code == 0, done.output
    said = " ".join(done.stdout.split())
    assert "measured: the median of 2 turns after a warm-up, 1 worker." in said
    with (tmp_path / "plans" / "scenes.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0])[-2:] == ("seconds_auto", "seconds_all")
    assert len({(row["seconds_auto"], row["seconds_all"]) for row in rows}) == 1
    assert all(0 < float(rows[0][name]) < 60 for name in scene_plans.MEASURED)
    record = json.loads((tmp_path / "plans" / "scenes.json").read_text())
    assert (record["turns"], record["workers"]) == (2, 1)


@pytest.mark.parametrize("asked", [["--measure"], ["--scenes", "all", "--turns", "2"]])
def test_options_that_need_others_are_refused_without_them(asked):
    done = CliRunner().invoke(app, ["plan", "starter", *asked])
    assert done.exit_code == 2
    assert "--measure needs --scenes" in done.output


def test_times_have_no_power_of_ten():
    texts = {0.0213: "0.021", 2.25: "2.2", 9.96: "10", 143.2: "143"}
    assert {time: scene_plans.time_text(time) for time in texts} == texts
