"""What the plan makes of effects on the light."""

import numpy as np
import pytest
from making import camera, radiance_for

from vcam_cli import simulate
from vcam_cli.image_formation import light_plan, photon_rate
from vcam_cli.image_formation.estimates import scene_detail
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
    """Effect -> on, off or free."""
    plan = prepare(camera(tmp_path, SIZE | changes), 1)[0].plan
    return {d.name: "free" if d.free else d.state for d in plan.decisions}


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


def test_the_lens_goes_before_the_average_of_the_photodetector(tmp_path):
    """Of the two, which change too much together, only without the lens is there no spectrum."""
    changes = {"array.rows": 300, "array.columns": 800, "pixel.width": "8 um", "effects": "auto"}
    changes |= {"optics.f_number": 5.6, "accuracy": "standard"}
    changes |= {"scene.source": WEDGE["scene.source"] | {"steps": 20}}
    ready = prepare(camera(tmp_path, changes), 1)[0]
    shares = ready.plan.decisions
    lens, average = (
        next(d for d in shares if d.name == n) for n in ("diffraction", "pixel_aperture")
    )
    assert (lens.state, average.state, ready.spectrum.terms) == ("off", "on", 0)
    budget = OMITTED_SHARE * ready.settings.tolerance
    without = changes | {"effects": {"diffraction": "on", "pixel_aperture": "auto"}}
    free = prepare(camera(tmp_path, without), 1)[0].plan.decisions
    own = next(d.contribution for d in free if d.name == "pixel_aperture")
    assert own < lens.contribution < budget < own + lens.contribution


def test_what_ends_the_spectrum_of_others_stays_and_is_free(tmp_path):
    """Diffraction that counts for nothing beside diffusion that does: alone, it has no last
    frequency."""
    changes = SILICON | {
        "pixel.width": "6 um",
        "optics.f_number": 0.8,
        "accuracy": 0.2,
        "effects": {"pixel_aperture": "on", "charge_diffusion": "on"},
        "scene.source": {"kind": "chart", "chart": "siemens-star", "spokes": 36},
    }
    assert states(tmp_path, changes)["diffraction"] == "free"


def test_the_photodetector_stays_and_is_free_where_the_lens_counts(tmp_path):
    """Its average counts for nothing in a coarse wedge; without it the spectrum is longer."""
    changes = SIZE | WEDGE | {"optics.f_number": 11, "accuracy": "draft"}
    kept = prepare(camera(tmp_path, changes | {"effects": "auto"}), 1)[0]
    found = {d.name: "free" if d.free else d.state for d in kept.plan.decisions}
    assert (found["diffraction"], found["pixel_aperture"]) == ("on", "free")
    without = {"effects": {"diffraction": "on", "pixel_aperture": "off"}}
    assert kept.spectrum.terms < prepare(camera(tmp_path, changes | without), 1)[0].spectrum.terms


def test_diffusion_of_little_weight_stays_and_is_free_where_the_lens_counts(tmp_path):
    """It costs nothing there, and without it the spectrum would be longer than of all."""
    changes = SILICON | WEDGE | {"optics.f_number": 11, "accuracy": "draft"}
    changes |= {"pixel.photodetector.charge_diffusion.substrate_depth": "0.7 um"}
    assert states(tmp_path, changes | {"effects": "auto"})["charge_diffusion"] == "free"
    kept, whole = (
        prepare(camera(tmp_path, SIZE | changes | {"effects": effects}), 1)[0].spectrum.terms
        for effects in ("auto", "all")
    )
    assert 0 < kept == whole


@pytest.mark.parametrize(("fraction", "state"), [(1e-4, "off"), (0.03, "on")])
def test_glare_is_left_out_where_it_shifts_nothing(fraction, state, tmp_path):
    edge = {"scene.source": {"kind": "chart", "chart": "slanted-edge", "contrast": 0.2}}
    changes = edge | {"optics.stray_light": fraction, "effects": "auto"}
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
    made = [
        simulate(camera(tmp_path, weak | WEDGE | {"effects": effects}))
        for effects in ("auto", {"microlens": "off"}, "all")
    ]
    auto, without, everything = (float(r.mean_electrons.mean()) for r in made)
    assert auto == pytest.approx(without, rel=1e-6)
    assert everything == pytest.approx(1.001 * without, rel=1e-6)
    np.testing.assert_allclose(made[0].frame.white_rate, made[1].frame.white_rate, rtol=1e-9)


def test_all_that_is_on_is_not_surveyed(tmp_path, monkeypatch):
    """Planning takes no time where nothing may be left out."""
    from vcam_cli.image_formation import light_plan

    monkeypatch.setattr(light_plan, "scene_detail", None)
    assert set(states(tmp_path, WEDGE | {"effects": "all"}).values()) <= {"on", "off"}


COMA = {"optics.zernike": {8: "60 nm"}}
SPINNING = {"motion": {"rotate": "400 deg/s"}}


@pytest.mark.parametrize("accuracy", ["draft", "standard"])
@pytest.mark.parametrize("chart", ["eye-chart", "dead-leaves", "siemens-star"])
@pytest.mark.parametrize(
    ("camera_keys", "source_keys"),
    [({}, {}), (SILICON, {}), (COMA, {}), (SILICON | COMA, {}), ({}, SPINNING)],
    ids=["lens", "silicon", "coma", "silicon and coma", "turning"],
)
def test_few_tiles_leave_out_what_all_do(
    camera_keys, source_keys, chart, accuracy, tmp_path, monkeypatch
):
    """Where it is not asked whether some tell enough, all are."""
    changes = camera_keys | {"accuracy": accuracy, "effects": "auto"}
    changes |= {"array.rows": 240, "array.columns": 320}
    changes |= {"scene.source": {"kind": "chart", "chart": chart, **source_keys}}
    planned = []
    whole = light_plan.light_plan

    def plan_light(path, scene):
        with monkeypatch.context() as patched:
            survey = scene_detail.scene_detail
            patched.setattr(light_plan, "scene_detail", lambda path, scene, _: survey(path, scene))
            planned.append(whole(path, scene).omitted)
        planned.append(whole(path, scene).omitted)
        raise Planned

    monkeypatch.setattr(photon_rate, "light_plan", plan_light)
    with pytest.raises(Planned):
        prepare(camera(tmp_path, changes), 1)
    all_tiles, few_tiles = planned
    assert few_tiles == all_tiles


class Planned(Exception):
    """Raised as soon as the light is planned."""
