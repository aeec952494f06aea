"""Gain, swing and full well from any two of them; the ADC's scale; what they contradict."""

import math
from itertools import combinations

import pytest
from making import BOLTZMANN, CHARGE, camera

from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput
from vcam_cli.physics.readout import reset_noise_variance

GAIN, SWING, WELL = 20e-6, 1.38, 69_000.0
THREE = {"conversion_gain": "20 uV/e", "voltage_swing": "1.38 V", "full_well": "69 ke"}


def solved(folder, readout: dict, adc: dict | None = None, **detector) -> Electrical:
    changes = {f"pixel.photodetector.{k}": v for k, v in detector.items()}
    changes["pixel.readout"] = readout
    if adc is not None:
        changes["adc"] = adc
    return electrical(camera(folder, changes))


def refused(folder, changes: dict):
    with pytest.raises(BadInput) as caught:
        camera(folder, changes)
    return list(caught.value.problems)


@pytest.mark.parametrize("pair", list(combinations(THREE, 2)), ids=" and ".join)
def test_any_two_determine_the_third(pair, tmp_path):
    e = solved(tmp_path, {name: THREE[name] for name in pair})
    assert e.conversion_gain == pytest.approx(GAIN, rel=1e-12)
    assert e.voltage_swing == pytest.approx(SWING, rel=1e-12)
    assert e.full_well == pytest.approx(WELL, rel=1e-12)
    # q / C = g, the other way round
    assert e.capacitance == pytest.approx(CHARGE / GAIN, rel=1e-12)


def test_all_three_where_they_agree_to_a_part_in_a_thousand(tmp_path):
    assert solved(tmp_path, THREE).full_well == pytest.approx(WELL, rel=1e-12)
    near = solved(tmp_path, THREE | {"full_well": "69.06 ke"})
    assert near.full_well == pytest.approx(WELL, rel=1e-12), "swing / gain, as kTC and ADC take it"
    [problem] = refused(tmp_path, {"pixel.readout": THREE | {"full_well": "70 ke"}})
    assert problem.path == ("pixel", "readout", "full_well")
    assert "69000 e" in problem.message
    assert "70000 e" in problem.message
    assert "give two of" in problem.remedy
    assert "made.yaml:" in problem.where


@pytest.mark.parametrize("other", ["voltage_swing", "full_well"])
def test_a_capacitance_stands_for_the_conversion_gain(other, tmp_path):
    """8 fF: q / C = 20.03 uV/e."""
    e = solved(tmp_path, {other: THREE[other]}, capacitance="8 fF")
    assert e.conversion_gain == pytest.approx(CHARGE / 8e-15, rel=1e-12)
    assert e.capacitance == 8e-15
    assert e.voltage_swing / e.conversion_gain == pytest.approx(e.full_well, rel=1e-12)


def test_a_capacitance_beside_a_gain_only_sets_reset_noise(tmp_path):
    e = solved(
        tmp_path, {k: THREE[k] for k in ("conversion_gain", "full_well")}, capacitance="5 fF"
    )
    assert e.conversion_gain == GAIN
    assert e.capacitance == 5e-15
    ktc = math.sqrt(reset_noise_variance(e.capacitance, 300))
    assert ktc == pytest.approx(math.sqrt(BOLTZMANN * 300 * 5e-15) / CHARGE, rel=1e-12)
    assert ktc == pytest.approx(28.4, abs=0.05)


@pytest.mark.parametrize("only", ["conversion_gain", "voltage_swing"])
def test_one_is_not_enough(only, tmp_path):
    [problem] = refused(tmp_path, {"pixel.readout": {only: THREE[only]}})
    assert problem.path == ("pixel", "readout")
    assert "not determined" in problem.message
    assert problem.remedy


@pytest.mark.parametrize("gain", [1, 2])
def test_a_data_sheet_counts_in_electrons_and_numbers(gain, tmp_path):
    """0.399 DN/e over 12 bits above 240 DN: the ADC is full at 9662 e, whatever volts are."""
    adc = {"bits": 12, "offset": "240 DN", "gain": "0.399 DN/e"}
    e = solved(tmp_path, {"full_well": "12 ke", "gain": gain}, adc)
    assert not e.has_volts
    assert e.capacitance is None
    assert e.full_well == pytest.approx(12_000, rel=1e-12)
    assert e.electrons_per_dn == pytest.approx(1 / 0.399, rel=1e-12)
    assert e.saturation == pytest.approx(3855 / 0.399, rel=1e-12)
    # nominal: a full well is 1 V
    assert e.conversion_gain * e.full_well == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize("swing", [{}, {"voltage_swing": "1 V"}])
