"""Parts of photocurrent and dark current by region; fields; charge below gates and in layers."""

import math

import mpmath
import numpy as np
import pytest
import reference_process as reference

from vcam_cli.physics import charge_storage, junction, photodiode

CHARGE = reference.CHARGE


@pytest.mark.parametrize("a", [1e-3, 1e3, 6.39e5, 2.5e6, 5e7])
def test_each_region_collects_what_is_born_in_it(a):
    """Integrals of a exp(-a x) times the share that reaches the junction, in 30 digits."""
    x1, x2, x3 = 0.2e-6, 0.5e-6, 5e-6
    with mpmath.workdps(30):
        born = lambda x: a * mpmath.exp(-a * x)  # noqa: E731
        pieces = [
            (lambda x: born(x) * x / x1, 0, x1),
            (born, x1, x2),
            (lambda x: born(x) * (x3 - x) / (x3 - x2), x2, x3),
        ]
        expected = [float(mpmath.quad(f, mpmath.linspace(low, high, 9))) for f, low, high in pieces]
    found = photodiode.collected_parts(a, x1, x2, x3)
    assert list(map(float, found)) == pytest.approx(expected, rel=1e-12, abs=1e-300)
    total = float(photodiode.quantum_efficiency(a, x1, x2, x3))
    assert sum(map(float, found)) == pytest.approx(total, rel=1e-13)


def test_the_dark_currents_of_the_regions_are_the_terms_of_eq_231():
    n_i, d_p, d_n, n_d, n_a = 1e16, 2e-4, 20e-4, 5e25, 8e22
    x1, neutral, x_n, x_p, tau_p, tau_n = 0.2e-6, 5e-6, 1e-9, 0.17e-6, 1e-7, 1e-6
    numbers = (n_i, d_p, d_n, n_d, n_a, x1, neutral, x_n, x_p, tau_p, tau_n)
    found = junction.dark_current_parts(*numbers)
    expected = (
        CHARGE * d_p * n_i**2 / (n_d * x1),
        CHARGE * n_i / 2 * (x_n / tau_p + x_p / tau_n),
        CHARGE * d_n * n_i**2 / (n_a * neutral),
    )
    assert list(map(float, found)) == pytest.approx(expected, rel=1e-13)


def test_fields_raise_generation_as_hurkx_has_it():
    """The formula in 40 digits; no field, no change."""
    with mpmath.workdps(40):
        kt = mpmath.mpf("1.380649e-23") * 300
        q, hbar = mpmath.mpf("1.602176634e-19"), mpmath.mpf("6.62607015e-34") / (2 * mpmath.pi)
        unit = mpmath.sqrt(24 * mpmath.mpf("0.25") * mpmath.mpf("9.1093837015e-31") * kt**3)
        unit /= q * hbar
        r = mpmath.mpf("3.3e7") / unit
        expected = float(1 + 2 * mpmath.sqrt(3 * mpmath.pi) * r * mpmath.exp(r**2))
    assert float(junction.field_enhancement(3.3e7, 300.0)) == pytest.approx(expected, rel=1e-12)
    assert float(junction.field_enhancement(0.0, 300.0)) == 1
    fields = junction.field_enhancement(np.linspace(0, 9e7, 50), 300.0)
    assert (np.diff(fields) > 0).all()


def test_a_pinned_layer_by_small_steps():
    """Voltage of the empty layer from Poisson's equation, summed over 40 000 slices of charge."""
    thickness, donors, acceptors = 0.25e-6, 5e22, 1.6e21
    upper, lower = 0.85, 0.70
    found = charge_storage.pinned_layer(thickness, donors, acceptors, upper, lower)
    rho = CHARGE * donors / reference.SILICON
    below = found.reach
    # The field is 0 at the maximum, where both regions meet: charges on either side are balanced.
    meet = thickness - below * acceptors / donors
    z = (np.arange(40_000) + 0.5) / 40_000
    above_drop = float(np.mean(rho * meet * z) * meet)
    layer_drop = float(np.mean(rho * (thickness - meet) * z) * (thickness - meet))
    field = rho * (thickness - meet)
    substrate_drop = float(np.mean(field * (1 - z)) * below)
    assert above_drop - upper == pytest.approx(found.pinning_voltage, rel=1e-6)
    assert layer_drop + substrate_drop - lower == pytest.approx(found.pinning_voltage, rel=1e-6)


def test_a_gate_holds_what_fills_it_to_inversion():
    """Gauss: the charge of gate and oxide is that of the region and of the electrons."""
    oxide, acceptors, n_i = 4.4e-3, 8e22, 1e16
    found = charge_storage.gate_well(3.3, oxide, acceptors, n_i, 300.0)
    fermi = 1.380649e-23 * 300 / CHARGE * math.log(acceptors / n_i)
    silicon = math.sqrt(2 * reference.SILICON * 2 * fermi / (CHARGE * acceptors))
    across_oxide = 3.3 + 0.56 + fermi - 2 * fermi
    held = oxide * across_oxide / CHARGE - acceptors * silicon
    assert found.capacity == pytest.approx(held, rel=1e-12)
    assert charge_storage.gate_well(-1.0, oxide, acceptors, n_i, 300.0).capacity == 0
