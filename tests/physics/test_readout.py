"""Electrons to volts to codes, and the figures of merit."""

import math
from functools import cache

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.physics import readout as ro

unit_registry = cache(pint.UnitRegistry)
gains = st.floats(1e-7, 1e-3)


def test_conversion_gain_by_a_unit_library() -> None:
    units = unit_registry()
    gain = (units.elementary_charge / (12 * units.femtofarad)).to("microvolt").magnitude
    assert ro.conversion_gain(12e-15) * 1e6 == pytest.approx(gain, rel=1e-9)
    assert ro.conversion_gain(1.602176634e-19) == 1


def test_reset_noise_by_a_unit_library() -> None:
    """20 fF at 300 K: 56.8 electrons."""
    units = unit_registry()
    thermal = units.boltzmann_constant * 300 * units.kelvin * 20 * units.femtofarad
    sigma = (thermal**0.5 / units.elementary_charge).to("").magnitude
    assert math.sqrt(ro.reset_noise_variance(20e-15, 300)) == pytest.approx(sigma, rel=1e-9)
    assert sigma == pytest.approx(56.8, abs=0.05)


@given(st.floats(1e-17, 1e-10), st.floats(0.1, 5))
def test_charge_voltage_and_capacitance_agree(capacitance: float, swing: float) -> None:
    gain = ro.conversion_gain(capacitance)
    assert ro.sense_capacitance(gain) == pytest.approx(capacitance, rel=1e-14)
    full = ro.well_capacity(swing, gain)
    assert full * ro.ELEMENTARY_CHARGE == pytest.approx(capacitance * swing, rel=1e-14)


@given(st.floats(1e-17, 1e-10), st.floats(1, 1000), st.floats(1, 100))
def test_reset_noise_grows_with_temperature_and_capacitance(
    capacitance: float, temperature: float, factor: float
) -> None:
    base = ro.reset_noise_variance(capacitance, temperature)
    assert ro.reset_noise_variance(capacitance * factor, temperature) == pytest.approx(
        base * factor, rel=1e-14
    )
    assert ro.reset_noise_variance(capacitance, temperature * factor) == pytest.approx(
        base * factor, rel=1e-14
    )


def test_voltage_swing_of_a_0_35_um_pixel() -> None:
    """3.3 V supply; thresholds of 0.8 V, a follower and a bias that cost 0.92 and 0.2 V."""
    assert ro.voltage_swing(3.3, 0.8, 0.92, 1.0, 0.8) == pytest.approx(1.38, rel=1e-14)


@given(gains, st.floats(0.1, 16), st.floats(0.1, 5), st.integers(1, 16), st.floats(0, 0.5))
def test_full_scale_gives_the_highest_code(
    g: float, gain: float, full_scale: float, bits: int, black: float
) -> None:
    offset = black * (2**bits - 1)
    slope = ro.codes_per_electron(g, gain, full_scale, bits, offset)
    electrons = full_scale / (g * gain)
    assert offset + slope * electrons == pytest.approx(2**bits - 1, rel=1e-12)
    assert ro.adc_full_scale(g, gain, slope, bits, offset) == pytest.approx(full_scale, rel=1e-13)


def test_dynamic_range_and_snr_by_hand() -> None:
    assert ro.dynamic_range_db(10_000.0, 0.0, 25.0) == pytest.approx(20 * math.log10(2000))
    assert ro.dynamic_range_db(10_100.0, 100.0, 300.0) == pytest.approx(20 * math.log10(500))
    assert ro.snr_db(10_000.0, 0.0, 0.0) == pytest.approx(40)  # shot noise: sqrt of the signal
    assert ro.snr_db(100.0, 200.0, 100.0) == pytest.approx(20 * math.log10(5))


@given(st.floats(100, 1e6), st.floats(0, 0.5), st.floats(0, 1e8))
def test_snr_at_a_fifth_of_the_well_lies_14_db_below_the_dynamic_range(
    well: float, dark_share: float, read: float
) -> None:
    """No noise gives 38 dB of the one beside 50 dB of the other, as the thesis's Fig 3.2 has it."""
    dark = dark_share * well
    snr = ro.snr_db(0.2 * (well - dark), dark, read + 1)
    assert snr <= ro.dynamic_range_db(well, dark, read + 1) + 20 * math.log10(0.2)


def test_limits_of_the_figures_of_merit() -> None:
    assert ro.dynamic_range_db(100.0, 100.0, 4.0) == -math.inf
    assert ro.dynamic_range_db(100.0, 500.0, 4.0) == -math.inf
    assert ro.dynamic_range_db(100.0, 0.0, 0.0) == math.inf
    assert ro.snr_db(0.0, 0.0, 0.0) == -math.inf
    values = ro.snr_db(np.array([0.0, 4.0]), 0.0, 0.0)
    assert values.shape == (2,)
    assert values[1] == pytest.approx(20 * math.log10(2))


@given(st.floats(1, 1e6), st.floats(0, 1e6), st.floats(0.1, 1e4), st.floats(1.01, 100))
def test_more_light_is_better_more_dark_is_worse(
    light: float, dark: float, read: float, more: float
) -> None:
    snr = ro.snr_db(light, dark, read)
    assert ro.snr_db(light * more, dark, read) > snr
    assert ro.snr_db(light, dark * more + 1, read) < snr
    full = ro.dynamic_range_db(2e6, dark, read)
    assert ro.dynamic_range_db(2e6, dark * more + 1, read) < full
