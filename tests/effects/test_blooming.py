"""Blooming: charge goes along columns until it finds room, and is kept."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.pixel.blooming import Blooming
from vcam_cli.errors import BadInput

EDGE = {
    "scene.source": {"kind": "chart", "chart": "slanted-edge", "angle": "80 deg", "contrast": 0.9},
    "scene.radiance": radiance_for(150e3),
    "effects": QUIET,
    "accuracy": {"preset": "standard", "float_width": 64},
}
"""Above the edge, or below it, pixels get more than the well of 100 ke."""


def test_a_lone_star_fills_its_column_to_both_sides():
    """By hand: of 10 wells 9 are too many; two thirds of them go on, three wells a side."""
    charge = np.zeros((21, 3))
    charge[10, 1] = 10 * 500.0
    settled = Blooming(2 / 3, 500.0).settled(charge)
    expected = np.zeros((21, 3))
    expected[7:14, 1] = 500.0
    np.testing.assert_allclose(settled, expected, atol=1e-9)


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_charge_is_kept_but_for_the_drain(share):
    """Away from the ends of columns; and no pixel holds more than its well."""
    rng = np.random.default_rng(5)
    charge = np.zeros((400, 30))
    charge[190:210] = rng.exponential(900, (20, 30))
    settled = Blooming(share, 1000.0).settled(charge)
    excess = np.maximum(charge - 1000, 0).sum(axis=0)
    drained = (1 - share) * excess
    np.testing.assert_allclose(settled.sum(axis=0), charge.sum(axis=0) - drained, rtol=1e-12)
    assert settled.max() <= 1000
    assert (settled >= np.minimum(charge, 1000)).all()


def test_without_excess_nothing_moves():
    charge = np.random.default_rng(6).uniform(0, 1000, (40, 30))
    np.testing.assert_array_equal(Blooming(1.0, 1000.0).settled(charge), charge)


def test_electrons_of_a_frame_are_those_of_its_settled_means(tmp_path):
    plain = simulate(camera(tmp_path, EDGE))
    bloomed = simulate(camera(tmp_path, EDGE | {"pixel.blooming": "40 %"}))
    expected = Blooming(0.4, 100e3).settled(plain.mean_electrons)
    np.testing.assert_allclose(bloomed.electrons, expected, rtol=1e-9)
    np.testing.assert_allclose(bloomed.frame.held_electrons, expected, rtol=1e-9)
    assert bloomed.electrons.sum() > plain.electrons.sum() * 1.01


def test_noise_of_other_effects_is_not_moved(tmp_path):
    dim = {**EDGE, "scene.radiance": radiance_for(2e4), "effects": "all"}
    dim["pixel.readout.read_noise"] = "9 e"
    plain = simulate(camera(tmp_path, dim)).dn
    np.testing.assert_array_equal(
        simulate(camera(tmp_path, dim | {"pixel.blooming": "40 %"})).dn, plain
    )


def test_is_left_out_where_no_well_is_full(tmp_path):
    for electrons, state in ((2e4, "off"), (3e5, "on")):
        changes = {"pixel.blooming": "40 %", "effects": "auto", "accuracy": "standard"}
        changes["scene.radiance"] = radiance_for(electrons)
        plan = simulate(camera(tmp_path, EDGE | changes)).frame.plan
        assert {d.name: d.state for d in plan.decisions}["blooming"] == state


def test_what_is_not_simulated_is_said(tmp_path):
    blooming = {"pixel.blooming": "40 %"}
    with pytest.raises(BadInput, match="several captures"):
        camera(tmp_path, EDGE | blooming | {"exposure": {"captures": ["1 ms", "2 ms"]}})
    with pytest.raises(BadInput, match="not stated"):
        simulate(camera(tmp_path, EDGE | blooming | {"pixel.defects": {"hot": 0.01}}))
