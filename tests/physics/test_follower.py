"""The source follower and the discharge of a junction, against high precision and brute force."""

import mpmath
import numpy as np
import pytest

from vcam_cli.physics.follower import discharge, follower_output


def output_by_bisection(gate, threshold, gamma, phi, overdrive):
    """V_out such that V_gate - V_out is threshold, body effect and overdrive, in 40 digits."""
    with mpmath.workdps(40):

        def excess(v):
            body = gamma * (mpmath.sqrt(phi + v) - mpmath.sqrt(phi))
            return gate - v - threshold - body - overdrive

        return float(mpmath.findroot(excess, (mpmath.mpf(0), mpmath.mpf(gate)), solver="illinois"))


@pytest.mark.parametrize("gate", [0.700001, 0.8, 1.2, 1.65, 3.0])
@pytest.mark.parametrize("gamma", [0.0, 0.3, 0.8])
def test_the_output_solves_the_transistors_equation(gate, gamma):
    got = follower_output(gate, 0.5, gamma, 0.7, 0.2)
    # 1e-12 of a volt: the gate's own rounding, 1e-16 V, over an output of 1e-6 V
    expected = output_by_bisection(gate, 0.5, gamma, 0.7, 0.2)
    assert got == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_the_gain_is_that_of_the_body_effect():
    """dV_out / dV_in = 1 / (1 + gamma / (2 sqrt(phi + V_out))), Tsividis section 4.7."""
    gate = np.linspace(0.9, 2.5, 9)
    slope = (follower_output(gate + 1e-5, 0.5, 0.6, 0.7, 0.2)
             - follower_output(gate - 1e-5, 0.5, 0.6, 0.7, 0.2)) / 2e-5  # fmt: skip
    out = follower_output(gate, 0.5, 0.6, 0.7, 0.2)
    assert slope == pytest.approx(1 / (1 + 0.6 / (2 * np.sqrt(0.7 + out))), rel=1e-8)
    assert (slope < 1).all()


def test_without_body_effect_it_only_shifts():
    assert follower_output(1.7, 0.5, 0.0, 0.7, 0.2) == pytest.approx(1.0, rel=1e-15)


def test_below_the_threshold_nothing_follows():
    assert np.isnan(follower_output(0.6, 0.5, 0.5, 0.7, 0.2))


@pytest.mark.parametrize("grading", [0.2, 0.36, 0.5])
def test_the_charge_is_the_sum_of_small_steps(grading):
    """Midpoint rule with 1e5 steps: its error is below 1e-10 of the whole."""
    edges = np.linspace(0.5, 1.65, 100_001)
    middle = (edges[1:] + edges[:-1]) / 2
    total = (4e-15 * (1 + middle / 0.8) ** -grading).sum() * (edges[1] - edges[0])
    assert discharge(0.5, 1.65, 4e-15, 0.8, grading) == pytest.approx(total, rel=1e-9)


def test_an_even_capacitance_takes_charge_evenly():
    fall = np.array([0.1, 0.2, 0.4])
    charge = discharge(1.65 - fall, 1.65, 4e-15, 0.8, 1e-12)
    assert charge == pytest.approx(4e-15 * fall, rel=1e-9)