def test_volts_that_are_given_stay_volts(swing, tmp_path):
    adc = {"bits": 12, "gain": "0.25 DN/e"}
    readout = {"full_well": "10 ke", **(swing or {"conversion_gain": "100 uV/e"})}
    e = solved(tmp_path, readout, adc)
    assert e.has_volts
    assert e.capacitance == pytest.approx(CHARGE / 100e-6, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        (
            {"pixel.readout": {"full_well": "9 ke", "reset_noise": "ktc"}},
            "pixel.readout.reset_noise",
        ),
        ({"output": {"raw": ["dn", "volts"]}}, "output.raw"),
    ],
)
def test_what_needs_volts_is_refused_without_them(changes, path, tmp_path):
    counted = {"pixel.readout": {"full_well": "9 ke"}, "adc": {"bits": 12, "gain": "0.4 DN/e"}}
    [problem] = refused(tmp_path, counted | changes)
    assert ".".join(problem.path) == path
    assert "needs a voltage" in problem.message
    assert "conversion_gain" in problem.remedy
    given = {"full_well": "9 ke", "voltage_swing": "1 V"}
    readout = changes.get("pixel.readout", {})
    camera(tmp_path, counted | changes | {"pixel.readout": readout | given})


# --- the ADC -------------------------------------------------------------------------------------

READOUT = {"conversion_gain": "20 uV/e", "full_well": "69 ke"}


def test_full_scale_is_the_swing_behind_the_analog_gain(tmp_path):
    """So a full well is the highest code whatever the gain."""
    for gain in (1, 4):
        e = solved(tmp_path, READOUT | {"gain": gain}, {"bits": 10, "offset": "16 DN"})
        assert e.full_scale == pytest.approx(SWING * gain, rel=1e-12)
        assert e.electrons_per_dn == pytest.approx(WELL / (1023 - 16), rel=1e-12)
        assert e.saturation == pytest.approx(WELL, rel=1e-12)
        assert e.highest_code == 1023


def test_a_given_full_scale_makes_codes_smaller(tmp_path):
    """0.5 V are 25 000 electrons at gain 1, 12 500 at gain 2."""
    for gain, electrons in ((1, 25_000), (2, 12_500)):
        e = solved(tmp_path, READOUT | {"gain": gain}, {"bits": 12, "full_scale": "0.5 V"})
        assert e.electrons_per_dn == pytest.approx(electrons / 4095, rel=1e-12)
        assert e.saturation == pytest.approx(electrons, rel=1e-12)


def test_a_full_scale_above_the_swing_leaves_the_well_to_saturate(tmp_path):
    e = solved(tmp_path, READOUT, {"bits": 12, "full_scale": "5 V"})
    assert e.saturation == pytest.approx(WELL, rel=1e-12)


@pytest.mark.parametrize("gain", [1, 3])
@pytest.mark.parametrize("offset", [0, 64])
def test_codes_per_electron_may_be_given(gain, offset, tmp_path):
    """0.25 DN/e are 4 electrons a code, whatever analog gain and offset are."""
    adc = {"bits": 12, "gain": "0.25 DN/e", "offset": f"{offset} DN"}
    e = solved(tmp_path, READOUT | {"gain": gain}, adc)
    assert e.electrons_per_dn == pytest.approx(4, rel=1e-12)
    assert e.saturation == pytest.approx(4 * (4095 - offset), rel=1e-12)


def test_gain_and_full_scale_are_two_words_for_one_thing(tmp_path):
    [problem] = refused(tmp_path, {"adc": {"bits": 12, "gain": "1 DN/e", "full_scale": "1 V"}})
    assert problem.path == ("adc", "gain")


@pytest.mark.parametrize("offset", [255, 300])
def test_an_offset_must_leave_codes(offset, tmp_path):
    [problem] = refused(tmp_path, {"adc": {"bits": 8, "offset": f"{offset} DN"}})
    assert problem.path == ("adc", "offset")
    assert "lower" in problem.remedy


def test_a_logarithmic_adc_bends_at_a_thousandth_of_full_scale_or_where_the_file_says(tmp_path):
    adc = {"bits": 10, "kind": "logarithmic"}
    e = solved(tmp_path, THREE, adc)
    assert e.reference == pytest.approx(SWING / 1000, rel=1e-12)
    assert e.saturation == pytest.approx(WELL, rel=1e-12)
    e = solved(tmp_path, THREE, adc | {"full_scale": "0.69 V", "reference": "3 mV"})
    assert e.reference == pytest.approx(3e-3, rel=1e-12)
    assert e.saturation == pytest.approx(WELL / 2, rel=1e-12), "the ADC is full first"
    assert solved(tmp_path, THREE, {"bits": 10}).reference is None
