"""A data sheet is enough: full well, bits and read noise make a camera; shares come in percent."""

import json

import numpy as np
import pytest
from making import GONE, QUIET, camera, radiance_for

from vcam_cli import load, simulate
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput

SHEET = {"pixel.readout": {"full_well": "9662 e", "read_noise": "2.5 e"}, "adc": {"bits": 10}}


def test_full_well_bits_and_read_noise_make_a_camera(tmp_path) -> None:
    """The ADC is full with the well: K = (2^bits - 1) / well, the offset aside."""
    made = camera(tmp_path, SHEET | {"adc.offset": "0 DN"})
    found = electrical(made)
    assert found.full_well == 9662
    assert found.electrons_per_dn == pytest.approx(9662 / 1023, rel=1e-12)
    assert not found.has_volts
    light = {"scene.radiance": radiance_for(0.3 * 9662), "effects": QUIET}
    dn = simulate(camera(tmp_path, SHEET | light | {"adc.offset": "0 DN"})).dn
    assert np.all(dn == round(0.3 * 1023))


def test_gain_makes_steps_of_a_data_sheet_smaller(tmp_path) -> None:
    made = camera(tmp_path, SHEET | {"exposure.gain": 4, "adc.offset": "0 DN"})
    assert electrical(made).electrons_per_dn == pytest.approx(9662 / 1023 / 4, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"adc.full_scale": "1 V"}, "adc.full_scale"),
        ({"adc.kind": "logarithmic", "adc.reference": "1 mV"}, "adc.reference"),
        ({"output.raw": ["volts"]}, "output.raw"),
        ({"pixel.readout.reset_noise": "ktc"}, "pixel.readout.reset_noise"),
        ({"pixel.readout.full_well": GONE}, "pixel.readout"),
    ],
)
def test_what_needs_volts_is_refused(changes, path, tmp_path) -> None:
    with pytest.raises(BadInput, match=path.replace(".", r"\.")):
        camera(tmp_path, SHEET | changes)


@pytest.mark.parametrize("key", ["prnu", "gain_pixel", "gain_column", "dark"])
@pytest.mark.parametrize("given", [0.5, 0.005, 1])
def test_bare_numbers_for_percentages_are_asked_back(key, given, tmp_path) -> None:
    """Both readings are named."""
    with pytest.raises(BadInput) as refused:
        camera(tmp_path, {"pixel.fpn": {key: given}})
    [problem] = refused.value.problems
    assert problem.path == ("pixel", "fpn", key)
    assert f"{given:g} % or {100 * given:g} %?" in problem.message + problem.remedy


def test_percentages_are_read_and_written_back(tmp_path) -> None:
    """0 needs no unit; whatever is written is read as the same number."""
    assert camera(tmp_path, {"pixel.fpn": {"prnu": 0}}).pixel.fpn.gain_pixel == 0
    for written in ("0.5 %", "0.1 %", "33.3333333 %", "1e-5 %", "100 %"):
        made = camera(tmp_path, {"pixel.fpn": {"prnu": written}})
        assert made.pixel.fpn.gain_pixel == pytest.approx(float(written[:-2]) / 100, rel=1e-15)
        (tmp_path / "again.yaml").write_text(json.dumps(made.model_dump(mode="json")))
        assert load(tmp_path / "again.yaml").pixel.fpn == made.pixel.fpn
