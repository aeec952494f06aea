"""The survey of a scene: what it says of blurs, against frames with and without them."""

import numpy as np
import pytest
from making import QUIET, camera, long_except, radiance_for

from vcam_cli import simulate
from vcam_cli.image_formation import light_plan, photon_rate
from vcam_cli.image_formation.estimates import scene_detail
from vcam_cli.simulation.simulate import prepare

SIZE = {"array.rows": 240, "array.columns": 320}
BLURS = ("diffraction", "pixel_aperture")


def chart(name: str, **more) -> dict:
    return {"scene.source": {"kind": "chart", "chart": name, **more}}


def detail_of(tmp_path, monkeypatch, changes: dict):
    """The detail of a camera's scene, the path, and the transfer functions at its frequencies."""
    found = []

    def survey(path, scene):
        found.append((path, scene_detail.scene_detail(path, scene)))
        return light_plan.LightPlan()

    monkeypatch.setattr(photon_rate, "light_plan", survey)
    prepare(camera(tmp_path, {"effects": "auto"} | changes), 1)
    path, detail = found[0]
    functions = {} if detail is None else scene_detail.transfer_functions(path, detail)
    return path, detail, functions


def estimate(tmp_path, monkeypatch, changes: dict, name: str) -> float:
    """The estimated change by leaving out a blur, relative to the brightest light of the survey."""
    _, detail, functions = detail_of(tmp_path, monkeypatch, changes)
    [effect] = [e for e in functions if e.name == name]
    return scene_detail.change_by_omission(detail, functions, [effect]) / detail.brightest


def change(tmp_path, changes: dict, name: str) -> float:
    """The same, from two frames, relative to full signal."""
    on, off = (
        np.asarray(simulate(camera(tmp_path, changes | {"effects": QUIET | own})).mean_electrons)
        for own in ({n: "on" for n in BLURS}, {n: "on" for n in BLURS} | {name: "off"})
    )
    return float(np.sqrt(np.mean((on - off) ** 2)) / on.max())


SCENES = {
    "edge": chart("slanted-edge"),
    "patches": chart("colorchecker"),
    "leaves": chart("dead-leaves", seed=3),
    "star": chart("siemens-star", spokes=36),
    # ten steps of 32 pixels: as wide as a tile, and where tiles would lie
    "steps as wide as tiles": chart("step-wedge", steps=10),
    "sinusoid": chart("sinusoid", frequency="30 lp/mm", orientation="20 deg"),
    "letters": chart("eye-chart"),
}


@pytest.mark.parametrize("name", BLURS)
@pytest.mark.parametrize("scene", long_except(SCENES.keys() - {"leaves", "letters"}, SCENES))
def test_the_estimate_is_what_leaving_it_out_changes(scene, name, tmp_path, monkeypatch):
    """Of few tiles, with two standard errors added: rarely below the truth, and of its size."""
    monkeypatch.setattr(scene_detail, "isolated_edges", lambda *_: None)  # tiles, nevertheless
    changes = SIZE | SCENES[scene]
    ratio = estimate(tmp_path, monkeypatch, changes, name) / change(tmp_path, changes, name)
    assert 0.75 < ratio < 2.5


@pytest.mark.parametrize("period", ["2 um", "4 um", "2.6666667 um"])
def test_detail_that_tiles_cannot_resolve_does_not_hide(period, tmp_path, monkeypatch):
    """Its frequencies fold onto those of the tile's points; as noise it counts all the same."""
    changes = SIZE | chart("point-grid", spacing=period, diameter="1.3 um")
    for name in BLURS:
        true = change(tmp_path, changes, name)
        assert estimate(tmp_path, monkeypatch, changes, name) > 0.1 * true


def test_a_wall_is_even(tmp_path, monkeypatch):
    _, detail, functions = detail_of(tmp_path, monkeypatch, chart("uniform"))
    assert detail.even
    assert functions == {}
    assert np.ptp(detail.light) == 0


def test_waves_are_known(tmp_path, monkeypatch):
    """A sinusoid of mean 0.5 and contrast 0.4: half of 0.2 squared, at its own frequency."""
    source = chart("sinusoid", frequency="30 lp/mm", contrast=0.4, mean=0.5)
    path, detail, _ = detail_of(tmp_path, monkeypatch, source)
    white = float(path.transfer.level.sum())
    assert detail.power.sum() == pytest.approx((0.2 * white) ** 2 / 2, rel=1e-9)
    assert detail.fx == pytest.approx([30e3])
    assert detail.error == 0


def test_nothing_is_told_of_an_array_smaller_than_the_blur(tmp_path, monkeypatch):
    """Light from beside it counts as much as its own."""
    few = {"array.rows": 4, "array.columns": 6, "optics.f_number": 16}
    assert detail_of(tmp_path, monkeypatch, chart("siemens-star") | few)[1] is None


def test_the_brightest_light_is_a_bound_from_below(tmp_path, monkeypatch):
    """A lamp of a few pixels, hundred times as bright as white."""
    changes = SIZE | chart("hdr-patches", lamp=100.0) | {"scene.radiance": radiance_for(100)}
    path, detail, _ = detail_of(tmp_path, monkeypatch, changes)
    made = simulate(camera(tmp_path, changes | {"effects": "all"}))
    assert detail.brightest <= 1.01 * min(
        float(made.mean_electrons.max()) / made.exposure_time, path.ceiling
    )
    assert detail.brightest > 0.2 * path.ceiling or detail.brightest > 50 * 100


@pytest.mark.parametrize(("rows", "columns"), [(24, 40), (33, 48), (60, 80), (90, 90), (100, 131)])
@pytest.mark.parametrize(
    "scene",
    [
        chart("slanted-edge", angle="0 deg"),
        chart("slanted-edge"),
        chart("step-wedge", steps=2),
        chart("step-wedge", steps=3),
    ],
    ids=["upright edge", "slanted edge", "two steps", "three steps"],
)
def test_a_lone_edge_is_never_missed(scene, rows, columns, tmp_path, monkeypatch):
    """Wherever it lies among the tiles of a small array."""
    changes = {"array.rows": rows, "array.columns": columns} | scene
    estimated = estimate(tmp_path, monkeypatch, changes, "diffraction")
    assert estimated > 0.5 * change(tmp_path, changes, "diffraction")
