"""The numbers of a process: scaling to another feature size, and what wins over what."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from making import camera

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.process import EXPONENTS, process
from vcam_cli.camera.sensor.technology import Technology
from vcam_cli.errors import BadInput

TECHNOLOGY = {
    "name": "made",
    "feature_size": "0.4 um",
    "supply": "4 V",
    "voltage_swing": "1.5 V",
    "reset_voltage": "3 V",
    "junction": {
        "depth": "0.2 um", "depletion_width": "0.3 um", "substrate_depth": "5 um",
        "diffusion_length": "20 um", "donors": "1e20 1/cm3", "acceptors": "1e17 1/cm3",
        "hole_lifetime": "1 us", "electron_lifetime": "2 us",
        "hole_diffusivity": "2 cm2/s", "electron_diffusivity": "20 cm2/s",
    },
    "well": {"depth": "1.5 um", "donors": "1e17 1/cm3", "acceptors": "2e15 1/cm3"},
    "gate": {"thickness": "0.25 um"},
    "capacitance": {
        "area": "1 fF/um2", "sidewall": "0.3 fF/um", "built_in": "0.8 V", "grading": 0.4,
        "sidewall_built_in": "0.7 V", "sidewall_grading": 0.2, "follower_gate": "2 fF",
    },
    "dark_current": {"area": "10 nA/cm2", "perimeter": "1 pA/cm"},
    "layout": {"border": 5, "transistors": 90},
}  # fmt: skip
PIXEL = {"pixel.photodetector": {}, "pixel.readout": {}, "pixel.width": "10 um"}


def made(folder, choice=None, **more):
    """The process of a camera in the technology above; `choice` = what is changed of it."""
    changes = PIXEL | {"pixel.technology": {"from": TECHNOLOGY} | (choice or {})}
    return process(camera(folder, changes | {k.replace("__", "."): v for k, v in more.items()}))


def numbers(p) -> dict[str, float]:
    """Every number of a process by a dotted name."""
    found = {"supply": p.supply, "voltage_swing": p.voltage_swing, "reset": p.reset_voltage}
    for section in ("junction", "gate", "capacitance", "dark_current", "layout"):
        for name, value in getattr(p, section).model_dump().items():
            if isinstance(value, float):
                found[f"{section}.{name}"] = value
    return found


def test_none_where_the_file_says_nothing(tmp_path):
    nothing = process(camera(tmp_path))
    assert (nothing.feature_size, nothing.supply, nothing.junction.depth) == (None, None, None)
    alone = process(camera(tmp_path, {"pixel.photodetector.junction": {"depth": "1 um"}}))
    assert alone.junction.depth == 1e-6
    assert alone.feature_size is None
    assert alone.layout.border is None


def test_unscaled_the_numbers_are_those_of_the_file(tmp_path):
    p = made(tmp_path)
    assert (p.feature_size, p.supply, p.voltage_swing, p.reset_voltage) == (0.4e-6, 4, 1.5, 3)
    assert p.junction.donors == 1e26
    assert p.capacitance.area == pytest.approx(1e-3)
    assert p.dark_current.perimeter == pytest.approx(1e-10)


POWERS = {
    "supply": 1, "voltage_swing": 1, "reset": 1,
    "junction.depth": 1, "junction.depletion_width": 1, "junction.substrate_depth": 1,
    "junction.diffusion_length": 1, "gate.thickness": 1, "capacitance.follower_gate": 1,
    "junction.donors": -1, "junction.acceptors": -1, "capacitance.area": -1,
}  # fmt: skip
"""Constant-field scaling by hand (Dennard 1974, table I): lengths and voltages shrink alike,
doping grows, junctions hold more per area; all that is not named stays."""


def test_scales_as_with_a_constant_field(tmp_path):
    before, after = numbers(made(tmp_path)), numbers(made(tmp_path, {"feature_size": "0.1 um"}))
    assert before.keys() == after.keys()
    assert len(before) > 20
    for name, value in before.items():
        assert after[name] == pytest.approx(value * 0.25 ** POWERS.get(name, 0), rel=1e-12), name


def test_the_same_size_scales_nothing(tmp_path):
    assert made(tmp_path, {"feature_size": "0.4 um"}) == made(tmp_path)


@given(st.floats(0.03, 3))
@settings(max_examples=25)
def test_what_is_scaled_stays_a_process(size):
    """The depletion width of the area capacitance stays in proportion to the depth, the swing
    below the reset voltage, and scaling there and back gives the numbers back."""
    c = Technology.model_validate(TECHNOLOGY)
    tree = {"from": c, "feature_size": f"{size!r} um"}
    p = process(bare(tree))
    first = process(bare({"from": c}))
    ratio = p.capacitance.area * p.junction.depth
    assert ratio == pytest.approx(first.capacitance.area * first.junction.depth, rel=1e-9)
    assert p.voltage_swing < p.reset_voltage < p.supply
    assert p.junction.depth * 0.4 / size == pytest.approx(0.2e-6, rel=1e-9)


def bare(technology) -> Camera:
    from camera_trees import changed

    return Camera.model_validate(changed(PIXEL | {"pixel.technology": technology}))


@pytest.mark.parametrize("name", EXPONENTS)
def test_every_exponent_may_be_given(name, tmp_path):
    """By the technology or by the camera, the camera last."""
    of_it = {
        "lengths": "junction.depth", "voltages": "supply", "concentrations": "junction.donors",
        "capacitance_area": "capacitance.area", "capacitance_sidewall": "capacitance.sidewall",
        "dark_current_area": "dark_current.area",
        "dark_current_perimeter": "dark_current.perimeter",
    }[name]  # fmt: skip
    base = numbers(made(tmp_path))[of_it]
    own = TECHNOLOGY | {"scaling": {name: 2}}
    finer = {"from": own, "feature_size": "0.2 um"}
    assert numbers(made(tmp_path, finer))[of_it] == pytest.approx(base * 0.25)
    last = finer | {"scaling": {name: 3}}
    assert numbers(made(tmp_path, last))[of_it] == pytest.approx(base / 8)


def test_overrides_are_not_scaled(tmp_path):
    """They are the numbers of the process as it is used."""
    choice = {"feature_size": "0.1 um", "dark_current": {"area": "7 nA/cm2"}, "supply": "1.2 V"}
    p = made(tmp_path, choice | {"junction": {"depth": "0.07 um"}})
    assert p.dark_current.area == pytest.approx(7e-5)
    assert p.supply == 1.2
    assert p.junction.depth == pytest.approx(0.07e-6)


def test_the_photodetectors_junction_wins_over_all(tmp_path):
    choice = {"feature_size": "0.1 um", "junction": {"depth": "0.07 um", "donors": "1e19 1/cm3"}}
    p = made(tmp_path, choice, pixel__photodetector__junction={"depth": "0.09 um"})
    assert p.junction.depth == pytest.approx(0.09e-6)
    assert p.junction.donors == pytest.approx(1e25)
    assert p.junction.substrate_depth == pytest.approx(5e-6 / 4)


class TestWell:
    """An n-well takes the place of the n-diffusion: depth and donors are its own."""

    def test_numbers(self, tmp_path):
        well = made(tmp_path, pixel__photodetector__kind="nwell-psub").junction
        diffusion = made(tmp_path).junction
        assert (well.depth, well.donors, well.acceptors) == pytest.approx((1.5e-6, 1e23, 2e21))
        assert well.depth > diffusion.depth
        assert well.donors < diffusion.donors
        same = {n: getattr(diffusion, n) for n in ("depth", "donors", "acceptors")}
        assert well.model_copy(update=same) == diffusion

    def test_the_photodetectors_junction_wins(self, tmp_path):
        p = made(
            tmp_path,
            pixel__photodetector__kind="nwell-psub",
            pixel__photodetector__junction={"depth": "2 um"},
        )
        assert p.junction.depth == pytest.approx(2e-6)
        assert p.junction.donors == pytest.approx(1e23)

    def test_the_n_diffusion_does_not_stand_in(self, tmp_path):
        own = {k: v for k, v in TECHNOLOGY.items() if k != "well"}
        with pytest.raises(BadInput) as caught:
            made(tmp_path, {"from": own}, pixel__photodetector__kind="nwell-psub")
        problem = next(iter(caught.value.problems))
        assert "junction.depth" in problem.message
        assert "junction.acceptors" in problem.message, "the p-well of transistors is none, either"
        assert "pixel.photodetector.junction.depth: 0.2 um" in problem.remedy

    def test_scales(self, tmp_path):
        kind = {"pixel__photodetector__kind": "nwell-psub"}
        p = made(tmp_path, {"feature_size": "0.2 um"}, **kind)
        assert (p.junction.depth, p.junction.donors) == pytest.approx((0.75e-6, 2e23))


def test_thresholds_replace_what_follows_from_them(tmp_path):
    """That of the reset the reset voltage, the others the swing."""
    p = made(tmp_path, {"thresholds": {"reset": "0.8 V"}})
    assert p.reset_voltage is None
    assert p.voltage_swing == 1.5
    four = {"reset": "0.8 V", "bias": "1 V", "bias_gate": "0.6 V", "follower_gate_source": "1 V"}
    p = made(tmp_path, {"thresholds": four})
    assert p.reset_voltage is None
    assert p.voltage_swing is None
    assert p.thresholds.bias_gate == 0.6


@pytest.mark.parametrize("size", ["1 nm", "1 mm"])
def test_a_process_is_scaled_only_so_far(size, tmp_path):
    with pytest.raises(BadInput) as caught:
        made(tmp_path, {"feature_size": size})
    (problem,) = set(caught.value.problems)
    assert problem.path == ("pixel", "technology", "feature_size")
    assert "0.4 um of made" in problem.message
    assert "factor of 20" in problem.remedy


@pytest.mark.parametrize("power", ["11", "-11", "nan"])
def test_exponents_are_bounded(power, tmp_path):
    with pytest.raises(BadInput):
        made(tmp_path, {"scaling": {"lengths": power}})


def test_unread_names_are_no_process():
    """Only `load` reads files."""
    with pytest.raises(BadInput, match=r"pixel\.technology\.from.*has not been read"):
        process(bare("cmos-0.35um"))


@pytest.mark.parametrize("size", ["0.021 um", "7.9 um"])
def test_all_numbers_are_finite_as_far_as_that(size, tmp_path):
    p = made(tmp_path, {"feature_size": size}, pixel__width="200 um")
    assert all(math.isfinite(value) and value > 0 for value in numbers(p).values())
