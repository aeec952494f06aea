"""What the plan makes of effects on the light."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from every import every
from making import camera, long_except, radiance_for
from optical_paths import of_camera, rms

from vcam_cli import simulate
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur
from vcam_cli.files.images.png import write_png
from vcam_cli.image_formation import light_plan
from vcam_cli.image_formation.light_plan import OMITTED_SHARE
from vcam_cli.simulation.simulate import prepare

SIZE = {"array.rows": 96, "array.columns": 128}
SILICON = {
    "pixel.photodetector.charge_diffusion": {
        "diffusion_length": "20 um",
        "depletion_width": "0.4 um",
        "substrate_depth": "5 um",
    }
}
WEDGE = {"scene.source": {"kind": "chart", "chart": "step-wedge", "steps": 3}}


def states(tmp_path, changes: dict) -> dict[str, str]:
    """Effect -> on, off or idle: could be left out, but would save nothing."""
    plan = prepare(camera(tmp_path, SIZE | changes), 1)[0].plan
    return {d.name: "idle" if d.free else d.state for d in plan.decisions}


def test_an_even_scene_calls_for_no_lens_and_no_transforms(tmp_path):
    rich = SILICON | {"optics.zernike": [{"field": 0, 4: "0 nm"}, {"field": 1, 8: "80 nm"}]}
    wall = {"scene.source": {"kind": "chart", "chart": "uniform"}, "effects": "auto"}
    ready = prepare(camera(tmp_path, SIZE | rich | wall), 1)[0]
    off = {d.name for d in ready.plan.decisions if d.state == "off" and d.by == "plan"}
    assert off >= {"diffraction", "aberration", "pixel_aperture", "charge_diffusion"}
    assert ready.spectrum.terms == 0


def test_without_a_blur_that_counts_there_is_no_spectrum(tmp_path):
    """A fast lens before pixels of 20 um: three steps in gray have next to no edge."""
    large = {"pixel.width": "20 um", "optics.f_number": 1.4, "accuracy": "draft"}
    ready = prepare(camera(tmp_path, SIZE | large | WEDGE | {"effects": "auto"}), 1)[0]
    assert {d.name: d.state for d in ready.plan.decisions}["diffraction"] == "off"
    assert ready.spectrum.terms == 0


def test_the_average_of_the_photodetector_stays_before_detail(tmp_path):
    """It costs nothing beside the lens, and of no chart is there a bound on what it changes."""
    changes = SIZE | WEDGE | {"optics.f_number": 11, "accuracy": "draft", "effects": "auto"}
    assert states(tmp_path, changes)["pixel_aperture"] == "on"


@pytest.mark.parametrize(("fraction", "state"), [(1e-4, "off"), (0.03, "on")])
def test_glare_is_left_out_where_it_shifts_nothing(fraction, state, tmp_path):
    edge = {"scene.source": {"kind": "chart", "chart": "slanted-edge", "contrast": 0.2}}
    changes = edge | {"optics.stray_light": fraction, "effects": "auto", "accuracy": "draft"}
    assert states(tmp_path, changes)["stray_light"] == state


def test_glare_stays_where_it_is_most_of_the_shadows(tmp_path):
    """Of full signal it is little, but blacks of a millionth of white are nothing else."""
    patches = {"kind": "chart", "chart": "hdr-patches", "dynamic_range": 1e6, "lamp": 1.0}
    changes = {"scene.source": patches, "optics.stray_light": 0.002, "accuracy": "draft"}
    assert states(tmp_path, changes | {"effects": "auto"})["stray_light"] == "on"


def test_a_gain_that_is_left_out_leaves_its_level_out_too(tmp_path):
    """The signal, and the white that exposures are timed by, are those without it."""
    weak = {"pixel.microlens": {"gain": 1.001}, "scene.radiance": radiance_for(1000)}
    weak |= {"accuracy": "draft"}
    lens = {"diffraction": "on", "pixel_aperture": "on"}
    made = [
        simulate(camera(tmp_path, weak | WEDGE | {"effects": effects}))
        for effects in (lens, lens | {"microlens": "off"}, "all")
    ]
    auto, without, everything = (float(r.mean_electrons.mean()) for r in made)
    assert auto == pytest.approx(without, rel=1e-5)
    assert everything == pytest.approx(1.001 * without, rel=1e-5)
    np.testing.assert_allclose(made[0].frame.white_rate, made[1].frame.white_rate, rtol=1e-9)


def test_nothing_is_bounded_where_all_is_on(tmp_path, monkeypatch):
    """Planning takes no time where nothing may be left out."""
    monkeypatch.setattr(light_plan, "_blur_shares", None)
    assert set(states(tmp_path, WEDGE | {"effects": "all"}).values()) <= {"on", "off"}


# --- what is left out changes less than its bound ---------------------------------------------

COMA = {"optics.zernike": {8: "60 nm"}}
CLOSE = {"pixel.width": "20 um", "optics.f_number": 2}
CHARTS = ("step-wedge", "slanted-edge", "colorchecker")


BLURS = {"lens": CLOSE, "silicon": CLOSE | SILICON, "coma": CLOSE | COMA}


@pytest.mark.parametrize(
    ("blurs", "chart"),
    long_except(
        {("lens", chart) for chart in CHARTS}
        | {("silicon", "slanted-edge"), ("coma", "step-wedge")},
        itertools.product(BLURS, CHARTS),
        several=True,
    ),
)
def test_each_blur_changes_at_most_its_bound(blurs, chart, tmp_path, monkeypatch):
    """The light with all effects, less that without one; sums over edges are not far off."""
    monkeypatch.setattr(light_plan, "EXACT", -1.0)  # exact sums, whatever they take
    changes = SIZE | BLURS[blurs] | {"scene.source": {"kind": "chart", "chart": chart}}
    path, scene = of_camera(camera(tmp_path, changes | {"accuracy": 0.2}))
    blurs = of_kind(path.effects, Blur)
    path = replace(path, optional=blurs, settings=replace(path.settings, tolerance=10.0))
    bounds = light_plan.light_plan(path, scene).shares
    assert set(bounds) == {blur.name for blur in blurs}
    whole = _rate(tmp_path, changes)
    for name, bound in bounds.items():
        change = rms(whole, _rate(tmp_path, changes, name)) / whole.max()
        assert change <= bound + 2e-5
        tighter = replace(path.settings, tolerance=bound / OMITTED_SHARE / 4)
        summed = light_plan.light_plan(replace(path, settings=tighter), scene).shares[name]
        assert change <= summed + 2e-5
        assert summed <= min(bound, 2 * change) + 2e-5


def _rate(tmp_path, changes, off=None) -> np.ndarray:
    effects = {"effects": {off: "off"} if off else "all"}
    return prepare(camera(tmp_path, changes | effects), 1)[0].rate


LENS = {"optics.f_number": 1.4, "pixel.width": "7.7 um", "pixel.photodetector.fill_factor": 1}


@pytest.mark.parametrize("seed", long_except([0, 1], range(4)))
@pytest.mark.parametrize(
    ("samples", "pixels"),
    long_except([(3, 16), (1, 15)], [(1, 48), (3, 16), (4, 25), (1, 15)], True),
)
@pytest.mark.parametrize("kind", ["star", "row", "column"])
def test_lone_light_is_seen_wherever_it_is(kind, samples, pixels, seed, tmp_path):
    """One sample, row or column that is lit: with every plan as with all effects."""
    size = samples * pixels
    rng = np.random.default_rng([seed, size])
    row, column = rng.integers(0, size, 2) if seed else (size - 1, size - 1)
    rows = slice(None) if kind == "column" else row
    columns = slice(None) if kind == "row" else column
    codes = np.full((size, size), (0, 655)[seed % 2], np.uint16)
    codes[rows, columns] = 65535
    write_png(tmp_path / "lone.png", codes)
    source = {"kind": "image", "file": str(tmp_path / "lone.png"), "model": "reflectance"}
    changes = LENS | {"array.rows": pixels, "array.columns": pixels, "scene.source": source}
    truth = _rate(tmp_path, changes)

    def check(accuracy):
        made = camera(tmp_path, changes | {"effects": "auto", "accuracy": accuracy})
        found = prepare(made, 1)[0]
        assert rms(found.rate, truth) <= found.settings.tolerance * truth.max()

    every(["draft", "standard", "reference"], check)


def test_the_set_that_saves_most_is_left_out(tmp_path, monkeypatch):
    """Of two effects that change too much together, the one that takes longer goes."""
    seconds = {"diffraction": 2.0, "charge_diffusion": 1.0}

    def cost(self, omitted):
        return sum(seconds.get(e.name, 0.0) for e in omitted)

    monkeypatch.setattr(light_plan.LightCost, "saved", cost)
    changes = SIZE | CLOSE | SILICON | WEDGE | {"effects": "auto"}
    both = prepare(camera(tmp_path, changes | {"accuracy": 0.5}), 1)[0].plan
    shares = {d.name: d.contribution for d in both.decisions if d.name in seconds}
    assert {d.state for d in both.decisions if d.name in seconds} == {"off"}
    tolerance = (sum(shares.values()) + max(shares.values())) / 2 / OMITTED_SHARE
    for slow, other in (("diffraction", "charge_diffusion"), ("charge_diffusion", "diffraction")):
        seconds |= {slow: 2.0, other: 1.0}
        plan = prepare(camera(tmp_path, changes | {"accuracy": tolerance}), 1)[0].plan
        states = {d.name: d.state for d in plan.decisions}
        assert (states[slow], states[other]) == ("off", "on")


@pytest.mark.parametrize(("coma", "state"), [("20 nm", "off"), ("200 nm", "on")])
def test_a_blur_over_the_field_is_left_out_where_edges_change_little(coma, state, tmp_path):
    lens = {"optics.zernike": [{"field": 0, 8: "0 nm"}, {"field": 1, 8: coma}]}
    small = {"pixel.width": "4 um", "optics.f_number": 2.8, "accuracy": "draft"}
    changes = small | WEDGE | lens | {"effects": "auto"}
    assert states(tmp_path, changes)["aberration"] == state
